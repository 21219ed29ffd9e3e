"""A method of one's own from the core's types, budget, checks and report included: instrumental variables on windows.

Z'(y − X θ) = 0 with the regressors of windows one period earlier as instruments Z, whose noise is independent of that
of the windows, so that it does not attenuate the inertia (Söderström and Stoica 1983).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import swingid as sw
from swingid.balance.covariance import column_noise, covariance_of
from swingid.balance.errors import errors_of, sensitivities
from swingid.balance.fits import WindowFit, columns_of, fit_rows
from swingid.balance.friction_laws import parameters_of
from swingid.balance.perturbations import propagated
from swingid.balance.rows import Signals, Windows, rows_of
from swingid.balance.systematics import grid_spread
from swingid.balance.windows import law_windows
from swingid.checks.momentum import MomentumCheck
from swingid.checks.stated import CONFLICT
from swingid.errors import UnanswerableError
from swingid.methods.momentum.method import momentum
from swingid.methods.table import METHODS, Method
from swingid.numerics.regression import fit_oblique
from swingid.preparation.prepared import prepare
from swingid.report import write_report
from swingid.result.result import Details, Result
from swingid.uncertainty.budget import Scatter, evaluate, systematic

NAME = "instruments-on-windows"
NOISY = sw.Rig.load("paper").changed({"sensors.noise": "1 mrad", "drive.wheel.inertia": "113.4 ± 0.34 kg*mm^2"})
J1 = 3.022e-3
EMPS = Path(__file__).resolve().parents[2] / "examples" / "rigs" / "emps.toml"


def instrumental(plain: WindowFit, signals: Signals, period: float) -> WindowFit:
    """The fit of the windows that have one a period (s) before them, by the regressors of those."""
    windows, first = plain.rows.windows, signals.nodes.time[0]
    rows = plain.rows.select(windows.centres - windows.half - period > first)
    earlier = rows_of(signals, Windows(rows.windows.centres - period, rows.windows.half))
    unknowns, columns = columns_of(rows, plain.equation, plain.friction)
    _, instruments = columns_of(earlier, plain.equation, plain.friction)
    fit = replace(plain, rows=rows, declared=())
    solved, _ = fit_oblique(columns, fit.known, instruments)
    covariance, computed = covariance_of(solved, rows, unknowns, plain.equation, plain.noise)
    return replace(fit, fit=solved, covariance=covariance, computed=float(computed))


def short_windows(check: MomentumCheck, share: float) -> tuple[WindowFit, Signals]:
    """Least squares on windows of this share of momentum's length, with the signals that they need."""
    choice = check.balanced.choice
    half = share * choice.law.half
    signals = choice.signals.suited(half)
    rows = rows_of(signals, law_windows(signals, half))
    fit = fit_rows(rows, choice.law.equation, choice.law.noise, choice.law.friction)
    if fit is None:
        raise UnanswerableError("the log is too short for the unknowns; record a longer one.", code="too-short")
    return fit, signals


def instruments_on_windows(check: MomentumCheck, *, share: float = 0.5) -> Result:
    """Inertia, sought coefficients and friction with their budget, compared with momentum, and its hypotheses."""
    prepared, part, _, moved = check.balanced
    plain, signals = short_windows(check, share)
    fit, rig = instrumental(plain, signals, 2 * signals.motion.half_period), prepared.rig
    values, weights = parameters_of(fit, fit.friction)
    combinations = np.array(list(weights.values()))
    errors = errors_of(fit.rows, signals, rig, fit.equation, fit.coefficients)
    evaluated = evaluate(
        values,
        Scatter("scatter of the windows", combinations @ fit.covariance @ combinations.T, np.full(len(values), np.inf)),
        [
            (systematic("place of the encoder's grid"), "inertia", grid_spread(fit, signals)),
            (systematic(CONFLICT), "inertia", check.conflict),
        ],
        propagated(errors, fit.fit.influence, combinations),
        relative=rig.axis.model_uncertainty,
    )
    evaluated = replace(evaluated, sensitivities=sensitivities(fit.rows, fit.equation, fit.fit.influence[0]))
    evaluated, differs = check.compared(evaluated, "noise that is the same one period later")
    checked = check.tested(check.alone(evaluated)) + differs + moved.checked
    turning = signals.motion.turning_times, signals.motion.turning_angles
    details = Details(part.start, part.stop, *turning, window=fit.half, residual_times=fit.rows.windows.centres)
    details = replace(details, residuals=fit.fit.residuals)
    return prepared.result(NAME, check.widened(evaluated), part, checked, details, corrections=moved.corrections)


@pytest.fixture(scope="module", autouse=True)
def _in_the_table() -> Iterator[None]:
    METHODS[NAME] = Method(NAME, lambda: instruments_on_windows, motor="unused", friction="any", speeds="none")
    yield
    METHODS.pop(NAME)


def log_of(seed: int) -> sw.Recording:
    """A run of the paper's rig."""
    return sw.simulate(NOISY, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=15, seed=seed)


def test_it_is_no_longer_than_a_method_may_be() -> None:
    assert len(Path(__file__).read_text(encoding="utf-8").splitlines()) <= 150


def test_instruments_remove_the_attenuation_of_short_windows() -> None:
    """On windows of 1/24 of the length noise of 1 mrad attenuates a11 by a tenth."""
    attenuated, found, expected = [], [], []
    for seed in range(4):
        plain, signals = short_windows(MomentumCheck(prepare(log_of(seed), NOISY), momentum), 1 / 24)
        attenuated.append(plain.inertia / J1 - 1)
        found.append(instrumental(plain, signals, 2 * signals.motion.half_period).inertia / J1 - 1)
        power = float(plain.rows["inertia"] @ plain.rows["inertia"])
        expected.append(-column_noise(plain.rows.windows, plain.noise) / power)
    assert np.mean(attenuated) == pytest.approx(np.mean(expected), rel=0.2)
    assert abs(np.mean(found)) < 0.1 * abs(np.mean(attenuated))


def test_budget_hypotheses_and_report_know_it(tmp_path: Path) -> None:
    log = log_of(5)
    result, reference = (sw.identify(log, NOISY, name) for name in (NAME, "momentum"))
    low, high = result.inertia.interval95
    assert low < J1 < high
    wheel = [
        next(one.standard_uncertainty for one in each.budget if "wheel.inertia" in one.source)
        for each in (result, reference)
    ]
    assert wheel[0] == pytest.approx(wheel[1], rel=1e-2)
    wrong = NOISY.changed({"axis.gravity_torque": 1.1 * NOISY.axis.gravity_torque.value})
    assert "gravity-torque-disagrees" in [one.code for one in sw.identify(log, wrong, NAME).warnings]
    page = write_report(result, log, NOISY, tmp_path / "own.html").read_text(encoding="utf-8")
    assert "scatter of the windows" in page


def test_it_agrees_with_momentum_on_a_real_log(data_dir: Path) -> None:
    rig = sw.Rig.load(EMPS)
    log = sw.Recording.load(data_dir / "emps" / "DATA_EMPS.mat", rig)
    own, reference = (sw.identify(log, rig, name).inertia for name in (NAME, "momentum"))
    assert own.value == pytest.approx(reference.value, abs=2 * own.standard_uncertainty)
