"""The inertia against the size of the swings, which must not depend on it; and the loss of energy of a free decay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import swingid as sw
from swingid.balance.parts import trends, unexplained
from swingid.checks.free_decay import loss_unexplained
from swingid.checks.hypothesis import Evidence, Finding, Judged
from swingid.checks.momentum import MomentumCheck
from swingid.checks.stability import disagreeing
from swingid.checks.table import TABLE, check_hypotheses
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
        '[drive]\nkind = "none"\n[sensors]\ncounts_per_turn = 16384\nnonlinearity = 0\nnoise = 2e-4\n'
    )


def evidence_of(log: sw.Recording, rig: sw.Rig) -> Evidence:
    evidence = MomentumCheck(prepare(log, rig), momentum).evidence
    assert evidence is not None
    return evidence


def decay(rig: sw.Rig, seed: int = 1, amplitude: float = 1.4) -> sw.Recording:
    return sw.simulate(rig, duration=15.0, rate=500.0, initial_angle=amplitude, seed=seed)


def judged_of(evidence: Evidence, factor: float = 1.0) -> Judged:
    """Such that nothing but parts that disagree matters."""
    limits = dict.fromkeys(("angle", "gravity", "balance", "place", "timing", "whole"), np.inf)
    return Judged(evidence.law.inertia, evidence.law.a11, limits | {"alone": factor * evidence.law.total})


def period(evidence: Evidence) -> list[Finding] | None:
    """The finding of the row of the table."""
    return disagreeing("amplitude", "speed", "place")(evidence, judged_of(evidence))


def swept(power: float, seed: int = 0) -> tuple[sw.Recording, sw.Rig]:
    """A linear drive at 12 rad/s whose strokes grow from 0.2 to 0.8 m, and whose mass is M A^power."""
    time = np.arange(0.0, 20.0, 2e-3)
    size, slope, phase = 0.2 + 0.03 * time, 0.03, 12 * time
    angle = size * np.sin(phase)
    speed = slope * np.sin(phase) + 12 * size * np.cos(phase)
    acceleration = 24 * slope * np.cos(phase) - 144 * angle
    torque = INERTIA * size**power * acceleration + 2e-4 * speed
    noise = np.random.default_rng(seed).normal(0, 2e-3, len(time))
    rig = sw.Rig.from_text(
        'name = "swept"\n[axis]\nkind = "linear"\n[drive]\nkind = "direct"\n[sensors]\nnoise = 2e-3\n'
    )
    return sw.Recording(time=time, angle=angle + noise, torque=torque, drive_held=False), rig


def test_an_inertia_that_grows_with_the_swings_is_found_with_its_size() -> None:
    evidence = evidence_of(*swept(0.05))
    (one,) = trends(evidence.law, evidence.signals)
    assert one.name == "amplitude"
    sizes = evidence.signals.motion.swing_sizes / 2
    for found, share in ((one.first, 5 / 6), (one.second, 1 / 6)):
        assert found[0] == pytest.approx(INERTIA * np.quantile(sizes, share) ** 0.05, rel=3e-3)
    assert one.deviation > 5
    assert one.off == pytest.approx(one.difference / 2)
    (found,) = period(evidence) or ()
    assert "larger and smaller swings" in found.text


def test_differences_by_size_are_as_large_as_they_are_stated() -> None:
    found = [trends(one.law, one.signals)[0] for one in (evidence_of(*swept(0.0, seed)) for seed in range(12))]
    # χ² of 12 independent values: 0.4 to 1.7 at 99.9 %
    assert 0.4 < np.sqrt(np.mean([one.deviation**2 for one in found])) < 1.7


def test_it_is_said_also_where_it_does_not_matter_and_widens_the_interval_smoothly() -> None:
    found = [evidence_of(*swept(power)) for power in (0.0, 0.002, 0.005, 0.02, 0.05)]
    spreads = [unexplained(one.parts, one.law.u) for one in found]
    assert np.all(np.diff(spreads) > 0)
    assert spreads[0] < 0.2 * found[0].law.u
    evidence = found[-1]
    (one,) = trends(evidence.law, evidence.signals)
    assert 0.95 * abs(one.off) < spreads[-1] < 0.05 * INERTIA
    warned, noted = (check_hypotheses(evidence, judged_of(evidence, factor)) for factor in (1.0, 100.0))
    assert "period-disagrees" in [one.code for one in warned.warnings]
    assert "period-disagrees" in [one.code for one in noted.notes]
    assert not noted.warnings


@pytest.mark.parametrize("friction", FRICTIONS.values(), ids=FRICTIONS)
@pytest.mark.parametrize("seed", range(3))
def test_a_decay_as_its_rig_has_no_finding(friction: str, seed: int) -> None:
    rig = rig_of(friction)
    evidence = evidence_of(decay(rig, seed, 0.6 + 0.5 * seed), rig)
    assert period(evidence) == []


def test_a_spring_beside_gravity_is_of_the_balance_where_it_is_stated() -> None:
    true = rig_of(FRICTIONS["coulomb"], "stiffness = 0.02\n")
    evidence = evidence_of(decay(true), true)
    assert period(evidence) == []
    evidence = evidence_of(decay(true), rig_of(FRICTIONS["coulomb"]))
    (found,) = period(evidence) or ()
    assert abs(found.change) > 0.005 * INERTIA


def test_a_wrong_scale_of_the_angle_is_found() -> None:
    rig = rig_of(FRICTIONS["viscous"])
    log = decay(rig)
    evidence = evidence_of(replace(log, angle=1.03 * log.angle), rig)
    (found,) = period(evidence) or ()
    assert judged_of(evidence).matters(found.change, "alone")
    assert "scale" in found.text


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


def test_a_driven_log_has_no_loss_of_a_decay() -> None:
    assert loss_unexplained(evidence_of(*swept(0.0))) is None


def test_a_drag_of_0_is_none() -> None:
    rig = rig_of(FRICTIONS["viscous"] + "\ndrag = 0")
    assert not evidence_of(decay(rig), rig).law.equation.slots
