"""Measured channels: the Recording, one file per format, repair."""

from swingid.recording.recording import Finding, Recording, Source

__all__ = ["Finding", "Recording", "Source"]
