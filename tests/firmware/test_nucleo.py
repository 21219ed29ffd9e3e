"""The image of the reference board, executed register by register: the bits of the core, and faults of its wiring."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_firmware_controller import steps

from firmware_build import FIRMWARE
from live_host import RIG, arm_frame, encode, experiment, parameter_frames, reference_frames
from long_cases import quick_first
from nucleo_chip import DOG, GPIOA, GPIOB, IWDG, MOST, RCC, SPI1, SUPPLY, TIM1, TIM6, USART2, As5048a, Chip
from refusals import coded
from swingid.cli.app import run as swingid
from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.errors import DeviceError
from swingid.identification import identify
from swingid.live.codes import FaultCode, Flag, State
from swingid.live.commission import commission
from swingid.live.devices.twin import TwinDevice
from swingid.live.experiment import Conductor, Order
from swingid.live.firmware import IMAGES, named, timing
from swingid.live.firmware_encoders import Turned, by_hand
from swingid.live.frames import Decoder, Frame
from swingid.live.guard import Board, Limits, Readings, parameters_of
from swingid.live.machine import Machine, most_taken
from swingid.live.plant import Plant, board_of
from swingid.live.session import Reason, Session
from swingid.recording.recording import Recording
from swingid.report.tables import recording_table

IMAGE = (FIRMWARE / "images" / "nucleo.bin").read_bytes()
BOARD = replace(board_of(RIG, firmware=zlib.crc32(IMAGE)), most_order=3)
PARAMETERS = parameters_of(Compensator.paper(RIG), BOARD, Limits.of(RIG))
SINE = parse_reference("sine 0.8 rad 8.5 rad/s")
COMPILER = "12.2.1"
NMI = 2
CLOCK = 2005
"""Microseconds of the board at its first sample: the second tick of TIM6, and the frame to the axis' encoder."""


def reference(seconds: float) -> np.ndarray:
    return SINE(np.arange(int(seconds * 1000)) / 1000.0)


def booted(image: bytes = IMAGE) -> Chip:
    """A board that waits for its first sample."""
    chip = Chip(image)
    chip.run(10 * MOST)
    chip._pass()
    chip.run()
    assert chip.samples == 1
    chip.output()
    return chip


class Delayed:
    """The machine in Python as a board has it: bytes that come while it waits are taken after the sample, and the PWM
    has steps.
    """

    def __init__(self, board: Board) -> None:
        self.machine, self.board, self.busy = Machine(board), board, False
        self._waiting = self._out = b""
        self.machine.tick(CLOCK - 1000, Readings(0, 0))

    def receive(self, data: bytes) -> None:
        self._waiting += data

    def tick(self, time: int, readings: Readings) -> float:
        voltage = self.machine.tick(time, readings)
        self._out += self.machine.output()
        taken, self._waiting = self._waiting[: most_taken(self.board)], self._waiting[most_taken(self.board) :]
        self.machine.receive(taken)
        self.machine.busy = len(taken) == most_taken(self.board)
        steps = np.float32(abs(voltage)) / np.float32(SUPPLY) * np.float32(9000) + np.float32(0.5)
        return float(np.sign(voltage)) * (int(steps) / 9000.0) * SUPPLY

    def output(self) -> bytes:
        out, self._out = self._out, b""
        return out


def run(seconds: float, chip: Chip, plant: Plant | None = None) -> tuple[list[Frame], bytes]:
    device = TwinDevice(plant or Plant(RIG), BOARD, machine=chip, clock=CLOCK)
    return experiment(device, PARAMETERS, reference(seconds))


def same_bytes(seconds: float, image: bytes, most_order: int = 3) -> None:
    board = replace(BOARD, firmware=zlib.crc32(image), most_order=most_order)
    device = TwinDevice(Plant(RIG), board, machine=Delayed(board), clock=CLOCK)
    _, expected = experiment(device, PARAMETERS, reference(seconds))
    frames, data = run(seconds, booted(image))
    assert frames[0].firmware == zlib.crc32(image)
    assert frames[-1].state == State.IDLE
    assert max(abs(frame.voltage) for frame in frames if frame.name == "Sample") > 0.05
    assert data == expected


