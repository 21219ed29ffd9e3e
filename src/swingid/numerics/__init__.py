"""Mathematics independent of the rig: splines, quadrature, modulating functions, regression."""
