"""Exports move like the twin, and say what they lack; the independent integrators are MuJoCo's and python-control's."""

from __future__ import annotations

import importlib.util
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import swingid as sw
from swingid.cli.app import run
from swingid.errors import InputError, UsageError
from swingid.exchange import export
from swingid.exchange.equations import right_hand_side, states
from swingid.exchange.export import FORMATS
from swingid.exchange.model import model_of, rig_of
from swingid.model.dynamics import accelerations
from swingid.model.motor import motor_branch
from swingid.model.parameters import rig_vector
from swingid.numerics.arrays import Array
from swingid.result.result import Parameter, Result, refusal
from swingid.simulation.twin import Setup, run_of

WHEEL = """
name = "smooth wheel"
[axis]
gravity_torque = 78e-3
inertia = 302.2e-5
[axis.friction]
viscous = 1.1e-3
quadratic = 2e-4
cubic = 1e-5
[drive]
kind = "reaction-wheel"
[drive.wheel]
inertia = 11.34e-5
[drive.motor]
rotor_inertia = 0.21e-5
gear_ratio = 4.4
torque_per_volt = 52.04e-4
back_emf = 3.697e-6
viscous = 3.687e-5
efficiency = 0.9
voltage_limit = 10
"""
NONE = """
name = "arm"
[axis]
gravity_torque = 0.204
inertia = 3e-3
stiffness = 0.05
[axis.friction]
viscous = 1e-3
[drive]
kind = "none"
"""
DIRECT = NONE.replace('"none"', '"direct"').replace('"arm"', '"driven"') + "[log]\ntorque_gain = 1\n"
SLIDE = """
name = "slide"
[axis]
kind = "linear"
inertia = 95.0
[axis.friction]
viscous = 200.0
[drive]
kind = "direct"
[log]
torque_gain = 1
"""
ROUGH = WHEEL.replace("cubic = 1e-5", "coulomb = 1e-3\nstatic = 2e-3\nstribeck_speed = 0.4\noffset = 1e-4").replace(
    "efficiency = 0.9", "efficiency = 0.9\ncoulomb = 3e-3\ndead_zone = [-3e-4, 5e-4]"
)
SIDED = NONE.replace(
    "viscous = 1e-3",
    "viscous_positive = 1e-3\nviscous_negative = 2e-3\ncoulomb_positive = 2e-3\ncoulomb_negative = 1e-3",
)
COGGED = NONE + "[axis.cogging]\namplitude = 2e-3\norder = 6\nphase = 0.3\n"
DRAGGED = NONE.replace("viscous = 1e-3", "viscous = 1e-3\ndrag = 1e-3")
RIGS = {"wheel": WHEEL, "none": NONE, "direct": DIRECT, "slide": SLIDE}
ROUGH_RIGS = RIGS | {"rough": ROUGH, "sided": SIDED, "cogged": COGGED, "dragged": DRAGGED}
RATE, DURATION = 1000.0, 5.0


def case(text: str) -> tuple[Result, sw.Rig]:
    """The rig without its inertia and friction, and a result that found these."""
    rig = sw.Rig.from_text(text)
    names = ("viscous", "coulomb", "static", "stribeck_speed", "quadratic", "cubic", "offset")
    sided = ("viscous_positive", "viscous_negative", "coulomb_positive", "coulomb_negative")
    found = {name: getattr(rig.axis.friction, name, None) for name in (*names, *sided, "drag")}
    values = {"inertia": rig.axis.inertia, **found}
    unit = "kg" if rig.axis.kind == "linear" else "kg m^2"
    parameters = {
        name: Parameter.of(one.value, 1e-4 * abs(one.value), unit if name == "inertia" else "")
        for name, one in values.items()
        if one is not None
    }
    return Result("momentum", "ok", parameters), rig


def commands(rig: sw.Rig) -> Array:
    time = np.arange(int(RATE * DURATION) + 1) / RATE
    size = {"reaction-wheel": 4.0, "direct": 0.1 if rig.axis.kind == "rotary" else 300.0}.get(rig.drive.kind, 0.0)
    return size * (np.sin(8.5 * time) + 0.5 * np.sin(3 * time + 1))


def twin(rig: sw.Rig) -> Array:
    """True angle, and wheel angle, at each row."""
    drive = commands(rig) if rig.drive.kind != "none" else None
    truth = run_of(Setup(rig, duration=DURATION, rate=RATE, initial_angle=0.6, drive=drive)).truth
    return np.column_stack([truth.angle, truth.wheel_angle])


