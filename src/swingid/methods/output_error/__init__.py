"""Output error: least squares of simulated against measured angles (the paper's NLS)."""

from swingid.methods.output_error.method import output_error

__all__ = ["output_error"]
