"""Mathematics that knows no pendulum: splines, quadrature, test functions, regression."""
