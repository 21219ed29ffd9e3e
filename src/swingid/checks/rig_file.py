"""What the momentum balance of a log contradicts in the rig file: one consistency check for every method.

Angles alone determine whether the zero and the scale of the angle, the gravity torque against the drive's scale, and
the timing of the channels are as stated, whatever a method computes of the same log.
"""

from __future__ import annotations

from dataclasses import dataclass

from swingid.balance.choice import Choice
from swingid.balance.rows import Signals
from swingid.balance.systematics import PlaceFit, gravity_conflict, place_fits, place_torque
from swingid.checks.angle_scale import SCALE, check_angle_scale
from swingid.checks.closure import check_closure
from swingid.checks.latency import check_latency, with_latency
from swingid.checks.place import PLACE, check_place, spring_note
from swingid.checks.stability import Stability
from swingid.checks.stated import check_gravity, check_zero
from swingid.errors import UnanswerableError
from swingid.preparation.prepared import Part, Prepared
from swingid.result.result import Message
from swingid.uncertainty.budget import Evaluated, Parameter, systematic
from swingid.uncertainty.significance import MATTERS

CONFLICT = "conflict of the gravity torque with the log"
"""Source of `gravity_conflict` in a budget."""

WORTH = 0.003
"""Relative change of the inertia that is worth a warning whatever the interval of the method."""


@dataclass(frozen=True)
class RigFileCheck:
    """The momentum balance of a log for the check of another method; conflict: standard uncertainty of a11.

    place: fits with torques that depend on the angle and are not in the rig file.
    """

    choice: Choice
    part: Part
    conflict: float
    place: list[PlaceFit]
    stability: Stability

    @classmethod
    def of(cls, prepared: Prepared, part: Part | None = None, signals: Signals | None = None) -> RigFileCheck | None:
        """The balance with its windows chosen as momentum does; None where momentum has no answer.

        part, signals: those of momentum, with turning points read again, where they are known.
        """
        try:
            part = part or prepared.part(reread=True)
            choice, _ = with_latency(part, signals=signals)
        except UnanswerableError:
            return None
        law, signals = choice.law, choice.signals
        place = place_fits(law, signals, choice.tried.values())
        return cls(choice, part, gravity_conflict(law, prepared.rig, signals), place, Stability.of(choice))

    def conflict_with(self, u: float) -> float:
        """The conflict for an estimate whose standard uncertainty is `u`, which a poorer balance must not widen."""
        return gravity_conflict(self.choice.law, self.part.rig, self.choice.signals, u) if self.conflict else 0.0

    def alone(self, inertia: Parameter) -> Parameter:
        """The inertia without the conflict, which is named, and neither makes an estimate hopeless nor hides causes."""
        u = max((inertia.standard_uncertainty or 0.0) ** 2 - self.conflict**2, 0.0) ** 0.5
        return Parameter.of(inertia.value, u, inertia.unit)

    def warnings(self, inertia: Parameter) -> list[Message]:
        """The contradictions that matter for this inertia."""
        law = self.choice.law
        alone = self.alone(inertia).standard_uncertainty or 0.0
        # what is wrong in the rig file widens the interval by its lack of fit, too, and would hide itself
        limit = min(alone, max(law.total, WORTH / MATTERS * law.a11))
        found = contradictions(self.choice, self.part, limit, limit)
        if all(one.code == SCALE for one in found):  # errors of the angle seem to be such a torque, too
            found += check_place(law, self.place, alone)
        found += [] if found else check_closure(law)
        found += check_latency(self.choice, self.part, limit)
        size = inertia.value, alone
        found += [] if found else self.stability.disagreement(*size)
        return found + self.stability.messages(*size, corrected=False)[0]

    def notes(self, inertia: Parameter) -> list[Message]:
        """What this inertia assumes of torques that depend on the angle, and of what does not change."""
        u = self.alone(inertia).standard_uncertainty or 0.0
        slow = self.stability.messages(inertia.value, u, corrected=False)[1]
        return spring_note(self.choice.law, self.place, self.choice.signals, u) + slow

    def widened(self, found: Evaluated) -> Evaluated:
        """Parameters and budget of the method with the uncertainty of the inertia by such torques and changes."""
        u = found.parameters["inertia"].standard_uncertainty
        if u is None:
            return found
        u = min(u, self.choice.law.u)
        more = {PLACE: place_torque(self.place, u)} | self.stability.not_corrected(u)
        for source, spread in more.items():
            found = found.widened(systematic(source), "inertia", spread)
        return found


def contradictions(choice: Choice, part: Part, uncertainty: float, for_gravity: float | None = None) -> list[Message]:
    """The first contradiction of angle or gravity torque that matters, for each changes the gravity torque.

    uncertainty: the inertia's, without what contradicts the rig file; for_gravity: without the disagreement of windows
    as well, which a wrong scale causes, if not that of the chosen windows.
    """
    law, signals, tried = choice.law, choice.signals, choice.tried.values()
    return (
        check_zero(law, signals, uncertainty)
        or check_angle_scale(law, tried, signals, uncertainty)
        or check_gravity(law, tried, signals, part.rig, for_gravity)
    )
