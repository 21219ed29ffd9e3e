"""Errors and intervals to expect of each method, from many runs of the planned experiment on the twin of the rig."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.format import percent
from swingid.identification import identify
from swingid.methods.table import METHODS, method_of, one_momentum
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.recording.recording import Recording
from swingid.study.experiment import Experiment, without_truth
from swingid.study.faults import parse_fault, with_faults
from swingid.study.output import Study, aligned, counted, noted
from swingid.system import cores, map_in_processes

if TYPE_CHECKING:
    from swingid.control.backstepping import Backstepping
    from swingid.control.compensator import Compensator

SCHEMA = "swingid.rehearse/1"

FEWEST_RUNS = 5

NO_OPTIONS: Mapping[str, object] = {}

HEADINGS = ("method", "RMSE", "bias", "95 % of errors", "95 % interval", "covers", "answers")


@dataclass(frozen=True)
class Expectation:
    """What to expect of one method: relative errors of the inertia, and half-widths of its 95 % intervals, per run.

    refusals, warnings: how many runs had which code.
    """

    method: str
    errors: Array
    half_widths: Array
    refusals: dict[str, int]
    warnings: dict[str, int]

    @property
    def answered(self) -> int:
        """Number of runs with a number."""
        return int(np.isfinite(self.errors).sum())

    @property
    def bias(self) -> float:
        """Mean relative error."""
        return float(np.nanmean(self.errors)) if self.answered else float("nan")

    @property
    def rmse(self) -> float:
        """Root of the mean square of the relative error."""
        return float(np.sqrt(np.nanmean(self.errors**2))) if self.answered else float("nan")

    @property
    def p95(self) -> float:
        """95th percentile of the absolute relative error."""
        return float(np.nanquantile(np.abs(self.errors), 0.95)) if self.answered else float("nan")

    @property
    def half_width(self) -> float:
        """Median relative half-width of the 95 % interval; NaN where no run has one."""
        known = self.half_widths[np.isfinite(self.half_widths)]
        return float(np.median(known)) if len(known) else float("nan")

    @property
    def coverage(self) -> tuple[float, float]:
        """Share of the intervals that contain the true value, and its binomial standard error (Agresti and Coull)."""
        known = np.isfinite(self.half_widths)
        count = int(known.sum())
        if not count:
            return float("nan"), float("nan")
        hits = int((np.abs(self.errors[known]) <= self.half_widths[known]).sum())
        # two more of each keep the error from vanishing at 100 %
        share = (hits + 2) / (count + 4)
        return hits / count, float(np.sqrt(share * (1 - share) / (count + 4)))


@dataclass(frozen=True)
class Rehearsal(Study):
    """The expectations of all methods over the same runs."""

    rig: str
    runs: int
    expectations: tuple[Expectation, ...]
    notes: tuple[str, ...]

    def of(self, method: str) -> Expectation:
        """The expectation of one method."""
        return next(e for e in self.expectations if e.method == method)

    def to_dict(self) -> dict[str, Any]:
        """Plain data, schema "swingid.rehearse/1"; what is unknown is null."""
        named = ("method", "answered", "bias", "rmse", "p95", "refusals", "warnings", "errors", "half_widths")
        methods = [
            {name: getattr(e, name) for name in named}
            | {"median_half_width": e.half_width, "coverage": e.coverage[0], "coverage_standard_error": e.coverage[1]}
            for e in self.expectations
        ]
        return {"schema": SCHEMA, "rig": self.rig, "runs": self.runs, "methods": methods, "notes": list(self.notes)}

    def summary(self) -> str:
        """One line per method for a terminal: relative errors and half-widths to expect; then refusals and notes."""
        rows = [HEADINGS, *(_cells(e, self.runs) for e in self.expectations)]
        lines = [f"[[{self.runs} runs of the twin of {self.rig}: relative error of the inertia to expect]]"]
        lines += [*aligned(rows), ""]
        for e in self.expectations:
            for what, codes in (("refused", e.refusals), ("warned", e.warnings)):
                lines += [f"    {e.method} {what}: {counted(codes, self.runs)}"] if codes else []
        return "\n".join([*lines, *noted(self.notes)]).rstrip()


def rehearse(
    rig: Rig,
    reference: Callable[[Array], Array] | None = None,
    controller: Compensator | Backstepping | None = None,
    *,
    duration: float,
    rate: float = 1000.0,
    runs: int = 40,
    seed: int = 0,
    initial_angle: float = 0.0,
    methods: Sequence[str] | Mapping[str, Mapping[str, object]] | None = None,
    faults: Sequence[str] = (),
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Rehearsal:
    """Run the planned experiment `runs` times on the twin of `rig` and identify every log by every method.

    In each run the constants with a stated uncertainty, the imperfections and places of the encoders, noise and jitter
    are drawn; run k draws by `seed` + k, so the answer is the same for any number of `workers` (processes; default: one
    per core).
    methods: names, or options by name; all of them by default. faults: what the rig, its file or its log has and nobody
    knows, as "clock: 200 ppm" (`study.faults`). The rig must state axis.inertia; friction as in
    axis.friction. progress(done, runs) is called after each run.

    Raises InputError for a rig without axis.inertia, UsageError for too few runs, UnanswerableError where no method
    answers in any run.
    """
    if runs < FEWEST_RUNS:
        raise UsageError(f"{runs} runs are too few to expect anything; take {FEWEST_RUNS} or more.", code="few-runs")
    if rig.axis.inertia is None:
        raise InputError(
            f"{rig.source}: axis.inertia is missing, but the twin needs it; give what you expect it to be.",
            code="no-inertia",
        )
    chosen = dict(methods) if isinstance(methods, Mapping) else dict.fromkeys(methods or METHODS, NO_OPTIONS)
    for name, options in chosen.items():
        method_of(name).check_options(options)
    ways = tuple((name, name, options) for name, options in chosen.items())
    experiment = Experiment(
        rig, without_truth(rig), reference, controller, duration, rate, initial_angle, draw=True, methods=ways
    )
    drawn = [parse_fault(text) for text in faults]
    if drawn:
        experiment = with_faults(experiment, drawn)
    outcomes: list[tuple[Outcome, ...]] = []
    for found in _runs(experiment, [seed + k for k in range(runs)], workers or cores()):
        outcomes.append(found)
        if progress is not None:
            progress(len(outcomes), runs)
    expectations = tuple(_expectation(name, [found[k] for found in outcomes]) for k, name in enumerate(chosen))
    if not any(e.answered for e in expectations):
        reasons = ", ".join(sorted({reason for e in expectations for reason in e.refusals}))
        raise UnanswerableError(
            f"no method found an inertia in any of {runs} runs ({reasons}); plan another motion.", code="all-refused"
        )
    return Rehearsal(
        rig.name, runs, expectations, (*_notes(rig), *(f"with the fault {one}: {one.fault.words}." for one in drawn))
    )


@dataclass(frozen=True)
class Outcome:
    """The answer of one method in one run: relative error of the inertia, relative half-width of its 95 % interval.

    Both are NaN where the method refused, the half-width also where the uncertainty is unknown; then `reason` is the
    code of the refusal. warnings: codes.
    """

    error: float
    half_width: float
    reason: str = ""
    warnings: tuple[str, ...] = ()


def _runs(experiment: Experiment, seeds: list[int], workers: int) -> Iterator[tuple[Outcome, ...]]:
    """The runs in the order of their seeds; the first one here, so that kernels are compiled once."""
    yield run_once(experiment, seeds[0])
    if workers == 1:
        yield from (run_once(experiment, seed) for seed in seeds[1:])
        return
    yield from map_in_processes(min(workers, len(seeds)), partial(run_once, experiment), seeds[1:])


def run_once(experiment: Experiment, seed: int) -> tuple[Outcome, ...]:
    """Simulate with everything drawn by `seed`, write the log, read it as a lab would, and identify it."""
    log = experiment.log(seed)
    truth = log.metadata["truth"]
    assert isinstance(truth, dict)
    try:
        read = experiment.read(log)
    except (UnanswerableError, InputError) as error:
        return tuple(Outcome(np.nan, np.nan, error.code) for _ in experiment.methods)
    inertia = float(truth["inertia"])
    with one_momentum():
        return tuple(
            _outcome(read, experiment.stated, method, options, inertia) for _, method, options in experiment.methods
        )


def _outcome(log: Recording, rig: Rig, method: str, options: Mapping[str, object], truth: float) -> Outcome:
    try:
        result = identify(log, rig, method, **options)
    except (UnanswerableError, InputError) as error:
        return Outcome(np.nan, np.nan, error.code)
    inertia = result.inertia
    low, high = inertia.interval95 or (np.nan, np.nan)
    warnings = tuple(warning.code for warning in result.warnings)
    return Outcome(inertia.value / truth - 1, (high - low) / 2 / truth, warnings=warnings)


def _expectation(method: str, outcomes: Sequence[Outcome]) -> Expectation:
    return Expectation(
        method,
        np.array([o.error for o in outcomes]),
        np.array([o.half_width for o in outcomes]),
        dict(Counter(o.reason for o in outcomes if o.reason)),
        dict(Counter(code for o in outcomes for code in set(o.warnings))),
    )


def _notes(rig: Rig) -> Iterator[str]:
    if not rig.axis.friction.model_fields_set:
        yield "the rig states no axis.friction, so the twin swings without; state what you expect of the bearing."
    if exact := rig.constants_without_uncertainty():
        yield f"taken as exact, since rig.toml states no uncertainty: {', '.join(exact)}."


def _cells(e: Expectation, runs: int) -> tuple[str, ...]:
    answers = f"{e.answered} of {runs}"
    if not e.answered:
        return (e.method, "", "", "", "", "", answers)
    half_width, coverage = "unknown", ""
    if math.isfinite(e.half_width):
        half_width, coverage = f"± {percent(e.half_width)}", "{:.0f} ± {:.0f} %".format(*(100 * x for x in e.coverage))
    errors = (percent(e.rmse), percent(e.bias, sign=True), f"within {percent(e.p95)}")
    return (e.method, *errors, half_width, coverage, answers)
