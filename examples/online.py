"""One estimate of the inertia per swing, from a stream of rows.

    python examples/online.py [LOG RIG]

Without arguments the twin of the paper's rig makes the log. Rows go in one by one, as they would come from a rig.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import swingid as sw


def rows(log: sw.Recording) -> Iterator[tuple[float | None, ...]]:
    """The rows of a log as a device would give them: time, angle, wheel angle, voltage or torque."""
    drive = log.torque if log.voltage is None else log.voltage
    for k, time in enumerate(log.time):
        wheel = None if log.wheel_angle is None else float(log.wheel_angle[k])
        yield float(time), float(log.angle[k]), wheel, None if drive is None else float(drive[k])


def twin() -> tuple[sw.Recording, sw.Rig]:
    """Twenty seconds of the paper's motion with Stribeck friction, and a rig that does not state it."""
    rig = sw.Rig.load("paper")
    friction = {"axis.friction.coulomb": 2e-3, "axis.friction.static": 4e-3, "axis.friction.stribeck_speed": 0.3}
    plant = rig.changed(friction)
    controller = sw.Compensator.paper(plant, sample_time=1e-3)
    log = sw.simulate(
        plant, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), controller, duration=20.0, rate=1000.0, seed=1
    )
    return log, rig


def main(arguments: list[str]) -> None:
    """Print an estimate per swing."""
    if arguments:
        path, rig_name = arguments
        rig = sw.Rig.load(rig_name)
        log = sw.Recording.load(path, rig)
    else:
        log, rig = twin()
    for estimate in sw.online(rows(log), rig):
        print(estimate)


if __name__ == "__main__":
    main(sys.argv[1:])
