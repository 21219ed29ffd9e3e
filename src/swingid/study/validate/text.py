"""A validation as a table for a terminal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from swingid.format import number
from swingid.study.terminal import aligned, noted

if TYPE_CHECKING:
    from swingid.study.validate.validation import Prediction, Validation

HEADINGS = ("log", "driven by", "free run", "one swing ahead", "its error, RMS", "sensor noise")
DRIVES = {"wheel": "measured wheel", "voltage": "voltage", "torque": "torque", "none": "nothing"}


def tabulate(validation: Validation) -> str:
    """One line per log: normalised fit of the free run and one swing ahead, error and noise."""
    rows = [HEADINGS, *(cells(p, linear=validation.linear) for p in validation.predictions)]
    lines = [f"[[Predictions of the model that {validation.method} identified: normalised fit, 100 % is perfect]]"]
    lines += aligned(rows)
    lines += noted(validation.notes)
    return "\n".join(lines)


def cells(p: Prediction, *, linear: bool, fine: bool = False) -> tuple[str, ...]:
    """One line of the table."""
    unit = "m" if linear else "rad"
    errors = (number(p.swing_rms, unit, 2, fine=fine), number(p.noise, unit, 2, fine=fine))
    return (p.log, DRIVES[p.input], fit_text(p.free_fit), fit_text(p.swing_fit), *errors)


def fit_text(fit: float) -> str:
    """A normalised fit in per cent."""
    return f"{fit:.2f} %" if math.isfinite(fit) else "ran away"
