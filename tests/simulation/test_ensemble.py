"""The ensemble is the single run many times: same physics, same controller, same sensors, to 1e-9."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from long_cases import quick_first
from refusals import coded
from swingid.control.backstepping import Backstepping
from swingid.control.compensator import Compensator
from swingid.control.observer import VelocityObserver
from swingid.errors import InputError, UsageError
from swingid.model.rig import Rig
from swingid.simulation import simulate
from swingid.simulation.ensemble import ensemble_chunks, simulate_ensemble

LAWS = {
    "viscous": {},
    "quadratic": {"quadratic": 1e-4},
    "coulomb": {"coulomb": 3e-3},
    "stribeck": {"coulomb": 3e-3, "static": 5e-3, "stribeck_speed": 0.05},
    "one-sided": {
        "viscous": None,
        "viscous_positive": 2e-3,
        "viscous_negative": 1e-3,
        "coulomb_positive": 2e-3,
        "coulomb_negative": 4e-3,
        "offset": 1e-3,
    },
    "cubic": {"cubic": 1e-5},
}
EQUAL = 1e-9
OBSERVER = VelocityObserver(200.0, 0.5, 2.0)


def slow(t: np.ndarray) -> np.ndarray:
    return 0.5 * np.sin(4.0 * t)


def fast(t: np.ndarray) -> np.ndarray:
    return 0.8 * np.sin(8.5 * t)


def difference(one, other) -> float:
    """Largest difference of two recordings over their channels, the metadata being the same."""
    assert one.metadata == other.metadata
    names = ("time", "angle", "wheel_angle", "voltage", "torque", "reference", "adaptive_gain")
    pairs = [(getattr(one, name), getattr(other, name)) for name in names]
    assert [a is None for a, _ in pairs] == [b is None for _, b in pairs]
    return max(float(np.abs(a - b).max()) for a, b in pairs if a is not None)


@pytest.mark.parametrize("law", quick_first(2, LAWS))
def test_runs_are_those_of_simulate(law):
    rig = Rig.builtin("paper").changed({f"axis.friction.{key}": value for key, value in LAWS[law].items()})
    inertias = 302.2e-5 * np.linspace(0.7, 1.5, 35)
    references = [slow if k % 3 == 0 else fast for k in range(35)]
    ensemble = simulate_ensemble(rig, references, duration=3.0, values={"axis.inertia": inertias}, seeds=range(35))
    assert len(ensemble) == 35
    assert not ensemble.alone.any()
    for k in (0, 7, 34):
        own = rig.changed({"axis.inertia": inertias[k]})
        assert difference(ensemble.recording(k), simulate(own, references[k], duration=3.0, seed=k)) <= EQUAL


def test_gains_noise_and_drawn_constants_are_those_of_simulate():
    rig = Rig.builtin("paper").changed(
        {"axis.inertia": "302.2e-5 ± 5e-5", "sensors.noise": 1e-4, "sensors.dropouts": 0.05}
    )
    controllers = [Compensator.paper(rig), Compensator(delta0=0.05, sigma0=0.2, lambda0=5.0, filter_time=0.0)]
    ensemble = simulate_ensemble(rig, slow, controllers, duration=2.0, rate=400.0, seeds=[5, 6], draw=True)
    for k, seed in enumerate((5, 6)):
        alone = simulate(rig, slow, controllers[k], duration=2.0, rate=400.0, seed=seed, draw=True)
        assert len(alone) < 801
        assert difference(ensemble.recording(k), alone) <= EQUAL


def test_nonlinear_encoders_go_in_lanes_too():
    changes = {"sensors.nonlinearity": "0.3 deg", "sensors.noise": 1e-4, "sensors.nonlinearity_sine": 2e-3}
    rig = Rig.builtin("paper").changed(changes)
    ensemble = simulate_ensemble(rig, fast, duration=2.0, seeds=range(3))
    assert not ensemble.alone.any()
    for k in range(3):
        assert difference(ensemble.recording(k), simulate(rig, fast, duration=2.0, seed=k)) <= EQUAL


@pytest.mark.parametrize(
    "changes",
    [
        {"sensors.latency": "0.2 ± 0.3 ms"},
        {"sensors.latency": "-0.7 ms", "sensors.noise": 1e-4},
        {"sensors.jitter": "0.1 ms"},
        {"sensors.wheel.latency": "2.5 ms", "sensors.wheel.counts_per_turn": 4096},
    ],
)
def test_encoders_that_are_read_late_or_early_give_what_simulate_gives(changes):
    """Beside a rig on time, through stops and reversals, and up to the last row, which is read after the end."""
    punctual = Rig.builtin("paper").changed({"axis.friction.coulomb": 3e-3})
    late = punctual.changed(changes)
    ensemble = simulate_ensemble([late, punctual, late], [fast, slow, slow], duration=1.5, seeds=[3, 4, 5])
    assert not ensemble.alone.any()
    for k, (rig, reference) in enumerate(((late, fast), (punctual, slow), (late, slow))):
        assert difference(ensemble.recording(k), simulate(rig, reference, duration=1.5, seed=3 + k)) <= EQUAL


def test_late_encoders_of_an_axis_that_rests_are_read_where_it_rests():
    """A decay that ends in rest, from a speed that reaches back before the start; coarse samples of several steps."""
    rig = Rig.builtin("paper-body").changed(
        {"axis.friction.coulomb": 2e-2, "sensors.latency": "-4 ms", "sensors.jitter": "1 ms", "sensors.noise": 1e-4}
    )
    options = {"duration": 4.0, "rate": 250.0, "initial_angle": 0.4, "initial_speed": 3.0}
    ensemble = simulate_ensemble(rig, seeds=[1, 2], **options)
    assert not ensemble.alone.any()
    for k in (0, 1):
        assert difference(ensemble.recording(k), simulate(rig, seed=1 + k, **options)) <= EQUAL


@pytest.mark.parametrize(
    "gains",
    [
        {"alpha": (1.0,), "k": ()},
        {"alpha": (0.01, 1.0, 4.0), "k": (4.0, 4.0)},
        {"alpha": (0.01, 1.0, 4.0), "k": (4.0, 4.0), "differentiate_gain": False, "sigma0": 20.0, "filter_time": 0.0},
        {"alpha": (0.001, 0.1, 1.0, 2.0), "k": (1.0, 3.0, 3.0), "k_tilde0": 30.0, "k_tilde_max": 40.0},
    ],
)
def test_compensators_of_other_relative_degrees_go_in_lanes(gains):
    rig = Rig.builtin("paper")
    controller = replace(Compensator.paper(rig), **({"k_tilde0": 0.5} | gains))
    references = [slow, fast, slow]
    ensemble = simulate_ensemble(rig, references, [controller, Compensator.paper(rig), controller], duration=1.5)
    assert not ensemble.alone.any()
    for k, own in ((0, controller), (1, Compensator.paper(rig))):
        alone = simulate(rig, references[k], own, duration=1.5)
        assert difference(ensemble.recording(k), alone) <= EQUAL
        assert np.ptp(alone.angle) > 0.01


@pytest.mark.parametrize("law", quick_first(1, ["printed", "consistent"]))
def test_backstepping_goes_in_lanes(law):
    rig = Rig.builtin("paper")
    controllers = [
        Backstepping.paper(rig, law=law),
        replace(Backstepping.paper(rig, law=law), n1=7.0, gamma1=3.0, observers=(VelocityObserver(300.0), OBSERVER)),
    ]
    ensemble = simulate_ensemble(rig, slow, controllers, duration=2.0)
    assert not ensemble.alone.any()
    for k in (0, 1):
        alone = simulate(rig, slow, controllers[k], duration=2.0)
        assert difference(ensemble.recording(k), alone) <= EQUAL
        assert np.ptp(alone.adaptive_gain) > 0.1


def test_a_peak_narrower_than_a_step_is_followed_through_reversals():
    """Ideal encoders, which hide nothing: the single run's own error is 3e-8 of the wheel's 400 rad."""
    friction = {f"axis.friction.{key}": value for key, value in LAWS["stribeck"].items()}
    rig = Rig.builtin("paper").changed(friction | {"sensors.counts_per_turn": None})
    own = simulate_ensemble(rig, fast, duration=5.0).recording(0)
    alone = simulate(rig, fast, duration=5.0)
    assert np.abs(own.angle - alone.angle).max() <= EQUAL
    assert np.abs(own.wheel_angle - alone.wheel_angle).max() <= 1e-7


def test_encoders_read_their_zero_as_in_simulate():
    rig = Rig.builtin("paper")
    step = rig.sensors.of("angle").resolution
    zeros = step * np.random.default_rng(0).random((3, 2))
    ensemble = simulate_ensemble(rig, fast, duration=2.0, seeds=range(3), encoder_zero=zeros)
    assert not ensemble.alone.any()
    for k in range(3):
        zero = (float(zeros[k, 0]), float(zeros[k, 1]))
        assert difference(ensemble.recording(k), simulate(rig, fast, duration=2.0, seed=k, encoder_zero=zero)) <= EQUAL


def test_open_loops_and_free_decays_are_those_of_simulate():
    rig = Rig.builtin("paper").changed({"axis.friction.coulomb": 2e-3})
    volts = 6.0 * np.sign(np.sin(5.0 * np.arange(2001) / 1000.0))
    ensemble = simulate_ensemble(
        rig, duration=2.0, drive=np.array([volts, -volts, 0.3 * volts]), initial_angle=[0, 0.3, 1]
    )
    for k, factor in enumerate((1.0, -1.0, 0.3)):
        alone = simulate(rig, duration=2.0, drive=factor * volts, initial_angle=(0, 0.3, 1)[k])
        assert difference(ensemble.recording(k), alone) <= EQUAL


@pytest.mark.parametrize("friction", [{"coulomb": 1e-2, "static": 2e-2}, {"coulomb": 1e-2, "quadratic": 1e-4}])
def test_runs_that_rest_and_are_released_again_are_those_of_simulate(friction):
    """Pulses with pauses in which axis and wheel come to rest: one after the other, or together."""
    rig = Rig.builtin("paper").changed({f"axis.friction.{key}": value for key, value in friction.items()})
    times = np.arange(3001) / 1000.0
    pulses = np.where(times % 1.0 < 0.05, 8.0, 0.0) * np.where(times % 2.0 < 1.0, 1.0, -1.0)
    ensemble = simulate_ensemble(rig, duration=3.0, drive=np.array([pulses, -0.7 * pulses, 0.0 * pulses]))
    assert not ensemble.alone.any()
    for k, factor in enumerate((1.0, -0.7, 0.0)):
        alone = simulate(rig, duration=3.0, drive=factor * pulses)
        assert difference(ensemble.recording(k), alone) <= EQUAL
        assert factor == 0.0 or np.ptp(alone.angle) > 0.01
        assert (np.diff(alone.angle) == 0.0).mean() > 0.5


def test_a_run_does_not_depend_on_those_beside_it():
    """Neither where a neighbour rests or reverses, nor where a block is full."""
    rig = Rig.builtin("paper").changed({f"axis.friction.{key}": value for key, value in LAWS["stribeck"].items()})
    inertias = 302.2e-5 * np.linspace(0.7, 1.5, 32)
    options = {"duration": 2.0, "record": "all"}
    beside = simulate_ensemble(rig, [slow, fast] * 16, values={"axis.inertia": inertias}, **options)
    for k in (0, 1, 31):
        own = simulate_ensemble(rig, (slow, fast)[k % 2], values={"axis.inertia": inertias[k : k + 1]}, **options)
        assert np.array_equal(own.log[:, 0], beside.log[:, k])


def test_chunks_and_threads_give_the_same_runs():
    rig, inertias = Rig.builtin("paper"), 302.2e-5 * np.linspace(0.7, 1.5, 70)
    options = {"duration": 0.5, "values": {"axis.inertia": inertias}, "record": "measured"}
    whole = simulate_ensemble(rig, fast, threads=1, **options)
    pieces = list(ensemble_chunks(rig, fast, threads=2, chunk=32, **options))
    assert [len(piece) for piece in pieces] == [32, 32, 6]
    assert np.array_equal(np.concatenate([piece.channel("angle") for piece in pieces]), whole.channel("angle"))
    with pytest.raises(UsageError, check=coded("not-recorded", "angle, wheel_angle, command")):
        whole.channel("adaptive_gain")


def test_lengths_and_keys_that_cannot_be_are_refused():
    rig = Rig.builtin("paper")
    for empty in ([], np.empty(0)):
        with pytest.raises(UsageError, check=coded("bad-lengths", "axis.inertia")):
            simulate_ensemble(rig, duration=1.0, values={"axis.inertia": empty})
    with pytest.raises(InputError, check=coded("not-finite", "axis.inertia")):
        simulate_ensemble(rig, duration=1.0, values={"axis.inertia": [3e-3, np.inf]})
    with pytest.raises(UsageError, check=coded("bad-lengths", "2 entries", "3 runs")):
        simulate_ensemble(rig, fast, duration=1.0, seeds=[1, 2, 3], values={"axis.inertia": [3e-3, 2e-3]})
    with pytest.raises(UsageError, check=coded("unknown-key", "sensors.noise")):
        simulate_ensemble(rig, fast, duration=1.0, values={"sensors.noise": [0.0, 1e-3]})


def test_recordings_of_a_rig_that_logs_a_rate_are_refused():
    """They would lack the rate; the angles are there."""
    rig = Rig.builtin("paper").changed({"log.angle_speed": "rate"})
    runs = simulate_ensemble(rig, fast, duration=0.1)
    assert runs.channel("angle").shape == (1, 101)
    with pytest.raises(UsageError, check=coded("not-recorded")):
        runs.recording(0)
