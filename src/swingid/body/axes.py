"""From what is stated of an axis to the inertia about its parallel through the centre of mass, source by source.

J_axis = nᵀ J n + m d² (Huygens–Steiner). d is stated, or follows from a point on the axis and the centre of mass,
d² = |r|² − (n·r)², or from the gravity torque of a horizontal axis, d = b/(m g). Sources that several axes share (the
wheel's inertia, mass, fixture, mounting) have one identity and so correlate the axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from swingid.body.directions import hemisphere
from swingid.body.tables import Axes, AxisTable
from swingid.errors import InputError
from swingid.model.rig.gravity import UNKNOWN_PLACE
from swingid.numerics.arrays import Array
from swingid.pooling.runs import GRAVITY
from swingid.result.data import require_inertia
from swingid.result.file import load_result
from swingid.result.result import Message, Result
from swingid.result.sources import Identity, value_of, values_of
from swingid.uncertainty.budget import BudgetEntry, Source, scatter, stated
from swingid.uncertainty.uncertain import Uncertain, covariance, weighted_sum
from swingid.units import Quantity

TARE = " (tare)"
"""End of the names of sources that a result of `difference` has from the run without the body."""

SECOND_ORDER = "second order of lever and tilt"


@dataclass
class Identities:
    """Which entries of the budgets of several results are one physical quantity, as `difference` decides it.

    A source that states a shared quantity and the sign of its effect is one with that of another result where value
    and standard uncertainty are alike; all others, also those of type A without a sign, are each result's own.
    """

    known: dict[str, list[tuple[float | None, float]]] = field(default_factory=dict)
    keys: set[str] = field(default_factory=set)

    def of(self, result: Result, name: str) -> Identity:
        """The identity of each entry of a result."""
        tare = result.origin.runs.get("tare")
        run = None if tare is None else next(iter(tare.digests), tare.result)

        def key(entry: BudgetEntry) -> str:
            if run is not None and entry.source.endswith(TARE):
                return f"{run}: {entry.source}"
            if entry.shared_id is None or not entry.sensitivity:
                return f"{name}: {entry.source}"
            stated = result.origin.constants.get(entry.shared_id)
            numbered = f"{entry.shared_id} #{self._index(entry, None if stated is None else stated.value)}"
            self.keys.add(numbered)
            return numbered

        return key

    def _index(self, entry: BudgetEntry, value: float | None) -> int:
        """Number of the quantity among those of one shared id."""
        std = entry.standard_uncertainty / abs(entry.sensitivity or 1.0)
        known = self.known.setdefault(str(entry.shared_id), [])
        for k, (other, spread) in enumerate(known):
            same = value is None or other is None or math.isclose(value, other, rel_tol=1e-6)
            if same and math.isclose(std, spread, rel_tol=1e-6):
                return k
        known.append((value, std))
        return len(known) - 1


@dataclass(frozen=True)
class Axis:
    """One axis: unit vector (3,); inertia about it without the fixture, and about its parallel through the centre.

    across (3, 3): what the tensor about a point of the axis has beyond the one about the centre of mass, where the
    lever follows from a point (else 0). tilt (rad), and mounting with the standard uncertainty of its rotation (rad).
    """

    name: str
    direction: Array
    about_axis: Uncertain
    central: Uncertain
    across: Array
    tilt: float
    mounting: str | None = None
    rotation: float = 0.0

    def tilted(self, tensor: Array) -> Uncertain:
        """The central inertia with the uncertainty of the direction, for a tensor (3, 3).

        To first order a change δn of the direction changes the inertia by 2 nᵀ J δn, which is 0 about a principal
        axis; the second order δnᵀ (J − nᵀJn) δn is an entry of its own (JCGM 100 5.1.2, note).
        """
        n, whole = self.direction, tensor + self.across
        gradient = 2 * whole @ n
        plane = np.stack(perpendicular(n))
        source = stated("tilt of the axes", None)
        errors = [
            Uncertain.of(0.0, float(u), source, f"{self.name}: tilt {k}")
            for k, u in enumerate(plane @ gradient * self.tilt)
        ]
        if self.mounting is not None:
            source = stated(f"rotation of the mounting {self.mounting}", f"mounting.{self.mounting}")
            turned = np.cross(np.eye(3), n) @ gradient * self.rotation
            errors += [
                Uncertain.of(0.0, float(u), source, f"mounting {self.mounting} {k}") for k, u in enumerate(turned)
            ]
        bend = self.tilt**2 * (plane @ whole @ plane.T - float(n @ whole @ n) * np.eye(2))
        errors.append(_second_order(bend, f"{self.name}: second order"))
        return sum((error for error in errors if error.u), self.central)


def tilt_variances(tensor: Array, tilt: float) -> Array:
    """Variance (TRIED,) that a tilt (rad) gives the inertia about each direction of `hemisphere()`."""
    n = hemisphere()
    gradient = n @ tensor
    along = np.sum(gradient * n, axis=1)
    variances: Array = 4 * tilt**2 * (np.sum(gradient**2, axis=1) - along**2)
    return variances


def read_axes(axes: Axes, results: Sequence[Result | str | Path] = ()) -> tuple[list[Axis], Identities, list[Message]]:
    """The axes with their inertias; which sources results share; warnings and notes of the results as messages.

    results: for the axes that name none, in their order. Raises InputError that names file, axis and key.
    """
    identities = Identities()
    readings = [_Reading(axes, k, result, identities) for k, result in enumerate(_results(axes, results))]
    messages = [
        Message(m.code, f"{reading.name}: {m.message}", m.kind)
        for reading in readings
        for m in (() if reading.result is None else reading.result.warnings)
    ]
    return [reading.axis() for reading in readings], identities, messages


def _results(axes: Axes, results: Sequence[Result | str | Path]) -> list[Result | None]:
    """The result of each axis, None where it states its inertia itself."""
    empty = [k for k, table in enumerate(axes.tables) if table.result is None and table.inertia is None]
    if len(empty) != len(results):
        raise InputError(
            f"{axes.source} has {len(empty)} axes without result or inertia, but {len(results)} results were given; "
            "give one for each, in the order of the file",
            code="count",
        )
    by_axis: dict[int, Result | str | Path] = dict(zip(empty, results, strict=True))
    by_axis |= {k: axes.folder / table.result for k, table in enumerate(axes.tables) if table.result is not None}
    read: list[Result | None] = []
    logs: dict[str, str] = {}
    for k in range(len(axes.tables)):
        source = by_axis.get(k)
        result = None if source is None else _usable(source, axes.place(k))
        read.append(result)
        for log in () if result is None else result.origin.runs.get("loaded", result.origin).digests:
            if log in logs:
                message = f"{axes.place(k)}: result is of the same log as {logs[log]}; each axis needs its own"
                raise InputError(message, code="same-log")
            logs[log] = axes.names[k]
    return read


def _usable(source: Result | str | Path, place: str) -> Result:
    """A result with a rotary inertia and its uncertainty."""
    try:
        result = source if isinstance(source, Result) else load_result(source)
    except InputError as error:
        raise InputError(f"{place}: {error.message}", code=error.code) from None
    words = "the result" if isinstance(source, Result) else str(source)
    require_inertia(result, f"{place}: {words}")
    if result.inertia.unit.replace("*", " ") != "kg m^2":
        message = f"{place}: {words} is of a linear axis, in {result.inertia.unit}; give one of a rotary axis"
        raise InputError(message, code="different-units")
    if not result.inertia.standard_uncertainty:
        message = f"{place}: the inertia of {words} has no uncertainty, so it has no weight; identify the log again"
        raise InputError(message, code="no-uncertainty")
    return result


def shared(quantity: Quantity, key: str) -> Uncertain:
    """A stated quantity that is one and the same for all axes."""
    return quantity.uncertain(key) if quantity.std else Uncertain(quantity.value)


def _own(quantity: Quantity, key: str, source: str) -> Uncertain:
    """A quantity that is stated of one axis."""
    if not quantity.std:
        return Uncertain(quantity.value)
    return Uncertain.of(quantity.value, quantity.std, stated(source, None), key)


@dataclass(frozen=True)
class _Reading:
    """What the result of an axis, or the file, states of it."""

    axes: Axes
    k: int
    result: Result | None
    identities: Identities

    @property
    def table(self) -> AxisTable:
        return self.axes.tables[self.k]

    @property
    def name(self) -> str:
        return self.axes.names[self.k]

    def axis(self) -> Axis:
        """The axis, with its inertia about itself and about its parallel through the centre of mass."""
        table, about = self.table, self.inertia()
        central, across = self.central(about)
        rotation = self.axes.mountings.get(table.mounting or "", 0.0)
        direction = self.axes.directions[self.k]
        return Axis(self.name, direction, about, central, across, table.tilt or 0.0, table.mounting, rotation)

    def inertia(self) -> Uncertain:
        """About the axis, less the fixture."""
        name, table = self.name, self.table
        if self.result is not None:
            whole = _inertia_of(self.result, self.identities.of(self.result, name), name)
        else:
            assert table.inertia is not None
            whole = _own(table.inertia, f"{name}: inertia", "stated inertia about an axis")
        fixture = self._fixture()
        if fixture is None:
            return whole
        inertia = whole - fixture[0]
        if inertia.value <= 0:
            message = f"{self.axes.place(self.k)}: fixture has no less inertia than the axis with the body; check both"
            raise InputError(message, code="fixture")
        return inertia

    def _fixture(self) -> tuple[Uncertain, Result | None, str] | None:
        """Inertia of the fixture, its result, and how it is called in keys."""
        given = self.table.fixture
        if given is None:
            return None
        if isinstance(given, Quantity):
            # one number stated for several axes is one quantity
            return shared(given, f"fixture {given.value!r} {given.std!r}"), None, ""
        path = self.axes.folder / given
        result = _usable(path, f"{self.axes.place(self.k)}: fixture")
        name = f"fixture {given}"
        return _inertia_of(result, self.identities.of(result, name), name), result, name

    def central(self, about: Uncertain) -> tuple[Uncertain, Array]:
        """The inertia about the parallel through the centre of mass, and `across` of the axis."""
        body, table, n = self.axes.body, self.table, self.axes.directions[self.k]
        across = np.zeros((3, 3))
        if body.mass is None:
            return about, across
        mass = shared(body.mass, "body.mass")
        m = mass.value
        if table.distance is not None:
            d = _own(table.distance, f"{self.name}: distance", "distance of an axis")
            lever, spread = mass * d**2, np.array([[m * d.u**2]])
        elif table.point is not None:
            places = zip(body.centre_of_mass or (), "xyz", strict=True)
            centre = [shared(part, f"body.centre_of_mass.{letter}") for part, letter in places]
            points = [_own(part, f"{self.name}: point {i}", "place of an axis") for i, part in enumerate(table.point)]
            r = np.array([c.value - p.value for c, p in zip(centre, points, strict=True)])
            normal = np.eye(3) - np.outer(n, n)
            off = [weighted_sum((*centre, *points), row) for row in np.hstack([normal, -normal])]
            lever = mass * sum((length**2 for length in off), Uncertain(0.0))
            across = m * (float(r @ r) * np.eye(3) - np.outer(r, r))
            plane = np.stack(perpendicular(n))
            both = np.diag([c.u**2 + p.u**2 for c, p in zip(centre, points, strict=True)])
            spread = m * plane @ both @ plane.T
        else:
            b, g = self.gravity_torque(), shared(body.gravity or UNKNOWN_PLACE, "body.gravity")
            lever, spread = b**2 / mass / g**2, np.array([[b.u**2 / (m * g.value**2)]])
        central = about - lever
        if central.value <= 0:
            raise InputError(
                f"{self.axes.place(self.k)}: m d^2 = {lever.value:.4g} kg m^2 is more than the inertia about the axis, "
                f"{about.value:.4g} kg m^2; check mass, units and the distance of the centre of mass",
                code="parallel-axis",
            )
        further = _second_order(spread, f"{self.name}: lever")
        return (central + further if further.u else central), across

    def gravity_torque(self) -> Uncertain:
        """The gravity torque of the body about the axis, less the fixture's."""
        given, name = self.table.gravity_torque, self.name
        if isinstance(given, Quantity):
            return _own(given, f"{name}: gravity torque", "gravity torque of an axis")
        assert self.result is not None
        whole = self._torque_of(self.result, name)
        fixture = self._fixture()
        if fixture is None or fixture[1] is None:
            return whole
        return whole - self._torque_of(fixture[1], fixture[2])

    def _torque_of(self, result: Result, name: str) -> Uncertain:
        """The gravity torque identified in a result, else the one that its rig file states."""
        identity = self.identities.of(result, name)
        torque = result.parameters.get("gravity_torque")
        if torque is not None and torque.standard_uncertainty is not None:
            return _identified_torque(result, identity, name)
        known = result.origin.constants.get(GRAVITY)
        if known is None:
            raise InputError(
                f'{self.axes.place(self.k)}: gravity_torque is "result", but {name} neither identifies nor states one; '
                "write the torque in N*m, or give distance or point",
                code="missing-key",
            )
        if not known.std:
            return Uncertain(known.value)
        entry = BudgetEntry(stated(GRAVITY, GRAVITY, known.std), "inertia", known.std, 1.0)
        return Uncertain.of(known.value, known.std, entry.origin, identity(entry))


