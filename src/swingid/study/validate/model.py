"""The model that a result stands for: the rig's constants with the identified inertia, gravity torque and friction."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from swingid.balance.friction_laws import friction_units
from swingid.errors import InputError, UnanswerableError
from swingid.methods.output_error.problem import Input
from swingid.model.parameters import constants, vector
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.recording.recording import Recording
from swingid.result.result import Result


def model_vector(result: Result, rig: Rig) -> Array:
    """Parameter vector of `rig` with what `result` found in the place of axis.inertia, friction and unknown gravity.

    Constants that the fit moved within what rig.toml states (output error) are where it found them.

    Raises InputError for a refused result, and for one of the other kind of axis.
    """
    if "inertia" not in result.parameters:
        raise InputError("the result has no inertia: it was refused; give one with a number.", code="refused-result")
    linear = rig.axis.kind == "linear"
    if (result.inertia.unit == "kg") != linear:
        kind = "linear" if linear else "rotary"
        raise InputError(
            f"the result is in {result.inertia.unit}, but rig {rig.name} is {kind}; give the rig of the result.",
            code="other-axis",
        )
    found = {name: parameter.value for name, parameter in result.parameters.items()}
    changes: dict[str, object] = {"axis.inertia": found["inertia"], "axis.friction": None}
    if "gravity_torque" in found:
        changes["axis.gravity_torque"] = found["gravity_torque"]
    values = {key: quantity.value for key, quantity in constants(rig.changed(changes)).items()}
    moved = result.provenance.get("constants_found")
    if isinstance(moved, dict):
        values |= {key: float(value) for key, value in moved.items() if key in values}
    # what a fit finds may lie a little outside what a rig file may state, such as a Coulomb friction below 0
    values |= {f"axis.friction.{name}": found[name] for name in friction_units(linear) if name in found}
    return vector(values, rig.drive.kind)


def with_found_gain(log: Recording, result: Result, rig: Rig) -> Recording:
    """The log with its torque by the gain that the fit found, where it moved log.torque_gain."""
    moved = result.provenance.get("constants_found")
    if log.torque is None or not isinstance(moved, dict) or "log.torque_gain" not in moved:
        return log
    return replace(log, torque=log.torque * (float(moved["log.torque_gain"]) / rig.log.torque_gain.value))


def drive_of(log: Recording, rig: Rig, wanted: Literal["voltage", "wheel"] | None) -> Input:
    """What drives the prediction: the measured wheel unless the voltage is wanted, the torque, or nothing."""
    if rig.drive.kind != "reaction-wheel":
        return "torque" if rig.drive.kind == "direct" else "none"
    if wanted == "voltage":
        motor = rig.drive.motor
        if log.voltage is None or motor is None or motor.torque_per_volt.value <= 0:
            raise UnanswerableError(
                "a prediction from the voltage needs the log's voltage and drive.motor.torque_per_volt; take the wheel "
                "as input.",
                code="no-motor-constants",
            )
        return "voltage"
    return "wheel"
