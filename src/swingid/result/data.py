"""What a result consists of: values, standard uncertainties, budget, warnings, notes, provenance; as plain data."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Literal

import numpy as np

from swingid.errors import InputError, UnanswerableError
from swingid.numerics.arrays import Array, robust_spread
from swingid.recording.findings import Kind
from swingid.result.origin import Origin
from swingid.uncertainty.budget import BudgetEntry, Parameter

SCHEMA = "swingid.result/1"
WHERE_GIVEN = ("sensitivities", "covariance", "correlation", "ratios", "monte_carlo", "per_log", "per_part")
"""Keys that a file has only where they hold something."""

TARE = "tare_inertia"
"""Parameter of a difference: the inertia without the body."""

IN_FILES = {"covariance_of_fit": "covariance"}
"""Keys in files of fields that are called otherwise here."""


@dataclass(frozen=True)
class Message:
    """A warning or a note: a stable slug for scripts, a sentence for people, and its kind, which no file holds."""

    code: str
    message: str
    kind: Kind | None = field(default=None, metadata={"plain": False})


@dataclass(frozen=True)
class SwingSeries:
    """One inertia per swing: instants of the turning points (s), +1 upper / −1 lower, values, uncertainties."""

    times: Array
    sides: Array
    values: Array
    uncertainties: Array

    @classmethod
    def of(cls, times: Array, sides: Array, values: Array, expected: Array | float = 0.0) -> SwingSeries:
        """Average values with their spread as the uncertainty of each, or what is expected of it where that is more."""
        return cls(times, sides, values, np.maximum(np.full(len(values), expected), robust_spread(values)))


@dataclass(frozen=True)
class FrictionCurve:
    """Friction torque (N m or N) against speed (rad/s or m/s), and the law that describes it best.

    `candidates` lists every law tried with its information criterion (lower is better).
    """

    speeds: Array
    torques: Array
    uncertainties: Array
    law: str
    law_torques: Array
    candidates: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Convergence:
    """How an online estimate of the inertia came to its value.

    times (s), values: the estimate over the log, thinned for drawing. settled: begin and end (s) of the part whose mean
    is the estimate. within: seconds from the first row until it stays within a distance of its final value ("5 %",
    "1 %"), None where it does not by the end.
    """

    times: Array
    values: Array
    settled: tuple[float, float]
    within: dict[str, float | None]


@dataclass(frozen=True)
class Changing:
    """What changes slowly within a log: values with standard uncertainties at instants (s), against their mean.

    what: "friction", whose values are shares of the mean loss (unit "1"), or "zero", that of the angle (rad or m).
    """

    what: str
    unit: str
    times: Array
    values: Array
    uncertainties: Array


@dataclass(frozen=True)
class Agreement:
    """Inertias of two parts of a log, with their standard uncertainties by its data alone (type A).

    division: "time" (first and second half), "amplitude" (larger and smaller swings), "direction" (with rising and with
    falling angle) or "rise" (away from the middle and back). difference: of both; standard_uncertainty: of that where
    the model holds, for both share data, sensors and constants.
    """

    division: str
    first: tuple[float, float]
    second: tuple[float, float]
    difference: float
    standard_uncertainty: float


@dataclass(frozen=True)
class PartValue:
    """What one part of a log gives alone: from when to when (s), its value and standard uncertainty, its status.

    value: of the parameter that the result is about; None where the part was refused.
    """

    start: float
    stop: float
    value: float | None
    standard_uncertainty: float | None
    status: str


@dataclass(frozen=True)
class Details:
    """What the report draws and the curious read: the way from the log to the number.

    start, stop: the part of the log used (s); left_out (k, 2): from when to when (s) not, within. turning_times,
    turning_angles: the turning points found. window: half-length of the modulating functions (s), None where a method
    has none. estimates: inertia and standard uncertainty by kind of window, for comparison. residual_times, residuals:
    residuals of the balance (N m or N, averaged over each window; with a residual_unit, rad or m, the angle of each
    sample). changing: what changes within the log. agreement: of its parts. checks: names of the
    consistency checks that were carried out (`checks.table.CHECKS`). extra: shares by the names of
    `report.words.EXTRA`, such as the relative residual of equation (II) when motor constants are known.
    """

    start: float
    stop: float
    turning_times: Array
    turning_angles: Array
    window: float | None = None
    swings: SwingSeries | None = None
    friction: FrictionCurve | None = None
    estimates: dict[str, tuple[float, float]] = field(default_factory=dict)
    residual_times: Array = field(default_factory=lambda: np.empty(0))
    residuals: Array = field(default_factory=lambda: np.empty(0))
    residual_unit: str | None = None
    extra: dict[str, float] = field(default_factory=dict)
    convergence: Convergence | None = None
    changing: tuple[Changing, ...] = ()
    agreement: tuple[Agreement, ...] = ()
    checks: tuple[str, ...] = ()
    left_out: Array = field(default_factory=lambda: np.empty((0, 2)))

    def unused(self, first: float, last: float) -> list[tuple[float, float]]:
        """Parts (s) of a log from `first` to `last` that were not used."""
        parts = [(first, self.start), *((float(a), float(b)) for a, b in self.left_out), (self.stop, last)]
        return [(begin, end) for begin, end in parts if end > begin]


@dataclass(frozen=True)
class Distributed:
    """A parameter by propagation of distributions (JCGM 101:2008).

    interval95: the shortest one; symmetric95: with 2.5 % on either side. agrees: whether the interval of the linear
    budget agrees with the symmetric one within `tolerance`; None where `interval_error`, the standard error of its
    ends, is too large to know. values (n,): the sample, sorted.
    """

    mean: float
    standard_uncertainty: float
    interval95: tuple[float, float]
    symmetric95: tuple[float, float]
    agrees: bool | None
    tolerance: float
    interval_error: float
    values: Array


@dataclass(frozen=True)
class MonteCarlo:
    """Distributions of the parameters by name; draws: how many were made; answered: how many gave an estimate.

    refusals: number of the others by the code of their error.
    """

    draws: int
    answered: int
    refusals: dict[str, int]
    parameters: dict[str, Distributed]


@dataclass(frozen=True)
class ResultData:
    """The result of one method from one log, as plain data; `Result` adds the text and the picture of it.

    status: "ok", "warning" (to be checked for the reasons in `warnings`) or "refused" (no parameters, `error` has
    the reason). `notes` hold assumptions and what was done; they do not change the status. sensitivities:
    change of the inertia per unit of each constant of the rig file, by its key, exact ones too. covariance_of_fit:
    of type A, `covariance` in a file, between parameters fitted together where that matters (inertia and an unknown
    gravity torque). correlation: of all parameters whose uncertainty is known, of type A and B together. per_log: the
    ordinary results of several logs, of which this one is the common result. ratios: whether nothing set the scale, so
    that the parameters are ratios such as "gravity_torque/inertia" and there is no "inertia". monte_carlo:
    distributions by Supplement 1 of the GUM. per_part: of several parts of one log, what each gives alone.
    """

    method: str
    status: Literal["ok", "warning", "refused"]
    parameters: dict[str, Parameter] = field(default_factory=dict)
    warnings: tuple[Message, ...] = ()
    notes: tuple[Message, ...] = ()
    budget: tuple[BudgetEntry, ...] = ()
    provenance: dict[str, object] = field(default_factory=dict)
    error: Message | None = None
    details: Details | None = None
    sensitivities: dict[str, float] = field(default_factory=dict)
    covariance_of_fit: dict[str, dict[str, float]] = field(default_factory=dict)
    correlation: dict[str, dict[str, float]] = field(default_factory=dict)
    ratios: bool = False
    monte_carlo: MonteCarlo | None = None
    per_log: tuple[ResultData, ...] = ()
    per_part: tuple[PartValue, ...] = ()

    @cached_property
    def origin(self) -> Origin:
        """What the provenance states, for code that asks."""
        return Origin.of(self.provenance)

    @property
    def inertia(self) -> Parameter:
        """The moment of inertia J1 (without a wheel: of the whole axis), the reason for all this.

        Raises UnanswerableError where nothing set the scale, so that the result has ratios only.
        """
        require_scale(self, "this result")
        return self.parameters["inertia"]

    @property
    def leading(self) -> str:
        """Name of the parameter that the result is about: "inertia", without a scale the first ratio.

        `TARE` of a difference whose scale a known body sets, for its "inertia" is the one that was given.
        """
        first = next(iter(self.parameters), "inertia")
        return first if self.ratios or first == TARE else "inertia"

    @property
    def main(self) -> Parameter:
        """The parameter that the result is about, see `leading`."""
        return self.parameters[self.leading]

    def to_dict(self) -> dict[str, object]:
        """The result as plain data, schema "swingid.result/1"; NaN and infinities become null."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        values["per_log"] = [result.to_dict() for result in self.per_log]
        values = {IN_FILES.get(name, name): value for name, value in values.items()}
        kept = {name: value for name, value in values.items() if name not in WHERE_GIVEN or value}
        document: dict[str, object] = plain({"schema": SCHEMA, **kept})
        return document

    def to_json(self) -> str:
        """The result as JSON text."""
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def require_scale(result: ResultData, name: str) -> None:
    """Raise UnanswerableError, with the `name` of the result, for one of ratios, where an inertia is needed."""
    if result.ratios:
        raise UnanswerableError(
            f"{name} has ratios to the inertia only ({', '.join(result.parameters)}), for nothing in its rig file set "
            "the scale; state what its note no-scale names, and identify the log again, or give two such results, "
            "without and with a known body, to swingid difference --known.",
            code="no-scale",
        )


def require_inertia(result: ResultData, name: str, *, ratios: bool = False) -> None:
    """Raise InputError for a result without a number, and, but with `ratios`, UnanswerableError as `require_scale`."""
    if not ratios:
        require_scale(result, name)
    if result.status == "refused" or result.leading not in result.parameters:
        reason = f": {result.error.message.rstrip('.')}" if result.error else ""
        raise InputError(f"{name} has no inertia{reason}; identify a log that gives one.", code="refused-result")


def plain(value: Any) -> Any:
    """Data as JSON has them: fields for a dataclass, lists for arrays, None for what is not finite; recursive."""
    if isinstance(value, BudgetEntry | Parameter):
        value = value.to_dict()
    if hasattr(value, "__dataclass_fields__"):
        names = [field.name for field in fields(value) if field.metadata.get("plain", True)]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return [plain(item) for item in value.tolist()]
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
