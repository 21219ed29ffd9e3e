"""The identification methods: what each needs of a log and a rig, what it assumes, and its function."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Literal

from swingid.errors import UnanswerableError, UsageError

if TYPE_CHECKING:
    from swingid.checks.momentum import MomentumCheck
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording
    from swingid.result.result import Result

KINDS: dict[str, tuple[str, type]] = {"bool": ("true or false", bool), "str": ("text", str)}
"""Annotations of options whose type is checked before the method is called: in words, and the type."""


Load = Callable[[], Callable[..., "Result"]]
"""Imports and returns a method's function: from a `MomentumCheck` to a `Result`, with options as keyword arguments.

It raises InputError where a channel is missing, UnanswerableError where the log does not determine J1.
"""


@dataclass(frozen=True)
class Method:
    """One method. motor: whether it uses the motor's constants and the voltage where there is a wheel.

    friction: what it assumes of the friction of the axis, "any", a "basis" of terms, one "law", or "viscous". speeds:
    where its speeds come from, "none" where it needs none. gravity, drive: it needs a gravity torque above 0, a drive.
    turning_points: it uses a log from its first to its last turning point. in_parts: results of the parts of a large
    log can be pooled. online: `sw.online` has it.
    """

    name: str
    load: Load
    motor: Literal["unused", "optional", "needed"]
    friction: Literal["any", "basis", "law", "viscous"]
    speeds: Literal["none", "smoothed", "filtered"]
    gravity: bool = False
    drive: bool = False
    turning_points: bool = False
    in_parts: bool = False
    online: bool = False

    def identify(
        self,
        log: Recording,
        rig: Rig,
        options: Mapping[str, object],
        *,
        one_of_several: bool = False,
        momentum: Answers | None = None,
    ) -> Result:
        """Prepare the log and identify it; errors as in `Load`.

        one_of_several: of logs of one body. momentum: its answers, kept where other methods are asked as well.
        """
        from swingid.checks.refusal import explained

        is_default, momentum = self.name == DEFAULT, momentum or Answers()
        check = momentum.of(log, rig, options if is_default else {}, one_of_several=one_of_several)
        try:
            return check.result() if is_default else _agreed(self.load(), check, **options)
        except UnanswerableError as error:
            raise explained(error, check) from None

    def options(self) -> dict[str, inspect.Parameter]:
        """The options by name, with their types and defaults."""
        parameters = inspect.signature(self.load()).parameters
        return {name: parameter for name, parameter in parameters.items() if parameter.kind is parameter.KEYWORD_ONLY}

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


def _agreed(method: Callable[..., Result], check: MomentumCheck, **options: object) -> Result:
    """The result of a method with the names of the checks that it carried out; errors of `require_agreement`."""
    from swingid.checks.refusal import require_agreement
    from swingid.checks.table import in_order

    result = method(check, **options)
    if result.details is not None:
        ran = [*result.details.checks, *(["signs"] if check.evidence is not None else [])]  # by momentum
        result = replace(result, details=replace(result.details, checks=in_order(ran)))
    return result if check.read.one_of_several else require_agreement(result, check.read.equation)


class Answers:
    """Momentum's answers to a log, with which all methods are compared; each is made once, on first use."""

    def __init__(self) -> None:
        self._kept: list[tuple[Recording, Rig, bool, MomentumCheck]] = []

    def forget(self) -> None:
        """Make the answers anew."""
        self._kept.clear()

    def of(
        self, log: Recording, rig: Rig, options: Mapping[str, object], *, one_of_several: bool = False
    ) -> MomentumCheck:
        """Momentum's answer with these options; one with the default options is kept until the next log."""
        from swingid.checks.momentum import MomentumCheck
        from swingid.preparation.prepared import prepare

        for kept_log, kept_rig, several, check in () if options else self._kept:
            if kept_log is log and kept_rig == rig and several == one_of_several:
                return check
        prepared = prepare(log, rig, one_of_several=one_of_several)
        check = MomentumCheck(prepared, partial(_agreed, METHODS[DEFAULT].load()), options)
        if not options:
            self._kept = [entry for entry in self._kept if entry[0] is log]  # logs come one after the other
            self._kept.append((log, rig, one_of_several, check))
        return check


def _of(package: str) -> Load:
    """What loads the function of a package beside this file; it can be pickled."""
    return partial(_function_of, package)


def _function_of(package: str) -> Callable[..., Result]:
    function: Callable[..., Result] = getattr(import_module(f"swingid.methods.{package}.method"), package)
    return function


_TABLE = (
    Method("momentum", _of("momentum"), motor="unused", friction="any", speeds="none", in_parts=True, online=True),
    Method("energy", _of("energy"), motor="needed", friction="basis", speeds="smoothed", turning_points=True,
           in_parts=True, online=True),
    Method("output-error", _of("output_error"), motor="optional", friction="law", speeds="none"),
    Method("equation-error", _of("equation_error"), motor="unused", friction="law", speeds="filtered"),
    Method("backstepping", _of("backstepping"), motor="needed", friction="viscous", speeds="smoothed", gravity=True,
           drive=True),
)  # fmt: skip

METHODS: dict[str, Method] = {method.name: method for method in _TABLE}
"""The methods by name, those that assume least first."""

DEFAULT = "momentum"


def method_of(name: str) -> Method:
    """The method of a name. Raises UsageError for a name that is none."""
    if name not in METHODS:
        raise UsageError(f"unknown method {name!r}; choose one of {', '.join(METHODS)}.", code="unknown-method")
    return METHODS[name]
