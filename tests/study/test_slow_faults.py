"""Faults that change over the run: what they do to angle and torque, in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.study.faults.effects import Scene, running_in, zero_drift

TIME = np.linspace(0, 10, 1001)


def scene(**changes: object) -> Scene:
    rig = Rig.load("paper").changed(changes)
    return Scene(TIME, np.sin(TIME), 5 * np.cos(TIME), rig, 1, 0.9)


def test_a_zero_that_drifts_moves_in_proportion_to_the_time() -> None:
    exact = {"sensors.counts_per_turn": None}
    log = Recording(time=TIME, angle=np.sin(TIME))
    moved = zero_drift(log, scene(**exact), 2e-3).angle - log.angle
    assert moved == pytest.approx(2e-4 * TIME, abs=1e-12)


def test_an_encoder_that_drifts_stays_on_its_grid() -> None:
    own = scene()
    step = own.rig.sensors.of("angle").resolution
    log = Recording(time=TIME, angle=step * np.round(np.sin(TIME) / step))
    found = zero_drift(log, own, 5e-3).angle / step
    assert np.max(np.abs(found - np.round(found))) < 1e-6
    assert np.max(np.abs(step * found - np.sin(TIME) - 5e-4 * TIME)) <= step


def test_running_in_removes_its_share_of_the_dry_friction_at_the_end() -> None:
    own = scene(**{"axis.friction.coulomb": 3e-3})
    torque = running_in(replace(own, speed=np.full_like(TIME, 2.0)), 0.2)
    assert torque[0] == 0.0
    assert torque[-1] == pytest.approx(0.2 * 3e-3)
    assert torque[500] == pytest.approx(0.1 * 3e-3)


def test_running_in_gives_a_rig_without_dry_friction_some() -> None:
    own = scene()
    torque = running_in(replace(own, speed=np.full_like(TIME, 2.0)), 0.2)
    assert torque[[0, -1]] == pytest.approx(-0.01 * own.scale * np.array([1.0, 0.8]))
