"""From a required uncertainty to a motion: candidates, predictions, the shortest that reaches it, a run of the twin."""

from __future__ import annotations

import math
from dataclasses import dataclass

from swingid.balance.identifiability import HOPELESS
from swingid.control.references import Multisine, Sine
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.format import percent
from swingid.model.rig import Rig
from swingid.preparation.scale import refuse_motor, refuse_terms
from swingid.progress import stepped, stepwise
from swingid.result.result import combined
from swingid.result.summary import sorted_budget
from swingid.study.design.information import predict
from swingid.study.design.motions import Limits, candidates, course_of, parts_of
from swingid.study.design.proposal import Design, Proposal, Trial, try_on_twin
from swingid.study.experiment import without_truth
from swingid.units import Quantity, parse_quantity

LONGEST = 60.0
"""Longest run where none is given, s."""

SETTLING = 6.0
"""Time the controller is given before its motion counts, s (the paper's gains take 4 to 6 s)."""

FEWEST_ROWS = 100
"""Rows of a whole motion below which nothing is planned."""

LOOK = 10.0
"""Used time at which candidates are first compared, s."""

SWINGS = 8
"""Fewest periods of the slowest sine that count."""

MOST_GRAVITY = 0.8
"""Per cent of inertia per per cent of gravity torque above which a motion is near resonance."""

PAPER_DELTA0 = 0.08
"""delta0 of the paper's experiment, rad."""

SHOWN = 8
"""Candidates that are worked out to the end, at most."""

ENOUGH = 5
"""Candidates that reach what is wanted, after which no more are worked out."""

TRIAL = 10
"""Candidates that take about as long as a run of the twin with its identification."""

ANGLE = 0.8
"""Largest angle of a rotary axis where none is given, rad; the paper's."""


def design(
    rig: Rig,
    uncertainty: float | str = "0.05 %",
    *,
    duration: float = LONGEST,
    max_angle: float | None = None,
    max_speed: float | None = None,
    inertia: float | str | None = None,
    gravity_torque: float | str | None = None,
    rate: float = 1000.0,
    settling: float = SETTLING,
    check: bool = True,
) -> Design:
    """Propose the motion that gives the inertia of `rig` with the wanted standard uncertainty, by the method momentum.

    Parameters
    ----------
    rig : Rig
        Its voltage limit holds, and its axis.friction is the expected friction.
    uncertainty : float or text
        A share (5e-4 or "0.05 %"), or an absolute value with its unit ("1.5e-6 kg*m^2").
    duration : float, s
        Longest run.
    max_angle : float, rad or m
        0.8 rad by default.
    max_speed : float, rad/s or m/s
        Of the wheel against the body; without a wheel, of the axis.
    inertia, gravity_torque : float or text
        Expected values where the rig states none.
    rate : float, 1/s
        Rows per second.
    settling : float, s
        The controller's time to reach its motion.
    check : bool
        Run the proposal once on the twin, with the paper's gains.

    Raises
    ------
    UsageError
        Values out of range.
    InputError
        An expected value is missing.
    UnanswerableError
        No motion within the limits reaches the uncertainty.

    Examples
    --------
    >>> import swingid as sw
    >>> rig = sw.Rig.load("paper").changed({"drive.wheel.inertia": "1134 ± 0.2 g*cm^2"})
    >>> found = sw.design(rig, "0.05 %", duration=20, check=False)
    >>> found.proposal.duration <= 20, found.proposal.reference.split()[0]
    (True, 'sine')
    """
    refuse_motor(rig, "design")
    task = required(rig, uncertainty, duration, max_angle, max_speed, inertia, gravity_torque, rate, settling)
    assert task.expected.axis.inertia is not None
    gravity = task.expected.axis.gravity_torque
    natural = math.sqrt((gravity.value if isinstance(gravity, Quantity) else 0.0) / task.expected.axis.inertia.value)
    slowest = 2 * math.pi * SWINGS / (duration - settling)
    motions = candidates(task.expected, task.limits, natural, slowest)
    with stepwise(len(motions) + SHOWN + TRIAL):
        return _designed(rig, motions, task, check=check)


def _designed(rig: Rig, motions: list[Sine | Multisine], task: Task, *, check: bool) -> Design:
    """The shortest of the motions that reaches what is wanted, and does so on the twin."""
    looked = _look(motions, task)
    if not looked:
        raise UnanswerableError(
            "no motion within the limits makes the inertia identifiable; allow a larger angle, speed, voltage or "
            "duration.",
            code="no-motion",
        )
    reached, missed = _work_out(looked, task)
    failed = ""
    for place, proposal in enumerate(reached):
        trial = None
        if check and rig.drive.wheel is not None:
            trial = try_on_twin(task.expected, proposal, task.limits, task.share)
            stepped(TRIAL)
        if trial is None or trial.passed:
            others = tuple(p for k, p in enumerate([*reached, *missed]) if k != place)
            return Design(rig.name, str(rig.source), task.share, proposal, others, trial, tuple(_notes(rig, trial)))
        failed = failed or trial.why
    raise UnanswerableError(_why_not(reached, missed, task.share, task.duration, failed), code="not-reachable")


