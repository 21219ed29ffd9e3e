"""Initial values of the search, and the choice of the friction law.

Initial values are those of the linear fit of equation (I) on modulating functions over the first swings. Other starts,
far from it, are tried on a few segments, so that a better minimum elsewhere is found.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from swingid.balance.friction_laws import EXACT, SIDES, law_terms, parameter_weights
from swingid.balance.law_choice import CANDIDATES, LawChoice
from swingid.methods.output_error.along import read_along
from swingid.methods.output_error.constants import constant_value, free_key
from swingid.methods.output_error.problem import Problem, as_read
from swingid.methods.output_error.setup import Setup
from swingid.methods.output_error.unknowns import FRICTION, Unknowns, entries_of
from swingid.model.parameters import PLACES, SIZE
from swingid.model.terms import power_of
from swingid.numerics.arrays import Array
from swingid.numerics.gauss_newton import SAME, fit_at, solve, solve_near
from swingid.numerics.shooting import Fit, Reduced
from swingid.uncertainty.significance import akaike, bayesian, misfit

OFF = ((1.6, 3.0), (0.6, 0.3))
"""Factors of inertia and friction of the other starts."""

FEW = 2
"""Segments on which several starts are tried."""

ROUGH, NEAR = 1e-3, 1e-4
"""Termination (see `solve`) of the search from several starts, and of the first fit of all segments."""

STRAIGHT = 0.02
"""Square of a change of the angles over the motion, in standard deviations of the mean of all readings, up to which the
change is linear in the unknowns."""

HEAD, HEAD_KNOTS = 0.1, 40
"""Share of a segment, and fewest knots, from which its initial values are estimated first."""

RICHEST = "coulomb + viscous + quadratic, direction-dependent"
"""The law about whose motion all laws are compared, to first order."""

PEAKS = (0.01, 0.025, 0.06, 0.13, 0.3)
"""Stribeck speeds tried, in shares of the highest speed."""


DISTINCT = tuple(name for name in CANDIDATES if "viscous" in law_terms(name) or "viscous_even" not in law_terms(name))
"""The laws tried: viscous friction by direction is the same law as that with a viscous term."""

PLACES_OF_TERMS = FRICTION | {"viscous_even": tuple(zip(PLACES["viscous"], SIDES.values(), strict=True))}
"""Places of the terms of EXACT."""

BELOW = 2.0
"""Standard uncertainties below zero from which on a coefficient is significantly negative."""


@dataclass(frozen=True)
class Searched:
    """The fit of a problem, and how it was found.

    starts, agreeing: starts of the search, and how many ended at this inertia. candidates: laws tried with their BIC
    above the best. law: the friction law. near: see `search`. spread: standard deviation of the inertia over these laws
    by their likelihoods; 0 where one law is given. drift: change of the inertia since segments of twice the length,
    where these were shortened.
    """

    problem: Problem
    unknowns: Unknowns
    fit: Fit
    starts: int = 1
    agreeing: int = 1
    candidates: dict[str, float] = field(default_factory=dict)
    law: str = ""
    near: bool = False
    spread: float = 0.0
    drift: float = 0.0


def first_values(setup: Setup, unknowns: Unknowns) -> Array:
    """Initial values: of the linear fit, of the rig for free constants; friction is at least a little above 0."""
    windows, equation, fastest = setup.windows, setup.equation, setup.fastest
    known = {name: windows.value(name) for name in ("coulomb", "viscous", "quadratic")}
    torque = max(abs(known["coulomb"]) + abs(known["viscous"]) * fastest, 1e-6 * windows.a11 * fastest)
    for name, even in (("coulomb", "offset"), ("viscous", "viscous_even")):
        known[f"{name}_positive"] = known[name] + windows.value(even)
        known[f"{name}_negative"] = known[name] - windows.value(even)
    values = []
    for item in unknowns.items:
        if item.name == "gravity_torque" and equation.seeks("gravity_torque"):
            value = max(windows.value("gravity_torque"), 1e-3 * windows.a11)
        elif item.name == "inertia":
            value = windows.a11 - equation.carried if windows.a11 > equation.carried else 0.1 * abs(windows.a11)
        elif item.name == "stribeck_speed":
            value = PEAKS[2] * fastest
        elif item.name == "offset":
            value = windows.value("offset")
        elif not item.is_sought:
            value = 0.0
        elif item.name in equation.sought:
            value = windows.value(item.name) if np.isinf(item.low) else max(windows.value(item.name), 0.0)
        elif item.name in FRICTION:
            value = max(known.get(item.name, 0.0), 0.03 * (torque / fastest ** power_of(item.name)))
        else:
            value = constant_value(setup.rig, free_key(item.name))[0]
        values.append(value)
    return np.array(values)


def best_start(problem: Problem, unknowns: Unknowns, values: Array, loss: str, starts: int) -> tuple[Array, int]:
    """Values (m,) to fit all segments from, and how many starts ended there: the best of several, on a few segments.

    The starts are `values` and `starts` − 1 off it.
    """
    if starts == 1:
        return values, 1
    chosen = list(np.unique(np.linspace(0, len(problem.bounds) - 2, FEW).astype(int)))
    some = problem.part(chosen).shooting(unknowns, loss)
    tried = [solve(some, values, some.starts, ROUGH)]
    for k in range(starts - 1):
        inertia, friction = OFF[k % len(OFF)]
        power = 1 + k // len(OFF)
        factors = [
            inertia**power if name == "inertia" else friction**power if name in FRICTION else 1.0
            for name in unknowns.names
        ]
        tried.append(solve(some, values * factors, some.starts, ROUGH, known=tried[0]))
    best = min(tried, key=lambda fit: fit.cost)
    spread = SAME * abs(best.values[0])
    agreeing = sum(abs(fit.values[0] - best.values[0]) < spread for fit in tried)
    return best.values if np.isfinite(best.cost) else values, agreeing


def search(problem: Problem, unknowns: Unknowns, values: Array, loss: str, *, near: bool = False) -> Searched:
    """Rough fit of all segments.

    near: first steps as from values that are nearly the best: where the model explains the log, that takes fewer.
    """
    shooting = problem.shooting(unknowns, loss)
    if near:
        values = np.clip(values, *unknowns.bounds)
        here = fit_at(shooting, values, first_states(problem, unknowns, values, loss))
        motion = float(np.std(problem.measured[~problem.wheel] / problem.sigma[~problem.wheel]))
        fit = solve_near(here, NEAR, STRAIGHT * motion / np.sqrt(len(here.residuals)))
    else:
        fit = solve(shooting, values, problem.starts, NEAR)
    return Searched(problem, unknowns, fit, near=near)


def first_states(problem: Problem, unknowns: Unknowns, values: Array, loss: str) -> Array:
    """Initial values of the segments (k, s) by one step of least squares on the first rows of each, at these values.

    Local cubics alone leave errors of the speeds that grow over a whole segment.
    """
    longest = int(np.max(np.diff(problem.bounds)))
    most = max(int(HEAD * longest), HEAD_KNOTS)
    if most > longest // 2:
        return problem.starts
    heads = problem.part(list(range(len(problem.starts))), most)
    fit = fit_at(heads.shooting(unknowns, loss), values, heads.starts)
    if not np.isfinite(fit.cost):
        return problem.starts
    states = problem.starts + fit.reduced.states(np.zeros(len(values)))
    return states if np.isfinite(states).all() else problem.starts


@dataclass(frozen=True)
class Choice:
    """A friction law, values of the unknowns and states (k, s) with it, all laws' criteria above its, their spread.

    size: number of the law's unknowns. predicted: its criterion to first order, above the misfit of the motion about
    which it is.
    """

    law: str
    values: dict[str, float]
    states: Array
    candidates: dict[str, float]
    spread: float
    size: int
    predicted: float

    @property
    def following(self) -> float:
        """The criterion to first order of the law that is the next best; infinite without another."""
        return self.predicted + min(
            (score for name, score in self.candidates.items() if name != self.law), default=np.inf
        )


def choose_law(rough: Searched, independent: float, fastest: float, names: tuple[str, ...]) -> Choice:
    """Choose the friction law of least Bayesian information criterion among `names`; of one name only its values.

    rough: the fit of `RICHEST`. Every law is compared about the motion of that fit, to first order, so that only
    the best one is fitted again. independent: effective number of independent readings. The spread is that of the
    inertia over all laws with Akaike's weights (Burnham and Anderson 2002, 4.3), which do not favour the smaller laws:
    what their variances are above that of the best law, and their distances from it.
    """
    unknowns, fit = rough.unknowns, rough.fit
    at = dict(zip(unknowns.names, fit.values, strict=True))
    body = [k for k, name in enumerate(unknowns.names) if name not in FRICTION]
    peaks = fastest * np.array(PEAKS)
    origin = np.concatenate([fit.values[body], _terms(at), np.zeros(len(peaks))])
    reduced, gram = _products(rough, body, peaks)
    choice = LawChoice(gram, len(body), independent, names, names[0], peaks=peaks, origin=origin, level=BELOW)
    best, weights, trials = choice.best, choice.weights(akaike), choice.trials
    squares = [(trial.values[0] - best.values[0]) ** 2 + trial.variance - best.variance for trial in trials.values()]
    spread = float(np.sqrt(max(np.array([weights[name] for name in trials]) @ np.array(squares), 0.0)))
    law = best.law
    values = {unknowns.names[k]: float(value) for k, value in zip(body, best.values[: len(body)], strict=True)}
    values |= dict(zip(law.unknowns, law.values.tolist(), strict=True))
    values |= {name: float(row @ law.coefficients) for name, row in parameter_weights(law.terms).items()}
    if len(names) == 1:
        spread, scores = 0.0, {}
    else:
        scores = dict(sorted(choice.scores().items(), key=lambda item: item[1]))
    states = fit.states + reduced.states(np.append(best.values - origin, 0.0))
    size, power = len(law.unknowns), float(gram[-1, -1])
    predicted = bayesian(best.lost, size, independent) - misfit(power, independent)
    return Choice(law.name, values, states, scores, spread, size, predicted)


def _terms(at: dict[str, float]) -> Array:
    """Coefficients of the terms of EXACT where those of `RICHEST`, by direction, have these values."""
    values = {"quadratic": at["quadratic"]}
    for name, even in (("coulomb", "offset"), ("viscous", "viscous_even")):
        up, down = at[f"{name}_positive"], at[f"{name}_negative"]
        values |= {name: (up + down) / 2, even: (up - down) / 2}
    return np.array([values.get(term, 0.0) for term in EXACT])


def _products(rough: Searched, body: list[int], peaks: Array) -> tuple[Reduced, Array]:
    """The Gram matrix of the unknowns `body`, the terms of EXACT, Stribeck's peaks of these speeds, and the residuals.

    The peaks have one motion, as their height is 0 in it. Also what gives the step of the initial values.
    """
    problem, unknowns, fit = rough.problem, rough.unknowns, rough.fit
    places = [*(unknowns.items[k].places for k in body), *(PLACES_OF_TERMS[name] for name in EXACT)]
    # a column for each peak, whose height the motion does not have, and one for the residuals
    places += [*(((SIZE + k, 1.0),) for k in range(len(peaks))), ()]
    p, entries = unknowns.vector(fit.values), entries_of(places, problem.states)
    extended = problem.predict(p, entries, fit.states, len(places), fit.prediction, peaks).slopes
    read = as_read(read_along(fit.prediction.steps, problem.measured), problem, unknowns.names, fit.values)
    for k, column in read.of_sensors.items():
        extended[:, problem.states + body.index(k)] = column
    extended[:, -1] = problem.sigma * fit.residuals
    reduced = fit.shooting.reduced(fit.shooting.grams(extended, fit.residuals, fit.weights))
    # the prior of each, as one more residual
    prior = np.zeros((len(body), len(reduced.matrix)))
    prior[:, : len(body)], prior[:, -1] = np.eye(len(body)), -fit.values[body]
    return reduced, reduced.matrix + (prior.T * unknowns.power[body]) @ prior
