"""One fit of the balance to the windows of several logs, which need no turning points and may differ in a known body.

The rows of all logs are equations for the same unknowns: inertia, friction as one function of the speed, the constants
of a motor on the axis, and a gravity torque or spring that is to be identified. A known body of inertia J_k that is
added in log k is a known term J_k ∫φ'' q1. So two coast-downs, with and without such a body, determine the inertia and
the drag together, although each of them alone determines their ratio only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import numpy as np

from swingid.balance.choice import FLAT, FURTHER, gain
from swingid.balance.errors import channel_errors, constant_error
from swingid.balance.fits import BASIS, WindowFit, fit_rows, with_errors
from swingid.balance.lengths import each, longest_of_best, search
from swingid.balance.motor_on_axis import is_open, volts, with_motor
from swingid.balance.perturbations import RowError, of_channels, of_constants
from swingid.balance.rows import Rows, Signals, Windows, rows_of
from swingid.balance.systematics import grid_spread, variance_of_difference
from swingid.balance.windows import law_windows
from swingid.errors import UnanswerableError
from swingid.model.equation import VOLTAGE_SCALE, Coefficient, Constant, Equation
from swingid.numerics.arrays import Array
from swingid.numerics.once import once
from swingid.numerics.regression import LinearFit, fit_linear
from swingid.numerics.test_functions import project
from swingid.preparation.noise import Noise
from swingid.preparation.prepared import Part
from swingid.uncertainty.freedom import coverage_factor
from swingid.units import Quantity

ONE_WAY = ("coulomb", "viscous", "quadratic")
"""Friction of a motion in one direction, where friction that depends on the direction has the same regressors."""

APART = 4.0
"""Time between the windows of two logs in the rows of all, in half-lengths: more than two, so that none overlap."""

SLOW, MOVING = 0.03, 0.9
"""Share of the greatest speed below which an axis with a motor may rest, and the weighted share of a window in which it
has to be faster: friction at rest is no function of the speed, and a gear holds against a voltage."""

TURN = 0.3
"""Angle (rad) in which a block of rows ends where the balance depends on the angle: sin q1 is smooth over it."""


@dataclass(frozen=True)
class Run:
    """One log as it is fitted: its name, the part of it that is used, its signals, the inertia of the body added."""

    name: str
    part: Part
    signals: Signals
    added: Quantity

    @classmethod
    def of(cls, name: str, part: Part, added: Quantity) -> Run:
        """The signals of a part; raises as `Signals.of`."""
        signals = Signals.of(part.log, part.rig, part.motion, part.encoders, longest=_block(part))
        return cls(name, part, signals, added)

    @once
    def rows(self, half: float) -> Rows:
        """The rows on windows of half-length `half` (s), with the terms of its own drive and body."""
        signals = self.signals.suited(half)
        windows = law_windows(signals, half)
        if "torque_per_volt" in self.part.equation.terms:
            rows = with_motor(rows_of(signals, _in_motion(windows, signals)), signals)
        else:
            rows = rows_of(signals, windows)
        return rows.beside({body_name(self.added): rows["inertia"]} if self.added.value else {})


def _in_motion(windows: Windows, signals: Signals) -> Windows:
    """The windows during which the axis moves: below `SLOW` a voltage may only push against friction at rest."""
    moves = (np.abs(signals.speed) > SLOW * signals.fastest).astype(np.float64)
    share = project(signals.nodes, [(moves, 0)], windows.centres, windows.half)[:, 0] / (windows.half * 32 / 35)
    return windows.select(share > MOVING)


def _block(part: Part) -> float | None:
    """Longest block of rows (s); None for what the change of the speed alone allows."""
    values = part.equation.stated
    if part.equation.linear or all(values.get(name) == 0 for name in part.equation.terms):
        return None
    fastest = float(np.max(np.abs(part.motion.speed.speed)))
    return min(part.motion.quickest / 8, TURN / max(fastest, 1e-300))


@dataclass(frozen=True)
class Together:
    """The fit of all logs, and those of other lengths of the windows by half-length (s)."""

    runs: tuple[Run, ...]
    law: WindowFit
    tried: dict[float, WindowFit]

    def places(self, half: float) -> list[slice]:
        """The rows of each log in a fit on windows of this half-length."""
        ends = [0, *accumulate(len(run.rows(half)) for run in self.runs)]
        return [slice(begin, end) for begin, end in pairwise(ends)]

    def of_log(self, k: int, fit: WindowFit) -> WindowFit:
        """The rows of one log in the fit of all, with their influence on the unknowns of all."""
        at = self.places(fit.half)[k]
        data = LinearFit(fit.fit.values, fit.fit.residuals[at], fit.fit.influence[:, at], fit.fit.condition)
        return replace(fit, fit=data, rows=self.runs[k].rows(fit.half), bare=None)

    def grid(self) -> float:
        """Standard uncertainty of a11 by the grid phase of the encoder, as of `systematics.grid_spread`."""
        spreads = [grid_spread(self.of_log(k, self.law), run.signals) for k, run in enumerate(self.runs)]
        return float(np.hypot.reduce(spreads))

    def variance_between(self, first: WindowFit, second: WindowFit) -> float:
        """Variance of the difference of two fits' a11 by white noise of the same samples."""
        return sum(
            variance_of_difference(run.signals, self.of_log(k, first), self.of_log(k, second))
            for k, run in enumerate(self.runs)
        )


