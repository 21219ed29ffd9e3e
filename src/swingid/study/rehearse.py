"""Errors and intervals to expect of each method, from many runs of the planned experiment on the twin of the rig."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from swingid.errors import InputError, UnanswerableError, UsageError, require_rig
from swingid.format import percent
from swingid.methods.table import METHODS, method_of
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.processes import map_in_processes
from swingid.study.experiment import Experiment, without_truth
from swingid.study.faults import parse_fault, with_faults
from swingid.study.output import Study, counted, noted
from swingid.study.trials import Expectation, Head, Row, columns_of, rows_of
from swingid.table import Table, plain

if TYPE_CHECKING:
    from swingid.control.backstepping import Backstepping
    from swingid.control.compensator import Compensator

SCHEMA = "swingid.rehearse/1"

FEWEST_RUNS = 5

NO_OPTIONS: Mapping[str, object] = {}

HEADINGS = plain("method", "RMSE", "bias", "95 % of errors", "95 % interval", "covers", "answers")


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
        table = Table(HEADINGS, tuple(_cells(e, self.runs) for e in self.expectations))
        lines = [f"[[{self.runs} runs of the twin of {self.rig}: relative error of the inertia to expect]]"]
        lines += [*table.lines(), ""]
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
    are drawn.

    Parameters
    ----------
    rig : Rig
        Must state axis.inertia; friction as in axis.friction.
    reference, controller, duration, rate, initial_angle
        The experiment, as of `simulate`.
    runs, seed, workers : int
        Run k draws by `seed` + k, so the answer is the same for any number of processes (by default one per core).
    methods : names, or options by name
        All of them by default.
    faults : texts
        What the rig, its file or its log has and nobody knows, as "clock: 200 ppm" (`study.faults`).
    progress : function
        Called with (done, runs) after each run.

    Raises
    ------
    InputError
        A rig without axis.inertia.
    UsageError
        Too few runs.
    UnanswerableError
        No method answers in any run.
    """
    require_rig(rig)
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
    tables: list[list[Row]] = []
    for rows in map_in_processes(partial(run_once, experiment), [seed + k for k in range(runs)], workers):
        tables.append(rows)
        if progress is not None:
            progress(len(tables), runs)
    expectations = tuple(
        Expectation.of(name, columns_of([rows[k] for rows in tables])) for k, name in enumerate(chosen)
    )
    if not any(e.answered for e in expectations):
        reasons = ", ".join(sorted({reason for e in expectations for reason in e.refusals}))
        raise UnanswerableError(
            f"no method found an inertia in any of {runs} runs ({reasons}); plan another motion.", code="all-refused"
        )
    return Rehearsal(
        rig.name,
        runs,
        expectations,
        (*_notes(rig), *(f"with the fault {fault}: {fault.fault.words}." for fault in drawn)),
    )


def run_once(experiment: Experiment, seed: int) -> list[Row]:
    """Simulate with everything drawn by `seed`, write the log, read it as a lab would, and identify it."""
    return rows_of(Head(), experiment, experiment.log(seed), caught=(UnanswerableError, InputError))


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
