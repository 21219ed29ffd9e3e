"""Output error: least squares of simulated against measured angles (the paper's NLS)."""
