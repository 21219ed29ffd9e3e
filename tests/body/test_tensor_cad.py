"""Inertia tensors of CAD files: against formulas, MuJoCo and Pinocchio; comparison with a measured tensor."""

from __future__ import annotations

import math
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import swingid as sw
from body_on_axis import inertia_about
from refusals import coded
from swingid.body.cad import load_cad
from swingid.body.directions import elements_of, rows_of
from swingid.body.tables import axes_from_text
from swingid.cli import main
from swingid.errors import InputError, SwingidError, UsageError
from swingid.numerics.arrays import Array
from swingid.units import Quantity

URDF = """<?xml version="1.0"?>
<robot name="r"><link name="frame"/><link name="arm"><inertial>
<origin xyz="0.1 -0.2 0.3" rpy="0.4 -0.5 0.6"/><mass value="1.5"/>
<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="-0.002" iyz="0.003"/>
</inertial></link></robot>"""
INERTIA = np.array([[0.02, 0.001, -0.002], [0.001, 0.03, 0.003], [-0.002, 0.003, 0.04]])
TURNS = {
    "none": "",
    "quat": 'quat="0.5 0.1 -0.7 0.3"',
    "axisangle": 'axisangle="1 2 -1 35"',
    "euler": 'euler="20 -30 50"',
    "xyaxes": 'xyaxes="1 0.2 0 0.1 1 0.4"',
    "zaxis": 'zaxis="0.3 -0.2 0.8"',
    "zaxis down": 'zaxis="0 0 -1"',
}


def mjcf(turn: str, compiler: str = "", inertia: str = 'diaginertia="0.02 0.03 0.04"') -> str:
    return (
        f'<mujoco><compiler {compiler}/><worldbody><body name="arm"><freejoint/>'
        f'<inertial pos="0.1 -0.2 0.3" mass="1.5" {turn} {inertia}/></body></worldbody></mujoco>'
    )


def written(folder: Path, text: str, name: str = "body.xml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def rotation(axis: Array, angle: float) -> Array:
    """By the exponential of the cross product's matrix (Rodrigues)."""
    x, y, z = axis / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def test_a_urdf_turns_by_roll_pitch_and_yaw(tmp_path: Path) -> None:
    found = load_cad(written(tmp_path, URDF))
    x, y, z = np.eye(3)
    turn = rotation(z, 0.6) @ rotation(y, -0.5) @ rotation(x, 0.4)
    assert np.allclose(found.tensor, turn @ INERTIA @ turn.T)
    assert (found.name, found.mass) == ("arm", 1.5)
    assert found.centre == pytest.approx([0.1, -0.2, 0.3])


def test_mjcf_orientations_by_formulas(tmp_path: Path) -> None:
    x, y, z = np.eye(3)
    d = np.pi / 180
    q = np.array([0.5, 0.1, -0.7, 0.3]) / np.linalg.norm([0.5, 0.1, -0.7, 0.3])
    expected = {
        "none": np.eye(3),
        "quat": rotation(q[1:], 2 * math.atan2(float(np.linalg.norm(q[1:])), q[0])),
        "axisangle": rotation(np.array([1.0, 2, -1]), 35 * d),
        "euler": rotation(x, 20 * d) @ rotation(y, -30 * d) @ rotation(z, 50 * d),
    }
    for name, turn in expected.items():
        found = load_cad(written(tmp_path, mjcf(TURNS[name])))
        assert np.allclose(found.tensor, turn @ np.diag([0.02, 0.03, 0.04]) @ turn.T), name
    fixed = load_cad(written(tmp_path, mjcf('euler="0.2 -0.3 0.5"', 'angle="radian" eulerseq="XYZ"')))
    turn = rotation(z, 0.5) @ rotation(y, -0.3) @ rotation(x, 0.2)
    assert np.allclose(fixed.tensor, turn @ np.diag([0.02, 0.03, 0.04]) @ turn.T)
    full = load_cad(written(tmp_path, mjcf("", inertia='fullinertia="0.02 0.03 0.04 0.001 -0.002 0.003"')))
    assert np.allclose(full.tensor, INERTIA)


@pytest.mark.parametrize(
    "text",
    [
        *(mjcf(turn) for turn in TURNS.values()),
        mjcf('euler="0.2 -0.3 0.5"', 'angle="radian" eulerseq="zYx"'),
        mjcf("", inertia='fullinertia="0.02 0.03 0.04 0.001 -0.002 0.003"'),
    ],
)
def test_mujoco_reads_the_same_tensor(tmp_path: Path, text: str) -> None:
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    model = mujoco.MjModel.from_xml_string(text)
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[1])
    turn = turn.reshape(3, 3)
    found = load_cad(written(tmp_path, text))
    assert np.allclose(found.tensor, turn @ np.diag(model.body_inertia[1]) @ turn.T, atol=1e-12)
    assert found.mass == pytest.approx(model.body_mass[1])
    assert found.centre == pytest.approx(model.body_ipos[1])


