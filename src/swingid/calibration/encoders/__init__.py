"""Encoder calibration: latency and once-per-turn nonlinearity of the encoders from logs of the rig itself."""

from __future__ import annotations

from swingid.calibration.encoders.method import EncoderCalibration, calibrate_encoders

__all__ = ["EncoderCalibration", "calibrate_encoders"]
