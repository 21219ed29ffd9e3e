"""The identification methods: what each needs of a log and a rig, what it assumes, and its function."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from swingid.errors import UnanswerableError, UsageError

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording
    from swingid.result.result import Result

KINDS: dict[str, tuple[str, type]] = {"bool": ("true or false", bool), "str": ("text", str)}
"""Annotations of options whose type is checked before the method is called: in words, and the type."""


Load = Callable[[], Callable[..., "Result"]]
"""Imports and returns a method's function: from a `Prepared` to a `Result`, with options as keyword arguments.

It raises InputError where a channel is missing, UnanswerableError where the log does not determine J1.
"""


@dataclass(frozen=True)
class Method:
    """One method. motor: whether it uses the motor's constants and the voltage where there is a wheel.

    friction: what it assumes of the friction of the axis, "any", a "basis" of terms, one "law", or "viscous". speeds:
    where its speeds come from, "none" where it needs none. gravity, drive: it needs a gravity torque above 0, a drive.
    turning_points: it uses a log from its first to its last turning point. unbroken: it is recursive, so uses the
    longest run without a gap. in_parts: results of the parts of a large log can be pooled. online: `sw.online` has
    it. rates: it estimates what is unknown of an angle that is the integral of a rate; the others get it as the
    momentum balance gives it.
    """

    name: str
    load: Load
    motor: Literal["unused", "optional", "needed"]
    friction: Literal["any", "basis", "law", "viscous"]
    speeds: Literal["none", "smoothed", "filtered"]
    gravity: bool = False
    drive: bool = False
    turning_points: bool = False
    unbroken: bool = False
    in_parts: bool = False
    online: bool = False
    rates: bool = False

    def identify(
        self, log: Recording, rig: Rig, options: Mapping[str, object], *, one_of_several: bool = False
    ) -> Result:
        """Prepare the log and identify it; errors as in `Load`. one_of_several: of logs of one body."""
        from swingid.checks.ran import recorded
        from swingid.checks.refusal import explained, require_agreement
        from swingid.checks.table import in_order
        from swingid.preparation.prepared import prepare

        method = self.load()
        prepared = prepare(log, rig, unbroken=self.unbroken, one_of_several=one_of_several)
        if prepared.encoders.level is not None and not self.rates:
            from swingid.checks.level import chosen_at_level
            from swingid.preparation.scale import refuse_rates

            if self.unbroken:
                refuse_rates(rig, f"the method {self.name}")
            prepared = chosen_at_level(prepared)[0]
        try:
            with recorded() as names:
                result = method(prepared, **options)
        except UnanswerableError as error:
            raise explained(error, prepared) from None
        if result.details is not None:
            result = replace(result, details=replace(result.details, checks=in_order(names)))
        return result if one_of_several else require_agreement(result)

    def options(self) -> dict[str, inspect.Parameter]:
        """The options by name, with their types and defaults."""
        parameters = inspect.signature(self.load()).parameters
        return {name: one for name, one in parameters.items() if one.kind is one.KEYWORD_ONLY}

    def check_options(self, options: Mapping[str, object]) -> None:
        """Raise UsageError for an option that the method does not have (the nearest is named), or of another type.

        Types are checked where the method takes text or true or false; the rest it checks itself.
        """
        known = self.options()
        for name, value in options.items():
            if name in known:
                words, kind = KINDS.get(str(known[name].annotation), ("", object))
                if not isinstance(value, kind):
                    raise UsageError(f"option {name} must be {words}, and is {value!r}.", code="bad-option")
                continue
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"the nearest is {near[0]!r}." if near else f"its options: {', '.join(known) or 'none'}."
            raise UsageError(f"method {self.name} has no option {name!r}; {hint}", code="unknown-option")


def _momentum() -> Callable[..., Result]:
    from swingid.methods.momentum.method import momentum

    return momentum


def _energy() -> Callable[..., Result]:
    from swingid.methods.energy.method import energy

    return energy


def _output_error() -> Callable[..., Result]:
    from swingid.methods.output_error.method import output_error

    return output_error


def _equation_error() -> Callable[..., Result]:
    from swingid.methods.equation_error.method import equation_error

    return equation_error


def _backstepping() -> Callable[..., Result]:
    from swingid.methods.backstepping.method import backstepping

    return backstepping


_TABLE = (
    Method("momentum", _momentum, motor="unused", friction="any", speeds="none", in_parts=True, online=True,
           rates=True),
    Method("energy", _energy, motor="needed", friction="basis", speeds="smoothed", turning_points=True, in_parts=True,
           online=True),
    Method("output-error", _output_error, motor="optional", friction="law", speeds="none"),
    Method("equation-error", _equation_error, motor="unused", friction="law", speeds="filtered"),
    Method("backstepping", _backstepping, motor="needed", friction="viscous", speeds="smoothed", gravity=True,
           drive=True, unbroken=True),
)  # fmt: skip

METHODS: dict[str, Method] = {method.name: method for method in _TABLE}
"""The methods by name, those that assume least first."""

DEFAULT = "momentum"


def method_of(name: str) -> Method:
    """The method of a name. Raises UsageError for a name that is none."""
    if name not in METHODS:
        raise UsageError(f"unknown method {name!r}; choose one of {', '.join(METHODS)}.", code="unknown-method")
    return METHODS[name]
