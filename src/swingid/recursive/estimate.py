"""What is known after one more swing."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from swingid.balance.friction_laws import friction_units
from swingid.format import number
from swingid.preparation.scale import Scale
from swingid.recursive.blocks import Block
from swingid.recursive.solution import Solution
from swingid.result.result import BudgetEntry, Parameter, combined

SCATTER = "scatter of the swings and sensor noise"
PLAIN = ("gravity_torque", "coulomb", "viscous", "quadratic")
"""Unknowns that are reported beside the inertia; what depends on the direction is fitted too, and not reported."""


@dataclass(frozen=True)
class SwingEstimate:
    """What is known after swing number `swing` (from 1), whose turning point was at `time` (s).

    side: +1 upper, −1 lower. swing_inertia: of this swing alone, with the friction known so far taken off.
    parameters: of all swings so far: inertia, gravity_torque where it is sought, coulomb, viscous, quadratic; the
    standard uncertainty is None (unknown) for the first swings. budget: what it consists of. rows_skipped: rows left
    out so far; swings_lost: turning points without an estimate, for gaps, rests or a hand on the body.
    """

    swing: int
    time: float
    side: float
    swing_inertia: Parameter
    parameters: dict[str, Parameter]
    budget: tuple[BudgetEntry, ...]
    rows_skipped: int
    swings_lost: int

    @property
    def inertia(self) -> Parameter:
        """The inertia of all swings so far."""
        return self.parameters["inertia"]

    def __str__(self) -> str:
        spread = self.inertia.standard_uncertainty
        known = "" if spread is None else f" ± {number(spread, '', 2)}"
        return (
            f"swing {self.swing} at {self.time:.2f} s: {self.swing_inertia.value:.6g}, "
            f"so far {self.inertia.value:.6g}{known} {self.inertia.unit}"
        )


@dataclass
class Reporter:
    """From solutions to estimates; remembers how much single swings scatter."""

    scale: Scale
    swings: int = 0
    _squares: float = field(default=0.0)

    def estimate(self, block: Block, solution: Solution, skipped: int, lost: int) -> SwingEstimate:
        """The estimate after `block`."""
        units = friction_units(self.scale.linear)
        units |= {"inertia": self.scale.unit, "gravity_torque": self.scale.torque_unit}
        names = ["inertia", *(name for name in PLAIN if name in block.unknowns)]
        at = [block.unknowns.index(name) for name in names]
        budget = tuple(_budget(names, at, solution))
        values = {name: float(solution.values[k]) for name, k in zip(names, at, strict=True)}
        values["inertia"] -= self.scale.carried
        known = solution.covariance is not None
        parameters = {
            name: Parameter.of(value, combined(budget, name) if known else None, units[name])
            for name, value in values.items()
        }
        self.swings += 1
        alone = self._alone(block, solution)
        self._squares += (alone - values["inertia"]) ** 2
        spread = float(np.sqrt(self._squares / (self.swings - 1))) if known else None
        return SwingEstimate(
            swing=self.swings,
            time=block.time,
            side=block.side,
            swing_inertia=Parameter.of(alone, spread, self.scale.unit),
            parameters=parameters,
            budget=budget,
            rows_skipped=skipped,
            swings_lost=lost,
        )

    def skip(self) -> None:
        """Count a swing that has no estimate of its own."""
        self.swings += 1

    def _alone(self, block: Block, solution: Solution) -> float:
        """The inertia of one swing, with the friction of all swings taken off."""
        own = block.columns[:, 0]
        left = block.target - block.columns[:, 1:] @ solution.values[1:]
        return float(own @ left / (own @ own)) - self.scale.carried


def _budget(names: list[str], at: list[int], solution: Solution) -> list[BudgetEntry]:
    entries = []
    for name, k in zip(names, at, strict=True):
        if solution.covariance is not None:
            entries.append(BudgetEntry(SCATTER, "A", name, float(np.sqrt(max(solution.covariance[k, k], 0.0)))))
        for effect in solution.effects:
            shift = float(effect.shifts[k]) + (effect.direct * effect.std if name == "inertia" else 0.0)
            slope = shift / effect.std
            entries.append(BudgetEntry(effect.source, "B", name, abs(shift), slope, effect.shared_id))
    return entries
