"""Bound, from the log itself, of the error of the inertia by passes that are not exact mirror images.

The inertia is linear in the energies at the nodes, a11 = Σ K_n (W + …)(t_n), so friction F(q1') adds
E[F] = Σ K_n ∫^t_n F q1' dt to it. Between exact mirror images every F odd in speed drops out. With s = |q1'| and
F(s) = F(0+) + ∫F' ds,

    E[F] = F(0+) T(0) + ∫ F'(s) T(s) ds,      T(s) = Σ K_n ∫^t_n [|q1'| > s] |q1'| dt:

T, which depends on the measured motion only, is the asymmetry of the passes at speeds above s; friction enters by its
slope alone, as T(0) = 0 at equal angles. So |error| ≤ ∫ max|F'| |T| ds, with the 95 % limit of the slope of the fitted
friction. For what a method fits beside the inertia E = 0, so only the slope of the rest counts. The paper states that
the accuracy "can be estimated by analyzing the tracking error": this is that estimate.

Not for dynamic friction or stiction, which have no slope to bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.balance.friction_laws import TERMS
from swingid.format import percent
from swingid.methods.energy.balance import PassRows
from swingid.methods.energy.fit import PassFit, fit_passes
from swingid.model.equation import Equation
from swingid.numerics.arrays import Array
from swingid.numerics.quadrature import running_hats
from swingid.result.result import Message
from swingid.uncertainty.freedom import COVERAGE_FACTOR

SOURCE = "asymmetry of the passes"

SPEEDS = np.array([0.12, 0.25, 0.4, 0.6, 0.8, 1.0])
"""Knots of the friction profile, in shares of the highest speed; below the first no slope is identifiable."""

ODD = ("coulomb", "viscous", "quadratic")
"""Terms of friction that a fit has beside the inertia; (6) has none."""

EVEN = ("offset", "viscous_even")
"""Terms that depend on the direction: they cancel between upper and lower turning points, not mirror images."""


HATS = tuple(f"hat {k}" for k in range(len(SPEEDS)))
"""Names of the works of the hat functions on these knots."""


@dataclass(frozen=True)
class Profile:
    """Friction of the log: torques at rising speeds (knots,), the coefficients of `EVEN`, and their covariance.

    The covariance (knots + 2, knots + 2) is that of the torques, then of the coefficients. rows: that it was fitted to.
    """

    speeds: Array
    torques: Array
    even: Array
    covariance: Array
    rows: PassRows | None = None


@dataclass(frozen=True)
class Symmetry:
    """Bound of the error of a11 (kg m² or kg), and its parts.

    speeds (knots,): between which friction is a line. asymmetry (knots,): T(0), then T averaged from each speed to the
    next. steps (knots,): limit of friction at the first speed, then of its rise from each speed to the next, N m (N).
    mirror_error: root mean square of |q1'| on the way in less that on the way out at equal angles, over the speed's.
    """

    bound: float
    speeds: Array
    asymmetry: Array
    steps: Array
    mirror_error: float

    def entry(self) -> dict[tuple[str, str], float]:
        """Standard uncertainty of the inertia: that of an error anywhere within the bound (rectangular, GUM 4.3.7)."""
        return {("inertia", SOURCE): self.bound / np.sqrt(3.0)}

    def note(self, inertia: float) -> Message:
        """The bound in words."""
        text = (
            f"on the way in and out of the turning points the speeds differ by {percent(self.mirror_error)}; with the "
            f"slope of this log's friction that can change the inertia by {percent(self.bound / abs(inertia))} at most."
        )
        return Message("symmetry-bound", text)


def friction_profile(rows: PassRows, equation: Equation) -> Profile:
    """Friction from the energies at mirrored nodes, linear from speed to speed; fitted together with the inertia."""
    speeds = SPEEDS * np.max(np.abs(rows.speed))
    rows = _with_hats(rows, speeds)
    fit = fit_passes(rows, equation, (*HATS, *EVEN))
    first = len(fit.unknowns) - len(speeds) - len(EVEN)
    torques, even = np.split(fit.fit.values[first:], [len(speeds)])
    return Profile(speeds, torques, even, fit.covariance[first:, first:], rows)


def asymmetry_bound(fit: PassFit, profile: Profile) -> Symmetry:
    """Bound of the error of a fit by friction and the asymmetry of its passes."""
    rows, weights = profile.rows, fit.fit.influence[0]
    if rows is None or rows.instants is not fit.rows.instants:
        rows = _with_hats(fit.rows, profile.speeds)
    # a rise from one speed to the next acts on all the hats above it
    ramps = np.cumsum((np.array([rows[name] for name in HATS]) @ weights)[::-1])[::-1]
    knots = len(profile.speeds)
    rises = np.eye(knots) - np.eye(knots, k=-1)
    odd = sum(fit.value(name) * TERMS[name](profile.speeds) for name in ODD) if "coulomb" in fit.unknowns else 0.0
    steps = rises @ (profile.torques - odd)
    spread = np.sqrt(np.diag(rises @ profile.covariance[:knots, :knots] @ rises.T))
    limits = np.abs(steps) + COVERAGE_FACTOR * spread
    bound = float(np.sum(limits * np.abs(ramps)))
    if "offset" not in fit.unknowns:
        even = np.array([rows[name] @ weights for name in EVEN])
        spread = np.sqrt(np.diag(profile.covariance)[knots:])
        bound += float(np.sum((np.abs(profile.even) + COVERAGE_FACTOR * spread) * np.abs(even)))
    return Symmetry(bound, profile.speeds, ramps, limits, _mirror_error(rows))


def _with_hats(rows: PassRows, speeds: Array) -> PassRows:
    """The rows with ∫Λ_k(|q1'|) |q1'| dt up to each node beside the terms; the outermost hats continue constant."""
    size, nodes = np.abs(rows.course.speed), rows.course.nodes
    works = rows.at(lambda times: running_hats(nodes, size, size, speeds, times))
    return rows.beside(dict(zip(HATS, works, strict=True)))


def _mirror_error(rows: PassRows) -> float:
    """Difference of the speeds' sizes at mirrored nodes, as a share of the speed (both root mean square)."""
    size = np.abs(rows.blocks(rows.speed))
    nodes = size.shape[1] // 2
    before, after = size[:, :nodes], size[:, -nodes:][:, ::-1]
    return float(np.sqrt(np.mean((before - after) ** 2) / np.mean(size**2)))
