"""The inertia tensor of a CAD model: URDF, MJCF, or a mesh through trimesh; and its comparison with a measured one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from swingid.body.directions import NAMES, elements_of, matrix_of
from swingid.body.tables import Body
from swingid.errors import InputError, UsageError
from swingid.format import number, percent
from swingid.numerics.arrays import Array
from swingid.numerics.regression import squared_distance
from swingid.system import is_file, read_input
from swingid.units import Quantity, parse_quantity

MESHES = (".stl", ".obj", ".ply", ".off", ".glb", ".gltf", ".3mf")
LARGEST = 50_000_000
"""Bytes beyond which no URDF or MJCF is read; one with meshes beside it has thousands."""


@dataclass(frozen=True)
class CadBody:
    """A body of a CAD file: mass (kg), centre of mass (m), tensor (3, 3) about it (kg m²), in the frame of its link.

    density (kg/m³): of a mesh.
    """

    source: str
    name: str
    tensor: Array
    mass: float
    centre: Array
    density: float | None = None


@dataclass(frozen=True)
class Comparison:
    """Measured less CAD: differences (6,), standard uncertainties (6,), chi-square with 6 degrees of freedom.

    moments: principal moments (measured, CAD), (2, 3), which no error of the frame changes. mass: (measured, u, CAD).
    """

    body: CadBody
    differences: Array
    uncertainties: Array
    chi_square: float
    moments: Array
    mass: tuple[float, float, float] | None
    centre: Array | None

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "file": self.body.source,
            "link": self.body.name,
            "elements": dict(zip(NAMES, elements_of(self.body.tensor).tolist(), strict=True)),
            "differences": dict(zip(NAMES, self.differences.tolist(), strict=True)),
            "normalised": dict(zip(NAMES, (self.differences / self.uncertainties).tolist(), strict=True)),
            "chi_square": self.chi_square,
            "principal_moments": {"measured": self.moments[0], "cad": self.moments[1]},
            "mass": self.body.mass,
            "density": self.body.density,
        }

    def lines(self) -> list[str]:
        """Lines for a terminal."""
        largest = float(self.moments[0, 0])
        lines = [f"    measured less {self.body.source} ({self.body.name}), u: standard uncertainty of the measured"]
        for name, cad, off, u in zip(
            NAMES, elements_of(self.body.tensor), self.differences, self.uncertainties, strict=True
        ):
            share = percent(float(off) / largest, sign=True)
            value = number(float(cad), "kg m^2", 6)
            lines.append(f"    {name}: CAD {value:<22} {share:>9} of the largest moment, {off / u:+.1f} u")
        lines.append(f"    all six: chi-square {self.chi_square:.3g} with 6 degrees of freedom (95 %: below 12.6)")
        pairs = zip(*self.moments, strict=True)
        lines.append(
            "    principal moments, whatever the frame: "
            + ", ".join(f"{percent(float(mine / other - 1), sign=True)}" for mine, other in pairs)
        )
        if self.mass is not None:
            measured, u, cad = self.mass
            inside = f", {(measured - cad) / u:+.1f} u" if u else ""
            lines.append(f"    mass: CAD {number(cad, 'kg', 5)}, {percent(measured / cad - 1, sign=True)}{inside}")
        if self.centre is not None:
            shown = " ".join(f"{1e3 * part:+.3g}" for part in self.centre)
            lines.append(f"    centre of mass: measured less CAD [{shown}] mm")
        if self.body.density is not None:
            lines.append(f"    density of the mesh: {number(self.body.density, 'kg/m^3', 4)}")
        return lines


def compare(cad: CadBody, matrix: Array, covariance: Array, body: Body) -> Comparison:
    """A measured tensor (3, 3) with covariance (6, 6) beside one of CAD; both in the same frame."""
    off = elements_of(matrix) - elements_of(cad.tensor)
    chi_square = squared_distance(off, covariance, 1e-15)
    moments = np.stack([np.linalg.eigvalsh(tensor)[::-1] for tensor in (matrix, cad.tensor)])
    mass = None
    # a mesh without a density has the weighed mass itself
    if body.mass is not None and cad.mass != body.mass.value:
        mass = body.mass.value, body.mass.std or 0.0, cad.mass
    centre = None
    if body.centre_of_mass is not None:
        centre = np.array([part.value for part in body.centre_of_mass]) - cad.centre
    return Comparison(cad, off, np.sqrt(np.diag(covariance)), chi_square, moments, mass, centre)


def load_cad(
    path: str | Path,
    *,
    link: str | None = None,
    mass: Quantity | None = None,
    density: str | float | None = None,
    mesh_unit: str = "m",
) -> CadBody:
    """The tensor in a URDF, MJCF or mesh file, in the frame of its link, body or mesh.

    link: which of several. A mesh is solid and uniform: of `density`, else of the weighed `mass`; mesh_unit: length of
    its coordinates. Raises InputError, naming the file, for one that cannot be used, UsageError for contradictions.
    """
    name = str(path)
    if Path(name).suffix.lower() in MESHES:
        return _mesh(name, mass, density, mesh_unit)
    if density is not None or mesh_unit != "m":
        raise UsageError(f"density and mesh unit belong to a mesh; {name} states its inertia", code="contradiction")
    root = _document(name)
    if root.tag == "robot":
        return _chosen(name, link, "link", root.iter("link"), _urdf)
    if root.tag == "mujoco":
        if root.find(".//include") is not None:
            raise _unusable(name, "includes other files; compile it with MuJoCo and save the XML (mj_saveLastXML)")
        angles = _Angles.of(root)
        return _chosen(name, link, "body", root.iter("body"), lambda file, body: _mjcf(file, body, angles))
    raise _unusable(name, f"has the root <{root.tag[:40]}>; give a URDF (<robot>), an MJCF (<mujoco>) or a mesh")


def _unusable(name: str, problem: str) -> InputError:
    return InputError(f"{name} {problem}", code="cad")


def _document(name: str) -> ElementTree.Element:
    """The root of an XML file; no entities."""
    content = read_input(name, missing="give a URDF, an MJCF or a mesh", folder=("not-a-file", "give the file in it"),
                         most=LARGEST)  # fmt: skip
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise _unusable(name, "declares a document type, which neither URDF nor MJCF needs; remove it")
    try:
        return ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        kinds = ", ".join(MESHES)
        raise _unusable(name, f"is not XML ({error}); give a URDF, an MJCF or a mesh ({kinds})") from None


def _chosen(
    name: str,
    wanted: str | None,
    kind: str,
    elements: Iterable[ElementTree.Element],
    read: Callable[[str, ElementTree.Element], CadBody],
) -> CadBody:
    """The one body with an inertia, or that of a name."""
    bodies = list(elements)
    able = {body.get("name", ""): body for body in bodies if body.find("inertial") is not None}
    if wanted is None:
        if len(able) == 1:
            return read(name, next(iter(able.values())))
        if not able:
            raise _unusable(name, f"has no {kind} with <inertial>; add it, or compare with a mesh")
        raise UsageError(f"{name} has several bodies; choose one with --link: {', '.join(able)}", code="link")
    if wanted in able:
        return read(name, able[wanted])
    if any(body.get("name") == wanted for body in bodies):
        raise _unusable(name, f"states no <inertial> for the {kind} {wanted!r}; add it, or compare with a mesh")
    raise UsageError(f"{name} has no {kind} {wanted!r}; there are {', '.join(able) or 'none'}", code="link")


def _numbers(name: str, text: str | None, count: int, what: str) -> Array:
    """So many finite numbers of an attribute."""
    try:
        numbers = np.array([float(part) for part in (text or "").split()])
    except ValueError:
        numbers = np.empty(0)
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise _unusable(name, f"has {what} {(text or '')[:60]!r}, but needs {count} number{'s' * (count > 1)} there")
    return numbers


def _body(name: str, link: str, mass: float, centre: Array, turn: Array, tensor: Array) -> CadBody:
    """The tensor (3, 3) turned by `turn` into the frame of the link."""
    if not mass > 0:
        raise _unusable(name, f"gives {link!r} the mass {mass:g}, which must be positive")
    if not np.linalg.eigvalsh(tensor)[0] > 0:
        raise _unusable(name, f"gives {link!r} an inertia that is not positive definite; correct it")
    return CadBody(name, link, turn @ tensor @ turn.T, mass, centre)


def _urdf(name: str, link: ElementTree.Element) -> CadBody:
    """<inertial>: origin with fixed-axis roll, pitch, yaw (rad); mass; inertia about the origin, along its axes."""
    from scipy.spatial.transform import Rotation

    called = link.get("name", "")
    inertial = link.find("inertial")
    assert inertial is not None
    origin, mass, inertia = (inertial.find(tag) for tag in ("origin", "mass", "inertia"))
    if mass is None or inertia is None:
        raise _unusable(name, f"has an <inertial> of {called!r} without <mass> or <inertia>; add both")
    xyz = _numbers(name, "0 0 0" if origin is None else origin.get("xyz", "0 0 0"), 3, "xyz")
    rpy = _numbers(name, "0 0 0" if origin is None else origin.get("rpy", "0 0 0"), 3, "rpy")
    i = {key: float(_numbers(name, inertia.get(f"i{key}", "0" if key[0] != key[1] else None), 1, f"i{key}")[0])
         for key in NAMES}  # fmt: skip
    tensor = matrix_of(np.array(list(i.values())))
    turn = np.asarray(Rotation.from_euler("xyz", rpy).as_matrix())
    return _body(name, called, float(_numbers(name, mass.get("value"), 1, "mass value")[0]), xyz, turn, tensor)


@dataclass(frozen=True)
class _Angles:
    """How an MJCF writes angles: one unit in rad, and the sequence of Euler's."""

    unit: float
    sequence: str

    @classmethod
    def of(cls, root: ElementTree.Element) -> _Angles:
        """Read the conventions of <compiler>; MuJoCo's defaults are degrees and "xyz"."""
        unit, sequence = "degree", "xyz"
        for compiler in root.iter("compiler"):
            unit, sequence = compiler.get("angle", unit), compiler.get("eulerseq", sequence)
        return cls(1.0 if unit == "radian" else math.pi / 180, sequence)