def test_a_run_gives_the_bytes_of_the_machine_in_python() -> None:
    same_bytes(0.6, IMAGE)


@pytest.mark.long
def test_commissioning_and_the_papers_experiment_on_the_image_give_the_inertia(tmp_path: Path) -> None:
    chip = booted()
    device = TwinDevice(Plant(RIG), BOARD, machine=chip, clock=CLOCK)
    session = Session(device)
    found = commission(session, RIG)
    assert (found.axis_sign, found.wheel_sign, found.voltage_sign) == (1, 1, 1)
    assert found.board.firmware == zlib.crc32(IMAGE)
    values = found.values(RIG, "serial:///dev/ttyACM0")
    assert values["sensors.latency"] == "-0.254 ± 0.03 ms"
    assert values["sensors.wheel.latency"] == "-0.247 ± 0.03 ms"
    timed = RIG.changed({key: values[key] for key in values if "latency" in key or "jitter" in key})
    assert "sensors.latency" not in found.values(timed, "serial:///dev/ttyACM0")  # what somebody has stated stays
    order = Order(SINE, Compensator.paper(RIG), 20.0)
    done = Conductor(RIG, device).run(order, tmp_path / "run.mcap")
    assert done.end.reason is Reason.FINISHED
    log = Recording.load(tmp_path / "run.mcap", RIG)
    result = identify(log, RIG)
    assert abs(result.inertia.value / 3.022e-3 - 1) < 2e-4
    late = identify(Recording.load(tmp_path / "run.mcap", timed), timed)
    assert abs(late.inertia.value / 3.022e-3 - 1) < 2e-4  # common to both angles, which cancels
    assert not chip.enabled()
    rows = dict(recording_table(log, result).rows)
    assert rows["device"].endswith(f"firmware {zlib.crc32(IMAGE):08x}")


def test_the_command_writes_the_image_and_a_run_names_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert swingid(["firmware", "nucleo", "--out", str(tmp_path / "nucleo.bin")]) == 0
    assert (tmp_path / "nucleo.bin").read_bytes() == IMAGE
    assert f"{zlib.crc32(IMAGE):08x}" in capsys.readouterr().out
    assert swingid(["firmware", "uno", "--out", str(tmp_path / "uno.bin")]) == 2
    assert "boards: nucleo" in capsys.readouterr().err
    assert named(zlib.crc32(IMAGE)) == f"{zlib.crc32(IMAGE):08x} (the image nucleo of this version)"
    assert named(0x12345678) == "12345678"


class Turning(Plant):
    """A rig whose body and wheel a hand turns, the motor off."""

    wheel = 1.0

    def read(self) -> Readings:
        super().read()
        angle = np.sin(4e-3 * self.row)
        return Readings(round(4000 * angle), round(5000 * self.wheel * angle))


def by_hand_on(chip: Chip, plant: Plant, seconds: float = 1.0) -> list[Turned]:
    assert not chip.enabled()
    found = by_hand(Session(TwinDevice(plant, BOARD, machine=chip, clock=CLOCK)), seconds=seconds)
    assert not chip.enabled()
    return found


def test_encoders_are_looked_at_by_hand_before_anything_is_armed() -> None:
    axis, wheel = by_hand_on(booted(), Turning(RIG))
    assert (axis.name, wheel.name) == ("axis", "wheel")
    assert 90.0 < axis.range < 176.0  # 4000 counts to both sides
    assert wheel.range == pytest.approx(1.25 * axis.range, rel=1e-3)
    still = Turning(RIG)
    still.wheel = 0.0
    for chip, plant, code in ((booted(), still, "not-turned"), (booted(), Turning(RIG), "no-readings")):
        if code == "no-readings":
            chip.axis.diagnosis = 0x0980
        with pytest.raises(DeviceError) as error:
            by_hand_on(chip, plant)
        assert error.value.code == code


