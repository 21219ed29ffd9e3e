"""The stage between a Recording and every method: corrections, pushes, used part, motion, noise, known constants."""
