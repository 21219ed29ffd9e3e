"""Uncertainty: typed sources, the budget, the joint covariance, degrees of freedom, dark uncertainty, significance."""