def counts(order: int, image: bytes = IMAGE, most_order: int = 3) -> list[list[int]]:
    """Instructions of some samples of a run, parted by the words to the encoders and by the voltage."""
    board = replace(BOARD, most_order=most_order)
    chip, parameters = booted(image), parameters_of(steps(order), board, Limits.of(RIG))
    sent = [*parameter_frames(parameters).split(b"\0")[:-1], arm_frame(parameters)[:-1]]
    sent += [reference_frames([0.1] * 14, last=False)[:-1], encode("Run", session=7)[:-1]]
    for frame in sent:
        chip.receive(frame + b"\0")
        chip.tick(0, Readings(0, 0))
    found = []
    for k in range(8):
        chip.receive(encode("Heartbeat", session=7))
        found.append(chip.counted(lambda k=k: chip.tick(0, Readings(10 * k, 300 * k))))
    assert Decoder().feed(chip.output())[-1].state == State.RUNNING
    return found


def instructions(order: int, image: bytes = IMAGE, most_order: int = 3) -> tuple[list[int], list[int]]:
    """Of some samples of a run: from the first word to the encoders up to the voltage, and in all."""
    found = counts(order, image, most_order)
    return [sum(parts[1:-1]) for parts in found], [sum(parts) for parts in found]


LINE = 100
"""Bytes that a line of 1 Mbaud carries in a sample."""

CYCLES = 1.5
"""Cycles an instruction at most, on the average of this code: ARM's manual states 1 for arithmetic, 2 for loads and 2
to 4 for branches taken, of which the soft doubles are a sixth each."""


@pytest.mark.parametrize("order", range(4))
def test_a_sample_has_the_time_for_its_controller_and_a_flood_of_the_host(order: int) -> None:
    """170 instructions a byte at worst (core/device.h), and the bytes that a line of 1 Mbaud brings in a sample."""
    _, whole = instructions(order)
    assert CYCLES * (max(whole) + 170 * LINE) < MOST


def test_the_voltage_begins_at_the_same_edge_of_the_pwm_in_each_sample() -> None:
    """Of the paper's controller, from one cycle an instruction to the most, behind four frames to the encoders."""
    voltage, _ = instructions(1)
    first = 50.0 * (1.0 - booted().registers[TIM1 + 0x24] / 9000)
    begin, end = (us + 4 * 16 / 2.8125 for us in (min(voltage) / 180, CYCLES * max(voltage) / 180))
    assert first == pytest.approx(15.0)
    assert (begin - first) // 50.0 == (end - first) // 50.0 == 1


FRAME = 16e-6 / 2.8125
"""Seconds of a word to an encoder."""


def test_the_timing_that_commissioning_writes_is_that_of_the_executed_image() -> None:
    """Of a sample's begin: the ends of the first words to both encoders, to 1 us; the voltage as of the test above."""
    parts = np.array(counts(1))
    stated = IMAGES["nucleo"]
    for cycles in (1.0, CYCLES):
        begin, between = (cycles * parts[:, k] / 180e6 for k in (0, 1))
        assert begin + FRAME == pytest.approx(stated.axis, abs=1e-6)
        assert begin + between + 2 * FRAME == pytest.approx(stated.wheel, abs=1e-6)
        assert np.ptp(begin) < 0.01 * stated.jitter
    assert stated.voltage == pytest.approx(115e-6)
    assert timing(zlib.crc32(IMAGE)) is stated
    assert timing(1) is None


def test_a_controller_that_the_board_cannot_compute_in_a_sample_is_refused_by_name() -> None:
    session = Session(TwinDevice(Plant(RIG), BOARD, machine=booted(), clock=CLOCK))
    session.connect()
    with pytest.raises(DeviceError, check=coded("order-too-high")):
        session.load(parameters_of(steps(4), BOARD, Limits.of(RIG)))
    session.load(parameters_of(steps(3), BOARD, Limits.of(RIG)))


def built(arm: str, folder: Path, *options: str) -> bytes:
    """The image that a compiler makes; options: of make."""
    here = folder / "firmware"
    shutil.copytree(FIRMWARE, here, ignore=shutil.ignore_patterns("build"))
    command = ["make", "-s", "-C", str(here), "nucleo", f"ARM={arm}", f"PYTHON={sys.executable}", *options]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "warning:" not in done.stderr
    return (here / "build" / "swingid-nucleo.bin").read_bytes()


