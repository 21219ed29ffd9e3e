"""Equation (I) as coefficients and the errors of them and of the channels, against the rig changed by each constant.

The derivative that a coefficient states by a constant is compared with that of the coefficient of a changed rig, and
the effect of an error of a channel on the rows with the rows of a log that has this error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import swingid as sw
from swingid.balance.energies import of_energy
from swingid.balance.errors import channel_errors, constant_error, errors_of
from swingid.balance.fits import BASIS, columns_of, fit_rows, known_side
from swingid.balance.perturbations import SHAPES, Perturbation, of_channels, of_constants
from swingid.balance.rows import Rows, Signals, rows_of
from swingid.balance.windows import law_windows
from swingid.model.equation import SOUGHT, Coefficient, Equation
from swingid.model.rig import Rig
from swingid.preparation.encoders import Encoders
from swingid.preparation.motion import find_motion
from swingid.preparation.noise import Noise

WHEEL = {
    "axis.gravity_torque": "78 ± 0.2 mN*m",
    "drive.wheel.inertia": "113.4 ± 0.3 kg*mm^2",
    "drive.motor.rotor_inertia": "2.1e-6 ± 1e-8 kg*m^2",
    "drive.motor.gear_ratio": "4.4 ± 0.01",
    "axis.stiffness": "4 ± 0.1 mN*m/rad",
    "axis.spring_zero": "0.1 ± 0.02 rad",
}
DIRECT = """
[axis]
gravity_torque = "78 ± 0.2 mN*m"
[drive]
kind = "direct"
[log]
torque = "tau"
torque_gain = "2 ± 0.01"
"""
MOTOR = """
[axis]
gravity_torque = "78 ± 0.2 mN*m"
[drive]
kind = "motor"
[drive.motor]
rotor_inertia = "2e-6 ± 1e-8 kg*m^2"
gear_ratio = "5 ± 0.01"
torque_per_volt = "5.2e-3 ± 1e-5 N*m/V"
back_emf = "4e-6 ± 1e-8 N*m*s"
"""


def rigs() -> dict[str, Rig]:
    """A rig of each drive, its constants stated with uncertainties."""
    return {
        "wheel": sw.Rig.builtin("paper").changed(WHEEL),
        "direct": sw.Rig.from_text(DIRECT, "direct.toml"),
        "motor": sw.Rig.from_text(MOTOR, "motor.toml"),
        "free": sw.Rig.from_text('[axis]\ngravity_torque = "78 ± 0.2 mN*m"\n[drive]\nkind = "none"\n', "free.toml"),
    }


def moved(rig: Rig, key: str, step: float) -> Rig:
    """The rig with one constant larger by `step`."""
    found: object = rig
    for part in key.split("."):
        found = getattr(found, part)
    return rig.changed({key: found.value + step})


def energies(rig: Rig) -> Equation:
    return of_energy(rig, Equation.of(rig))


@pytest.mark.parametrize(
    ("drive", "of"),
    [*((drive, Equation.of) for drive in ("wheel", "direct", "motor", "free")), ("wheel", energies)],
)
def test_coefficients_state_their_derivatives_by_the_constants(drive: str, of: Callable[[Rig], Equation]) -> None:
    rig = rigs()[drive]
    equation = of(rig)
    keys = [one.key for one in equation.constants if not one.deviation]
    assert keys
    for key in keys:
        slopes, step = equation.slopes(key), 1e-6
        up, down = (of(moved(rig, key, sign * step)) for sign in (1.0, -1.0))
        for name, value in equation.stated.items():
            if name in ("torque", "stiffness'"):
                continue  # the column, not the coefficient, changes with the gain and with the spring's zero
            numeric = (up.value(name) - down.value(name)) / (2 * step)
            assert slopes.get(name, 0.0) == pytest.approx(numeric, rel=1e-7, abs=1e-12), (key, name, value)
        carried = (up.carried - down.carried) / (2 * step)
        assert equation.beside.sources.get(key, 0.0) == pytest.approx(carried, rel=1e-7, abs=1e-12), key


def test_a_tilt_and_the_clock_are_relative_changes_of_gravity_and_spring() -> None:
    equation = Equation.of(rigs()["wheel"])
    b, k = equation.value("gravity_torque"), equation.value("stiffness")
    assert equation.slopes("axis.tilt") == pytest.approx({"gravity_torque": b})
    assert equation.slopes("log.clock") == pytest.approx({"gravity_torque": -2 * b, "stiffness": -2 * k})
    assert equation.slopes("drive.wheel.tilt") == pytest.approx({"wheel": equation.value("wheel")})


def test_the_clock_and_the_scale_of_the_voltage_change_the_motor_of_the_energies() -> None:
    equation = energies(rigs()["wheel"].changed({"log.voltage_scale": "1 ± 0.01"}))
    volts, emf = equation.value("torque_per_volt"), equation.value("back_emf")
    clock = {"torque_per_volt": -2 * volts, "back_emf": -emf, "motor_coulomb": -2 * equation.value("motor_coulomb")}
    clock |= {"motor_viscous": -equation.value("motor_viscous")}
    assert {name: equation.slopes("log.clock")[name] for name in clock} == pytest.approx(clock)
    assert equation.slopes("log.voltage_scale") == pytest.approx({"torque_per_volt": volts})


def test_what_is_unknown_is_sought_and_has_no_sources() -> None:
    rig = rigs()["wheel"].changed(
        {"axis.gravity_torque": "unknown", "axis.stiffness": "unknown", "axis.spring_zero": 0.1}
    )
    equation = Equation.of(rig)
    assert equation.sought == ("inertia", "gravity_torque", "stiffness")
    assert equation.seeks("gravity_torque")
    assert not equation.slopes("log.clock")
    freed = Equation.of(rigs()["wheel"]).but(gravity_torque=SOUGHT, body=Coefficient(1e-3, {"body": 1.0}))
    assert freed.sought == ("inertia", "gravity_torque")
    assert freed.value("body") == 1e-3
    assert freed.without({"body"}).value("body") == 0.0


def swung(rig: Rig) -> sw.Recording:
    """A driven motion without noise."""
    twin = rig.changed({"axis.inertia": 3.022e-3, "axis.friction.viscous": 1e-3})
    return sw.simulate(twin, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=6.0)


def signals_of(log: sw.Recording, rig: Rig) -> Signals:
    motion = find_motion(log.time, log.angle, 1e-9)
    return Signals.of(log, rig, motion, Encoders.of(rig))


def rows_on(signals: Signals) -> Rows:
    return rows_of(signals, law_windows(signals, 0.3))


def test_the_effect_of_a_constant_is_the_change_of_the_known_side() -> None:
    rig = rigs()["wheel"]
    rows = rows_on(signals_of(swung(rig), rig))
    equation = Equation.of(rig)
    for one in of_constants(equation):
        if not one.constant or one.source == "axis.spring_zero":
            continue
        step = 1e-7
        change = known_side(rows, Equation.of(moved(rig, one.source, step))) - known_side(rows, equation)
        error = constant_error(rows, equation, one)
        assert error.rows == pytest.approx(change / step, rel=1e-5, abs=1e-6 * np.max(np.abs(error.rows)) + 1e-12)


@pytest.mark.parametrize("shape", ["cosine", "sine", "scale", "offset"])
@pytest.mark.parametrize("channel", ["angle", "wheel"])
def test_the_effect_of_an_error_of_a_channel_is_that_of_a_log_which_has_it(channel: str, shape: str) -> None:
    """ρ = −Σ c ∫φ ∂f/∂channel s: the balance, with the true coefficients, of the log with the error less without it."""
    rig = rigs()["wheel"].changed({"axis.gravity_torque": "78 mN*m"})
    log, size = swung(rig), 1e-5
    name = "angle" if channel == "angle" else "wheel_angle"
    values = getattr(log, name)
    other = replace(log, **{name: values + size * SHAPES[shape](values)})
    signals, equation = signals_of(log, rig), Equation.of(rig)
    rows = rows_on(signals)
    coefficients = equation.stated | {"inertia": 3.022e-3 + equation.carried}
    after = rows_of(replace(signals_of(other, rig), motion=signals.motion), rows.windows)
    found = channel_errors(rows, signals, [Perturbation("error", size, None, channel, shape)], coefficients)[0].rows  # type: ignore[arg-type]
    change = (rows.sum_of(coefficients) - after.sum_of(coefficients)) / size
    assert found == pytest.approx(change, abs=2e-3 * np.max(np.abs(change)) + 1e-10)


def test_what_is_stated_comes_in_one_order_and_without_what_is_exact() -> None:
    rig = rigs()["wheel"].changed({"sensors.nonlinearity": "0.1 deg", "log.clock": "0 ± 1e-4"})
    log = swung(rig)
    signals, equation = signals_of(log, rig), Equation.of(rig)
    rows = rows_on(signals)
    fit = fit_rows(rows, equation, Noise(1e-6, 1e-6, 1e-3), BASIS)
    assert fit is not None
    errors = errors_of(rows, signals, rig, equation, fit.coefficients)
    sources = [error.source for error in errors]
    assert all(error.std > 0 for error in errors)
    assert sources[: len(sources) - len(of_channels(rig, signals.encoders))] == [
        one.key for one in equation.constants if one.std > 0
    ]
    assert [error.of.shape for error in errors if error.of.channel == "angle"][:2] == ["cosine", "sine"]
    unknowns, columns = columns_of(rows, equation, BASIS)
    assert unknowns == ("inertia", *BASIS)
    assert columns.shape == (len(rows), len(unknowns))
