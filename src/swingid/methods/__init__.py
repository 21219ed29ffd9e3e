"""The identification methods, one folder each."""
