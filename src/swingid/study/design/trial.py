"""One run of a proposal on the twin: whether the controller holds it within the limits, and what the method says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.control.compensator import Compensator
from swingid.control.references import parse_reference
from swingid.errors import SwingidError
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.simulation import simulate

if TYPE_CHECKING:
    from swingid.study.design.candidates import Limits
    from swingid.study.design.proposal import Proposal

OVER = 1.15
"""How far beyond the asked angle and speed the controlled motion may swing."""

SATURATED = 0.02
"""Share of the rows at the voltage limit above which the controller does not hold the motion."""

CLAIM = 1.5
"""Largest uncertainty that the method may claim, in units of the one wanted."""


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
        """Whether the twin agrees with the plan."""
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
    given = expected.changed({"axis.inertia": None, "axis.friction": None})
    start = relative = error = None
    why = ""
    try:
        result = identify(log, given)
        relative = (result.inertia.standard_uncertainty or 0.0) / truth
        error = result.inertia.value / truth - 1
        start = None if result.details is None else result.details.start
        if result.warnings:
            why = f"the method warns: {result.warnings[0].code}"
        elif relative > CLAIM * wanted:
            why = f"the method claims {100 * relative:.2g} %"
    except SwingidError as refused:
        why = f"the method refuses: {refused.code}"
    if angle > OVER * limits.angle:
        why = f"the axis swings to {angle:.3g}"
    elif saturated > SATURATED:
        why = f"the voltage is at its limit {100 * saturated:.0f} % of the time"
    return Trial(start, angle, voltage, saturated, relative, error, why)
