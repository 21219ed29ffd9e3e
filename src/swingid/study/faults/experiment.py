"""An experiment on the twin with faults: torques from outside in the run, columns changed, a rig file that is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import UnanswerableError
from swingid.recording.conventions import Conventions
from swingid.recording.recording import CHANNELS, Recording
from swingid.simulation.twin import Run, run_of
from swingid.study.changes import changed
from swingid.study.experiment import Experiment
from swingid.study.faults.effects import Scene

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.study.faults.registry import Drawn

MOST_RUNS = 40
"""Runs after which a torque that depends on the motion must have settled."""

SETTLED, BOUND = 1e-4, 1e-2
"""Change of a torque from run to run over its largest value: from which on it is taken, and beyond which it never is.

The first is below what matters beside the fault itself; the rounding of encoders in the loop may keep it from being
reached."""


@dataclass(frozen=True)
class FaultyExperiment(Experiment):
    """An experiment with `faults`, which `twin` and `stated` have already; the log is written by the rig `written`."""

    faults: tuple[Drawn, ...] = ()
    written: Rig | None = None

    def log(self, seed: int) -> Recording:
        """The log in the model's conventions. Raises UnanswerableError for a fault that this rig cannot have."""
        for drawn in self.faults:
            if self.twin.drive.kind not in drawn.fault.drives:
                what = f"a rig with drive.kind = {self.twin.drive.kind!r} cannot have the fault {drawn.name!r}"
                raise UnanswerableError(f"{what}; leave it out", code="no-such-fault")
        run, scene = self._run(seed)
        log = run.recording
        for drawn in self.faults:
            if drawn.fault.columns is not None:
                log = drawn.fault.columns(log, scene, drawn.severity)
        return log

    def read(self, log: Recording) -> Recording:
        """The columns that the rig `written` logs, without metadata, as the rig file `stated` has them read."""
        assert self.written is not None
        channels = {name: values for name in CHANNELS if (values := getattr(log, name)) is not None}
        channels.pop("adaptive_gain", None)
        conventions = Conventions.of(self.written)
        if conventions.wheel == "wheel_speed" and log.wheel_angle is not None:
            channels["wheel_speed"] = conventions.speed_of(log.time, log.wheel_angle, log.angle)
        return Recording.from_columns(conventions.to_log(channels), self.stated)

    def _run(self, seed: int) -> tuple[Run, Scene]:
        """The run under the torques of the faults, found by repeating it with the torques of the motion before."""
        setup = self.setup(seed)
        run = run_of(setup)
        true = run.truth
        scene = Scene(true.time, true.angle, true.speed, self.twin, seed, float(np.quantile(true.angle, 0.95)))
        torques = [(d.fault.torque, d.severity) for d in self.faults if d.fault.torque is not None]
        held, change = np.zeros(len(true.time)), 0.0
        for _ in range(MOST_RUNS if torques else 0):
            total = sum((torque(scene, severity) for torque, severity in torques), np.zeros(len(held)))
            before, held = held, np.append((total[1:] + total[:-1]) / 2, total[-1:])  # held from row to row
            change = float(np.max(np.abs(held - before)) / max(float(np.max(np.abs(held))), 1e-300))
            if change < SETTLED:
                break
            run = run_of(replace(setup, push=held))
            scene = replace(scene, angle=run.truth.angle, speed=run.truth.speed)
        if not change < BOUND:
            names = ", ".join(str(drawn) for drawn in self.faults)
            raise UnanswerableError(f"the motion under {names} was not found; take a milder grade", code="not-settled")
        return run, scene


def with_faults(experiment: Experiment, faults: Sequence[Drawn]) -> FaultyExperiment:
    """The same experiment with faults: those of constants and conventions put into the twin and the rig file.

    A fault that the rig cannot have is found out by `FaultyExperiment.log`. Raises InputError where a rig file with
    the faults is none.
    """
    twin, written = experiment.twin, experiment.stated
    possible = [(d.fault, d.severity) for d in faults if twin.drive.kind in d.fault.drives]
    for fault, severity in possible:
        twin = changed(twin, fault.twin(twin, severity)) if fault.twin else twin
        written = changed(written, fault.written(written, severity)) if fault.written else written
    stated = written
    for fault, severity in possible:
        stated = changed(stated, fault.stated(stated, severity)) if fault.stated else stated
    given = {field.name: getattr(experiment, field.name) for field in fields(Experiment)}
    return FaultyExperiment(**given | {"twin": twin, "stated": stated}, faults=tuple(faults), written=written)