def test_mujoco_moves_the_tensor_to_an_axis_as_the_twin_does(tmp_path: Path) -> None:
    """The joint-space inertia of one hinge about any axis."""
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    text = mjcf(TURNS["euler"])
    body = load_cad(written(tmp_path, text))
    for axis, place in (([1, 0, 0], [0, 0, 0]), ([1, -2, 0.5], [0.3, 0.1, -0.2])):
        joint = f'<joint type="hinge" axis="{" ".join(map(str, axis))}" pos="{" ".join(map(str, place))}"/>'
        model = mujoco.MjModel.from_xml_string(text.replace("<freejoint/>", joint))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        expected, _ = inertia_about(body.tensor, body.mass, list(body.centre), axis, place)
        mass_matrix = np.zeros((1, 1))
        try:
            mujoco.mj_fullM(model, mass_matrix, data.qM)
        except (TypeError, AttributeError):  # signature of later versions
            mujoco.mj_fullM(model, data, mass_matrix)
        assert mass_matrix[0, 0] == pytest.approx(expected, rel=1e-9)


def test_pinocchio_reads_the_same_tensor(tmp_path: Path) -> None:
    pinocchio = pytest.importorskip("pinocchio", reason="Pinocchio is not installed")
    text = URDF.replace('<link name="frame"/>', "")
    path = written(tmp_path, text, "body.urdf")
    model = pinocchio.buildModelFromUrdf(str(path), pinocchio.JointModelFreeFlyer())
    inertia = model.inertias[1]
    found = load_cad(path)
    assert np.allclose(found.tensor, inertia.inertia)
    assert found.mass == pytest.approx(inertia.mass)
    assert found.centre == pytest.approx(inertia.lever)


BAD = {
    "no xml": ("ixx = 1", "is not XML"),
    "other root": ("<svg/>", "has the root <svg>"),
    "entity": ('<!DOCTYPE x [<!ENTITY a "b">]><robot/>', "declares a document type"),
    "no inertial": ('<robot><link name="a"/></robot>', "has no link with <inertial>"),
    "no mass": (URDF.replace('<mass value="1.5"/>', ""), "without <mass> or <inertia>"),
    "zero mass": (URDF.replace('value="1.5"', 'value="0"'), "which must be positive"),
    "text": (URDF.replace('ixx="0.02"', 'ixx="much"'), "has ixx 'much'"),
    "no ixx": (URDF.replace('ixx="0.02"', ""), "has ixx ''"),
    "infinite": (URDF.replace('ixx="0.02"', 'ixx="inf"'), "has ixx 'inf'"),
    "rpy": (URDF.replace("0.4 -0.5 0.6", "0.4 -0.5"), "has rpy '0.4 -0.5', but needs 3 numbers"),
    "indefinite": (URDF.replace('ixx="0.02"', 'ixx="-0.02"'), "not positive definite"),
    "geoms only": ('<mujoco><body name="a"><geom size="1"/></body></mujoco>', "has no body with <inertial>"),
    "include": ('<mujoco><include file="x.xml"/></mujoco>', "mj_saveLastXML"),
    "no quaternion": (mjcf('quat="0 0 0 0"'), "a vector of no length"),
}


@pytest.mark.parametrize(("text", "words"), BAD.values(), ids=BAD)
def test_a_bad_file_is_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        load_cad(written(tmp_path, text))
    assert words in caught.value.message


