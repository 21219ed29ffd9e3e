"""The friction that the balance leaves once inertia and gravity are known: as a curve, and as the best simple law.

On windows all over the motion the torque that remains is ∫φ F(v). With hat functions Λ_j on a grid of speeds,
F = Σ F_j Λ_j is the curve, and any law f is the column ``hats @ f(speeds)``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swingid.identify.friction_laws import DIRECTIONS, LAWS, STRIBECK_SHARES, law_columns, law_terms
from swingid.identify.momentum.balance import Rows, Signals
from swingid.identify.momentum.fits import LAG, columns_of, known_side
from swingid.identify.result import FrictionCurve
from swingid.identify.scale import Scale
from swingid.numerics.regression import fit_linear
from swingid.numerics.test_functions import project_hats

Array = NDArray[np.float64]
CURVE_KNOTS = 8
FINE_KNOTS = 24


@dataclass(frozen=True)
class FrictionLaw:
    """The chosen law: terms with their coefficients, covariance and influence of the rows, Stribeck speed, curve."""

    name: str
    terms: tuple[str, ...]
    values: Array
    covariance: Array
    influence: Array
    rows: Rows
    stribeck_speed: float
    curve: FrictionCurve

    def torque(self, speeds: Array) -> Array:
        """Friction torque of the law at `speeds`."""
        result: Array = law_columns(self.terms, speeds, self.stribeck_speed) @ self.values
        return result


def fit_friction(signals: Signals, rows: Rows, scale: Scale, memory: float) -> FrictionLaw:
    """Best law by the Bayesian information criterion, and the curve, beside an inertia of their own.

    The inertia (and an unknown gravity torque) is fitted again with every law, so that what these windows get wrong
    of it does not end in the friction. memory: strength of the impulse at each reversal, as found before.
    """
    fastest = float(np.quantile(np.abs(signals.speed), 0.999))
    speeds = _knots(fastest, FINE_KNOTS)
    windows = rows.windows
    hats = project_hats(signals.nodes, signals.speed, speeds, windows.centres, windows.half)
    target = known_side(rows, scale) - rows.friction["memory"] * memory
    _, body = columns_of(rows, scale, ())
    best, stribeck_speed, scores = _choose(body, hats, speeds, target)
    terms = law_terms(best)
    fit = fit_linear(np.column_stack([hats @ law_columns(terms, speeds, stribeck_speed), body]), target)
    own = slice(0, len(terms))
    law = FrictionLaw(
        best,
        terms,
        fit.values[own],
        fit.covariance(LAG)[own, own],
        fit.influence[own],
        rows,
        stribeck_speed,
        FrictionCurve(np.empty(0), np.empty(0), np.empty(0), best, np.empty(0)),
    )
    return replace(law, curve=_curve(body, hats, speeds, target, law, fastest, scores))


def _knots(fastest: float, count: int) -> Array:
    """Speeds on both sides of zero, denser near it, with a pair at ±0 so that the curve may jump there."""
    side = fastest * np.linspace(0, 1, count) ** 1.5
    side[0] = 1e-6 * fastest
    return np.concatenate([-side[::-1], side])


def _choose(body: Array, hats: Array, speeds: Array, target: Array) -> tuple[str, float, dict[str, float]]:
    """Name of the best law, its Stribeck speed, and the scores of all laws above the best.

    Every law's columns lie in the span of body and hats, so all laws are compared on one Gram matrix. The dependence
    on the direction is settled by the laws without Stribeck's peak, which does not touch it.
    """
    everything = np.column_stack([body, hats, target])
    gram = everything.T @ everything
    independent = len(target) / (LAG / 2)
    scores: dict[str, float] = {}
    stribeck_speeds: dict[str, float] = {}

    def attempt(name: str) -> None:
        terms = law_terms(name)
        trials = speeds[-1] * STRIBECK_SHARES if "stribeck" in terms else np.ones(1)
        fits = [_lost(gram, body.shape[1], law_columns(terms, speeds, trial)) for trial in trials]
        k = int(np.argmin([lost for lost, _, _ in fits]))
        lost, values, inverse = fits[k]
        if name == "viscous" or _dissipates(terms, values, inverse * lost / independent):
            count = len(terms) + ("stribeck" in terms)
            scores[name] = float(independent * np.log(lost) + count * np.log(independent))
            stribeck_speeds[name] = float(trials[k])

    peaked = [odd for odd, terms in LAWS.items() if "stribeck" in terms]
    for odd in (odd for odd in LAWS if odd not in peaked):
        for direction in DIRECTIONS:
            attempt(odd + direction)
    plain = min(scores, key=lambda name: scores[name])
    for odd in peaked:
        attempt(odd + "".join(plain.partition(",")[1:]))
    best = min(scores, key=lambda name: scores[name])
    return best, stribeck_speeds[best], {name: score - scores[best] for name, score in scores.items()}


def _lost(gram: Array, body: int, columns: Array) -> tuple[float, Array, Array]:
    """Sum of squared residuals of a law, its coefficients, and the block of the inverse that scales their covariance.

    gram: of [body | hats | target]; columns: the law's terms at the hats' knots.
    """
    terms = columns.shape[1]
    blend = np.zeros((len(gram) - 1, body + terms))
    blend[:body, terms:] = np.eye(body)
    blend[body:, :terms] = columns
    inner = blend.T @ gram[:-1, :-1] @ blend
    right = blend.T @ gram[:-1, -1]
    scale = 1 / np.sqrt(np.maximum(np.diag(inner), 1e-300))
    scales = np.outer(scale, scale)
    inverse = np.linalg.inv(inner * scales + 1e-13 * np.eye(len(inner))) * scales
    values = inverse @ right
    # what is left of the target cannot be told below the rounding of its own square
    lost = max(float(gram[-1, -1] - values @ right), 1e-15 * float(gram[-1, -1]), 1e-300)
    return lost, values[:terms], inverse[:terms, :terms]


def _dissipates(terms: tuple[str, ...], values: Array, covariance: Array) -> bool:
    """Whether no coefficient, in either direction, is negative beyond two standard uncertainties."""
    unit = {term: np.eye(len(terms))[k] for k, term in enumerate(terms)}
    sides = [unit[term] for term in terms if term not in ("offset", "viscous_even")]
    if "viscous_even" in unit:
        viscous, even = unit.get("viscous", np.zeros(len(terms))), unit["viscous_even"]
        sides += [viscous + even, viscous - even]
    if "offset" in unit and "coulomb" in unit:
        sides += [unit["coulomb"] + unit["offset"], unit["coulomb"] - unit["offset"]]
    rows = np.array(sides)
    spread = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", rows, covariance, rows), 0.0))
    return bool(np.all(rows @ values > -2 * spread))


def _curve(
    body: Array, hats: Array, speeds: Array, target: Array, law: FrictionLaw, fastest: float, scores: dict[str, float]
) -> FrictionCurve:
    """The law plus what the rows show beyond it, as a sum of hat functions on a coarse grid of speeds.

    Hats alone are ill-conditioned where the motion passes quickly. The deviations at the nodes have a normal prior
    whose width is the likeliest one for these rows (empirical Bayes), so the curve is the law where the rows
    say nothing, and leaves it where they do. Type A uncertainties.
    """
    coarse = _knots(fastest, CURVE_KNOTS)
    blend = np.array([np.interp(speeds, coarse, unit) for unit in np.eye(len(coarse))]).T
    fitted = np.column_stack([hats @ law_columns(law.terms, speeds, law.stribeck_speed), body])
    basis, _ = np.linalg.qr(fitted)
    # what the law and the inertia can take up is not the curve's to explain
    left = target - basis @ (basis.T @ target)
    columns = hats @ blend
    columns = columns - basis @ (basis.T @ columns)
    noise = LAG / 2 * float(left @ left) / len(left)
    eigen, vectors = np.linalg.eigh(columns.T @ columns)
    eigen = np.maximum(eigen, 0.0)
    projected = vectors.T @ (columns.T @ left)
    width = _likeliest_width(eigen, projected, noise)
    shrunk = width / (noise + width * eigen) if noise > 0 else np.zeros_like(eigen)
    deviation = vectors @ (shrunk * projected)
    spread = (vectors**2) @ (shrunk * noise)
    of_law = law_columns(law.terms, coarse, law.stribeck_speed)
    variance = np.einsum("ij,jk,ik->i", of_law, law.covariance, of_law) + spread
    torques = law.torque(coarse)
    # at rest there is no speed to tell friction by; the pair at ±0 only lets the curve jump
    moving = np.abs(coarse) > 1e-3 * fastest
    uncertainties = np.sqrt(np.maximum(variance, 0.0))[moving]
    return FrictionCurve(
        coarse[moving], (torques + deviation)[moving], uncertainties, law.name, torques[moving], scores
    )


def _likeliest_width(eigen: Array, projected: Array, noise: float) -> float:
    """Prior variance of the deviations that makes the rows likeliest, by search over a grid (0 among its values)."""
    if noise <= 0:
        return 0.0
    trials = noise / max(float(eigen.max()), 1e-300) * np.geomspace(1e-2, 1e6, 33)
    terms = noise + trials[:, None] * eigen
    evidence = (trials[:, None] * projected**2 / (noise * terms) - np.log(terms / noise)).sum(axis=1)
    best = int(np.argmax(evidence))
    return float(trials[best]) if evidence[best] > 0 else 0.0
