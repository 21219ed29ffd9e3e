"""What the momentum balance of a log contradicts in the rig file, for a method that estimates otherwise."""

from __future__ import annotations

from dataclasses import dataclass, field

from swingid.balance.rows import Signals
from swingid.checks.hypothesis import Evidence, Judged
from swingid.checks.latency import with_latency
from swingid.checks.stated import CONFLICT, conflict
from swingid.checks.table import entries, messages_of
from swingid.errors import UnanswerableError
from swingid.preparation.prepared import Part, Prepared
from swingid.result.result import Message
from swingid.uncertainty.budget import Evaluated, Parameter, systematic
from swingid.uncertainty.significance import MATTERS

WORTH = 0.003
"""Relative change of the inertia that is worth a warning whatever the interval of the method."""


@dataclass(frozen=True)
class RigFileCheck:
    """The balance with its windows chosen as momentum does; conflict: `CONFLICT` of its own a11.

    answers: warnings and notes by inertia, computed once.
    """

    evidence: Evidence
    conflict: float
    answers: dict[Parameter, tuple[list[Message], list[Message]]] = field(default_factory=dict)

    @classmethod
    def of(cls, prepared: Prepared, part: Part | None = None, signals: Signals | None = None) -> RigFileCheck | None:
        """Of a prepared log; None where momentum has no answer.

        part, signals: those of momentum, with turning points read again, where they are known.
        """
        try:
            part = part or prepared.part(reread=True)
            choice, _ = with_latency(part, signals=signals)
        except UnanswerableError:
            return None
        evidence = Evidence(choice, part)
        return cls(evidence, conflict(evidence, choice.law.u))

    def conflict_with(self, u: float) -> float:
        """The conflict for an estimate whose standard uncertainty is `u`, which a poorer balance must not widen."""
        return conflict(self.evidence, u) if self.conflict else 0.0

    def alone(self, inertia: Parameter) -> Parameter:
        """The inertia without the conflict, which is named, and neither makes an estimate hopeless nor hides causes."""
        u = max((inertia.standard_uncertainty or 0.0) ** 2 - self.conflict**2, 0.0) ** 0.5
        return Parameter.of(inertia.value, u, inertia.unit)

    def _answers(self, inertia: Parameter) -> tuple[list[Message], list[Message]]:
        if inertia not in self.answers:
            law, alone = self.evidence.law, self.alone(inertia).standard_uncertainty or 0.0
            # what is wrong in the rig file widens the interval by its lack of fit, too, and would hide itself
            limit = min(alone, max(law.total, WORTH / MATTERS * law.a11))
            limits = {"alone": alone, "place": alone} | dict.fromkeys(("angle", "gravity", "timing"), limit)
            self.answers[inertia] = messages_of(self.evidence, Judged(inertia.value, law.a11, limits))
        return self.answers[inertia]

    def warnings(self, inertia: Parameter) -> list[Message]:
        """The contradictions that matter for this inertia."""
        return list(self._answers(inertia)[0])

    def notes(self, inertia: Parameter) -> list[Message]:
        """What this inertia assumes of torques that depend on the angle, and of what does not change."""
        return list(self._answers(inertia)[1])

    def widened(self, found: Evaluated) -> Evaluated:
        """Parameters and budget of the method with the uncertainty of the inertia by such torques and changes."""
        u = found.parameters["inertia"].standard_uncertainty
        if u is None:
            return found
        more = entries(self.evidence, min(u, self.evidence.law.u), own=False)
        for source, spread in more.items():
            if source != CONFLICT:  # which the method has in its budget
                found = found.widened(systematic(source), "inertia", spread)
        return found
