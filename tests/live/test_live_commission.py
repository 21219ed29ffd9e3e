"""`swingid commission` on twins whose wiring is known."""

from __future__ import annotations

import json
import tomllib
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from live_host import RIG
from long_cases import long, quick_first, quick_if
from swingid.cli import main
from swingid.errors import SwingidError
from swingid.live.codes import FaultCode
from swingid.live.commission import Commissioning, commission
from swingid.live.devices.twin import TwinDevice
from swingid.live.guard import Guard, Readings
from swingid.live.plant import Plant, board_of
from swingid.live.session import Session
from swingid.model.parameters import A11, rig_vector
from swingid.model.rig import Rig


class Wired(Plant):
    """A twin behind other wires: signs, counts per turn of what its encoders make over what the device says, zero."""

    def __init__(
        self,
        rig: Rig = RIG,
        *,
        axis: float = 1.0,
        wheel: float = 1.0,
        voltage: float = 1.0,
        zero: int = 0,
        **options: Any,
    ) -> None:
        super().__init__(rig, **options)
        self._axis, self._wheel, self._voltage, self._zero = axis, wheel, voltage, zero

    def read(self) -> Readings:
        found = super().read()
        wrapped = (round(self._axis * found.axis) + self._zero + 2**31) % 2**32 - 2**31
        return Readings(wrapped, round(self._wheel * found.wheel))

    def hold(self, voltage: float) -> None:
        super().hold(self._voltage * voltage)


def session_of(plant: Plant) -> Session:
    return Session(TwinDevice(plant, board_of(plant.rig)))


def found_on(plant: Plant, rig: Rig | None = None, wait: float = 30.0) -> Commissioning:
    with session_of(plant) as session:
        return commission(session, rig or plant.rig, wait=wait)


def refused(plant: Plant, rig: Rig | None = None) -> SwingidError:
    with pytest.raises(SwingidError) as error:
        found_on(plant, rig, wait=0.0)
    assert error.value.message.count("\n") == 0
    return error.value


@pytest.mark.parametrize(
    ("axis", "wheel", "voltage"),
    quick_if(lambda signs: sum(signs) in (1, -3), product([1, -1], repeat=3)),  # each wire alone, and all of them
)
def test_every_wiring_is_found(axis: int, wheel: int, voltage: int) -> None:
    """The axis' direction is a choice, +1 where the file states none: the others are found relative to it."""
    found = found_on(Wired(axis=axis, wheel=wheel, voltage=voltage))
    assert (found.axis_sign, found.wheel_sign, found.voltage_sign) == (1, axis * wheel, axis * voltage)


@pytest.mark.long
def test_a_body_that_swings_is_waited_for() -> None:
    assert found_on(Wired(initial_angle=0.05)).wheel_sign == 1


def test_the_axis_direction_of_the_file_is_kept() -> None:
    found = found_on(Wired(wheel=-1), RIG.changed({"device.axis_sign": -1}))
    assert (found.axis_sign, found.wheel_sign, found.voltage_sign) == (-1, 1, -1)


@pytest.mark.parametrize("name", quick_first(1, ["paper", "paper-body"]))
def test_counts_and_inertia_are_within_their_uncertainty(name: str) -> None:
    rig = Rig.load(name)
    found = found_on(Wired(rig))
    assert found.ratio is not None
    assert found.inertia is not None
    assert abs(found.ratio[0] - 1.0) < 3 * found.ratio[1] < 0.05
    assert abs(found.inertia[0] - rig_vector(rig)[A11]) < 3 * found.inertia[1] < 0.02 * found.inertia[0]
    assert (found.delay, found.warnings) == (pytest.approx(0.0, abs=3e-4), ())


@pytest.mark.parametrize(("stated", "made"), quick_first(2, [(1.0, 0.5), (1.0, 4.4), (1.0, 2.0), (1.0, 4.0)]))
def test_a_wheel_with_other_counts_is_refused_with_the_factor(stated: float, made: float) -> None:
    """An encoder that makes `made` times the counts that the device says."""
    error = refused(Wired(wheel=made / stated))
    assert (error.code, error.exit_code) == ("wrong-counts", 3)
    said = float(error.message.partition("turns ")[2].lstrip("(").split(" ±")[0])
    scale = 10.0 ** int(error.message.partition(")e")[2].split()[0]) if ")e" in error.message else 1.0
    assert said * scale == pytest.approx(stated / made, rel=0.03)


def test_a_small_deviation_of_the_counts_is_a_warning() -> None:
    found = found_on(Wired(wheel=0.87))
    assert found.ratio is not None
    assert found.ratio[0] == pytest.approx(1 / 0.87, rel=0.03)
    assert "check counts per turn" in found.warnings[0]


def test_without_gravity_torque_signs_are_found_and_counts_are_not() -> None:
    unknown = RIG.changed({"axis.gravity_torque": "unknown"})
    found = found_on(Wired(wheel=-2.0), unknown)
    assert (found.wheel_sign, found.voltage_sign, found.ratio, found.inertia) == (-1, 1, None, None)


def test_zero_is_found_also_where_counts_wrap() -> None:
    found = found_on(Wired(zero=2**31 - 100))
    assert found.axis.zero == pytest.approx(2**31 - 100, abs=1)
    assert found.wheel_sign == 1
    assert found_on(Wired(zero=5000, axis=-1)).axis.zero == pytest.approx(5000, abs=1)


def test_noise_is_that_of_the_encoder() -> None:
    rig = RIG.changed({"sensors.noise": 2e-3, "sensors.wheel.noise": 0.0})
    found = found_on(Wired(rig, seed=3), RIG)
    assert found.axis.noise == pytest.approx(2e-3, rel=0.1)
    assert found.wheel.noise == pytest.approx(0.0, abs=1e-5)
    assert found.values(RIG, "x")["sensors.noise"] == pytest.approx(found.axis.noise, rel=1e-2)
    assert "sensors.wheel.noise" not in found.values(RIG, "x")


