"""The paper's check with the balanced pendulum: the test body on the far side of the axis, b = 0, 0.8 sin 2t.

    python examples/balanced_pendulum.py [FOLDER]

Two logs of the twin, identified from their files and subtracted; then the other direction: a body of known inertia
corrects a wheel that is stated 1 % wrong. Logs and results (JSON) go to FOLDER, or to out/balanced_pendulum.
"""

from __future__ import annotations

import sys
from pathlib import Path

import swingid as sw

BODY = "96.1e-5 ± 0.1 % kg*m^2"
"""J_e of section 5, as if it were known to 0.1 %."""

# The body hangs opposite to the motor, as far from the axis: the pendulum is balanced.
PLAIN = sw.Rig.load("paper")
BALANCED = sw.Rig.load("paper-body").changed({"name": "paper-2020-balanced", "axis.gravity_torque": 0.0})


def identified(rig: sw.Rig, motion: str, path: Path, wheel: str) -> Path:
    """Simulate a run of `rig`, identify its log with the wheel as stated, write the result; returns its file."""
    controller = sw.Compensator.paper(rig)
    log = sw.simulate(rig, sw.parse_reference(motion), controller, duration=25, rate=1000)
    given = rig.changed({"axis.inertia": None, "axis.friction": None, "drive.wheel.inertia": wheel})
    result = sw.identify(sw.Recording.load(log.save(path, given), given), given)
    target = path.with_suffix(".json")
    target.write_text(result.to_json(), encoding="utf-8")
    return target


def both(folder: Path, wheel: str) -> tuple[Path, Path]:
    """Results without and with the body."""
    return (
        identified(PLAIN, "sine 0.8 rad 8.5 rad/s", folder / "plain.parquet", wheel),
        identified(BALANCED, "sine 0.8 rad 2 rad/s", folder / "balanced.parquet", wheel),
    )


def main() -> None:
    """Find the body's inertia, then the wheel's by the body."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/balanced_pendulum")
    folder.mkdir(parents=True, exist_ok=True)

    body = sw.difference(*both(folder, "113.4 ± 0.3 kg*mm^2"))
    print("the body, by difference (the paper: 102.9e-5, 7 % more than the 96.1e-5 known):")
    print(body.summary())

    print("\nwith a wheel that is stated 1 % too heavy, and the body as the scale:")
    corrected = sw.difference(*both(folder, "114.5 ± 0.3 kg*mm^2"), known=BODY)
    print(corrected.summary())


if __name__ == "__main__":
    main()
