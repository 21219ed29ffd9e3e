"""Whether an identified model predicts logs that it was not fitted to."""

from __future__ import annotations

from swingid.study.validate.validation import Prediction, Validation, validate

__all__ = ["Prediction", "Validation", "validate"]
