"""Mathematics independent of the rig: splines, quadrature, test functions, regression."""