def _mjcf(name: str, body: ElementTree.Element, angles: _Angles) -> CadBody:
    """<inertial>: pos, orientation, mass, diaginertia or fullinertia (xx yy zz xy xz yz)."""
    called = body.get("name", "")
    inertial = body.find("inertial")
    assert inertial is not None
    mass = float(_numbers(name, inertial.get("mass"), 1, "mass")[0])
    centre = _numbers(name, inertial.get("pos"), 3, "pos")
    full, diagonal = inertial.get("fullinertia"), inertial.get("diaginertia")
    if full is not None:
        tensor = matrix_of(_numbers(name, full, 6, "fullinertia"))
    else:
        tensor = np.diag(_numbers(name, diagonal, 3, "diaginertia"))
    return _body(name, called, mass, centre, _orientation(name, inertial, angles), tensor)


def _orientation(name: str, inertial: ElementTree.Element, angles: _Angles) -> Array:
    """Rotation matrix (3, 3) of quat, axisangle, euler, xyaxes or zaxis."""
    from scipy.spatial.transform import Rotation

    if (text := inertial.get("quat")) is not None:
        w, x, y, z = _unit(_numbers(name, text, 4, "quat"), name)
        return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())
    if (text := inertial.get("axisangle")) is not None:
        given = _numbers(name, text, 4, "axisangle")
        return np.asarray(Rotation.from_rotvec(given[3] * angles.unit * _unit(given[:3], name)).as_matrix())
    if (text := inertial.get("euler")) is not None:
        turn = Rotation.identity()
        for letter, angle in zip(angles.sequence, _numbers(name, text, 3, "euler"), strict=False):
            about_axis = Rotation.from_euler(letter.lower(), angle * angles.unit)
            # a lower-case letter turns about the moving axis, an upper-case about_axis about the fixed axis
            turn = turn * about_axis if letter.islower() else about_axis * turn
        return np.asarray(turn.as_matrix())
    if (text := inertial.get("xyaxes")) is not None:
        both = _numbers(name, text, 6, "xyaxes")
        x = _unit(both[:3], name)
        y = _unit(both[3:] - x * float(x @ both[3:]), name)
        return np.stack([x, y, np.cross(x, y)], axis=1)
    if (text := inertial.get("zaxis")) is not None:
        z = _unit(_numbers(name, text, 3, "zaxis"), name)
        axis = np.cross([0.0, 0.0, 1.0], z)
        size = float(np.linalg.norm(axis))
        axis = axis / size if size > 1e-12 else np.array([1.0, 0.0, 0.0])
        return np.asarray(Rotation.from_rotvec(math.atan2(size, float(z[2])) * axis).as_matrix())
    return np.eye(3)