def _inertia_of(result: Result, identity: Identity, name: str) -> Uncertain:
    """Inertia with its sources; a result without a budget has one of its own."""
    inertia = value_of(result, "inertia", identity)
    if inertia.shifts:
        return inertia
    parameter = result.inertia
    source = scatter("scatter", parameter.degrees_of_freedom)
    return Uncertain.of(parameter.value, parameter.standard_uncertainty or 0.0, source, f"{name}: scatter")


def _identified_torque(result: Result, identity: Identity, name: str) -> Uncertain:
    """The gravity torque of a result; its scatter is correlated with that of the inertia as the result states it."""
    inertia, torque = values_of(result, ("inertia", "gravity_torque"), identity).values()
    both = covariance([inertia.of_type("A"), torque.of_type("A")])
    size, spread = np.sqrt(np.diag(both)).tolist()
    r = float(np.clip(both[0, 1] / (size * spread), -1.0, 1.0)) if size * spread else 0.0
    freedom = min((torque.sources[key].degrees_of_freedom for key in torque.of_type("A").shifts), default=math.inf)
    alone = scatter("scatter of the gravity torque", freedom)
    known = torque.of_type("B")
    if r:
        known += r * spread / size * replace(inertia.of_type("A"), value=0.0)
    return known + Uncertain.of(0.0, spread * math.sqrt(1 - r * r), alone, f"{name}: gravity torque alone")


def _second_order(spread: Array, key: str) -> Uncertain:
    """Error by a quadratic form of normal quantities with mean tr A and variance 2 tr A², about 0."""
    u = math.sqrt(2 * float(np.sum(spread * spread)) + float(np.trace(spread)) ** 2)
    return Uncertain.of(0.0, u, Source(SECOND_ORDER, "B"), key)


def perpendicular(n: Array) -> tuple[Array, Array]:
    """Two unit vectors across a unit vector, right-handed with it."""
    start = np.eye(3)[int(np.argmin(np.abs(n)))]
    first = start - n * float(n @ start)
    first = first / np.linalg.norm(first)
    return first, np.cross(n, first)