def test_the_image_of_the_package_is_what_its_compiler_makes_of_the_sources(tmp_path: Path) -> None:
    """Where this fails after a change of the sources: make -C firmware image, and commit the image."""
    if shutil.which("arm-none-eabi-gcc") is None or shutil.which("make") is None:
        pytest.skip("arm-none-eabi-gcc (Debian: gcc-arm-none-eabi) or make is not on PATH")
    version = subprocess.run(["arm-none-eabi-gcc", "-dumpfullversion"], capture_output=True, text=True).stdout.strip()
    if version != COMPILER:
        pytest.skip(f"the image was built by arm-none-eabi-gcc {COMPILER}, here is {version}")
    assert built("gcc", tmp_path) == IMAGE


@pytest.mark.parametrize(
    "values",
    [
        "LIMIT=20",
        "LIMIT=8 SUPPLY=6.5",
        "SUPPLY=0",
        "LIMIT=0",
        "LIMIT=-1",
        "LIMIT=1e1",
        "LIMIT=9V",
        "ORDER=9",
        "ARM=foo",
    ],
)
def test_values_that_no_board_can_have_are_refused_before_the_compiler(values: str, tmp_path: Path) -> None:
    """A limit above the supply would be recorded as applied, where the bridge gives less."""
    if shutil.which("make") is None:
        pytest.skip("make is not on PATH")
    command = ["make", "-s", "-C", str(FIRMWARE), "values", *values.split()]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 2
    assert values.split(maxsplit=1)[0] in run.stdout


def test_values_that_a_board_can_have_are_taken() -> None:
    if shutil.which("make") is None:
        pytest.skip("make is not on PATH")
    for values in ("", "LIMIT=8", "LIMIT=9.5 SUPPLY=9.5", "ORDER=0 ARM=zig"):
        command = ["make", "-s", "-C", str(FIRMWARE), "values", *values.split()]
        assert subprocess.run(command, capture_output=True, text=True).stdout == ""


@pytest.mark.long
def test_in_single_precision_every_order_has_the_time_and_other_voltages(tmp_path: Path) -> None:
    """The build that is not shipped: README.md has its figures beside those of doubles."""
    if shutil.which("arm-none-eabi-gcc") is None or shutil.which("make") is None:
        pytest.skip("arm-none-eabi-gcc (Debian: gcc-arm-none-eabi) or make is not on PATH")
    single = built("gcc", tmp_path, "SINGLE=1")
    for order in range(5):
        _, whole = instructions(order, single, most_order=4)
        assert CYCLES * (max(whole) + 170 * LINE) < MOST
    runs = [[f for f in run(0.6, booted(image))[0] if f.name == "Sample"] for image in (IMAGE, single)]
    assert len(runs[0]) == len(runs[1])
    apart = [abs(one.voltage - other.voltage) for one, other in zip(*runs, strict=True)]
    assert 0.0 < max(apart) < 1e-3
    assert [f.state for f in runs[0]] == [f.state for f in runs[1]]


@pytest.mark.long
def test_the_compiler_of_pypi_makes_an_image_that_does_the_same(tmp_path: Path) -> None:
    if importlib.util.find_spec("ziglang") is None or shutil.which("make") is None:
        pytest.skip("ziglang is not installed (pip install 'swingid[cortex]'), or make is not on PATH")
    image = built("zig", tmp_path)
    same_bytes(0.3, image, most_order=2)  # its doubles are slower
    _, whole = instructions(2, image, most_order=2)
    assert CYCLES * (max(whole) + 170 * LINE) < MOST


def test_the_registers_give_the_frequencies_that_the_rig_is_told() -> None:
    times = booted().times()
    assert times == {
        "core": 180e6,
        "samples": 1000.0,
        "microseconds": 1e6,
        "pwm": 20e3,
        "line": 1e6,
        "encoders": 2.8125e6,
    }


