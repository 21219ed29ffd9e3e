"""Initial values of the search, and the choice of the friction law.

Initial values are those of the linear fit of equation (I) on modulating functions over the first swings. Other starts,
far from it, are tried on a few segments, so that a better minimum elsewhere is found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from swingid.balance.friction_laws import DIRECTIONS, LAWS, law_terms
from swingid.methods.output_error.constants import constant_value, free_key
from swingid.methods.output_error.problem import Problem, as_read
from swingid.methods.output_error.setup import Setup
from swingid.methods.output_error.unknowns import FRICTION, Unknowns, entries_of, friction_unknowns
from swingid.model.terms import power_of
from swingid.numerics.arrays import Array
from swingid.numerics.gauss_newton import SAME, fit_at, solve, solve_near
from swingid.numerics.shooting import Fit, Reduced

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

FRICTION_TERMS = (
    "coulomb",
    "viscous",
    "quadratic",
    "cubic",
    "stribeck",
    "offset",
    "coulomb_positive",
    "viscous_positive",
)
"""Friction terms of which the laws are made."""

PEAKS = (0.01, 0.025, 0.06, 0.13, 0.3)
"""Stribeck speeds tried, in shares of the highest speed."""


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
    windows, scale, fastest = setup.windows, setup.scale, setup.fastest
    known = {name: windows.value(name) for name in ("coulomb", "viscous", "quadratic")}
    torque = max(abs(known["coulomb"]) + abs(known["viscous"]) * fastest, 1e-6 * windows.a11 * fastest)
    for name, even in (("coulomb", "offset"), ("viscous", "viscous_even")):
        known[f"{name}_positive"] = known[name] + windows.value(even)
        known[f"{name}_negative"] = known[name] - windows.value(even)
    values = []
    for item in unknowns.items:
        if item.name == "gravity_torque" and scale.b is None:
            value = max(windows.value("gravity_torque"), 1e-3 * windows.a11)
        elif item.name == "inertia":
            value = windows.a11 - scale.carried if windows.a11 > scale.carried else 0.1 * abs(windows.a11)
        elif item.name == "stribeck_speed":
            value = PEAKS[2] * fastest
        elif item.name == "offset":
            value = windows.value("offset")
        elif not item.is_sought:
            value = 0.0
        elif item.name in scale.unknown:
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
    found = fit_at(heads.shooting(unknowns, loss), values, heads.starts)
    if not np.isfinite(found.cost):
        return problem.starts
    states = problem.starts + found.reduced.states(np.zeros(len(values)))
    return states if np.isfinite(states).all() else problem.starts


@dataclass(frozen=True)
class _Columns:
    """Gram matrix of every friction term beside inertia and other unknowns, and the residuals, about one motion.

    values (n,): the unknowns at which the columns were computed. states: step of the initial values (k, s) that belongs
    to a step (n,) of these.
    """

    names: tuple[str, ...]
    gram: Array
    values: Array
    peak: float
    states: Callable[[Array], Array]


@dataclass(frozen=True)
class Choice:
    """A friction law, values of the unknowns and states (k, s) with it, all laws' criteria above its, their spread."""

    law: str
    values: dict[str, float]
    states: Array
    candidates: dict[str, float]
    spread: float


@dataclass(frozen=True)
class _Trial:
    """Bayesian and Akaike information criterion of a law (up to the same constant), and its values to first order.

    variance: of the inertia. states: step of the initial values.
    """

    bayes: float
    akaike: float
    values: dict[str, float]
    variance: float
    states: Callable[[], Array]


def choose_law(rough: Searched, independent: float, fastest: float, law: str) -> Choice:
    """Choose the friction law of least Bayesian information criterion; with a `law` other than "auto" only its values.

    rough: the fit of `RICHEST`. Every law is compared about the motion of that fit, to first order, so that only
    the best one is fitted again. independent: effective number of independent readings. The spread is that of the
    inertia over all laws with Akaike's weights (Burnham and Anderson 2002, 4.3), which do not favour the smaller laws:
    what their variances are above that of the best law, and their distances from it.
    """
    tried: dict[str, _Trial] = {}
    for number, columns in enumerate(_columns(rough, [share * fastest for share in PEAKS])):
        for odd in LAWS:
            for direction in DIRECTIONS:
                name = odd + direction
                if law not in ("auto", name) or (number > 0 and "stribeck" not in LAWS[odd]):
                    continue
                if law == "auto" and direction.endswith("dependent") and "viscous" not in LAWS[odd]:
                    # viscous friction by direction is the same law as that with a viscous term
                    continue
                trial = _try(columns, name, independent, forced=law != "auto")
                if trial is not None and (name not in tried or trial.bayes < tried[name].bayes):
                    tried[name] = trial
    ranked = sorted(tried, key=lambda name: tried[name].bayes)
    least = min(trial.akaike for trial in tried.values())
    weights = np.exp([-0.5 * (trial.akaike - least) for trial in tried.values()])
    best = tried[ranked[0]]
    off = np.array([trial.values["inertia"] for trial in tried.values()]) - best.values["inertia"]
    more = np.array([trial.variance for trial in tried.values()]) - best.variance
    spread = float(np.sqrt(max(weights @ (off**2 + more) / weights.sum(), 0.0)))
    scores = {name: tried[name].bayes - best.bayes for name in ranked} if law == "auto" else {}
    return Choice(ranked[0], best.values, rough.fit.states + best.states(), scores, spread)


