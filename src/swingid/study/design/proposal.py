"""The result of a design: proposed motions with their predictions, one run of the chosen one on the twin, the text."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.control.compensator import Compensator
from swingid.control.references import parse_reference
from swingid.errors import SwingidError
from swingid.format import interval, number, percent, plus_minus
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.result.summary import folded, sorted_budget
from swingid.simulation import simulate
from swingid.study.design.information import Prediction
from swingid.study.experiment import without_truth
from swingid.study.output import Study, json_text, noted
from swingid.table import Table, plain

if TYPE_CHECKING:
    from swingid.study.design.motions import Limits

SCHEMA = "swingid.design/1"

HEADINGS = plain("motion", "time", "inertia", "sensors", "constants", "voltage", "wheel")

MOST = 6

OVER = 1.15
"""How far beyond the planned angle and speed the controlled motion may swing."""

SATURATED = 0.02
"""Share of the rows at the voltage limit above which the controller does not hold the motion."""

CLAIM = 1.5
"""Largest uncertainty that the method may state, in units of the required one."""


@dataclass(frozen=True)
class Proposal:
    """A motion with what is predicted of it.

    duration (s) contains `settling`; delta0 (rad): the error that the compensator may keep (18); peaks: SI, by name.
    """

    reference: str
    duration: float
    settling: float
    rate: float
    delta0: float
    peaks: dict[str, float]
    prediction: Prediction

    @property
    def relative(self) -> float:
        """Predicted standard uncertainty of the inertia as a share of it."""
        return self.prediction.relative

    def to_dict(self) -> dict[str, object]:
        """Plain data."""
        named = ("reference", "duration", "settling", "rate", "delta0", "peaks")
        return {name: getattr(self, name) for name in named} | {
            "relative_uncertainty": self.relative,
            "parameters": self.prediction.parameters,
            "budget": self.prediction.budget,
            "condition": self.prediction.seen.condition,
            "inflation": self.prediction.seen.inflation,
        }


@dataclass(frozen=True)
class Design(Study):
    """The proposal that reaches the wanted relative standard uncertainty, those beside it, and one run on the twin."""

    rig: str
    rig_source: str
    wanted: float
    proposal: Proposal
    others: tuple[Proposal, ...]
    trial: Trial | None
    notes: tuple[str, ...]

    @property
    def command(self) -> str:
        """The command that makes the log of the proposal on the twin."""
        source = self.rig_source.removeprefix("built-in ")
        p = self.proposal
        return (
            f"swingid simulate --rig {shlex.quote(source)} --reference {shlex.quote(p.reference)} "
            f"--duration {p.duration:g} --rate {p.rate:g} --delta0 {p.delta0:g} --out run.parquet"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain data, schema "swingid.design/1"."""
        return {
            "schema": SCHEMA,
            "status": "ok",
            "rig": self.rig,
            "rig_source": self.rig_source,
            "wanted": self.wanted,
            "proposal": self.proposal.to_dict(),
            "command": self.command,
            "others": [other.to_dict() for other in self.others],
            "trial": self.trial,
            "notes": self.notes,
            "error": None,
        }

    def summary(self) -> str:
        """The proposals as a table for a terminal, then the first with interval, budget, trial and command."""
        p = self.proposal
        inertia = p.prediction.parameters["inertia"]
        table = Table(HEADINGS, tuple(_cells(candidate) for candidate in (p, *self.others)))
        lines = [f"[[Motions of {self.rig} for an inertia to {percent(self.wanted)}, predicted for momentum]]"]
        lines += table.lines()
        lines += ["[[Proposal]]", f"    {p.reference}"]
        lines.append(f"    {p.duration:g} s at {p.rate:g} rows per second, of which the first {p.settling:g} s settle")
        for name, parameter in p.prediction.parameters.items():
            text = plus_minus(parameter.value, parameter.standard_uncertainty, parameter.unit)
            if parameter.interval95 is not None:
                text += f"  95 %: {interval(parameter.interval95, middle=parameter.value)}"
            lines.append(f"    {name}: {text}")
        shown, rest = folded(sorted_budget(p.prediction.budget, "inertia"), MOST)
        lines += [f"    {e.type}  {e.source}  {percent(e.standard_uncertainty / inertia.value)}" for e in shown]
        lines += [f"       {len(rest)} smaller ones"] if rest else []
        seen = p.prediction.seen
        condition = f"rank {seen.rank} of {len(seen.names)}, condition {number(seen.condition, digits=2)}"
        values = {name: q.value for name, q in p.prediction.parameters.items()}
        lines.append(f"    {condition}; {seen.combination(values)}")
        trial = self.trial
        if trial is not None and trial.relative is not None and trial.error is not None:
            lines.append("[[One run on the twin]]")
            text = f"error {percent(trial.error, sign=True)}, the method states ± {percent(trial.relative)}"
            volts = "" if trial.voltage is None else f", {trial.voltage:.3g} V"
            lines.append(f"    {text}; largest angle {trial.angle:.3g}{volts}")
        lines += ["[[Command]]", f"    {self.command}"]
        lines += noted(self.notes)
        return "\n".join(lines)


