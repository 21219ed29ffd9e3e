"""The balance of terms on test functions: rows, windows, fits, friction, declared imperfections."""
