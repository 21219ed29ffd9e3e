"""A body that hangs on parallel strings and turns about the vertical: bifilar and trifilar suspension.

Strings from a circle of radius R above to one of radius r on the body, which is h below: at the angle q the horizontal
distance of the ends of a string is c² = R² + r² − 2 R r cos q, so the height is H² = L² − c² = h² (1 − ε (1 − cos q)),
ε = 2 R r/h². With the potential energy −m g H the torque is, exactly,

    m g R r sin q / H = κ sin q / √(1 − ε (1 − cos q)),    κ = m g R r / h,

for two strings (R, r half of the distances D, d: κ = m g D d/(4 h)) as for three. Strings are thin, stiff and massless.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import PlainValidator, model_validator

from swingid.model.rig.fields import Table, plain_number, quantity, quantity_or_unknown, refuse, stated
from swingid.model.rig.gravity import NORMAL_GRAVITY, UNKNOWN_PLACE, normal_gravity
from swingid.units import Quantity

Length = Annotated[Quantity, quantity("m", above=0)]
FREE_FALL = UNKNOWN_PLACE.value


class Suspension(Table):
    """Strings by what acts: κ (N m/rad), ε, and the height h (m) of the suspension, of which the rise depends.

    height: 0 where the vertical motion is negligible.
    """

    stiffness: Annotated[Quantity | Literal["unknown"], PlainValidator(quantity_or_unknown("N*m/rad", above=0))]
    shape: Annotated[float, plain_number("", least=0, below=2)] = 0.0
    height: Annotated[float, plain_number("m", least=0)] = 0.0

    @property
    def rise(self) -> float:
        """μ/κ in s²: the vertical motion adds the inertia μ sin² q, μ = m (R r/h)² = κ ε h/(2 g)."""
        return self.shape * self.height / (2 * FREE_FALL)


class _Strings(Table):
    """What bifilar and trifilar have in common: mass of all that hangs, length of a string or height h, place.

    across: the key of what stands between the strings on the body; that above has "upper_" before it.
    """

    across: ClassVar[str]
    mass: Annotated[Quantity | Literal["unknown"], PlainValidator(quantity_or_unknown("kg", above=0))]
    length: Length | None = None
    height: Length | None = None
    g: Annotated[Quantity, quantity("m/s^2", above=0)] | None = None
    latitude: Annotated[float, plain_number("rad", least=-math.pi / 2, most=math.pi / 2)] | None = None

    @model_validator(mode="after")
    def _one_height(self) -> Self:
        if (self.length is None) == (self.height is None):
            if self.length is None:
                refuse("missing-key", "is missing: give the length of the strings, or the height", "length")
            refuse("contradiction", "is given beside length; keep one", "height")
        if self.g is not None and self.latitude is not None:
            refuse("contradiction", "is given beside latitude; keep one", "g")
        self.suspension()
        return self

    @property
    def free_fall(self) -> Quantity:
        """Acceleration of free fall, m/s²."""
        if self.latitude is not None:
            return Quantity(normal_gravity(self.latitude), NORMAL_GRAVITY)
        return self.g or UNKNOWN_PLACE

    @property
    def radii(self) -> tuple[Quantity, Quantity]:
        """R above and r on the body, m."""
        raise NotImplementedError

    def suspension(self) -> dict[str, Any]:
        """The table [axis.suspension] that it stands for; its uncertainties are independent (GUM 5.1.2).

        Raises PydanticCustomError for strings that are too short.
        """
        upper, lower = self.radii
        same = not stated(self, f"upper_{self.across}")
        apart = 0.0 if same else upper.value - lower.value
        given, key = self.height or self.length, "height" if self.height else "length"
        assert given is not None
        square = given.value * given.value - (0.0 if self.height else apart * apart)
        if not 0 < square < math.inf:
            refuse("out-of-range", f"is {given.value:g} m, too short for these distances", key)
        h = math.sqrt(square)
        shape = 2 * upper.value * lower.value / square
        if shape >= 2:
            refuse("out-of-range", f"is {given.value:g} m, too short for these distances", key)
        fields: dict[str, Any] = {"shape": shape, "height": h, "stiffness": "unknown"}
        if isinstance(self.mass, Quantity):
            table = f"axis.{type(self).__name__.lower()}"
            r = lower.uncertain(f"{table}.{self.across}")
            above = r if same else upper.uncertain(f"{table}.upper_{self.across}")
            long = given.uncertain(f"{table}.{key}")
            high = long if self.height else (long**2 - (above - r) ** 2) ** 0.5
            weight = self.mass.uncertain(f"{table}.mass") * self.free_fall.uncertain(f"{table}.g")
            kappa = weight * above * r / high
            fields["stiffness"] = Quantity.of(kappa)
        return fields


class Bifilar(_Strings):
    """Two strings, their distance at the body and above (by default the same)."""

    distance: Length
    upper_distance: Length | None = None
    across: ClassVar[str] = "distance"

    @property
    def radii(self) -> tuple[Quantity, Quantity]:
        """Half of the distances, m."""
        return _half(self.upper_distance or self.distance), _half(self.distance)


class Trifilar(_Strings):
    """Three strings at the corners of equal-sided triangles: radius of their circle on the body, and above."""

    radius: Length
    upper_radius: Length | None = None
    across: ClassVar[str] = "radius"

    @property
    def radii(self) -> tuple[Quantity, Quantity]:
        """The radii, m."""
        return self.upper_radius or self.radius, self.radius


def _half(distance: Quantity) -> Quantity:
    return Quantity.of(distance.uncertain("distance") / 2)