def _proposal(motion: Sine | Multisine, task: Task, used: float) -> Proposal:
    """A motion with its prediction for `used` seconds after settling."""
    duration = task.settling + used
    course = course_of(task.expected, motion, duration, task.rate)
    prediction = predict(course.recording(task.settling), task.given, task.expected)
    # delta0 of (18): a tenth of the amplitude, at most the paper's, and above what noise makes of the error
    tenth = 0.1 * sum(part.amplitude for part in parts_of(motion))
    sensor = task.expected.sensors.of("angle")
    delta0 = float(f"{min(max(tenth, 0.5 * (sensor.noise + sensor.resolution)), PAPER_DELTA0):.2g}")
    return Proposal(motion.describe(), duration, task.settling, task.rate, delta0, course.peaks, prediction)


def _look(motions: list[Sine | Multisine], task: Task) -> list[tuple[Sine | Multisine, Proposal]]:
    """Every motion over one and the same used time; those near resonance and those without an answer are left out."""
    proposals = []
    for motion in motions:
        stepped()
        used = min(max(LOOK, _fewest_swings(motion)), task.duration - task.settling)
        try:
            proposal = _proposal(motion, task, used)
        except UnanswerableError:
            continue
        if proposal.prediction.gravity_sensitivity <= MOST_GRAVITY and math.isfinite(proposal.relative):
            proposals.append((motion, proposal))
    return proposals


def _fewest_swings(motion: Sine | Multisine) -> float:
    """Time (s) of the fewest periods of the slowest sine that count."""
    return 2 * math.pi * SWINGS / min(part.frequency for part in parts_of(motion))


def _work_out(looked: list[tuple[Sine | Multisine, Proposal]], task: Task) -> tuple[list[Proposal], list[Proposal]]:
    """The best candidates with the time they need, shortest first, and those that do not reach it."""

    def needed(proposal: Proposal) -> tuple[float, float]:
        remaining = task.share**2 - proposal.prediction.part("B") ** 2
        share = proposal.prediction.part("A") ** 2 / remaining if remaining > 0 else math.inf
        used = proposal.duration - proposal.settling
        return max(share * used, min(LOOK, used) / 2), proposal.relative

    reached: list[Proposal] = []
    missed: list[Proposal] = []
    for motion, first in sorted(looked, key=lambda item: needed(item[1]))[:SHOWN]:
        if len(reached) == ENOUGH:
            break
        stepped()
        least = max(_fewest_swings(motion), LOOK / 2)
        longest = task.duration - task.settling
        used = float(math.ceil(min(max(needed(first)[0], least), longest)))
        proposal = first
        while True:
            used = min(used, longest)
            proposal = _proposal(motion, task, used)
            if proposal.relative <= task.share or used >= longest:
                break
            used = min(float(math.ceil(max(1.3 * used, min(needed(proposal)[0], longest)))), longest)
        (reached if proposal.relative <= task.share else missed).append(proposal)
    reached.sort(key=lambda p: (p.duration, p.relative))
    missed.sort(key=lambda p: p.relative)
    return reached, missed


def _why_not(reached: list[Proposal], missed: list[Proposal], wanted: float, duration: float, failed: str) -> str:
    """Which source keeps the uncertainty up, and what to do about it."""
    if reached:
        return (
            f'by prediction "{reached[0].reference}" reaches {percent(wanted)}, but on the twin neither it nor any '
            f"other does ({failed}); allow a larger angle or voltage, or a longer settling."
        )
    best = missed[0]
    value = best.prediction.parameters["inertia"].value
    entries = sorted_budget(best.prediction.budget, "inertia")
    worst, share = entries[0], entries[0].standard_uncertainty / value
    head = (
        f'{percent(wanted)} is out of reach: the best motion within the limits, "{best.reference}" for '
        f"{best.duration:g} s, gives {percent(best.relative)}, of which {worst.source} makes {percent(share)}"
    )
    if worst.type == "A":
        return f"{head}; allow more than {duration:g} s or larger swings, or read the angle more finely."
    remaining = wanted**2 - (combined(entries[1:], "inertia") / value) ** 2
    if remaining <= 0:
        return f"{head} and {entries[1].source} {percent(entries[1].standard_uncertainty / value)}; know both better."
    return f"{head}; know it to {percent(math.sqrt(remaining) / share)} of the uncertainty that rig.toml states."


def _notes(rig: Rig, trial: Trial | None) -> list[str]:
    notes = []
    if not rig.axis.friction.model_fields_set:
        notes.append("the rig states no axis.friction, so none is expected; state what you expect of the bearing.")
    exact = rig.constants_without_uncertainty()
    used = [key for key in exact if key.split(".")[-1] in ("inertia", "rotor_inertia", "gear_ratio", "gravity_torque")]
    if used:
        notes.append(f"taken as exact, since rig.toml states no uncertainty: {', '.join(used)}.")
    sensor = rig.sensors.of("angle")
    if sensor.noise == 0 and sensor.resolution == 0:
        notes.append("the rig states neither noise nor resolution of its angle sensor, so the data count as perfect.")
    if trial is None:
        notes.append("not tried on the twin, whose controller has no gains for this drive.")
    return notes


