"""The stage between a Recording and every method: what is corrected and excluded, once, and listed in the result.

Rows while a push acts are excluded, known errors of the encoders are corrected, the rig's constants checked; then the
part to use with its motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Correction, Encoders, corrected, on_stamps
from swingid.preparation.motion import Motion, find_motion
from swingid.preparation.noise import Noise, channel_noise
from swingid.preparation.push import push_decided
from swingid.preparation.rate import levelled
from swingid.preparation.scale import equation_of, refuse_motor, require_channels, require_drive
from swingid.preparation.segment import of_selected, part_of
from swingid.preparation.strings import VerticalMotion
from swingid.preparation.zero import centred
from swingid.recording.points import pivot_of
from swingid.recording.recording import Recording
from swingid.result.checked import Checked
from swingid.result.encoders import encoders_cost
from swingid.result.provenance import add_findings, defaults_taken, provenance
from swingid.result.result import Details, Message, Result
from swingid.uncertainty.budget import Evaluated
from swingid.units import Quantity


@dataclass(frozen=True)
class Part:
    """The rows that a method uses and their motion; noise of one sample; rig and scale as in `Prepared`.

    start, stop: as chosen (s), at most a row beyond the first and last row; note: how. encoders: latencies that are
    still to be corrected in `log`, and declared uncertainties.
    """

    rig: Rig
    equation: Equation
    log: Recording
    motion: Motion
    start: float
    stop: float
    note: Message
    noise: Noise
    encoders: Encoders

    @property
    def longest_gap(self) -> float:
        """Time between rows (s) that is no gap yet: a few rows, or a twentieth of a swing."""
        several = len(self.motion.turning_times) > 1
        return max(4.5 * self.noise.step, 0.05 * (self.motion.half_period if several else self.stop - self.start))


@dataclass(frozen=True)
class Prepared:
    """A log as methods read it: encoders corrected as in `corrections`, rows of pushes excluded, at its own stamps.

    one_of_several: whether other logs of the same body may determine what this one does not.
    """

    log: Recording
    rig: Rig
    equation: Equation
    encoders: Encoders
    corrections: tuple[Correction, ...]
    one_of_several: bool = False

    @cached_property
    def noise(self) -> Noise:
        """Noise and grid of the channels."""
        return channel_noise(self.log, self.rig)

    @cached_property
    def _motions(self) -> list[tuple[Array, Array, float, Motion]]:
        return []

    def _motion(self, log: Recording, noise: float) -> Motion:
        """See `find_motion`; found once for the same angles and noise."""
        for time, angle, level, motion in self._motions:
            if time is log.time and angle is log.angle and level == noise:
                return motion
        motion = find_motion(log.time, log.angle, noise)
        self._motions.append((log.time, log.angle, noise, motion))
        return motion

    def part(
        self,
        *,
        whole: bool = False,
        few: bool = False,
        reread: bool = False,
        at_stamps: bool = False,
        noise: Noise | None = None,
    ) -> Part:
        """The part to use: the steady motion of a driven axis, or the free decay.

        whole: all of the log instead, few: also with too few turning points to choose a part. reread: turning points
        read off narrow cubics. at_stamps: latencies are corrected in the angles, for methods that use them beside the
        drive. noise: another than that of the channels. Raises UnanswerableError without motion or with too few
        turning points.
        """
        noise = noise or self.noise
        log = on_stamps(self.log, self.encoders) if at_stamps else self.log
        full_motion = self._motion(log, noise.angle)
        if not few:
            start, stop, note = part_of(log, full_motion, self.rig.drive.channel)
        if whole:
            start, stop = float(log.time[0]), float(log.time[-1])
            note = Message("segment", f"used the whole log from {start:.4g} to {stop:.4g} s.")
        used = log.segment(start, stop)
        motion = full_motion.within(float(used.time[0]), float(used.time[-1]))
        if reread and len(motion.turning_times):
            motion = motion.reread(log.time, log.angle, full_motion.speed.half_width)
        encoders = self.encoders.on_time() if at_stamps else self.encoders
        return Part(self.rig, self.equation, used, motion, start, stop, note, noise, encoders)

    def relevelled(self, amounts: Mapping[str, float]) -> Prepared:
        """The same with these amounts of what is unknown of an integrated rate subtracted from the angle, too."""
        assert self.encoders.level is not None
        log, level = self.encoders.level.less(self.log, amounts)
        return replace(self, log=log, encoders=replace(self.encoders, level=level))

    def result(
        self,
        method: str,
        evaluated: Evaluated,
        part: Part,
        checked: Checked,
        details: Details,
        options: dict[str, object] | None = None,
        *,
        corrections: tuple[Correction, ...] = (),
        more: dict[str, object] | None = None,
        covariance: dict[str, dict[str, float]] | None = None,
    ) -> Result:
        """The result of a method on this log, with the findings of its reading and the corrections of its preparation.

        corrections: by the method; more: of its provenance; covariance: of type A, where logs share unknowns.
        """
        cost = encoders_cost(self.rig, evaluated.budget, evaluated.parameters)
        warnings, notes = [*checked.warnings], [part.note, *checked.notes, *defaults_taken(self.rig), *cost]
        identified = evaluated.parameters.get("suspension_stiffness")
        kappa = None if identified is None else identified.value
        rises = VerticalMotion.of(self.rig, kappa, part.motion.turning_angles)
        if rises is not None:
            notes.append(rises.note(evaluated.parameters["inertia"].value))
            evaluated = rises.counted(evaluated)
        log = self.log
        off = of_selected(log, self._motion(log, part.noise.angle), self.rig.drive.channel) if log.selected else None
        log = replace(log, findings=(*log.findings, off)) if off else log
        add_findings(log, warnings, notes, used=(part.start, part.stop), budget=evaluated.budget)
        decided = {
            "corrections": [correction.as_dict() for correction in (*self.corrections, *corrections)],
            "part": [part.start, part.stop],
            "noise": {"angle": part.noise.angle, "wheel": part.noise.wheel if self.equation.value("wheel") else None},
        }
        return Result(
            method=method,
            status="warning" if warnings else "ok",
            parameters=evaluated.parameters,
            warnings=tuple(warnings),
            notes=tuple(notes),
            budget=tuple(evaluated.budget),
            provenance=provenance(self.log, self.rig, options) | {"preparation": decided} | (more or {}),
            details=replace(details, left_out=self.log.left_out, checks=checked.ran),
            sensitivities=evaluated.sensitivities,
            covariance_of_fit=covariance or {},
            correlation=evaluated.correlation,
        )


def prepare(
    log: Recording,
    rig: Rig,
    *,
    one_of_several: bool = False,
    together: bool = False,
    scaled_elsewhere: bool = False,
) -> Prepared:
    """Decide what is corrected in a log and excluded from it, and do it.

    together: for one fit to several logs, which may have a motor on the axis; scaled_elsewhere: see `equation_of`.
    Raises InputError where the log lacks what the rig's drive needs, or that cannot have done the motion;
    UnanswerableError without a scale reference.
    """
    if not together:
        refuse_motor(rig, "this method")
    rig = as_recorded(rig, log)
    log, encoders, corrections = corrected(log, rig)
    log, level = levelled(log, rig)
    encoders = replace(encoders, level=level)
    log, pushes = push_decided(log, rig)
    equation = equation_of(rig, elsewhere=scaled_elsewhere)
    require_channels(log, rig)
    require_drive(log, rig)
    log, zero = centred(log, rig) if level is None else (log, ())
    return Prepared(log, rig, equation, encoders, (*corrections, *pushes, *zero), one_of_several)


def as_recorded(rig: Rig, log: Recording) -> Rig:
    """The rig whose clock, zero of the angle and pivot are as uncertain as the findings of the log say."""
    keys: dict[str, Quantity] = {}
    for key, attribute in (("clock", "of_time"), ("angle_offset", "of_zero")):
        u = max((getattr(finding, attribute) for finding in log.findings), default=0.0)
        if u:
            stated: Quantity = getattr(rig.log, key)
            keys[key] = replace(stated, std=math.hypot(stated.std or 0.0, u))
    rig = rig.model_copy(update={"log": rig.log.model_copy(update=keys)}) if keys else rig
    pivot = pivot_of(log.findings)
    return rig if pivot is None else rig.model_copy(update={"sensors": rig.sensors.with_pivot(*pivot)})
