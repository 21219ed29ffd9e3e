"""Measured channels: the Recording, one file per format, repair."""
