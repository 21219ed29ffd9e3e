"""The twin as a device: the motion of `simulate`, the paper's experiment, and the C core in the same loop."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import live_host
from firmware_build import CoreDevice
from live_host import encode, experiment
from long_cases import quick_first
from swingid.control import law
from swingid.control.compensator import Compensator
from swingid.control.law import compensator_step
from swingid.control.references.parse import parse_reference
from swingid.errors import UsageError
from swingid.identification import identify
from swingid.live.codes import FaultCode, Flag, State
from swingid.live.devices.twin import TwinDevice, open_twin, twin_of
from swingid.live.frames import Decoder, Frame
from swingid.live.guard import Limits, parameters_of
from swingid.live.plant import Plant, board_of
from swingid.model.rig import Rig
from swingid.model.rig.sensors import Sensors
from swingid.numerics.arrays import Array
from swingid.recording.recording import Recording
from swingid.simulation.twin import simulate_run

SINE = parse_reference("sine 0.8 rad 8.5 rad/s")
RIG = Rig.load("paper")


def rounded(reference: Array) -> Array:
    return reference.astype(np.float32).astype(np.float64)


def by_hand(plant: Plant, rig: Rig, reference: Array, *, rounding: bool) -> Array:
    """Log (rows, 4) of the twin's own controller around the plant; rounding: the voltage to 32 bits."""
    controller = Compensator.paper(rig)
    state, gains = controller.initial_state(), controller.parameters(1.0 / plant.rate)
    log = np.zeros((len(reference), 4))
    for k, wanted in enumerate(reference):
        angle, wheel = plant.angles()
        u = compensator_step(wanted, angle, wheel, state, gains)
        u = float(np.float32(u)) if rounding else u
        log[k] = angle, wheel, u, state[law.K_TILDE]
        plant.hold(u)
    return log


SENSORS = {
    "14 bits": Sensors(counts_per_turn=16384),
    "no resolution": Sensors(),
    "noise, bent": Sensors(counts_per_turn=16384, noise=2e-4, nonlinearity="0.1 deg"),
    "read early, jitter": Sensors(counts_per_turn=16384, latency=-1.3e-3, jitter=1e-4, noise=1e-4),
}


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("rate", [1000.0, 4000.0])
def test_the_plant_is_the_twin_of_simulate_to_the_last_bit(name: str, rate: float) -> None:
    rig = RIG.model_copy(update={"sensors": SENSORS[name]})
    rows = int(1.5 * rate) + 1
    expected = simulate_run(rig, SINE, duration=1.5, rate=rate, seed=3).log
    plant = Plant(rig, rate=rate, rows=rows, seed=3)
    found = by_hand(plant, rig, SINE(np.arange(rows) / rate), rounding=False)
    np.testing.assert_array_equal(found[:, 2:], expected[:, 2:])
    # a log reads dense output at the end of a step, a controller the step's end: one rounding may differ
    np.testing.assert_allclose(found[:, :2], expected[:, :2], rtol=0, atol=1e-12)


def test_a_push_is_that_of_simulate() -> None:
    push = np.zeros(1001)
    push[300:400] = 0.05
    expected = simulate_run(RIG, push=push, duration=1.0, initial_angle=0.4).log
    plant = Plant(RIG, initial_angle=0.4)
    for k, row in enumerate(expected):
        assert plant.angles()[0] == pytest.approx(row[0], abs=1e-12)
        plant.push = push[k]
        plant.hold(0.0)


def test_draws_go_on_after_the_first_block() -> None:
    sensors = Sensors(latency=-1.3e-3, jitter=1e-4, noise=1e-4)
    plant = Plant(RIG.model_copy(update={"sensors": sensors}), rows=50, seed=1)
    angles = []
    for _ in range(200):
        angles.append(plant.angles()[0])
        plant.hold(0.0)
    blocks = np.reshape(angles, (4, 50))
    assert np.abs(np.corrcoef(blocks) - np.eye(4)).max() < 0.6
    assert blocks.std(axis=1) == pytest.approx(np.full(4, 1e-4), rel=0.4)
    assert np.abs(angles).max() < 1e-3


def frames_of(device: TwinDevice, seconds: float) -> tuple[list[Frame], bytes]:
    rig = device.plant.rig
    parameters = parameters_of(Compensator.paper(rig), device.board, Limits.of(rig))
    return experiment(device, parameters, SINE(np.arange(int(seconds * 1000)) / 1000.0))


def run_of(frames: list[Frame]) -> list[Frame]:
    """The samples of the run, from reference 0 to the end of the fading."""
    start = next(frame.value for frame in frames if frame.name == "Ack" and frame.message == 0x53)
    return [frame for frame in frames if frame.name == "Sample" and frame.sequence >= start]


def recording_of(frames: list[Frame], seconds: float) -> Recording:
    run = run_of(frames)[: int(seconds * 1000)]
    time = np.array([frame.time for frame in run]) * 1e-6
    step = 2 * np.pi / 16384
    return Recording(
        time=time - time[0],
        angle=np.array([frame.axis for frame in run]) * step,
        wheel_angle=np.array([frame.wheel for frame in run]) * step,
        voltage=np.array([frame.voltage for frame in run]),
    )


@functools.cache
def paper_run(name: str = "paper") -> tuple[list[Frame], bytes]:
    return frames_of(twin_of(Rig.load(name)), 25.0)


