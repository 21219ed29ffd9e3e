"""Motor calibration: the constants of the wheel's motor from voltage tests and free swings."""

from __future__ import annotations

from swingid.calibration.motor.method import Calibration, calibrate

__all__ = ["Calibration", "calibrate"]