def fit_together(runs: Sequence[Run], equation: Equation, friction: tuple[str, ...] | None = None) -> Together:
    """The fit with the shortest interval over lengths of the windows; among nearly equal ones the longest windows.

    The interval, not the standard uncertainty: in few long windows that is itself hardly known. friction: its unknown
    terms, by default `friction_of`. Raises UnanswerableError for logs too short.
    """
    equation = with_bodies(_separable(equation, runs), runs)
    noise, friction = _noise(runs), friction or friction_of(runs)

    def fit_at(half: float) -> WindowFit | None:
        fit = fit_rows(_stacked([run.rows(half) for run in runs]), equation, noise, friction)
        return fit and replace(fit, half=half)

    tried = search(fit_at, min(_longest(run) for run in runs), 4 * noise.step)
    if not tried:
        raise UnanswerableError(
            "the logs contain too little usable motion to fit inertia and friction; record longer ones.",
            code="too-short",
        )
    tried = _with_cubic(tried)
    tried = each(tried, lambda fit: with_errors(fit, declared_of(fit, runs)))
    law = longest_of_best(tried.values(), lambda fit: fit.relative(fit.total) * coverage_factor(fit.freedom), FLAT)
    law = tried[max(tried)] if law is None else law
    return Together(tuple(runs), law, tried)


def friction_of(runs: Sequence[Run]) -> tuple[str, ...]:
    """The terms of friction that these motions distinguish: fewer where all go in one direction."""
    directions = {float(sign) for run in runs for sign in run.signals.directions if sign}
    return BASIS if len(directions) > 1 else ONE_WAY


def unit_of_friction(runs: Sequence[Run]) -> str:
    """The largest term of the friction, the unit where nothing sets a scale."""
    rows, terms = _stacked([run.rows(_longest(run) / 2) for run in runs]), friction_of(runs)
    columns = np.array([rows[name] for name in terms]).T
    sizes = np.linalg.norm(columns * fit_linear(columns, rows["inertia"]).values, axis=0)
    return terms[int(np.argmax(sizes))]


def with_bodies(equation: Equation, runs: Sequence[Run]) -> Equation:
    """The equation with the bodies that were added as known terms J_k q1''; equal ones are one body."""
    for body in dict.fromkeys(run.added for run in runs if run.added.value):
        name = body_name(body)
        equation = equation.but(**{name: Coefficient(body.value, {name: 1.0})})
        constant = Constant(name, body.std or 0.0, shared=False)
        equation = replace(equation, constants=(*equation.constants, constant))
    return equation