def test_the_bridge_is_off_before_the_clocks_are_touched_and_its_enable_low_until_arm() -> None:
    chip = Chip(IMAGE, writes=[])
    chip.run(10 * MOST)
    assert chip.writes is not None
    clock = next(i for i, (address, _) in enumerate(chip.writes) if address == RCC)
    for port, pin in ((GPIOB, 10), (GPIOA, 8), (GPIOA, 9)):
        low = chip.writes.index((port + 0x18, 1 << 16 + pin))
        output = next(i for i, (to, what) in enumerate(chip.writes) if to == port and what >> 2 * pin & 3 == 1)
        assert low < output < clock
    enabled: list[tuple[bool, int]] = []

    class Watched(Plant):
        def read(self) -> Readings:
            enabled.append((chip.enabled(), self.row))
            return super().read()

    chip._pass()
    chip.run()
    frames, _ = run(0.2, chip, Watched(RIG))
    states = [frame.state for frame in frames if frame.name == "Sample"]
    # what a sample's frame says of its state, the enable shows by the next sample
    shown = [on for on, _ in enabled][-len(states) + 1 :]
    assert shown == [state in (State.ARMED, State.RUNNING, State.STOPPING) for state in states[:-1]]
    assert not chip.enabled()
    assert {True, False} <= set(shown)


def test_without_the_debuggers_clock_it_never_starts() -> None:
    chip = Chip(IMAGE, clock=False, writes=[])
    chip.run(15_000_000)
    assert chip.writes is not None
    assert chip.writes[-1] != (IWDG, 0xAAAA)
    assert chip.writes.count((IWDG, 0xAAAA)) > 100_000  # 10 cycles a look at 16 MHz: a clock has 60 ms and more
    chip.pass_time(DOG + 1)
    assert chip.resets == 2
    assert chip.samples == 0
    assert not chip.enabled()
    assert not [address for address, _ in chip.writes if address in (TIM6, SPI1, USART2)]


@pytest.mark.parametrize("vector", [NMI, 3, 4, 5, 6])
def test_a_clock_that_fails_and_a_fault_of_the_processor_let_go_of_the_bridge(vector: int) -> None:
    chip = booted()
    assert chip.registers[GPIOA] >> 16 & 3 == 2
    chip._pc = chip.vectors[vector]
    chip.pass_time()
    assert not chip.enabled()
    assert (chip._pin(GPIOA, 8), chip._pin(GPIOA, 9), chip._pin(GPIOB, 10)) == (0, 0, 0)
    chip.pass_time(DOG)
    assert chip.resets == 2


class Struck(Plant):
    """A rig whose board something happens to at its row 700, in the run."""

    def __init__(self, strike: Callable[[], None]) -> None:
        super().__init__(RIG)
        self._strike = strike

    def read(self) -> Readings:
        if self.row == 700:
            self._strike()
        return super().read()


def struck(strike: Callable[[Chip], None]) -> tuple[Chip, list[Frame]]:
    """The board and the frames of a run of 0.8 s that something happens in; no voltage is left."""
    chip = booted()
    frames, _ = run(0.8, chip, Struck(lambda: strike(chip)))
    assert chip.voltage() == 0.0
    assert not chip.enabled()
    return chip, frames


def fault_of(frames: list[Frame]) -> Frame:
    return next(frame for frame in frames if frame.name == "Fault")


def wired(encoder: str, wire: Callable[[int], int]) -> Callable[[Chip], None]:
    return lambda chip: setattr(getattr(chip, encoder), "wire", wire)


def diagnosis(encoder: str, value: int) -> Callable[[Chip], None]:
    return lambda chip: setattr(getattr(chip, encoder), "diagnosis", value)


LASTING = {
    "unplugged, the line pulled up": wired("axis", lambda _: 0xFFFF),
    "unplugged, the line at 0": wired("wheel", lambda _: 0),
    "a line that keeps one bit": wired("axis", lambda answer: answer | 1 << 9),
    "wrong parity in each answer": wired("wheel", lambda answer: answer ^ 4),
    "magnet too weak": diagnosis("axis", 0x0180 | 1 << 11),
    "magnet too strong": diagnosis("wheel", 0x0180 | 1 << 10),
    "angle out of range": diagnosis("axis", 0x0180 | 1 << 9),
    "offsets not compensated": diagnosis("wheel", 0x0080),
}