def test_of_several_links_one_is_chosen(tmp_path: Path) -> None:
    path = written(
        tmp_path, URDF.replace("</robot>", URDF[URDF.index('<link name="arm">') :].replace('"arm"', '"leg"'))
    )
    with pytest.raises(UsageError, check=coded("link", "--link: arm, leg")):
        load_cad(path)
    assert load_cad(path, link="leg").name == "leg"
    with pytest.raises(UsageError, check=coded("link", "'hand'", "arm, leg")):
        load_cad(path, link="hand")
    with pytest.raises(InputError, check=coded("cad", "<inertial>", "'frame'")):
        load_cad(path, link="frame")


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=200) | st.text(max_size=200).map(lambda text: f"<robot>{text}</robot>".encode()))
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.mktemp("cad") / "x.xml"
    path.write_bytes(content)
    with pytest.raises(SwingidError):
        load_cad(path)


# meshes


def stl(folder: Path, size: tuple[float, float, float], *, closed: bool = True) -> Path:
    """A box as binary STL, one corner at the origin."""
    corners = np.array([[x, y, z] for x in (0, size[0]) for y in (0, size[1]) for z in (0, size[2])], dtype=np.float32)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [(a, b, c) for f in faces for a, b, c in ((f[0], f[1], f[2]), (f[0], f[2], f[3]))]
    content = b"\0" * 80 + struct.pack("<I", len(triangles) - (not closed))
    for triangle in triangles[: len(triangles) - (not closed)]:
        content += struct.pack("<12fH", 0, 0, 0, *corners[list(triangle)].ravel(), 0)
    path = folder / "box.stl"
    path.write_bytes(content)
    return path


def test_a_mesh_is_a_uniform_solid(tmp_path: Path) -> None:
    pytest.importorskip("trimesh", reason="trimesh is not installed")
    path = stl(tmp_path, (100.0, 200.0, 300.0))
    by_density = load_cad(path, density="2700 kg/m^3", mesh_unit="mm")
    mass = 2700 * 0.1 * 0.2 * 0.3
    expected = mass / 12 * np.diag([0.13, 0.1, 0.05])
    assert np.allclose(by_density.tensor, expected, atol=1e-6)
    assert by_density.centre == pytest.approx([0.05, 0.1, 0.15])
    by_mass = load_cad(path, mass=Quantity(mass), mesh_unit="mm")
    assert by_mass.density == pytest.approx(2700, rel=1e-6)
    with pytest.raises(UsageError, match=r"give body\.mass or --density"):
        load_cad(path)
    with pytest.raises(InputError, check=coded("cad")):
        load_cad(stl(tmp_path, (1, 1, 1), closed=False), mass=Quantity(1.0))
    (tmp_path / "no.stl").write_bytes(b"solid nothing")
    with pytest.raises(InputError, match=r"no\.stl is"):
        load_cad(tmp_path / "no.stl", mass=Quantity(1.0))


def test_without_trimesh_a_mesh_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(UsageError, check=coded("missing-package", "'swingid[meshes]'")):
        load_cad(tmp_path / "x.stl", mass=Quantity(1.0))


# comparison


def test_the_comparison_is_in_standard_uncertainties(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = np.array([[0.02, 0.001, -0.002], [0.001, 0.03, 0.003], [-0.002, 0.003, 0.0401]])
    path = written(tmp_path, mjcf("", inertia='fullinertia="0.02 0.03 0.04 0.001 -0.002 0.003"'))
    text = '[body]\nmass = "1.51 ± 0.01 kg"\n[every_axis]\ntilt = 0\ndistance = 0\n'
    directions = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 1, 1]]
    for n in np.array(directions, dtype=float):
        value = float((rows_of((n / np.linalg.norm(n))[None]) @ elements_of(truth))[0])
        text += f'[[axis]]\ndirection = {n.tolist()}\ninertia = "{value!r} ± 1e-5 kg*m^2"\n'
    found = sw.tensor(axes_from_text(text), compare_with=load_cad(path))
    comparison = found.comparison
    assert comparison is not None
    assert comparison.differences == pytest.approx([0, 0, 1e-4, 0, 0, 0], abs=1e-12)
    off = comparison.differences
    assert comparison.chi_square == pytest.approx(float(off @ np.linalg.inv(found.covariance) @ off))
    assert comparison.mass == (1.51, 0.01, 1.5)
    assert found.to_dict()["comparison"]["normalised"]["zz"] == pytest.approx(1e-4 / math.sqrt(found.covariance[2, 2]))
    axes = written(tmp_path, text, "axes.toml")
    assert main(["tensor", str(axes), "--compare", str(path), "--link", "arm"]) == 0
    out = capsys.readouterr().out
    assert "mass: CAD 1.5 kg, +0.67 %, +1.0 u" in out