def test_delay_is_that_of_the_encoder() -> None:
    rig = RIG.changed({"sensors.latency": "-5 ms"})
    found = found_on(Wired(rig), RIG)
    assert found.delay == pytest.approx(5e-3, abs=3e-4)
    assert "5.0 ms after the voltage" in found.warnings[0]


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        ({"initial_angle": 0.05}, "not-still", "must hang still"),
        ({"voltage": 0.0}, "no-motion", "neither wheel nor body moves"),
        long(({"wheel": 0.0}, "no-motion", "the wheel's counts do not")),
        long(({"axis": 0.0}, "no-motion", "the body's counts do not")),
    ],
)
def test_what_is_refused_on_the_rig(options: dict[str, float], code: str, words: str) -> None:
    error = refused(Wired(**options))
    assert (error.code, error.exit_code) == (code, 5)
    assert words in error.message


@pytest.mark.parametrize(
    ("values", "code", "words"),
    [
        ({"device.wheel_sign": -1}, "wrong-sign", "device.wheel_sign is -1 and the pulses show +1"),
        ({"device.voltage_sign": -1}, "wrong-sign", "device.voltage_sign is -1 and the pulses show +1"),
        (
            {"sensors.counts_per_turn": 4096},
            "wrong-counts",
            "of the axis in [sensors] is 4096 and the device says 16384",
        ),
        (
            {"sensors.wheel.counts_per_turn": 4096},
            "wrong-counts",
            "of the wheel in [sensors] is 4096 and the device says 16384",
        ),
        ({"drive.motor.voltage_limit": 24}, "wrong-limit", "lower it to that"),
    ],
)
def test_a_rig_file_that_the_device_contradicts(values: dict[str, object], code: str, words: str) -> None:
    error = refused(Wired(), RIG.changed(values))
    assert (error.code, error.exit_code) == (code, 3)
    assert words in error.message


def test_other_drives_are_not_offered() -> None:
    text = 'name = "x"\n[axis]\ngravity_torque = 0.1\n[drive]\nkind = "none"\n'
    assert refused(Wired(), Rig.from_text(text)).code == "not-offered"


def test_the_guard_is_in_force_during_the_pulses() -> None:
    """A rig file's limit of the wheel's speed below what the pulse makes ends it at 0 V."""
    with session_of(Wired()) as session, pytest.raises(SwingidError) as error:
        commission(session, RIG.changed({"device.wheel_speed_limit": 1.0}))
    assert error.value.code == "pulse-ended"
    device = session.link.stream
    assert isinstance(device, TwinDevice)
    assert (device.machine.fault, device.machine.voltage) == (FaultCode.WHEEL_SPEED, 0.0)  # type: ignore[attr-defined]


def test_the_guard_is_tested_and_cleared() -> None:
    with session_of(Wired()) as session:
        found = commission(session, RIG)
        assert 0.0 < found.guard_angle < 0.1
        assert any(line.startswith("guard: 0 V at ") for line in found.lines())
        session.require_ready()  # no latched fault is left


def test_a_device_whose_guard_does_not_trip_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Guard, "check", lambda *_: (FaultCode.NONE, 0.0))
    error = refused(Wired())
    assert (error.code, error.exit_code) == ("no-guard", 5)


# ---- the command


def test_the_command_writes_the_file_and_keeps_its_comments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, report = tmp_path / "rig.toml", tmp_path / "found.json"
    path.write_text("# my rig\n" + RIG.text, encoding="utf-8")
    assert main(["commission", "--device", "twin://paper", "--rig", str(path), "--json", str(report)]) == 0
    out = capsys.readouterr().out
    assert "signs: axis +1 (a choice), wheel +1, voltage +1" in out
    assert f"wrote {path}" in out
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# my rig\n")
    assert "# J2, section 5" in text
    written = tomllib.loads(text)["device"]
    assert (written["address"], written["voltage_sign"], written["axis_zero"]) == ("twin://paper", 1, 0)
    assert json.loads(report.read_text(encoding="utf-8"))["values"]["device.wheel_sign"] == 1
    # a second time the address is known, and what was written is confirmed
    assert main(["commission", "--rig", str(path)]) == 0
    assert path.read_text(encoding="utf-8") == text


def test_bad_use_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["commission", "--rig", "paper"]) == 2
    assert "no device.address; give --device" in capsys.readouterr().err
    assert main(["commission", "--rig", "paper", "--device", "tcp://127.0.0.1:1"]) == 5
    assert main(["commission", "--rig", "paper", "--device", "twin://paper", "--out", "x.json"]) == 2
    assert main(["commission", "--rig", str(tmp_path / "none.toml"), "--device", "twin://paper"]) == 3
    capsys.readouterr()
    assert main(["commission", "--rig", "paper", "--device", "twin://paper"]) == 0
    assert "a built-in rig stays as it is" in capsys.readouterr().out


@pytest.mark.parametrize("rest", quick_first(1, [0.4, -0.4]))
def test_a_body_that_rests_between_two_counts_has_the_right_counts(rest: float) -> None:
    """The zero is known to half a count, which bends the wheel's angle by more than the pulses turn it."""
    step = 2 * 3.141592653589793 / 16384
    found = found_on(Wired(encoder_zero=(rest * step, 0.0)))
    assert found.ratio is not None
    assert abs(found.ratio[0] - 1.0) < 3 * found.ratio[1] < 0.15  # by a smaller pulse, at one of them