@pytest.mark.parametrize("name", quick_first(3, LASTING))
def test_an_encoder_that_cannot_be_trusted_ends_the_run_within_five_samples(name: str) -> None:
    _, frames = struck(LASTING[name])
    fault = fault_of(frames)
    assert fault.code == FaultCode.ENCODER
    assert 700 <= fault.sequence - 1 <= 707


def once(act: Callable[[As5048a], None]) -> Callable[[Chip], None]:
    return lambda chip: act(chip.axis)


def flip_once(encoder: As5048a) -> None:
    left = [1]

    def wire(answer: int) -> int:
        return answer ^ (8 if left and left.pop() else 0)

    encoder.wire = wire


PASSING = {
    "one answer with a wrong bit": once(flip_once),
    "one command that the encoder misunderstands": once(lambda encoder: setattr(encoder, "error", True)),
}


@pytest.mark.parametrize("name", PASSING)
def test_one_wrong_frame_costs_a_reading_and_no_more(name: str) -> None:
    _, frames = struck(PASSING[name])
    samples = [frame for frame in frames if frame.name == "Sample"]
    invalid = [frame.sequence for frame in samples if frame.flags & Flag.INVALID]
    assert 1 <= len(invalid) <= 2
    assert samples[-1].flags & Flag.FINISHED
    assert not [frame for frame in frames if frame.name == "Fault"]


def test_a_sample_that_is_missed_ends_the_run() -> None:
    _, frames = struck(lambda chip: chip._pass())
    assert fault_of(frames).code == FaultCode.OVERRUN


def hang(chip: Chip) -> None:
    chip.cpu.mem_write(0x2000_0000 + 120_000, b"\xfe\xe7")  # a branch to itself
    chip._pc, chip.hung = 0x2000_0000 + 120_000, True


def test_a_loop_that_hangs_is_ended_by_the_watchdog() -> None:
    chip = booted()
    voltages: list[float] = []

    class Watched(Struck):
        def hold(self, voltage: float) -> None:
            voltages.append(voltage)
            super().hold(voltage)

    frames, _ = run(0.8, chip, Watched(lambda: hang(chip)))
    assert chip.resets == 2
    assert frames[-1].state == State.IDLE
    held = voltages[700 : 700 + DOG]
    assert held == [held[0]] * DOG
    assert held[0] != 0.0
    assert set(voltages[700 + DOG :]) == {0.0}


def test_a_loss_of_power_in_a_run_leaves_nothing_on() -> None:
    chip, frames = struck(lambda chip: chip.reset(memory=b"\xa5"))
    assert chip.resets == 2
    assert frames[-1].state == State.IDLE
    sequences = [frame.sequence for frame in frames if frame.name == "Sample"]
    assert min(sequences[700:]) < 20


def test_a_byte_that_the_line_loses_is_told_and_the_run_goes_on() -> None:
    def strike(chip: Chip) -> None:
        chip.receive(b"\x05\x05")
        chip.overrun()

    _, frames = struck(strike)
    samples = [frame for frame in frames if frame.name == "Sample"]
    assert sum(bool(frame.flags & Flag.BAD_FRAME) for frame in samples) == 1
    assert samples[-1].flags & Flag.FINISHED


def test_a_host_is_answered_while_another_floods_the_line() -> None:
    chip = booted()
    chip.line = 100
    chip.receive(encode("Who") + b"\x55" * 20_000)
    for _ in range(100):
        chip.tick(0, Readings(0, 0))
    frames = Decoder().feed(chip.output())
    assert frames[0].name == "Hello"
    samples = [frame.sequence for frame in frames if frame.name == "Sample"]
    assert len(samples) > 90
    assert samples == list(range(samples[0], samples[0] + len(samples)))
