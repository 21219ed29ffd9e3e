"""The example of a method of one's own: its estimate, its budget, and that the rest of swingid knows it."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import swingid as sw
from swingid.balance.covariance import column_noise
from swingid.balance.fits import fit_rows
from swingid.balance.rows import rows_of
from swingid.balance.windows import law_windows
from swingid.checks.level import chosen_at_level
from swingid.methods.table import METHODS
from swingid.preparation.prepared import prepare
from swingid.report import write_report

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "own_method.py"
NOISY = sw.Rig.load("paper").changed({"sensors.noise": "1 mrad"})
J1 = 3.022e-3


@pytest.fixture(scope="module")
def example() -> Iterator[ModuleType]:
    """The example as a module, its method in the table until the end of these tests."""
    spec = importlib.util.spec_from_file_location("own_method", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    METHODS.pop(module.NAME)


def log_of(seed: int, rig: sw.Rig = NOISY) -> sw.Recording:
    """A run of the paper's rig."""
    return sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=15, seed=seed)


def test_it_is_no_longer_than_a_method_may_be() -> None:
    assert len(EXAMPLE.read_text(encoding="utf-8").splitlines()) <= 150


def test_the_compensation_removes_the_attenuation_of_short_windows(example: ModuleType) -> None:
    """On windows of 1/24 of the length noise of 1 mrad attenuates a11 by a tenth."""
    plain, compensated, expected = [], [], []
    for seed in range(8):
        _, _, choice, _ = chosen_at_level(prepare(log_of(seed), NOISY), "off")
        half = choice.law.half / 24
        signals = choice.signals.suited(half)
        fit = fit_rows(
            rows_of(signals, law_windows(signals, half)), choice.law.equation, choice.law.noise, ("viscous",)
        )
        assert fit is not None
        plain.append(fit.inertia / J1 - 1)
        compensated.append(example.compensated_fit(fit).inertia / J1 - 1)
        expected.append(-column_noise(fit.rows.windows, fit.noise) / float(fit.rows["inertia"] @ fit.rows["inertia"]))
    spread = float(np.std(compensated, ddof=1)) / 8**0.5
    assert np.mean(plain) == pytest.approx(np.mean(expected), abs=4 * spread)
    assert np.mean(plain) < -8 * spread
    assert abs(np.mean(compensated)) < 4 * spread


def test_without_noise_it_is_least_squares(example: ModuleType) -> None:
    _, _, choice, _ = chosen_at_level(prepare(log_of(0), NOISY), "off")
    quiet = replace(choice.law, noise=replace(choice.law.noise, angle=0.0, resolution=0.0))
    plain = fit_rows(quiet.rows, quiet.equation, quiet.noise, quiet.friction)
    assert plain is not None
    assert example.compensated_fit(plain).inertia == pytest.approx(plain.inertia, rel=1e-10)


@pytest.mark.long
def test_its_intervals_hold(example: ModuleType) -> None:
    """Of 20 logs about one may miss; more than 4 have a probability of 0.3 %."""
    results = [sw.identify(log_of(seed), NOISY, example.NAME) for seed in range(20)]
    off = [abs(one.inertia.value - J1) for one in results]
    widths = [(one.inertia.interval95[1] - one.inertia.interval95[0]) / 2 for one in results]
    assert sum(far > width for far, width in zip(off, widths, strict=True)) <= 4
    assert max(widths) < 2e-4 * J1


def test_errors_that_the_rig_file_states_are_in_its_budget(example: ModuleType) -> None:
    """A wheel of ± 0.3 % makes the inertia uncertain by 0.3 % of a12 · (a11 / a12), as for momentum."""
    rig = NOISY.changed({"drive.wheel.inertia": "113.4 ± 0.34 kg*mm^2"})
    log = log_of(3, rig)
    shares = [
        next(one.standard_uncertainty for one in sw.identify(log, rig, name).budget if "wheel.inertia" in one.source)
        for name in ("momentum", example.NAME)
    ]
    assert shares[1] == pytest.approx(shares[0], rel=1e-2)


def test_a_wrong_gravity_torque_is_found_by_it_too(example: ModuleType) -> None:
    wrong = NOISY.changed({"axis.gravity_torque": 1.1 * NOISY.axis.gravity_torque.value})
    result = sw.identify(log_of(1), wrong, example.NAME)
    assert "gravity-torque-disagrees" in [one.code for one in result.warnings]


def test_report_and_file_know_it(example: ModuleType, tmp_path: Path) -> None:
    log = log_of(2)
    result = sw.identify(log, NOISY, example.NAME)
    assert json.loads(result.to_json())["method"] == example.NAME
    page = write_report(result, log, NOISY, tmp_path / "own.html").read_text(encoding="utf-8")
    assert "scatter of the windows" in page
