"""Mathematics that knows no pendulum: quadrature, test functions, regression."""
