"""Periods of a free decay against the amplitude: the law of the fitted balance, and what is not of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import swingid as sw
from swingid.checks.free_decay import half_periods, loss_unexplained, period_of_amplitude
from swingid.checks.hypothesis import Evidence, Judged
from swingid.checks.momentum import MomentumCheck
from swingid.checks.table import TABLE
from swingid.methods.momentum.method import momentum
from swingid.preparation.prepared import prepare

INERTIA, GRAVITY = 3e-3, 0.08

FRICTIONS = {
    "viscous": "viscous = 2e-4",
    "coulomb": "viscous = 1e-4\ncoulomb = 3e-4",
    "stribeck": "viscous = 1e-4\ncoulomb = 2e-4\nstatic = 3e-4\nstribeck_speed = 0.1",
    "quadratic": "viscous = 1e-4\nquadratic = 3e-5",
}


def rig_of(friction: str, more: str = "") -> sw.Rig:
    return sw.Rig.from_text(
        f'name = "arm"\n[axis]\ngravity_torque = {GRAVITY}\ninertia = {INERTIA}\n{more}[axis.friction]\n{friction}\n'
        '[drive]\nkind = "none"\n[sensors]\ncounts_per_turn = 16384\nnoise = 2e-4\n'
    )


def evidence_of(log: sw.Recording, rig: sw.Rig) -> Evidence:
    evidence = MomentumCheck(prepare(log, rig), momentum).evidence
    assert evidence is not None
    return evidence


def decay(rig: sw.Rig, seed: int = 1, amplitude: float = 1.4) -> sw.Recording:
    return sw.simulate(rig, duration=15.0, rate=500.0, initial_angle=amplitude, seed=seed)


def judged_of(evidence: Evidence) -> Judged:
    return Judged(evidence.law.inertia, evidence.law.a11, {"alone": evidence.law.total})


@pytest.mark.parametrize("friction", FRICTIONS.values(), ids=FRICTIONS)
def test_half_periods_are_those_of_the_log(friction: str) -> None:
    evidence = evidence_of(decay(rig_of(friction)), rig_of(friction))
    times = np.diff(evidence.signals.motion.turning_times)
    assert np.ptp(times) > 0.02 * np.mean(times)
    np.testing.assert_allclose(half_periods(evidence), times, rtol=1e-3)


def test_half_periods_of_a_pendulum_without_friction_are_the_elliptic_integral() -> None:
    rig = rig_of("viscous = 1e-7")
    evidence = evidence_of(decay(rig), rig)
    modulus = np.sin(evidence.signals.motion.swing_sizes[0] / 4) ** 2
    theta = (np.arange(1000) + 0.5) / 1000 * np.pi / 2
    expected = 2 * np.sqrt(evidence.law.a11 / GRAVITY) * np.pi / 2 * np.mean((1 - modulus * np.sin(theta) ** 2) ** -0.5)
    # the turning angles are known to 0.1 mrad
    assert half_periods(evidence)[0] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("friction", FRICTIONS.values(), ids=FRICTIONS)
@pytest.mark.parametrize("seed", range(3))
def test_a_decay_as_its_rig_has_no_finding(friction: str, seed: int) -> None:
    rig = rig_of(friction)
    evidence = evidence_of(decay(rig, seed, 0.6 + 0.5 * seed), rig)
    assert period_of_amplitude(evidence, judged_of(evidence)) == []


def test_a_spring_beside_gravity_is_of_the_balance_where_it_is_stated() -> None:
    true = rig_of(FRICTIONS["coulomb"], "stiffness = 0.02\n")
    evidence = evidence_of(decay(true), true)
    assert period_of_amplitude(evidence, judged_of(evidence)) == []
    evidence = evidence_of(decay(true), rig_of(FRICTIONS["coulomb"]))
    (found,) = period_of_amplitude(evidence, judged_of(evidence)) or ()
    assert abs(found.change) > 0.01 * INERTIA


def test_a_wrong_scale_of_the_angle_is_found() -> None:
    rig = rig_of(FRICTIONS["viscous"])
    log = decay(rig)
    evidence = evidence_of(replace(log, angle=1.03 * log.angle), rig)
    (found,) = period_of_amplitude(evidence, judged_of(evidence)) or ()
    assert judged_of(evidence).matters(found.change, "alone")
    assert "period" in found.text


def test_a_driven_log_is_not_tested() -> None:
    rig = sw.Rig.load("paper")
    motion = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
    log = sw.simulate(rig, motion, sw.Compensator.paper(rig), duration=8.0, rate=500.0, seed=1)
    evidence = evidence_of(log, rig)
    assert period_of_amplitude(evidence, judged_of(evidence)) is None
    assert loss_unexplained(evidence) is None


def test_every_method_tests_it() -> None:
    assert "period" in {one.check for one in TABLE}
    rig = rig_of(FRICTIONS["viscous"])
    for method in ("momentum", "energy", "equation-error", "output-error"):
        result = sw.identify(decay(rig), rig, method=method)
        assert result.details is not None
        assert "period" in result.details.checks


def test_the_loss_is_compared_only_where_friction_and_gravity_are_all_that_acts() -> None:
    rig = rig_of(FRICTIONS["viscous"])
    assert loss_unexplained(evidence_of(decay(rig), rig)) is not None
    braked = rig_of(FRICTIONS["viscous"] + "\ndrag = 1e-3")
    assert loss_unexplained(evidence_of(decay(braked), braked)) is None


def test_a_drag_of_0_is_none() -> None:
    rig = rig_of(FRICTIONS["viscous"] + "\ndrag = 0")
    assert not evidence_of(decay(rig), rig).signals.further