def refused(rig: Rig, error: SwingidError) -> str:
    """The JSON text of a refused design, with the reason."""
    reason = {"code": error.code, "message": error.message}
    data = {"schema": SCHEMA, "status": "refused", "rig": rig.name, "rig_source": str(rig.source), "error": reason}
    return json_text(data)


@dataclass(frozen=True)
class Trial:
    """What one run showed: part used (s), largest angle and voltage after settling, share of rows at the limit.

    relative: standard uncertainty that the method gave, as a share; None where it refused. why: what failed, "" if
    nothing.
    """

    start: float | None
    angle: float
    voltage: float | None
    saturated: float
    relative: float | None
    error: float | None
    why: str

    @property
    def passed(self) -> bool:
        """Return whether the twin agrees with the plan."""
        return not self.why


def controller_of(rig: Rig, proposal: Proposal) -> Compensator:
    """The compensator that the proposal's command names: the gains of the paper's experiment, with its own delta0."""
    return replace(Compensator.paper(rig), delta0=proposal.delta0)


def try_on_twin(expected: Rig, proposal: Proposal, limits: Limits, wanted: float) -> Trial:
    """Simulate the proposal and identify the log."""
    assert expected.axis.inertia is not None
    truth = expected.axis.inertia.value
    motion, controller = parse_reference(proposal.reference), controller_of(expected, proposal)
    log = simulate(expected, motion, controller, duration=proposal.duration, rate=proposal.rate, seed=0)
    settled = log.segment(min(proposal.settling, log.duration / 2), float(log.time[-1]))
    angle = float(np.abs(settled.angle).max())
    voltage = None if settled.voltage is None else float(np.abs(settled.voltage).max())
    saturated = 0.0
    if settled.voltage is not None and limits.voltage is not None:
        saturated = float(np.mean(np.abs(settled.voltage) > 0.999 * limits.voltage))
    start = relative = error = None
    why = ""
    try:
        result = identify(log, without_truth(expected))
        relative = (result.inertia.standard_uncertainty or 0.0) / truth
        error = result.inertia.value / truth - 1
        start = None if result.details is None else result.details.start
        if result.warnings:
            why = f"the method warns: {result.warnings[0].code}"
        elif relative > CLAIM * wanted:
            why = f"the method states {100 * relative:.2g} %"
    except SwingidError as refused:
        why = f"the method refuses: {refused.code}"
    if angle > OVER * limits.angle:
        why = f"the axis swings to {angle:.3g}"
    elif saturated > SATURATED:
        why = f"the voltage is at its limit {100 * saturated:.0f} % of the time"
    return Trial(start, angle, voltage, saturated, relative, error, why)


def _cells(p: Proposal) -> tuple[str, ...]:
    peaks, prediction = p.peaks, p.prediction
    return (
        p.reference,
        f"{p.duration:g} s",
        f"± {percent(p.relative)}",
        percent(prediction.part("A")),
        percent(prediction.part("B")) if prediction.part("B") else "exact",
        f"{peaks['voltage']:.2g} V" if "voltage" in peaks else "",
        f"{peaks['wheel_speed']:.0f} rad/s" if "wheel_speed" in peaks else "",
    )