def _columns(rough: Searched, peaks: list[float]) -> Iterator[_Columns]:
    """For each Stribeck speed of `peaks`; they have one motion, as the height of the peak is 0 in it."""
    problem, unknowns, fit = rough.problem, rough.unknowns, rough.fit
    p = unknowns.vector(fit.values)
    body = tuple(k for k, name in enumerate(unknowns.names) if name not in FRICTION)
    own, at = [unknowns.names[k] for k in body], dict(zip(unknowns.names, fit.values, strict=True))
    names = (*own, *(name for name in FRICTION_TERMS if name != "stribeck"))
    places = [unknowns.items[k].places for k in body] + [FRICTION[name] for name in names[len(own) :]]
    entries = entries_of(places, problem.states)
    prediction = problem.with_peaks(p, entries, fit.states, len(places), fit.prediction, np.array(peaks))
    prediction = as_read(prediction, problem, names, np.array([at.get(name, 0.0) for name in names]))
    extended = prediction.slopes
    extended[:, -1] = problem.sigma * fit.residuals
    reduced = fit.shooting.reduced(fit.shooting.grams(extended, fit.residuals, fit.weights))
    gram = reduced.matrix.copy()
    for column, k in enumerate(body):
        if (power := unknowns.power[k]) > 0:
            # the prior, as one more residual
            gram[column, column] += power
            gram[column, -1] -= power * fit.values[k]
            gram[-1, column] -= power * fit.values[k]
            gram[-1, -1] += power * fit.values[k] ** 2
    friction = {"coulomb": at["coulomb_negative"], "viscous": at["viscous_negative"], "quadratic": at["quadratic"]}
    for name in ("coulomb", "viscous"):
        friction[f"{name}_positive"] = at[f"{name}_positive"] - at[f"{name}_negative"]
    values = np.array([at[name] for name in own] + [friction.get(name, 0.0) for name in names[len(own) :]] + [0.0])
    for k, peak in enumerate(peaks):
        chosen = [*range(len(names)), len(names) + k, len(gram) - 1]
        states = partial(_states_with, reduced, chosen[:-1])
        yield _Columns((*names, "stribeck"), gram[np.ix_(chosen, chosen)], values, peak, states)


def _states_with(reduced: Reduced, places: list[int], step: Array) -> Array:
    """Step of the initial values where the columns at these places take a step, and the others none."""
    whole = np.zeros(len(reduced.matrix))
    whole[places] = step
    return reduced.states(whole)


def _try(columns: _Columns, law: str, independent: float, *, forced: bool) -> _Trial | None:
    """Criteria and values of a law; None where a coefficient is significantly negative, unless forced."""
    terms, n = law_terms(law), len(columns.names)
    directed = "viscous_even" in terms
    # of two coefficients by direction one is a term, and the difference another
    other = {"viscous_even": "viscous_positive"}
    if directed and "coulomb" in terms:
        other["offset"] = "coulomb_positive"
    wanted = {other.get(term, term) for term in terms} | ({"viscous"} if directed else set())
    body = [k for k, name in enumerate(columns.names) if name not in FRICTION]
    own = sorted([*body, *(columns.names.index(name) for name in wanted)])
    # residual of the law: the present one plus what the terms that it lacks contribute now
    blend = np.zeros((n + 1, len(own) + 1))
    blend[:, -1] = np.append(columns.values, 1.0)
    blend[own, -1] = 0.0
    blend[own, np.arange(len(own))] = 1.0
    gram = blend.T @ columns.gram @ blend
    inner, right, total = gram[:-1, :-1], gram[:-1, -1], gram[-1, -1]
    scale = 1 / np.sqrt(np.maximum(np.diag(inner), 1e-300))
    inverse = np.linalg.inv(inner * np.outer(scale, scale) + 1e-12 * np.eye(len(own))) * np.outer(scale, scale)
    change = inverse @ right
    lost = max(float(total - change @ right), 1e-300)
    values = columns.values[own] + change
    spread = np.sqrt(np.maximum(np.diag(inverse) * lost / independent, 0.0))
    for k, value, u in zip(own, values, spread, strict=True):
        free = k in body or columns.names[k] in ("offset", "coulomb_positive", "viscous_positive")
        if not free and value < -2 * u and law != "viscous" and not forced:
            return None
    count = len(friction_unknowns(law))
    likelihood = float(independent * np.log(lost))
    named = {columns.names[k]: float(value) for k, value in zip(own, values, strict=True)}
    named["stribeck_speed"] = columns.peak
    for name in ("coulomb", "viscous"):
        named[f"{name}_negative"] = named.get(name, 0.0)
        named[f"{name}_positive"] = named.get(name, 0.0) + named.get(f"{name}_positive", 0.0)
    variance = float(spread[own.index(columns.names.index("inertia"))] ** 2)
    step = -columns.values
    step[own] = change
    states = partial(columns.states, step)
    return _Trial(likelihood + count * float(np.log(independent)), likelihood + 2.0 * count, named, variance, states)
