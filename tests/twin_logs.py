"""Logs of the twin as a lab would have them: a file and a rig that says nothing of inertia or friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.recording.findings import notes_of
from swingid.recording.recording import Recording
from swingid.simulation import simulate

INERTIA = 302.2e-5
PAPER = Rig.builtin("paper")
GIVEN = PAPER.changed({"axis.inertia": None, "axis.friction": None})
"""What identification is told of the paper's rig."""

DRY = {"viscous": 5e-4, "coulomb": 3e-3}
LAWS = {
    "none": {},
    "viscous": {"viscous": 1.144e-3},
    "8 x viscous": {"viscous": 9.152e-3},
    "Coulomb": DRY,
    "Stribeck": {**DRY, "static": 5e-3, "stribeck_speed": 0.3},
    "sharp Stribeck": {**DRY, "static": 5e-3, "stribeck_speed": 0.05},
    "quadratic": {"viscous": 2e-4, "quadratic": 3e-4},
    "cubic": {"viscous": 2e-4, "cubic": 5e-5},
    "direction-dependent": {"viscous_positive": 1.716e-3, "viscous_negative": 0.572e-3},
    "LuGre, short bristles": {**DRY, "lugre": {"bristle_stiffness": 30.0, "bristle_damping": 1e-3}},
    "LuGre": {**DRY, "lugre": {"bristle_stiffness": 3.0, "bristle_damping": 1e-3}},
    "sticking": {"viscous": 5e-4, "coulomb": 15e-3, "static": 20e-3},
    "Stribeck and quadratic": {"coulomb": 2e-3, "static": 4e-3, "stribeck_speed": 0.3, "quadratic": 2e-4},
}
"""Every friction law of the rig file; "sticking" rests at its turning points."""


def twin(law: str = "viscous", **sensors: object) -> Rig:
    """The paper's rig with a friction law and other sensors."""
    friction = {"axis.friction": None} | {f"axis.friction.{key}": value for key, value in LAWS[law].items()}
    return PAPER.changed({**friction, **{f"sensors.{key}": value for key, value in sensors.items()}})


def given(rig: Rig) -> Rig:
    """The rig without what identification seeks."""
    return rig.changed({"axis.inertia": None, "axis.friction": None})


def logged(rig: Rig, folder, reference=None, *, duration=25.0, rate=1000.0, **options) -> Recording:
    """A closed-loop run with the gains of the paper's experiment, written to a file and read back."""
    controller = Compensator.paper(rig, sample_time=1 / rate)
    run = simulate(rig, reference or Sine(0.8, 8.5), controller, duration=duration, rate=rate, **options)
    return Recording.load(run.save(folder / "log.parquet", given(rig)), given(rig))


def without(log: Recording, repair: str) -> Recording:
    """The log as read with this repair switched off."""
    off = frozenset([repair])
    return replace(log, findings=(*log.findings, *notes_of(off)), repairs_off=log.repairs_off | off)


def result_of(rig: Rig, folder, reference=None, **options):
    """What momentum says of such a log."""
    return identify(logged(rig, folder, reference, **options), given(rig))


def error(result) -> float:
    """Relative error of the inertia."""
    return result.inertia.value / INERTIA - 1


def static_friction(law: str, speeds):
    """Friction torque of a law without memory at `speeds`."""
    found = {"coulomb": 0.0, "viscous": 0.0, "quadratic": 0.0, "cubic": 0.0, "stribeck_speed": 1.0, **LAWS[law]}
    dry = found["coulomb"] + (found.get("static", found["coulomb"]) - found["coulomb"]) * np.exp(
        -((speeds / found["stribeck_speed"]) ** 2)
    )
    return (
        np.sign(speeds) * dry
        + found["viscous"] * speeds
        + found["quadratic"] * speeds * np.abs(speeds)
        + found["cubic"] * speeds**3
    )