@pytest.mark.parametrize("name", RIGS)
def test_mujoco_moves_like_the_twin(tmp_path: Path, name: str) -> None:
    mujoco = pytest.importorskip("mujoco", minversion="3.6", reason="needs mujoco 3.6")
    result, rig = case(RIGS[name])
    done = export(result, rig, "mjcf", tmp_path / "rig.xml")
    assert done.left_out == ()
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "rig.xml"))
    data = mujoco.MjData(model)
    data.qpos[0] = 0.6
    seen = []
    for u in commands(rig):
        seen.append(np.resize(data.qpos.copy(), 2))
        if model.nu:
            data.ctrl[0] = u
        mujoco.mj_step(model, data)
    error = np.abs(np.array(seen) - twin(rig))[:, : model.nq]
    assert np.ptp(twin(rig)[:, 0]) > 0.1
    assert error[:, 0].max() < 1e-6
    assert error.max() < 1e-4  # the wheel turns by hundreds of radians


@pytest.mark.parametrize("name", ["rough", "sided", "cogged", "dragged"])
@pytest.mark.parametrize("to", ["mjcf", "urdf"])
def test_what_a_format_lacks_is_said_and_stands_in_the_file(
    tmp_path: Path, name: str, to: str, capsys: pytest.CaptureFixture[str]
) -> None:
    result, rig = case(ROUGH_RIGS[name])
    done = export(result, rig, to, tmp_path / f"rig{FORMATS[to][1]}")
    words = {
        "rough": ("Stribeck", "dead zone", "constant torque"),
        "sided": ("directions",),
        "cogged": ("cogging",),
        "dragged": ("drag of power 3/2",),
    }
    text = (tmp_path / f"rig{FORMATS[to][1]}").read_text(encoding="utf-8")
    for word in words[name]:
        assert word in done.summary()
        assert word in text
    ET.fromstring(text)


def test_dry_friction_in_mujoco_is_close_to_coulombs_law(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", minversion="3.6", reason="needs mujoco 3.6")
    result, rig = case(NONE.replace("viscous = 1e-3", "coulomb = 2e-3"))
    done = export(result, rig, "mjcf", tmp_path / "rig.xml")
    assert "creeps" in done.summary()
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "rig.xml"))
    data = mujoco.MjData(model)
    data.qpos[0] = 0.6
    seen = []
    for _ in range(int(RATE * DURATION) + 1):
        seen.append(data.qpos[0])
        mujoco.mj_step(model, data)
    assert np.abs(np.array(seen) - twin(rig)[:, 0]).max() < 0.02


def test_the_links_of_the_urdf_have_the_inertia_about_the_axis(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", minversion="3.6", reason="needs mujoco 3.6")
    result, rig = case(NONE)
    export(result, rig, "urdf", tmp_path / "rig.urdf")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "rig.urdf"))
    data = mujoco.MjData(model)
    data.qpos[0] = 0.4
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass) if mujoco.__version__ >= "4" else mujoco.mj_fullM(model, mass, data.qM)
    assert mass[0, 0] == pytest.approx(3e-3, rel=1e-6)
    assert data.qfrc_bias[0] * 9.80665 / 9.81 == pytest.approx(0.204 * np.sin(0.4), rel=1e-6)


def evaluated(model: Any, state: Array, u: float) -> dict[str, float]:
    """The equations as text, in Python."""
    names: dict[str, Any] = dict(model.constants) | dict(zip(states(model), state, strict=True)) | {"u": u}
    names |= {name: getattr(np, name) for name in ("sin", "cos", "exp", "sqrt", "abs", "sign")}
    for name, expression in right_hand_side(model):
        names[name] = eval(expression, {"__builtins__": {}}, names)
    return names


@pytest.mark.parametrize("name", ROUGH_RIGS)
def test_the_equations_are_those_of_the_twin(name: str) -> None:
    result, rig = case(ROUGH_RIGS[name])
    model, p = model_of(result, rig), rig_vector(rig)
    generator = np.random.default_rng(3)
    for _ in range(100):
        state = generator.normal(0, [1, 3, 5, 40][: len(states(model))])
        u = float(generator.normal(0, 5))
        v2 = state[3] if model.has_wheel else 0.0
        s1, s2 = int(np.sign(state[1])), int(np.sign(v2)) if model.has_wheel else 0
        expected = accelerations(state[0], state[1], v2, 0.0, s1, s2, motor_branch(u, v2, p), u, p)
        found = evaluated(model, state, u)
        assert found["dv1"] == pytest.approx(expected[0], rel=1e-10, abs=1e-10)
        if model.has_wheel:
            assert found["dv2"] == pytest.approx(expected[1], rel=1e-10, abs=1e-10)


