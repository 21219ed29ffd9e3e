"""What the result says of the adaptation: how it differs from the paper, what it assumed, whether it has converged."""

from __future__ import annotations

from swingid.control.observer import VelocityObserver
from swingid.methods.backstepping.adaptation import Gains
from swingid.methods.backstepping.curve import BANDS, Run
from swingid.methods.backstepping.signals import Widths
from swingid.result.result import Message, Parameter

FAR = 0.01
"""Relative way left to the end of the curve that is worth a warning."""


def told(run: Run, gains: Gains, widths: Widths | None, inertia: Parameter) -> tuple[list[Message], list[Message]]:
    """Warnings and notes."""
    notes = [
        Message(
            "differs-from-paper",
            "the adaptation follows the prediction error of a series-parallel model of the swing equation, not the "
            "tracking error of the paper's own controller, for that of another one says nothing about the inertia.",
        ),
        Message("velocities", _velocities(widths)),
        Message("friction-law", "the friction of the axis is taken to be viscous; the estimate leans on that."),
        Message("convergence", _convergence(run, gains)),
    ]
    settled = run.settled
    if settled.converged and (settled.drift is not None and settled.drift < FAR * abs(settled.mean)):
        return [], notes
    text = (
        "the estimate has not come to rest by the end of the log: record a longer or faster motion, or choose "
        "the other law, a higher gamma2 or an alpha2 nearer to b/J."
    )
    if inertia.standard_uncertainty is None:
        notes.append(Message("no-uncertainty-inertia", "where a curve that still moves will end cannot be told."))
        notes.append(Message("no-uncertainty-viscous", "where a curve that still moves will end cannot be told."))
    return [Message("not-converged", text)], notes


def _velocities(widths: Widths | None) -> str:
    if widths is None:
        gains = VelocityObserver()
        return (
            f"speeds by the observers (23) with the paper's gains (sigma = {gains.sigma:g} 1/s), causal; they are late "
            "by half a row, which moves the friction more than the inertia."
        )
    wheel = f", of the wheel over ±{1e3 * widths.wheel:.3g} ms" if widths.wheel else ""
    return (
        f"speeds by local cubics over ±{1e3 * widths.axis:.3g} ms of the angle{wheel}, which look ahead and so are not "
        'those of an online estimate; velocities="observers" are.'
    )


def _convergence(run: Run, gains: Gains) -> str:
    curve = run.inertia
    parts = []
    for name, band in BANDS.items():
        seconds = curve.convergence_time(band)
        parts.append(f"within {name} " + ("not by the end" if seconds is None else f"after {seconds:.3g} s"))
    begin, end = run.settled.span(curve.turning)
    return (
        f"law {gains.law}: {', '.join(parts)}, of the mean of its last quarter; the answer is the mean from "
        f"{begin:.4g} to {end:.4g} s."
    )
