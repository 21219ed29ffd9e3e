"""What jumps of an angle do to the inertia: each as a step of the zero of its encoder, which slipped or lost counts."""

from __future__ import annotations

import math

from swingid.balance.systematics import angle_weights
from swingid.checks.hypothesis import Evidence
from swingid.recording.continuity import find_jumps
from swingid.recording.findings import JUMPS


def jump_entry(evidence: Evidence) -> float:
    """Standard uncertainty of a11 by the jumps that were found when the log was read: all of what they do to it.

    Nobody knows on which side of a jump the angle is right: the larger effect of the two counts. 0 without jumps, and
    where not all that were reported are found in the part, for then this is not all that they do.
    """
    log, signals = evidence.part.log, evidence.signals
    start, stop = evidence.part.start, evidence.part.stop
    reported = [
        at for finding in log.findings if finding.source == JUMPS for at, _ in finding.spans if start <= at <= stop
    ]
    if not reported:
        return 0.0
    weights = angle_weights(evidence.law, signals)
    stamps, steps = signals.nodes.flat
    instants: list[float] = []
    effects: list[float] = []
    for angle, weight in zip((log.angle, log.wheel_angle), weights, strict=True):
        for row, size in find_jumps(log.time, angle) if angle is not None else ():
            after = stamps >= log.time[row]
            instants.append(float(log.time[row]))
            effects.append(size * max(abs(float((weight * steps)[side].sum())) for side in (after, ~after)))
    near = evidence.part.noise.step
    every = all(any(abs(at - instant) <= near for instant in instants) for at in reported)
    return math.hypot(*effects) if every else 0.0