def module(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@pytest.mark.parametrize("name", RIGS)
def test_python_control_moves_like_the_twin(tmp_path: Path, name: str) -> None:
    control = pytest.importorskip("control", reason="needs control")
    result, rig = case(RIGS[name])
    export(result, rig, "python-control", tmp_path / "rig_model.py")
    system = module(tmp_path / "rig_model.py").system
    time = np.arange(int(RATE * DURATION) + 1) / RATE
    start = np.zeros(system.nstates)
    start[0] = 0.6
    # the twin's drive is held from row to row, so is this one: one run per row would be slow, so a free decay
    options = {"rtol": 1e-10, "atol": 1e-12}
    moved = control.input_output_response(
        system, time, np.zeros_like(time), start, solve_ivp_kwargs=options, solve_ivp_method="DOP853"
    )
    truth = run_of(Setup(rig, duration=DURATION, rate=RATE, initial_angle=0.6)).truth
    assert np.abs(moved.outputs[0] - truth.angle).max() < 1e-6


def test_the_linearisation_hangs_and_stands(tmp_path: Path) -> None:
    pytest.importorskip("control", reason="needs control")
    result, rig = case(ROUGH)
    done = export(result, rig, "python-control", tmp_path / "rough.py")
    assert "creeps" in done.summary()
    found = module(tmp_path / "rough.py")
    p = model_of(result, rig)
    a11, a12, a22, b = (p.value(name) for name in ("a11", "a12", "a22", "b"))
    stiff = a22 * b / (a11 * a22 - a12**2)
    assert found.linear().A[1, 0] == pytest.approx(-stiff, rel=1e-6)
    assert found.linear(np.pi).A[1, 0] == pytest.approx(stiff, rel=1e-6)
    assert (found.linear().poles().real < 1e-9).all()
    assert (found.linear(np.pi).poles().real > 0).any()
    torque = p.value("gear") * p.value("eta") * p.value("c1")
    assert found.linear().B[1, 0] == pytest.approx(-a12 * torque / (a11 * a22 - a12**2), rel=1e-6)


def test_the_matlab_function_has_the_same_lines(tmp_path: Path) -> None:
    result, rig = case(ROUGH)
    export(result, rig, "simulink-m", tmp_path / "rough.m")
    text = (tmp_path / "rough.m").read_text(encoding="utf-8")
    model = model_of(result, rig)
    for name, expression in right_hand_side(model):
        assert f"    {name} = {expression};" in text
    for name, value in model.constants.items():
        assert f"    p.{name} = {value!r};" in text
        assert f"    {name} = p.{name};" in text
    assert text.startswith("function [dx, A, B] = rough(x, u, p)")
    assert len(re.findall(r"^(?:function|    (?:if|for)|        (?:for)|    end|end|        end)\b", text, re.M)) == 14


def test_the_command_finds_the_rig_of_the_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = sw.Rig.load("paper")
    motion = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
    sw.simulate(rig, motion, sw.Compensator.paper(rig), duration=12.0, rate=1000.0).save(tmp_path / "a.parquet", rig)
    log, found, model = (str(tmp_path / name) for name in ("a.parquet", "r.json", "rig.xml"))
    assert run(["identify", log, "--rig", "paper", "--json", found]) == 0
    assert run(["export", found, "--to", "mjcf", "--out", model]) == 0
    seen = capsys.readouterr().out
    assert "wrote" in seen
    assert "not in it: the dead zone" in seen
    assert run(["export", found, "--to", "mjcf", "--out", str(tmp_path / "rig.txt")]) == 2
    assert run(["export", found, "--to", "python-control", "--out", str(tmp_path / "my-rig.py")]) == 2
    assert run(["export", str(tmp_path / "none.json"), "--to", "mjcf", "--out", model]) == 3


def test_what_cannot_be_exported_is_refused(tmp_path: Path) -> None:
    result, rig = case(NONE)
    with pytest.raises(UsageError) as caught:
        export(result, rig, "sdf", tmp_path / "x.sdf")
    assert caught.value.code == "unknown-format"
    with pytest.raises(InputError, match="refused"):
        export(refusal("momentum", InputError("x", code="y")), rig, "mjcf", tmp_path / "x.xml")
    with pytest.raises(UsageError, match="--rig"):
        rig_of(result, None)
    file = tmp_path / "rig.toml"
    file.write_text(NONE, encoding="utf-8")
    stale = Result("momentum", "ok", result.parameters, provenance={"rig_source": str(file), "rig_sha256": "0" * 64})
    with pytest.raises(UsageError, match="changed"):
        rig_of(stale, None)
    assert rig_of(stale, str(file)).name == "arm"
