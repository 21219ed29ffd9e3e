"""What in a log contradicts the model of the rig: signs, gravity torque, zero, encoders."""