@dataclass(frozen=True)
class Task:
    """What a design is for, checked: the rig as given to the method and as expected, the required relative uncertainty.

    duration: longest run (s); rate: rows per second; settling: the controller's time to reach its motion (s).
    """

    given: Rig
    expected: Rig
    share: float
    limits: Limits
    duration: float
    rate: float
    settling: float


def required(
    rig: Rig,
    uncertainty: float | str,
    duration: float,
    max_angle: float | None,
    max_speed: float | None,
    inertia: float | str | None,
    gravity_torque: float | str | None,
    rate: float,
    settling: float,
) -> Task:
    """The task of the arguments of `design`; raises as it does, but never for what the motions cannot do."""
    expected = expected_rig(rig, inertia, gravity_torque)
    assert expected.axis.inertia is not None
    share = wanted_share(uncertainty, expected.axis.inertia.value, rig)
    limits = limits_of(rig, max_angle, max_speed)
    for name, value in (("duration", duration), ("rate", rate)):
        if not 0 < value < math.inf:
            raise UsageError(f"{name} must be a positive number, and is {value}.", code="out-of-range")
    if rate * duration < FEWEST_ROWS:
        text = f"rate is {rate:g} rows per second, which is {rate * duration:.2g} rows in {duration:g} s; take more."
        raise UsageError(text, code="out-of-range")
    if not 0 <= settling < math.inf:
        raise UsageError(f"settling must be zero or positive, and is {settling}.", code="out-of-range")
    if duration < settling + 3:
        raise UsageError(
            f"duration is {duration:g} s, but the controller takes {settling:g} s to settle; allow more.",
            code="too-short",
        )
    return Task(without_truth(rig), expected, share, limits, duration, rate, settling)


def expected_rig(rig: Rig, inertia: float | str | None, gravity_torque: float | str | None) -> Rig:
    """The rig as it is expected to be; InputError for what is not known at all."""
    if rig.drive.channel is None:
        raise UnanswerableError(
            f"rig {rig.name} has no drive, so its motion cannot be chosen; release it from a large angle.",
            code="no-drive",
        )
    refuse_terms(rig, "a design")
    linear = rig.axis.kind == "linear"
    changes: dict[str, Quantity] = {}
    if inertia is not None:
        changes["axis.inertia"] = _read(inertia, "kg" if linear else "kg*m^2", "inertia")
        if not changes["axis.inertia"].value > 0:
            raise UsageError(f"inertia is {inertia}, but must be positive.", code="out-of-range")
    elif rig.axis.inertia is None:
        raise InputError(
            f'{rig.source}: axis.inertia is missing; state what you expect there or as --inertia "3e-3 kg*m^2".',
            code="no-inertia",
        )
    if gravity_torque is not None:
        changes["axis.gravity_torque"] = _read(gravity_torque, "N*m", "gravity_torque")
    elif isinstance(rig.axis.gravity_torque, str):
        raise InputError(
            f"{rig.source}: axis.gravity_torque is unknown; state what you expect as --gravity-torque.",
            code="no-gravity-torque",
        )
    return rig.changed(changes) if changes else rig


def _read(value: float | str, unit: str, name: str) -> Quantity:
    """A quantity that the caller gave; UsageError for what is none."""
    try:
        return parse_quantity(float(value) if _is_number(value) else value, unit, name)
    except InputError as error:
        raise UsageError(error.message, code=error.code) from None


def _is_number(value: float | str) -> bool:
    try:
        float(value)
    except ValueError:
        return False
    return True


def wanted_share(uncertainty: float | str, inertia: float, rig: Rig) -> float:
    """The wanted relative standard uncertainty."""
    if isinstance(uncertainty, str) and not _is_number(uncertainty) and not uncertainty.rstrip().endswith("%"):
        share = _read(uncertainty, "kg" if rig.axis.kind == "linear" else "kg*m^2", "uncertainty").value / inertia
    else:
        share = _read(uncertainty, "", "uncertainty").value
    if not 0 < share < HOPELESS:
        raise UsageError(
            f"uncertainty is {share:.3g} of the inertia, but must be above 0 and below {HOPELESS:g}; "
            'write for example "0.05 %".',
            code="out-of-range",
        )
    return share


def limits_of(rig: Rig, max_angle: float | None, max_speed: float | None) -> Limits:
    """The limits of angle, speed and voltage; UsageError for what is no limit."""
    if max_angle is None:
        if rig.axis.kind == "linear":
            raise UsageError("a linear axis needs max_angle, its largest excursion in m.", code="no-limit")
        max_angle = ANGLE
    for name, value in (("max_angle", max_angle), ("max_speed", max_speed)):
        if value is not None and not 0 < value < math.inf:
            raise UsageError(f"{name} must be a positive number, and is {value}.", code="out-of-range")
    motor = rig.drive.motor
    return Limits(max_angle, max_speed, None if motor is None else motor.voltage_limit)
