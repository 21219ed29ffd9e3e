"""Output error: least squares of simulated against measured angles (the paper's NLS, section 5; MATLAB's nlgreyest).

The default simulates both rows under the held voltage and so stands on the motor's constants; input="wheel" takes the
measured wheel as the input of row (I) and needs none. Either way a friction law is part of the model: a wrong one
biases the inertia, and shows in the residuals. `momentum` needs no law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.fits import WindowFit
from swingid.checks.consistency import Consistency, consistency_check
from swingid.errors import UnanswerableError
from swingid.methods.output_error.answer import answer_of, details_of, estimate_of, type_a
from swingid.methods.output_error.checks import POOR, check_fit, left_of_channels, misfit_ratios
from swingid.methods.output_error.constants import uncertain_constants
from swingid.methods.output_error.declared import constants_found
from swingid.methods.output_error.options import check_options, input_of, names_of, require_rows
from swingid.methods.output_error.problem import Input, Problem, problem_of
from swingid.methods.output_error.readings import uncertain_readings
from swingid.methods.output_error.search import RICHEST, Searched, choose_law, first_values, search
from swingid.methods.output_error.solver import solve
from swingid.methods.output_error.unknowns import Unknowns, unknowns_of
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.motion import Motion
from swingid.preparation.prepared import Part, Prepared
from swingid.preparation.scale import Scale
from swingid.result.result import Result

SHORTEST = 48
"""Rows of a segment that are not halved further."""

SHARES = (64, 16, 8, 4)
"""Parts of a segment over which residuals may be alike."""

SWINGS = 4
"""Half swings per segment: longer ones tell hardly more, shorter ones spend it on their initial values."""


def output_error(
    prepared: Prepared,
    *,
    input: str | None = None,
    law: str = "auto",
    free: str | Sequence[str] = (),
    loss: str = "linear",
    starts: int = 3,
    segment: float | None = None,
) -> Result:
    """Identify inertia and friction by least squares of simulated against measured angles.

    input: "voltage" (default with a whole voltage, the wheel's angle and motor constants) or "wheel" (default
    otherwise), of a wheel rig.
    law: a friction law of `friction_laws.LAWS`, with ", offset" or ", direction-dependent" after it where wanted, or
    "auto": the law of least Bayesian information criterion. free: further unknowns, as a sequence or with commas:
    gravity_torque, torque_per_volt, back_emf, motor_viscous, motor_coulomb, efficiency, rotor_inertia, wheel_inertia.
    loss: "linear", "huber" or "soft_l1". starts: from how many points the search begins. segment: length of the
    segments with initial values of their own, s; four half swings by default.

    Raises UsageError for unknown options, InputError where a channel is missing or has the wrong sign,
    UnanswerableError where the motor's constants are missing or the motion cannot tell.
    """
    free = names_of(free)
    check_options(law, loss, starts, segment)
    log, rig, scale = prepared.log, prepared.rig, prepared.scale
    require_rows(segment, log)
    source = input_of(input, log, rig, scale)
    part = prepared.part()
    used, motion, noise = part.log, part.motion, part.noise
    consistency = consistency_check(used, rig, motion, scale, noise, part.encoders)
    setup = _Setup(part, rig, scale, source, consistency, free, loss, starts)
    problem, searched, law = _best_fit(setup, law, segment)
    estimate = estimate_of(searched, problem, used, rig, scale, motion, noise)
    answer = answer_of(estimate, rig, scale, consistency)
    warnings, notes = check_fit(answer, estimate, problem, consistency, rig, scale, motion)
    notes = [part.note, *notes]
    details = details_of(estimate, problem, scale, motion, (part.start, part.stop), law)
    extra = left_of_channels(searched.fit, problem)
    if consistency.balance is not None:
        extra["motor_balance_residual"] = consistency.balance.as_stated
    options: dict[str, object] = {"input": source, "law": law, "loss": loss, "starts": starts}
    if free:
        options["free"] = free
    found = constants_found(searched, rig)
    return prepared.result(
        "output-error",
        answer,
        part,
        warnings,
        notes,
        replace(details, extra=extra),
        options,
        more={"constants_found": found} if found else {},
    )


@dataclass(frozen=True)
class _Setup:
    """What every fit of one log shares; moves: whether what rig.toml is unsure of may move within what it states."""

    part: Part
    rig: Rig
    scale: Scale
    source: Input
    consistency: Consistency
    free: tuple[str, ...]
    loss: str
    starts: int
    moves: bool = True

    @property
    def windows(self) -> WindowFit:
        """The linear fit of row (I). Raises UnanswerableError without one."""
        if self.consistency.windows is None:
            raise UnanswerableError(
                "the log holds too few swings to begin the search from; record at least five swings.", code="too-short"
            )
        return self.consistency.windows

    @property
    def fastest(self) -> float:
        """Highest speed of the axis, rad/s."""
        return float(np.max(np.abs(self.part.motion.speed.speed)))

    def unknowns(self, law: str) -> Unknowns:
        """The unknowns with a friction law."""
        strongest = _strongest(self.windows, self.part.motion, self.scale)
        more = self.uncertain if self.moves else ((), {})
        resolution = self.part.noise.resolution
        return unknowns_of(self.rig, self.scale, law, self.free, self.fastest, strongest, resolution, *more)

    @property
    def uncertain(self) -> tuple[tuple[str, ...], dict[str, float]]:
        """Constants and sensors that rig.toml is unsure of, see `unknowns_of`."""
        readings = uncertain_readings(self.part.encoders, self.source, rotary=not self.scale.linear)
        return uncertain_constants(self.rig, self.scale, self.source), readings

    def first(self, unknowns: Unknowns) -> Array:
        """Where the search begins."""
        return first_values(unknowns, self.windows, self.rig, self.scale, self.fastest)

    def problem(self, length: float) -> Problem:
        """The log in segments of about `length` s."""
        part = self.part
        return problem_of(part.log, part.encoders, part.noise, self.source, length, part.longest_gap)

    def is_poor(self, problem: Problem, found: Searched) -> bool:
        """Whether a fit leaves more than the sensors explain."""
        return max(misfit_ratios(found.fit, found.unknowns, problem).values()) > POOR


def _best_fit(setup: _Setup, law: str, segment: float | None) -> tuple[Problem, Searched, str]:
    """The fit, its segments, and its friction law.

    What rig.toml is unsure of moves only where the log is explained with it: under a wrong model it would move to hide
    what the model lacks.
    """
    problem, found, chosen = _fit(setup, law, segment)
    if any(setup.uncertain) and setup.is_poor(problem, found):
        problem, found, chosen = _fit(replace(setup, moves=False), law, segment)
    return problem, found, chosen


def _fit(setup: _Setup, law: str, segment: float | None) -> tuple[Problem, Searched, str]:
    # Stribeck's peak has minima of its own, so its place is looked for about a motion without it
    problem, rough = _rough_fit(setup, RICHEST if law == "auto" or "stribeck" in law else law, segment)
    return problem, *_final_fit(setup, problem, rough, law)


def _rough_fit(setup: _Setup, law: str, segment: float | None) -> tuple[Problem, Searched]:
    """A first fit, on segments of `segment` s, or of a length that suits.

    A model that is not quite the rig's runs away from the log over a long segment. Where the fit is poor the segments
    are halved (quartered where the search does not settle), and those taken on which the inertia is most certain.
    """
    unknowns = setup.unknowns(law)
    values = setup.first(unknowns)
    length = SWINGS * setup.part.motion.half_period if segment is None else segment
    tried: list[tuple[Problem, Searched]] = []
    while True:
        problem = setup.problem(length)
        found = search(problem, unknowns, values, setup.loss, 1 if tried else setup.starts)
        if not tried and (unknowns.zero_bound(found.fit.values) or setup.is_poor(problem, found)):
            # a zero of the angle beyond its grid counts where with it nothing is left to explain
            other = search(problem, unknowns.with_free_zero(), values, setup.loss, 1)
            found = found if setup.is_poor(problem, other) else other
        tried.append((problem, found))
        # where not even the search settles the segments are far too long
        length /= 2 if found.fit.converged else 4
        if segment is not None or not setup.is_poor(problem, found) or length * setup.part.log.rate < SHORTEST:
            break
    best = 0
    if len(tried) > 1:
        certain = [type_a(problem, found, setup.part.motion) for problem, found in tried]
        best = int(np.argmin(np.where(np.isfinite(certain), certain, np.inf)))
    problem, found = tried[best]
    found = replace(found, law=law)
    if best > 0 and np.isfinite(tried[best - 1][1].fit.cost):
        found = replace(found, drift=abs(float(found.fit.values[0] - tried[best - 1][1].fit.values[0])))
    return problem, found


def _final_fit(setup: _Setup, problem: Problem, rough: Searched, law: str) -> tuple[Searched, str]:
    """The fit with the law asked for, or with the one that describes the log best."""
    if rough.law == law:
        fit = solve(problem, rough.unknowns, rough.fit.values, rough.fit.states, setup.loss)
        return replace(rough, fit=fit), law
    independent = _independent(problem, rough)
    choice = choose_law(problem, rough.unknowns, rough.fit, independent, setup.fastest, law)
    unknowns = setup.unknowns(choice.law).with_zero_of(rough.unknowns)
    begin = np.array([choice.values[name] for name in unknowns.names])
    fit = solve(problem, unknowns, begin, rough.fit.states, setup.loss)
    spread = choice.spread if law == "auto" else 0.0
    return replace(rough, unknowns=unknowns, fit=fit, candidates=choice.candidates, spread=spread), choice.law


def _strongest(windows: WindowFit, motion: Motion, scale: Scale) -> float:
    """A torque (N m) that no friction of this motion exceeds: some times what inertia and gravity take."""
    speed = motion.speed
    quickest = float(np.max(np.abs(speed.acceleration(speed.grid))))
    gravity = windows.value("gravity_torque") if scale.b is None else scale.b
    return 3 * (abs(windows.a11) * quickest + abs(gravity))


def _independent(problem: Problem, found: Searched) -> float:
    """Number of readings that count as independent: fewer where residuals of neighbours are alike."""
    total, runs = 0.0, np.zeros(len(SHARES))
    for first, last in zip(problem.rows[:-1], problem.rows[1:], strict=True):
        for channel in (False, True):
            own = found.fit.residuals[first:last][problem.wheel[first:last] == channel]
            total += float(own @ own)
            for k, share in enumerate(SHARES):
                size = max(len(own) // share, 1)
                runs[k] += float(np.sum(own[: len(own) // size * size].reshape(-1, size).sum(axis=1) ** 2))
    inflation = max(float(np.max(runs)) / total, 1.0) if total > 0 else 1.0
    return max(len(problem.measured) / inflation, 8.0)
