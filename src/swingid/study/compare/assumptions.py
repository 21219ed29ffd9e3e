"""What each method takes for granted, so that a disagreement can be read."""

from __future__ import annotations

from dataclasses import dataclass

from swingid.methods.table import METHODS
from swingid.model.rig import Rig
from swingid.result.result import Result


@dataclass(frozen=True)
class Assumptions:
    """What a number rests on besides the angles.

    scale: what sets it, "wheel inertia", "torque" or "" (gravity alone). motor: the motor's constants and the
    voltage. gravity: the stated gravity torque b. friction: what is assumed of the friction of the axis. speed: where
    the method gets speeds from, "none" where it needs none.
    """

    scale: str
    motor: bool
    gravity: bool
    friction: str
    speed: str

    def words(self) -> str:
        """What the number rests on, in one phrase: 'wheel inertia, motor, b, friction basis'."""
        parts = [self.scale] if self.scale else []
        parts += ["motor"] if self.motor else []
        parts += ["b"] if self.gravity else []
        parts += [] if self.friction == "any" else [f"friction {self.friction}"]
        parts += [] if self.speed == "none" else [f"{self.speed} speeds"]
        return ", ".join(parts)


def assumptions(method: str, rig: Rig, result: Result) -> Assumptions:
    """Assumptions of `method` on this rig; a rig without a motor has none to rely on, nor b where it is 0 or sought."""
    needs = METHODS[method]
    motor = needs.motor != "unused"
    gravity = rig.axis.gravity_torque
    options = result.provenance.get("options")
    if isinstance(options, dict) and options.get("input") == "wheel":
        motor = False
    return Assumptions(
        scale={"reaction-wheel": "wheel inertia", "direct": "torque", "none": ""}[rig.drive.kind],
        motor=motor and rig.drive.kind == "reaction-wheel",
        gravity=not isinstance(gravity, str) and gravity.value != 0,
        friction=needs.friction,
        speed=needs.speeds,
    )