def body_name(added: Quantity) -> str:
    """Name of the known term of an added body."""
    return f"added body of {added.value:g}"


def _separable(equation: Equation, runs: Sequence[Run]) -> Equation:
    """The equation without unknown terms of the motor that no log shows.

    An unknown back-EMF has the regressor of viscous friction where no bridge is open.
    """
    hidden = set() if any(is_open(run.part.log) for run in runs) else {"back_emf"}
    if not any(run.part.log.voltage is not None and np.any(volts(run.part.log)) for run in runs):
        hidden = {"back_emf", "torque_per_volt", "gear_friction"}
    return equation.without(hidden & set(equation.sought))


def _longest(run: Run) -> float:
    """Longest half-length (s) of the windows of a log."""
    time, motion = run.signals.nodes.time, run.signals.motion
    duration = float(time[-1] - time[0])
    return min(duration / 5, 0.75 * motion.half_period) if len(motion.turning_times) > 3 else duration / 5


def _noise(runs: Sequence[Run]) -> Noise:
    """One noise for the rows of all logs: the largest of each, for rows are weighted alike."""
    all_of = [run.part.noise for run in runs]
    loudest = max(all_of, key=lambda noise: noise.angle**2 * noise.step)
    return replace(loudest, resolution=max(noise.resolution for noise in all_of))


def _stacked(rows: Sequence[Rows]) -> Rows:
    """The rows of all logs one after another, each log's instants behind those of the one before.

    A term that a log does not have is 0 in its rows.
    """
    centres, after = [], 0.0
    for of_log in rows:
        reach = APART * of_log.windows.middle if len(of_log.windows) else 0.0
        begin = float(of_log.windows.centres[0]) if len(of_log.windows) else 0.0
        centres.append(of_log.windows.centres - begin + after)
        after = float(centres[-1][-1]) + reach if len(of_log.windows) else after
    names = dict.fromkeys(name for of_log in rows for name in of_log.columns)
    columns = {name: _joined([of_log.columns.get(name, np.zeros(len(of_log))) for of_log in rows]) for name in names}
    pulls = {name: float(np.mean([of_log.pulls[name] for of_log in rows])) for name in rows[0].pulls}
    return Rows(Windows(_joined(centres), _joined([of_log.windows.half for of_log in rows])), columns, pulls)


def _joined(arrays: Sequence[Array]) -> Array:
    return np.concatenate(list(arrays))


def _with_cubic(tried: dict[float, WindowFit]) -> dict[float, WindowFit]:
    """The fits with a cubic term of friction where the best of them shows one, by the level of `balance.choice`."""
    plain = min(tried.values(), key=lambda fit: fit.relative(fit.u))
    more = fit_rows(plain.rows, plain.equation, plain.noise, (*plain.friction, "cubic"))
    if more is None or not gain(plain, more) > FURTHER["cubic",]:
        return tried
    cubic = each(tried, lambda fit: fit_rows(fit.rows, fit.equation, fit.noise, (*fit.friction, "cubic")))
    return {half: replace(fit, half=half) for half, fit in cubic.items()}


def declared_of(fit: WindowFit, runs: Sequence[Run]) -> list[RowError]:
    """What is stated as uncertain, with its effect on the rows of all logs."""
    errors = [constant_error(fit.rows, fit.equation, error) for error in of_constants(fit.equation) if error.std > 0]
    if "torque_per_volt" in fit.rows.columns:  # unknown or known, they have the error of the voltage
        volts_off = -fit.rows.sum_of({name: fit.value(name) for name in ("torque_per_volt", "gear_friction")})
        errors = [replace(error, rows=volts_off) if error.source == VOLTAGE_SCALE else error for error in errors]
    shared = of_channels(runs[0].part.rig, runs[0].signals.encoders)
    each = [channel_errors(run.rows(fit.half), run.signals, shared, fit.coefficients) for run in runs]
    joined = [_joined([error[k].rows for error in each]) for k in range(len(shared))]
    return errors + [RowError(error, rows) for error, rows in zip(shared, joined, strict=True)]
