"""The balance of terms on modulating functions: rows, windows, fits, friction, stated errors."""
