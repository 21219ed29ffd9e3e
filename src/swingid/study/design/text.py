"""A design as text for a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from swingid.format import interval, number, percent, plus_minus
from swingid.result.summary import folded, sorted_budget
from swingid.study.terminal import aligned, noted

if TYPE_CHECKING:
    from swingid.study.design.proposal import Design, Proposal

HEADINGS = ("motion", "time", "inertia", "sensors", "constants", "voltage", "wheel")
MOST = 6


def tabulate(design: Design) -> str:
    """Candidates as a table, then the proposal with its interval and budget, the run on the twin, the command."""
    p = design.proposal
    inertia = p.prediction.parameters["inertia"]
    rows = [HEADINGS, *(_cells(candidate) for candidate in (p, *design.others))]
    lines = [f"[[Motions of {design.rig} for an inertia to {percent(design.wanted)}, predicted for momentum]]"]
    lines += aligned(rows)
    lines += ["[[Proposal]]", f"    {p.reference}"]
    lines.append(f"    {p.duration:g} s at {p.rate:g} rows per second, of which the first {p.settling:g} s settle")
    for name, parameter in p.prediction.parameters.items():
        text = plus_minus(parameter.value, parameter.standard_uncertainty, parameter.unit)
        span = (
            "" if parameter.interval95 is None else f"  95 %: {interval(parameter.interval95, middle=parameter.value)}"
        )
        lines.append(f"    {name}: {text}{span}")
    shown, rest = folded(sorted_budget(p.prediction.budget, "inertia"), MOST)
    lines += [f"    {e.type}  {e.source}  {percent(e.standard_uncertainty / inertia.value)}" for e in shown]
    lines += [f"       {len(rest)} smaller ones"] if rest else []
    seen = p.prediction.seen
    condition = f"rank {seen.rank} of {len(seen.names)}, condition {number(seen.condition, digits=2)}"
    values = {name: q.value for name, q in p.prediction.parameters.items()}
    lines.append(f"    {condition}; {seen.combination(values)}")
    trial = design.trial
    if trial is not None and trial.relative is not None and trial.error is not None:
        lines.append("[[One run on the twin]]")
        text = f"error {percent(trial.error, sign=True)}, the method says ± {percent(trial.relative)}"
        volts = "" if trial.voltage is None else f", {trial.voltage:.3g} V"
        lines.append(f"    {text}; largest angle {trial.angle:.3g}{volts}")
    lines += ["[[Command]]", f"    {design.command}"]
    lines += noted(design.notes)
    return "\n".join(lines)


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
