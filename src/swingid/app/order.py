"""What a page may ask for: its fields as an order, or one sentence for the field that is wrong."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING

from swingid.errors import SwingidError, UsageError

if TYPE_CHECKING:
    from swingid.control.references import Reference
    from swingid.live.experiment import Order
    from swingid.model.rig import Rig

LONGEST = 200
"""Letters of a reference: a multisine of ten parts."""

MOTION, DURATION, UNTIL = "reference", "duration", "until"
"""Names of the fields."""


class WrongFieldError(SwingidError):
    """A field of the page that cannot be used. field: its name."""

    exit_code = UsageError.exit_code

    def __init__(self, message: str, *, code: str = "wrong-field", field: str = "") -> None:
        super().__init__(message, code=code)
        self.field = field


def order_of(motion: object, duration: object, until: object, rig: Rig, *, clear: bool = False) -> Order:
    """The order of a run from what a page sent, whatever that is.

    duration (s); until: relative standard uncertainty, 0 for never. Raises WrongFieldError, InputError for a rig file
    without what a controller needs.
    """
    from swingid.control.compensator import Compensator
    from swingid.live.experiment import Order, required

    seconds, share = _number(DURATION, duration, "seconds"), _number(UNTIL, until, "percent")
    if not 0.0 <= share < 1.0:
        raise WrongFieldError("give 0 to 99 %; 0 runs for the whole duration", field=UNTIL)
    order = Order(_reference(motion, rig), Compensator.paper(rig), seconds, share, clear=clear)
    try:
        required(order)
    except UsageError as error:
        raise WrongFieldError(error.message.replace("--", ""), field=DURATION) from None
    return order


def share_of(percents: object) -> object:
    """A share out of percents; what is no number, or too large for one, stays as it is."""
    try:
        return percents / 100 if isinstance(percents, int | float) else percents
    except OverflowError:
        return percents


def _number(field: str, value: object, unit: str) -> float:
    if not isinstance(value, bool) and isinstance(value, int | float):
        with suppress(OverflowError):  # a whole number of four hundred digits
            if math.isfinite(value):
                return float(value)
    raise WrongFieldError(f"write a number of {unit}", field=field)


def _reference(text: object, rig: Rig) -> Reference:
    """The motion; one from a file is refused, for who uses a page must not read the files of its server."""
    from swingid.control.references import reference_for
    from swingid.control.references.parse import EXAMPLES

    kinds = [kind for kind in EXAMPLES if kind != "file"]
    example = EXAMPLES[kinds[0]]
    if not isinstance(text, str) or not text.strip():
        raise WrongFieldError(f"write a motion, for example {example!r}", field=MOTION)
    kind = text.split()[0]
    if kind == "file":
        raise WrongFieldError(f"a page takes no file: use swingid run, or write for example {example!r}", field=MOTION)
    if kind not in kinds:
        text = f"begin with {', '.join(kinds[:-1])} or {kinds[-1]}; write for example {example!r}"
        raise WrongFieldError(text, field=MOTION)
    if len(text) > LONGEST:
        raise WrongFieldError(f"write at most {LONGEST} letters", field=MOTION)
    try:
        return reference_for(text, rig)
    except SwingidError as error:
        raise WrongFieldError(error.message, field=MOTION) from None
