"""The Cramér–Rao bound against closed forms and against the scatter of maximum-likelihood estimates."""

from __future__ import annotations

import numpy as np
import pytest

from refusals import coded
from swingid.control.references import Sine
from swingid.errors import InputError, UnanswerableError
from swingid.identification import identify
from swingid.methods.output_error.bound import cramer_rao
from swingid.model.rig import Rig
from swingid.simulation import simulate

SIGMA = 1e-3
PAPER = Rig.builtin("paper").changed({"sensors.counts_per_turn": None, "sensors.noise": SIGMA})


def cart(**friction: float) -> Rig:
    """A mass of 2 kg under a known force, without gravity."""
    lines = "\n".join(f"{key} = {value}" for key, value in friction.items())
    return Rig.from_text(f"""
[axis]
kind = "linear"
inertia = 2.0
[axis.friction]
{lines}
[drive]
kind = "direct"
[sensors]
latency = 0
noise = {SIGMA}
[log]
time = "t"
angle = "x"
angle_unit = "m"
torque = "f"
""")


def test_a_mass_under_a_constant_force() -> None:
    """x = x0 + v0 t + F t²/(2 m) and F − c v: the scatter of a fit of m and c by their columns of sensitivity.

    With c = 0: dx/dm = −F t²/(2 m²), dx/dc = −(v0 t²/2 + F t³/(6 m))/m.
    """
    force, mass, rate = 3.0, 2.0, 100.0
    rig = cart(viscous=0.0)
    log = simulate(rig, duration=2.0, rate=rate, drive=np.full(201, force))
    t = log.time
    columns = np.column_stack([-force * t**2 / (2 * mass**2), -force * t**3 / (6 * mass**2), np.ones_like(t), t])
    expected = SIGMA * np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))
    found = cramer_rao(log, rig, "viscous", start=(0.0, 0.0))
    assert found["inertia"] == pytest.approx(expected[0], rel=1e-6)
    assert found["viscous"] == pytest.approx(expected[1], rel=1e-6)


def test_it_falls_with_noise_and_rises_with_unknowns() -> None:
    log = simulate(PAPER, Sine(0.8, 8.5), duration=5.0, seed=1)
    one = cramer_rao(log, PAPER, start=(0, 0, 0, 0))["inertia"]
    ten = cramer_rao(log, PAPER.changed({"sensors.noise": 10 * SIGMA}), start=(0, 0, 0, 0))["inertia"]
    assert ten == pytest.approx(10 * one, rel=1e-9)
    more = cramer_rao(log, PAPER, "coulomb + viscous", start=(0, 0, 0, 0))
    assert more["inertia"] > one
    free = cramer_rao(log, PAPER, free=("torque_per_volt", "motor_viscous"), start=(0, 0, 0, 0))
    assert free["inertia"] > one
    # the initial values matter little, and are found well enough in the noisy angles
    assert cramer_rao(log, PAPER)["inertia"] == pytest.approx(one, rel=0.05)


@pytest.mark.long
def test_output_error_scatters_as_the_bound_says() -> None:
    """Maximum likelihood of 24 noisy logs; momentum, which needs no motor constant, scatters more."""
    told = PAPER.changed({"axis.inertia": None, "axis.friction": None})
    errors, bounds = [], []
    for seed in range(24):
        log = simulate(PAPER, Sine(0.8, 8.5), duration=5.0, seed=seed)
        found = identify(log, told, "output-error", law="viscous", starts=1)
        errors.append((found.inertia.value - 302.2e-5, found.parameters["viscous"].value - 1.144e-3))
        bounds.append(cramer_rao(log, PAPER, start=(0, 0, 0, 0)))
    scatter = np.sqrt(np.mean(np.square(errors), axis=0))
    # 24 errors know their size to 1/sqrt(48); the log's beginning, which the method leaves out, costs a little
    assert scatter[0] / np.mean([b["inertia"] for b in bounds]) == pytest.approx(1.05, abs=3 / np.sqrt(48))
    assert scatter[1] / np.mean([b["viscous"] for b in bounds]) == pytest.approx(1.05, abs=3 / np.sqrt(48))


def test_what_is_not_identifiable_is_refused() -> None:
    log = simulate(PAPER, Sine(0.8, 8.5), duration=2.0)
    with pytest.raises(InputError, check=coded("missing-key", "sensors.noise")):
        cramer_rao(log, PAPER.changed({"sensors.noise": 0.0}))
    with pytest.raises(InputError, check=coded("missing-key", "axis.inertia")):
        cramer_rao(log, PAPER.changed({"axis.inertia": None}))
    still = simulate(PAPER, duration=1.0, drive=np.zeros(1001))
    with pytest.raises(UnanswerableError, check=coded("not-identifiable")):
        cramer_rao(still, PAPER, start=(0, 0, 0, 0))


def test_a_motor_on_the_axis_is_refused() -> None:
    text = '[axis]\ninertia = 3e-3\n[drive]\nkind = "motor"\n[drive.motor]\ntorque_per_volt = 0.1\n'
    with pytest.raises(UnanswerableError, check=coded("unknown-drive", "the bound")):
        cramer_rao(simulate(PAPER, duration=1.0, drive=np.zeros(1001)), Rig.from_text(text))
