"""Constants of the motor and errors of the encoders, from logs."""