def test_the_papers_experiment_over_the_link_is_that_of_the_twin() -> None:
    frames, _ = paper_run()
    run = run_of(frames)
    assert {frame.state for frame in run[:25_000]} == {State.RUNNING}
    assert (run[-1].state, run[-1].voltage) == (State.IDLE, 0.0)
    assert run[-1].flags == Flag.FINISHED
    sequences = np.diff([frame.sequence for frame in frames if frame.name == "Sample"])
    assert set(sequences) == {1}
    reference = rounded(SINE(np.arange(25_000) / 1000.0))
    plant = Plant(RIG)
    expected = by_hand(plant, RIG, reference, rounding=True)
    counts = np.round(expected[:, :2] / (2 * np.pi / 16384)).astype(int)
    found = np.array([(frame.axis, frame.wheel) for frame in run[:25_000]])
    # the run begins some samples after the plant, whose step ends are rounded elsewhere
    assert np.mean(found != counts) < 1e-3
    assert np.abs(found - counts).max() <= 2
    assert abs(run[24_999].gain / expected[-1, 3] - 1) < 1e-6


@pytest.mark.parametrize("name", quick_first(1, ["paper", "paper-body"]))
def test_momentum_finds_the_inertia_in_its_interval(name: str) -> None:
    rig = Rig.load(name)
    assert rig.axis.inertia is not None
    true = rig.axis.inertia.value
    result = identify(recording_of(paper_run(name)[0], 25.0), rig, method="momentum")
    inertia = result.parameters["inertia"]
    assert abs(inertia.value / true - 1) < 2e-4
    low, high = inertia.interval95
    assert low <= true <= high


@pytest.mark.long
@pytest.mark.parametrize("name", ["paper", "paper-body"])
def test_the_guard_leaves_good_rigs_alone(name: str) -> None:
    """No fault in ten runs of 10 s each, with constants drawn and the paper's encoders noisy."""
    rig = Rig.load(name).model_copy(update={"sensors": Sensors(counts_per_turn=16384, noise=2e-4)})
    for seed in range(10):
        run = run_of(frames_of(twin_of(rig, seed=seed, draw=True), 10.0)[0])
        assert {frame.fault for frame in run} == {FaultCode.NONE}
        assert sum(frame.state == State.RUNNING for frame in run) == 10_000


def test_the_c_core_in_the_loop_gives_the_same_bytes() -> None:
    board = board_of(RIG)
    one = frames_of(TwinDevice(Plant(RIG), board), 3.0)[1]
    other = frames_of(TwinDevice(Plant(RIG), board, machine=CoreDevice(board)), 3.0)[1]
    assert one == other
    assert len(one) > 3000 * 30


@pytest.mark.long
def test_the_c_core_in_the_loop_gives_the_same_bytes_for_the_whole_experiment() -> None:
    board = board_of(RIG, firmware=twin_of(RIG).board.firmware)
    other = frames_of(TwinDevice(Plant(RIG), board, machine=CoreDevice(board)), 25.0)[1]
    assert paper_run()[1] == other


def test_time_passes_while_the_host_reads_and_only_then() -> None:
    device = twin_of(RIG)
    device.write(encode("Who"))
    assert device.plant.row == 0
    assert [frame.name for frame in Decoder().feed(device.read(0.0))] == ["Hello"]
    assert device.plant.row == 0
    for _ in range(4):
        device.read(0.0005)
    assert device.plant.row == 2
    device.read(10.0)
    assert device.plant.row == 18
    device.close()
    with pytest.raises(UsageError, match="closed"):
        device.read(0.0)


def test_a_dead_host_is_0_volts_in_100_ms() -> None:
    device = twin_of(RIG)
    parameters = parameters_of(Compensator.paper(RIG), device.board, Limits.of(RIG))
    device.read(0.01)
    for frame in (
        live_host.parameter_frames(parameters)
        + live_host.arm_frame(parameters)
        + live_host.reference_frames(SINE(np.arange(980) / 1000.0), last=False)
    ).split(b"\0")[:-1]:
        device.write(frame + b"\0")
    device.write(encode("Run", session=7))
    decoder, samples = Decoder(), []
    for _ in range(20):
        samples += [frame for frame in decoder.feed(device.read(0.016)) if frame.name == "Sample"]
    driven = [frame.time for frame in samples if frame.voltage != 0.0]
    assert driven[-1] - device_start(samples) < 100_000
    assert samples[-1].fault == FaultCode.HEARTBEAT


def device_start(samples: list[Frame]) -> int:
    """Time of the first sample of the run, before which the last message of the host came."""
    return int(next(frame.time for frame in samples if frame.state == State.RUNNING))


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("serial://x", "starts with twin"),
        ("twin://paper?seed=x", "seed must be a number"),
        ("twin://paper?speed=1", "speed is not offered"),
        ("twin://paper?rate=1", "rate is not offered"),
        ("twin://paper?seed=-1", "seed is not offered"),
    ],
)
def test_addresses_that_are_none(address: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        open_twin(address)


def test_an_address_with_options() -> None:
    device = open_twin("twin://paper?rate=500&seed=3")
    assert (device.board.rate, device.plant.seed, device.board.axis_counts) == (500.0, 3, 16384)


def test_a_rig_without_a_voltage_limit_is_no_device() -> None:
    rig = Rig.from_text(RIG.text.replace("voltage_limit = 10", ""))
    with pytest.raises(UsageError, match="voltage_limit"):
        board_of(rig)
