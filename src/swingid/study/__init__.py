"""Studies: what needs both the twin and the methods, or several methods at once."""
