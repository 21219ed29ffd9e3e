"""`identify` in process on 25 s at 1 kHz, each method with all its checks, beside IDIM-LS on the same log."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import idim_ls
from case import Case, processor_time

import swingid as sw

ASKED = {"momentum": 1.0, "energy": 1.0, "equation-error": 3.0, "output-error": 10.0}
DURATION, RATE = 25.0, 1000.0


def cases() -> Iterator[Case]:
    """One case per method; the log is the paper's experiment on the twin, read from a file."""
    rig = sw.Rig.builtin("paper")
    stated = rig.changed({"axis.inertia": None, "axis.friction": None})
    run = sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=DURATION, rate=RATE, seed=1)
    with tempfile.TemporaryDirectory() as folder:
        log = sw.Recording.load(run.save(Path(folder) / "run.parquet", stated), stated)
    drive, motor = rig.drive, rig.drive.motor
    constants = (drive.wheel.inertia.value, motor.rotor_inertia.value, motor.gear_ratio.value)
    gravity = rig.axis.gravity_torque.value
    script = partial(idim_ls.inertia, log.time, log.angle, log.wheel_angle, *constants, gravity)
    error = script()[0] / rig.axis.inertia.value - 1.0
    assert abs(error) < 0.05, f"the reference errs by {error:.1%}"
    for method, asked in ASKED.items():
        ours = processor_time(partial(sw.identify, log, stated, method))
        yield Case(f"identify, {method}", "IDIM-LS with SciPy", ours, processor_time(script), asked)