def _unit(vector: Array, name: str) -> Array:
    size = float(np.linalg.norm(vector))
    if size < 1e-12:
        raise _unusable(name, "has an orientation with a vector of no length; correct it")
    unit: Array = vector / size
    return unit


def _mesh(name: str, mass: Quantity | None, density: str | float | None, unit: str) -> CadBody:
    """A closed mesh as a uniform solid."""
    try:
        import trimesh
    except ImportError:
        message = f"{name}: meshes need trimesh; install it with pip install 'swingid[meshes]'"
        raise UsageError(message, code="missing-package") from None
    if density is None and mass is None:
        raise UsageError(f"{name}: a mesh has no mass; give body.mass or --density", code="missing-key")
    scale = parse_quantity(f"1 {unit}", "m", "mesh unit").value
    if not is_file(name):
        read_input(name, missing="give the mesh", folder=("not-a-file", "give the mesh in it"))
    try:
        mesh: Any = trimesh.load(name, force="mesh")
        solid = bool(mesh.is_watertight) and float(mesh.volume) > 0
    except Exception as error:  # of any of trimesh's readers
        raise _unusable(name, f"is no mesh that trimesh reads ({type(error).__name__}: {str(error)[:80]})") from None
    if not solid:
        raise _unusable(name, "is not closed, or its faces point inwards, so it has no volume; repair the mesh")
    mesh.apply_scale(scale)
    volume = float(mesh.volume)
    rho = parse_quantity(density, "kg/m^3", "density").value if density is not None else mass.value / volume  # type: ignore[union-attr]
    if not rho > 0:
        raise UsageError(f"density is {rho:g}, but must be positive", code="out-of-range")
    mesh.density = rho
    return CadBody(name, "mesh", np.asarray(mesh.moment_inertia), rho * volume, np.asarray(mesh.center_mass), rho)
