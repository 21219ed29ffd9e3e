"""A method of one's own in one file: least squares on windows that allows for noise in the regressor of the inertia.

    python examples/own_method.py

The momentum balance a11 ∫φ'' q1 + … = y has noise in its regressor ∫φ'' q1, which attenuates a11 (errors in variables).
`momentum` avoids it by longer windows and books the rest. Here the noise, known from the log, is subtracted from the
normal equations (bias-compensated least squares; Söderström 2007, Automatica 43, 939): θ = (XᵀX − S)⁻¹ Xᵀ y, for
windows of half the length. Rows, terms, declared errors, budget, hypotheses, report: those of swingid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

import swingid as sw
from swingid.balance.covariance import column_noise, covariance_of
from swingid.balance.errors import errors_of, sensitivities
from swingid.balance.fits import WindowFit, columns_of, fit_rows
from swingid.balance.friction_laws import parameters_of
from swingid.balance.perturbations import propagated
from swingid.balance.rows import rows_of
from swingid.balance.systematics import grid_spread
from swingid.balance.windows import law_windows
from swingid.checks.momentum import MomentumCheck
from swingid.checks.stated import CONFLICT
from swingid.errors import UnanswerableError
from swingid.methods.table import METHODS, Method
from swingid.numerics.regression import LinearFit
from swingid.preparation.prepared import Prepared
from swingid.result.result import Details, Result
from swingid.uncertainty.budget import Evaluated, Scatter, evaluate, systematic

NAME = "compensated"
SHORTER = 0.5
"""Length of the windows as a share of those of momentum: twice as many rows, 2√2 as much noise in each."""


def compensated_fit(fit: WindowFit) -> WindowFit:
    """The fit θ = K y, K = (XᵀX − S)⁻¹ Xᵀ; S: power of the noise in the regressor of a11, 0 elsewhere.

    Raises UnanswerableError where the noise is all that the regressor has.
    """
    unknowns, columns = columns_of(fit.rows, fit.equation, fit.friction)
    scale = np.linalg.norm(columns, axis=0)
    noise = np.zeros((len(unknowns), len(unknowns)))
    noise[0, 0] = column_noise(fit.rows.windows, fit.noise)
    normal = (columns.T @ columns - noise) / np.outer(scale, scale)
    powers = np.linalg.eigvalsh(normal)
    if powers[0] <= 1e-12 * powers[-1]:
        raise UnanswerableError("the windows contain no more than noise; record larger swings.", code="too-noisy")
    influence = np.linalg.solve(normal, (columns / scale).T) / scale[:, None]
    values = influence @ fit.known
    solved = LinearFit(values, fit.known - columns @ values, influence, float(np.sqrt(powers[-1] / powers[0])))
    covariance, computed = covariance_of(solved, fit.rows, unknowns, fit.equation, fit.noise)
    return replace(fit, fit=solved, covariance=covariance, computed=float(computed), declared=())


def compensated(check: MomentumCheck) -> Result:
    """Inertia and sought coefficients by bias-compensated least squares on windows."""
    prepared, part, choice, moved = check.balanced
    law, signals, rig = choice.law, choice.signals, prepared.rig
    suited = signals.suited(SHORTER * law.half)
    plain = fit_rows(rows_of(suited, law_windows(suited, SHORTER * law.half)), law.equation, law.noise, law.friction)
    if plain is None:
        raise UnanswerableError("the log is too short for the unknowns; record a longer one.", code="too-short")
    fit = compensated_fit(plain)
    common = {"place of the encoder's grid": grid_spread(fit, suited), CONFLICT: check.conflict}
    evaluated = _evaluated(fit, prepared, errors_of(fit.rows, suited, rig, fit.equation, fit.coefficients), common)
    evaluated, differs = check.compared(evaluated, "the power of the noise")
    checked = check.tested(check.alone(evaluated)) + differs + moved.checked
    details = Details(
        start=part.start, stop=part.stop, window=fit.half, friction=choice.friction.curve,
        turning_times=signals.motion.turning_times, turning_angles=signals.motion.turning_angles,
        residual_times=fit.rows.windows.centres, residuals=fit.fit.residuals / (fit.rows.windows.half * 32 / 35),
    )  # fmt: skip
    return prepared.result(NAME, check.widened(evaluated), part, checked, details, corrections=moved.corrections)


def _evaluated(fit: WindowFit, prepared: Prepared, errors: list, common: dict[str, float]) -> Evaluated:
    """Inertia and sought coefficients with their budget: scatter, what it lacks, what the rig file states."""
    values, weights = parameters_of(fit, ())
    of_unknowns = np.array(list(weights.values()))
    declared = propagated(errors, fit.fit.influence, of_unknowns)
    covariance = of_unknowns @ fit.covariance @ of_unknowns.T
    scatter = Scatter("scatter of the windows", covariance, np.full(len(values), fit.freedom))
    beyond = [(systematic(source), "inertia", spread) for source, spread in common.items()]
    evaluated = evaluate(values, scatter, beyond, declared, relative=prepared.rig.axis.model_uncertainty)
    return replace(evaluated, sensitivities=sensitivities(fit.rows, fit.equation, fit.fit.influence[0]))


def _load() -> Callable[..., Result]:
    return compensated


METHODS[NAME] = Method(NAME, _load, motor="unused", friction="any", speeds="none")


def main() -> None:
    """A noisy log of the twin by momentum and by this method."""
    paper = sw.Rig.load("paper")
    noisy = paper.changed({"sensors.noise": "0.5 mrad"})
    log = sw.simulate(noisy, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=25)
    for method in ("momentum", NAME):
        result = sw.identify(log, noisy, method)
        print(result.summary(), end="\n\n")


if __name__ == "__main__":
    main()
