"""Equation error: inverse-dynamics least squares on filtered and differentiated angles, the standard in robotics."""
