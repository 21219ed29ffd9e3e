"""Several logs pooled: weights, scatter between logs, what they share, who disagrees; on values known beforehand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from refusals import coded
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.pooling.pooling import deviations, outliers, pool
from swingid.pooling.several import combine, identify_several
from swingid.recording.findings import Kind
from swingid.result.result import Message, Parameter, Result, combined, refusal
from swingid.uncertainty.budget import BudgetEntry, stated, systematic
from swingid.uncertainty.budget import scatter as scattering
from swingid.uncertainty.significance import FAMILY
from swingid.uncertainty.uncertain import Uncertain, covariance, weighted_sum

BCG = """4 119 11 128; 6 300 29 274; 3 228 11 209; 62 13536 248 12619; 33 5036 47 5761; 180 1361 372 1079; 8 2537 10 619
505 87886 499 87892; 29 7470 45 7232; 17 1699 65 1600; 186 50448 141 27197; 5 2493 3 2338; 27 16886 29 17825"""
"""Thirteen trials of a vaccine (Colditz et al. 1994), cases and others, vaccinated and not."""


def alone(value: float, u: float, name: str = "") -> Uncertain:
    return Uncertain.of(value, u, scattering("scatter"), f"scatter of {name or value}")


def made(value: float, u: float, *shared: tuple[str, float, float], name: str = "run", **more: object) -> Result:
    """A result with scatter u and shared constants (key, standard deviation, sensitivity)."""
    budget = (
        BudgetEntry(scattering("scatter of the windows"), "inertia", u),
        *(BudgetEntry(stated(key, key), "inertia", abs(slope) * std, slope) for key, std, slope in shared),
    )
    return Result(
        method="momentum",
        status="ok",
        parameters={"inertia": Parameter.of(value, combined(budget, "inertia"), "kg m^2")},
        budget=budget,
        provenance={"log": name},
        **more,  # type: ignore[arg-type]
    )


def names(count: int) -> list[str]:
    return [f"run {k}" for k in range(count)]


# weights and scatter


def test_consistent_logs_weigh_by_their_variance() -> None:
    values, u = np.array([10.0, 10.3, 9.8]), np.array([0.5, 1.0, 2.0])
    pooled = pool([alone(x, s) for x, s in zip(values, u, strict=True)])
    weights = u**-2 / np.sum(u**-2)
    assert pooled.between == 0
    assert pooled.estimate.value == pytest.approx(weights @ values)
    assert pooled.estimate.u == pytest.approx(np.sum(u**-2) ** -0.5)


def test_scatter_between_is_paule_and_mandels() -> None:
    """tau^2 = 0.3181, mean -0.7150, standard error 0.1809 (R, metafor, rma of dat.bcg, method "PM")."""
    table = np.array([[float(x) for x in row.split()] for row in BCG.replace("\n", ";").split(";")])
    a, b, c, d = table.T
    values = np.log(a / (a + b) / (c / (c + d)))
    variances = 1 / a - 1 / (a + b) + 1 / c - 1 / (c + d)
    pooled = pool([alone(x, math.sqrt(v)) for x, v in zip(values, variances, strict=True)])
    assert pooled.between**2 == pytest.approx(0.3181, abs=5e-5)
    assert pooled.estimate.value == pytest.approx(-0.7150, abs=5e-5)
    assert pooled.estimate.u == pytest.approx(0.1809, abs=5e-5)
    assert pooled.freedom == pytest.approx(12)


def test_what_logs_share_does_not_average_out() -> None:
    runs = [made(10.0 + 1e-3 * k, 0.1, ("wheel", 0.3, 2.0)) for k in range(9)]
    pooled = combine(runs, names(9)).inertia
    assert pooled.standard_uncertainty == pytest.approx(math.hypot(0.1 / 3, 0.6))
    (wheel,) = (entry for entry in combine(runs, names(9)).budget if entry.type == "B")
    assert (wheel.sensitivity, wheel.shared_id) == (pytest.approx(2.0), "wheel")


def test_opposite_sensitivities_cancel() -> None:
    runs = [made(10.0, 0.1, ("b", 0.3, slope)) for slope in (2.0, -2.0)]
    assert combine(runs, names(2)).inertia.standard_uncertainty == pytest.approx(0.1 / math.sqrt(2))


def test_a_log_that_leans_more_on_a_constant_counts_less() -> None:
    near_resonance, other = made(10.0, 0.01, ("b", 1.0, 3.0)), made(10.1, 0.01, ("b", 1.0, 0.5))
    pooled = combine([near_resonance, other], names(2))
    assert pooled.inertia.value == pytest.approx(10.1, abs=1e-3)
    assert pooled.inertia.standard_uncertainty < 1.001 * other.inertia.standard_uncertainty


def test_scatter_that_a_shared_constant_explains_is_none_between_logs() -> None:
    """Two speeds lean differently on b, so an error of b moves them apart: no scatter, no verdict."""
    runs = [made(10.0, 0.01, ("b", 1.0, 0.1)), made(10.9, 0.01, ("b", 1.0, 1.0))]
    pooled = combine(runs, names(2))
    assert pooled.status == "ok"
    assert all("between" not in entry.source for entry in pooled.budget)


def test_errors_alike_in_every_run_do_not_average_out() -> None:
    drift = BudgetEntry(systematic("drift with the length of the windows"), "inertia", 0.5)
    runs = [made(10.0, 0.1) for _ in range(25)]
    runs = [replace(run, budget=(*run.budget, drift)) for run in runs]
    assert combine(runs, names(25)).inertia.standard_uncertainty == pytest.approx(math.hypot(0.5, 0.02))


@pytest.mark.parametrize(("count", "between"), [(4, 0.0), (4, 3.0), (8, 1.0)])
def test_the_interval_covers(count: int, between: float) -> None:
    random, held, trials = np.random.default_rng(count), 0, 500
    for _ in range(trials):
        u = random.uniform(0.5, 2, count)
        values = 10 + random.normal(0, np.hypot(u, between))
        low, high = pool([alone(x, s, str(x)) for x, s in zip(values, u, strict=True)]).parameter("").interval95
        held += low < 10 < high
    # Mandel and Paule's scatter is a little short for few logs; 2 binomial standard errors are 2 %
    assert 0.91 < held / trials < 0.985


def test_sums_know_what_their_terms_share() -> None:
    wheel = stated("wheel", "wheel", 0.2)
    one = Uncertain(3.0, {"wheel": 0.4, "a": 0.1}, {"wheel": wheel, "a": scattering("a")})
    other = Uncertain(5.0, {"wheel": 0.5, "b": 0.2}, {"wheel": wheel, "b": scattering("b")})
    gap = 1.0 + weighted_sum([other, one], [1.0, -1.0])
    assert gap.value == 3.0
    assert gap.u == pytest.approx(math.sqrt(0.1**2 + 0.1**2 + 0.2**2))
    matrix = covariance([one, other])
    assert matrix[0, 1] == pytest.approx(0.2)
    assert gap.u**2 == pytest.approx(matrix[0, 0] + matrix[1, 1] - 2 * matrix[0, 1])
    (of_wheel,) = (entry for entry in gap.entries("x") if entry.shared_id == "wheel")
    assert of_wheel.sensitivity == pytest.approx((0.5 - 0.4) / 0.2)


# verdicts


def test_the_log_that_disagrees_is_named_with_its_parameter() -> None:
    runs = [made(10.0, 0.1), made(10.05, 0.1), made(11.0, 0.1), made(9.95, 0.1)]
    common = combine(runs, names(4))
    (warning,) = common.warnings
    assert (warning.code, common.status) == ("logs-disagree", "warning")
    assert warning.message.startswith("run 2 (+10 %, En = 4.3) disagrees with the other logs in inertia")
    assert common.inertia.interval95[1] > 11.0 > common.inertia.interval95[0] - 5


def test_of_two_logs_both_are_named() -> None:
    (warning,) = combine([made(10.0, 0.1), made(11.0, 0.1)], names(2)).warnings
    assert "run 0 and run 1 disagree in inertia" in warning.message


def test_normalised_deviation_by_hand() -> None:
    """E_n = 0.5 (10.6 - 10) / sqrt(0.3² + 0.4²), what they share left out."""
    shared = Uncertain.of(0.0, 5.0, stated("wheel", "wheel", 1.0))
    logs = [alone(10.6, 0.3), alone(10.0, 0.4)]
    both = deviations([one + shared for one in logs])
    assert [d.normalised for d in both] == [pytest.approx(0.6), pytest.approx(-0.6)]


def test_sound_logs_raise_few_alarms() -> None:
    random, alarms, trials = np.random.default_rng(5), 0, 700
    for k in range(trials):
        u = random.uniform(0.5, 2, 2 + k % 5)
        alarms += bool(outliers([alone(10 + random.normal(0, s), s, str(j)) for j, s in enumerate(u)]))
    assert alarms / trials < FAMILY + 2 * math.sqrt(FAMILY / trials)


def test_no_majority() -> None:
    runs = [made(x, 0.01) for x in (9.0, 10.0, 11.0, 12.0)]
    (warning,) = combine(runs, names(4)).warnings
    assert "no majority" in warning.message


def test_friction_is_each_logs_own_and_judged() -> None:
    def with_friction(value: float) -> Result:
        run = made(10.0, 0.1)
        entry = BudgetEntry(scattering("scatter of the windows"), "viscous", 0.01)
        parameters = run.parameters | {"viscous": Parameter.of(value, 0.01, "N m s")}
        return replace(run, parameters=parameters, budget=(*run.budget, entry))

    alike = combine([with_friction(1.0), with_friction(1.01)], names(2))
    assert set(alike.parameters) == {"inertia"}
    assert "viscous agrees" in next(n.message for n in alike.notes if n.code == "friction-per-log")
    apart = combine([with_friction(1.0), with_friction(1.2)], names(2))
    assert apart.status == "ok"
    assert "disagree in viscous" in next(n.message for n in apart.notes if n.code == "friction-per-log")
    shared = combine([with_friction(1.0), with_friction(1.01)], names(2), friction="shared")
    assert shared.parameters["viscous"].value == pytest.approx(1.005)
    assert [
        w.code for w in combine([with_friction(1.0), with_friction(1.2)], names(2), friction="shared").warnings
    ] == ["logs-disagree"]


def test_refused_logs_leave_the_others() -> None:
    gone = refusal("", InputError("c.csv has no wheel angle.", code="missing-wheel-angle"), {"log": "c.csv"})
    common = combine([made(10.0, 0.1), gone, made(10.1, 0.1)], ["a.csv", "c.csv", "b.csv"])
    (warning,) = common.warnings
    assert warning.code == "log-refused"
    assert warning.message.startswith("c.csv ")
    assert warning.message.endswith(": c.csv has no wheel angle.")
    assert common.inertia.value == pytest.approx(10.05)
    assert [run.status for run in common.per_log] == ["ok", "refused", "ok"]
    assert common.per_log[1].method == "momentum"


def test_a_log_without_uncertainty_has_no_weight() -> None:
    bare = replace(made(12.0, 0.1), parameters={"inertia": Parameter.of(12.0, None, "kg m^2")})
    common = combine([made(10.0, 0.1), bare, made(10.1, 0.1)], names(3))
    assert common.inertia.value == pytest.approx(10.05)
    assert [w.code for w in common.warnings] == ["log-without-uncertainty"]


def test_warnings_of_logs_carry_their_names_once() -> None:
    doubt = Message("spikes", "rows were dropped.")
    runs = [replace(made(10.0, 0.1), warnings=(doubt,), status="warning") for _ in range(2)]
    assert [w.message for w in combine(runs, names(2)).warnings] == ["run 0, run 1: rows were dropped."]


# inertia and gravity torque together


def pair(inertia: float, b: float, speed: float, across: float, along: float) -> Result:
    """A log at one speed: it sees a11 − b/ω² to `across`, and what moves along it to `along` (of the inertia)."""
    seen = np.array([1.0, -1 / speed**2])
    own = np.linalg.inv(np.outer(seen, seen) / across**2 + np.outer([1, 0], [1, 0]) / along**2)
    run = made(inertia, math.sqrt(own[0, 0]))
    entry = BudgetEntry(scattering("scatter of the windows"), "gravity_torque", math.sqrt(own[1, 1]))
    keys = ("inertia", "gravity_torque")
    table = {one: {other: float(own[i, j]) for j, other in enumerate(keys)} for i, one in enumerate(keys)}
    parameters = run.parameters | {"gravity_torque": Parameter.of(b, entry.standard_uncertainty, "N m")}
    return replace(run, parameters=parameters, budget=(*run.budget, entry), covariance_of_fit=table)


def test_two_speeds_tell_inertia_and_gravity_torque_as_one_fit_of_all_rows() -> None:
    """The pooled pair is the least-squares solution of the four equations that the two logs stand for."""
    across, along = 1e-6, 3e-4
    speeds, truth = (8.5, 12.0), np.array([3e-3, 78e-3])
    random = np.random.default_rng(1)
    rows, target, runs = [], [], []
    for speed in speeds:
        seen, held = np.array([1, -1 / speed**2]), np.array([1.0, 0.0])
        y = np.array([seen @ truth + 0.3 * across * random.normal(), held @ truth + 0.3 * along * random.normal()])
        found = np.linalg.solve(np.array([seen, held]), y)
        runs.append(pair(*found, speed, across, along))
        rows += [seen / across, held / along]
        target += [y[0] / across, y[1] / along]
    whole = np.linalg.lstsq(np.array(rows), np.array(target), rcond=None)[0]
    spread = np.sqrt(np.diag(np.linalg.inv(np.array(rows).T @ np.array(rows))))
    common = combine(runs, names(2))
    found = [common.parameters[name] for name in ("inertia", "gravity_torque")]
    assert [p.value for p in found] == pytest.approx(whole, rel=1e-6)
    assert [p.standard_uncertainty for p in found] == pytest.approx(spread, rel=0.01)
    assert spread[0] < along / 50
    assert common.status == "ok"


def test_one_speed_twice_does_not() -> None:
    runs = [pair(3e-3, 78e-3, 8.5, 1e-6, 2e-3) for _ in range(2)]
    with pytest.raises(UnanswerableError, check=coded("not-identifiable")):
        combine(runs, names(2))
    hardly = combine([pair(3e-3, 78e-3, 8.5, 1e-6, 2e-4) for _ in range(2)], names(2))
    assert [w.code for w in hardly.warnings] == ["gravity-and-inertia"]


def test_one_speed_that_is_left_alone_is_refused() -> None:
    text = "one frequency: inertia and gravity torque move together."
    doubt = Message("not-identifiable", text, Kind.NOT_IDENTIFIABLE)
    left = replace(pair(3e-3, 78e-3, 8.5, 1e-6, 2e-3), warnings=(doubt,), status="warning")
    gone = refusal("momentum", InputError("b.csv does not exist.", code="missing-file"), {"log": "b.csv"})
    with pytest.raises(UnanswerableError, check=coded("not-identifiable")):
        combine([left, gone], names(2))


def test_a_pair_that_stands_apart_is_named() -> None:
    runs = [pair(3e-3, 78e-3, speed, 1e-6, 3e-4) for speed in (8.5, 12.0, 10.0)]
    off = pair(3.02e-3, 78e-3, 9.0, 1e-6, 3e-4)
    assert combine(runs, names(3)).status == "ok"
    (warning,) = combine([*runs, off], names(4)).warnings
    assert warning.message.startswith("run 3 disagrees with the others in inertia and gravity torque")


# correlations


def correlated(inertia: float, u: float, r: float, wheel: float) -> Result:
    """Inertia with scatter u and viscous friction with scatter 2 u, r between the scatters; both feel the wheel."""
    run = made(inertia, u, ("drive.wheel.inertia", 1.0, wheel))
    own = [
        BudgetEntry(scattering("scatter of the windows"), "viscous", 2 * u),
        BudgetEntry(stated("drive.wheel.inertia", "drive.wheel.inertia"), "viscous", 3 * wheel, -3 * wheel),
    ]
    viscous = Parameter.of(1.0, combined(own, "viscous"), "N m s")
    sizes = run.inertia.standard_uncertainty * viscous.standard_uncertainty
    whole = (2 * r * u**2 - 3 * wheel**2) / sizes
    table = {"inertia": {"inertia": 1.0, "viscous": whole}, "viscous": {"inertia": whole, "viscous": 1.0}}
    parameters = run.parameters | {"viscous": viscous}
    return replace(run, parameters=parameters, budget=(*run.budget, *own), correlation=table)


def test_scatter_averages_out_of_a_correlation_and_the_wheel_stays() -> None:
    runs = [correlated(10.0, 0.2, 0.6, 0.1) for _ in range(4)]
    common = combine(runs, names(4), friction="shared")
    covariance_ = 2 * 0.6 * 0.2**2 / 4 - 3 * 0.1**2
    sizes = math.hypot(0.1, 0.1) * math.hypot(0.2, 0.3)
    assert common.correlation["inertia"]["viscous"] == pytest.approx(covariance_ / sizes)
    assert common.correlation["viscous"]["viscous"] == 1.0
    # one parameter alone, and results that do not hold their own coefficients
    assert combine(runs, names(4)).correlation == {}
    assert combine([replace(run, correlation={}) for run in runs], names(4), friction="shared").correlation == {}


def test_a_pooled_pair_is_correlated_as_its_covariance_states() -> None:
    runs = [pair(3e-3, 78e-3, speed, 1e-6, 3e-4) for speed in (8.5, 12.0)]
    tables = []
    for run in runs:
        own, u = run.covariance_of_fit, [run.parameters[name].standard_uncertainty for name in run.parameters]
        r = own["inertia"]["gravity_torque"] / (u[0] * u[1])
        tables.append({"inertia": {"inertia": 1.0, "gravity_torque": r}, "gravity_torque": {"inertia": r}})
        tables[-1]["gravity_torque"]["gravity_torque"] = 1.0
    common = combine([replace(run, correlation=own) for run, own in zip(runs, tables, strict=True)], names(2))
    matrix = common.covariance_of_fit
    expected = matrix["inertia"]["gravity_torque"] / math.sqrt(
        matrix["inertia"]["inertia"] * matrix["gravity_torque"]["gravity_torque"]
    )
    assert common.correlation["inertia"]["gravity_torque"] == pytest.approx(expected)


# the door


def test_lists_are_checked() -> None:
    with pytest.raises(UsageError) as caught:
        identify_several([], lambda log: made(1.0, 0.1))
    assert caught.value.code == "no-log"
    with pytest.raises(UsageError, check=coded("no-friction-choice", "per-log")):
        identify_several({"a": InputError("a is gone.", code="missing-file")}, lambda log: made(1, 1), friction="own")


def test_where_all_are_refused_the_first_error_stands() -> None:
    errors = {
        "a": UnanswerableError("a: no motion.", code="no-motion"),
        "b": InputError("b is gone.", code="missing-file"),
    }
    with pytest.raises(UnanswerableError) as caught:
        identify_several(errors, lambda log: made(1.0, 0.1))
    assert caught.value.code == "no-motion"
