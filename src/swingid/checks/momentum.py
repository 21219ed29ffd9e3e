"""Momentum's answer on a log, with which every other method is compared: one answer, made once and only when asked for.

It assumes least of all (no law of friction, no motor, no speed), so a difference beyond the uncertainties of both is an
error of the other method: it enters the other budget, so that the two 95 % intervals overlap, and is a warning where it
matters. What momentum's balance contradicts in the rig file concerns every method, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from swingid.balance.choice import Choice
from swingid.balance.motor import MotorBalance, motor_balance
from swingid.checks.answer import MotorCheck, check_motor, free_reading
from swingid.checks.hypothesis import Evidence, Judged, matters
from swingid.checks.latency import Moved
from swingid.checks.level import chosen_at_level
from swingid.checks.stated import CONFLICT, conflict
from swingid.checks.table import check_hypotheses, entries
from swingid.errors import UnanswerableError
from swingid.format import percent
from swingid.preparation.prepared import Part, Prepared
from swingid.result.checked import Checked, warned
from swingid.result.result import Message, Result
from swingid.result.sources import value_of
from swingid.uncertainty.budget import BudgetEntry, Evaluated, Parameter, combined, systematic
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.significance import INDICATED, MATTERS

DISAGREES = "disagreement with the momentum balance"
"""Source of the difference to momentum's answer in the budget of another method."""

WORTH = 0.003
"""Relative change of the inertia that is worth a warning whatever the interval of the method."""

LACK_OF_FIT = (
    "drift with the length of the windows",
    'disagreement of "swing" windows',
    'disagreement of "even" windows',
)
"""Sources of momentum's budget by which a log shows that something acts that its terms do not contain.

Another method has the same terms or fewer, so its budget lacks that error too, and its own scatter may not show it: the
probability of that is taken as the share that these sources have in momentum's variance of type A.
"""

NORMAL = 1.9599
"""Coverage factor of a 95 % interval, not above that of any (infinitely many degrees of freedom)."""


class Balanced(NamedTuple):
    """What `chosen_at_level` finds: the log at the level of the balance, its part, the fit of it, what it corrected."""

    prepared: Prepared
    part: Part
    choice: Choice
    moved: Moved


@dataclass(frozen=True, eq=False)
class MomentumCheck:
    """Momentum's answer to a log, and what a method that estimates otherwise has to say by it; each found once.

    read: the log as prepared. method: `momentum`; options: its own.
    """

    read: Prepared
    method: Callable[..., Result]
    options: Mapping[str, object] = field(default_factory=dict)
    judged: dict[Parameter, Checked] = field(default_factory=dict)

    @cached_property
    def _balanced(self) -> Balanced | UnanswerableError:
        try:
            return Balanced(*chosen_at_level(self.read, str(self.options.get("memory", "auto"))))
        except UnanswerableError as error:
            return error

    @property
    def balanced(self) -> Balanced:
        """The balance of the log. Raises UnanswerableError where the motion allows no fit."""
        if isinstance(self._balanced, UnanswerableError):
            raise self._balanced
        return self._balanced

    @property
    def prepared(self) -> Prepared:
        """The log as methods use it; what is unknown of an integrated rate as the balance gives it, else its error."""
        return self.read if self.read.encoders.level is None else self.balanced.prepared

    @cached_property
    def evidence(self) -> Evidence | None:
        """The balance that the hypotheses are tested on; None where the motion allows no fit."""
        if isinstance(self._balanced, UnanswerableError):
            return None
        return Evidence(self._balanced.choice, self._balanced.part, str(self.options.get("memory", "auto")))

    @cached_property
    def answer(self) -> Result | UnanswerableError:
        """Momentum's answer, or its refusal. Raises InputError where a channel has the wrong sign."""
        try:
            return self.method(self, **self.options)
        except UnanswerableError as error:
            return error

    def require_signs(self) -> None:
        """Raise InputError as `answer`."""
        _ = self.answer

    def result(self) -> Result:
        """Momentum's answer. Raises InputError as `answer`, UnanswerableError for its refusal."""
        if isinstance(self.answer, UnanswerableError):
            raise self.answer
        return self.answer

    @cached_property
    def motor_balance(self) -> MotorBalance | None:
        """Residuals of equation (II) on the windows of the balance; None without voltage, motor constants or fit."""
        if self.evidence is None:
            return None
        part, law = self.evidence.part, self.evidence.law
        return motor_balance(part.log, part.rig, self.evidence.signals, law.rows.windows, part.noise)

    def motor(self, inertia: Parameter, *, method: str = "momentum", uses_motor: bool = False) -> MotorCheck:
        """What equation (II) says of the wheel's angle and the motor, see `check_motor`; inertia: of the method."""
        if self.evidence is None:
            return MotorCheck()
        part, signals = self.evidence.part, self.evidence.signals
        without = None if self.motor_balance else free_reading(part.rig, signals, part.noise, inertia)
        return check_motor(self.motor_balance, signals, method=method, uses_motor=uses_motor, without=without)

    @cached_property
    def conflict(self) -> float:
        """Standard uncertainty of the balance's own inertia by `CONFLICT`."""
        return 0.0 if self.evidence is None else conflict(self.evidence, self.evidence.law.u)

    def conflict_with(self, u: float) -> float:
        """The conflict for an estimate whose standard uncertainty is `u`, which a poorer balance must not widen."""
        return conflict(self.evidence, u) if self.evidence is not None and self.conflict else 0.0

    def compared(self, evaluated: Evaluated, cause: str) -> tuple[Evaluated, Checked]:
        """Another method's answer, its inertia as uncertain as its difference to momentum's shows; the check of that.

        A source that both share (a constant of the rig) acts on the difference by the difference of its shifts. cause:
        the likely one, in words.
        """
        inertia = evaluated.parameters["inertia"]
        if isinstance(self.answer, UnanswerableError):
            return evaluated, self._refused(self.answer)
        if inertia.standard_uncertainty is None:
            return evaluated, Checked()
        other = self.answer.parameters["inertia"]
        gap = value_of(evaluated, "inertia", _alone("own")) - value_of(self.answer, "inertia", _alone("momentum's"))
        lacking = share_of(self.answer.budget, LACK_OF_FIT)
        dark = dark_uncertainty(gap.value, gap.u**2, inertia.standard_uncertainty, incomplete=lacking)
        widened = evaluated.widened(systematic(DISAGREES), "inertia", max(dark, overlapping(inertia, other)))
        if abs(gap.value) <= INDICATED * gap.u or not matters(gap.value, inertia.standard_uncertainty, other.value):
            return widened, Checked(ran=("momentum",))
        share = inertia.value / other.value - 1
        apart = f"{percent(abs(share))} {'more' if share > 0 else 'less'}"
        text = (
            f"this inertia is {apart} than that of the momentum method; the likely cause is "
            f"{cause}, on which the momentum method depends less."
        )
        return widened, warned(Message("disagrees-with-momentum", text), ran="momentum")

    def _refused(self, error: UnanswerableError) -> Checked:
        """A warning where momentum reads the motion and has no answer; a motion too short for it is no finding."""
        if self.evidence is None:
            return Checked()
        reason = error.message.rstrip(".")
        text = f"the momentum method, which assumes less, has no answer to compare this inertia with: {reason}."
        return warned(Message("not-compared-with-momentum", text))

    def alone(self, evaluated: Evaluated) -> Parameter:
        """The inertia without what is named by messages, and neither makes an estimate hopeless nor hides causes."""
        inertia = evaluated.parameters["inertia"]
        if inertia.standard_uncertainty is None:
            return inertia
        u = combined([entry for entry in evaluated.budget if entry.source not in (CONFLICT, DISAGREES)], "inertia")
        return Parameter.of(inertia.value, u, inertia.unit)

    def tested(self, inertia: Parameter) -> Checked:
        """The hypotheses of `checks.table` for an inertia as `alone` gives it."""
        if self.evidence is None:
            return Checked()
        if inertia not in self.judged:
            law, u = self.evidence.law, inertia.standard_uncertainty or 0.0
            # what is wrong in the rig file widens the interval by its lack of fit, too, and would hide itself
            limit = min(u, max(law.total, WORTH / MATTERS * law.a11))
            whole = math.hypot(u, *self._entries(u).values())
            limits = {"alone": u, "place": u, "whole": whole} | dict.fromkeys(("angle", "gravity", "timing"), limit)
            self.judged[inertia] = check_hypotheses(self.evidence, Judged(inertia.value, law.a11, limits))
        return self.judged[inertia]

    def widened(self, evaluated: Evaluated) -> Evaluated:
        """Parameters and budget of the method with the uncertainty of the inertia by such torques and changes."""
        u = evaluated.parameters["inertia"].standard_uncertainty
        if u is None or self.evidence is None:
            return evaluated
        for source, spread in self._entries(u).items():
            evaluated = evaluated.widened(systematic(source), "inertia", spread)
        return evaluated

    def _entries(self, u: float) -> dict[str, float]:
        """Standard uncertainties that `widened` adds to one of `u`, by source."""
        assert self.evidence is not None
        spreads = entries(self.evidence, min(u, self.evidence.law.u), of_balance=False)
        return {source: spread for source, spread in spreads.items() if source != CONFLICT}  # which the method has


def share_of(budget: Iterable[BudgetEntry], sources: Collection[str]) -> float:
    """Share of the type A variance of the inertia that is of these sources."""
    scattered = [entry for entry in budget if entry.parameter == "inertia" and entry.type == "A"]
    whole = combined(scattered, "inertia")
    return (
        (combined([entry for entry in scattered if entry.source in sources], "inertia") / whole) ** 2 if whole else 0.0
    )


def overlapping(inertia: Parameter, other: Parameter) -> float:
    """Standard uncertainty that an inertia lacks for its 95 % interval to meet another's, 0 where they overlap."""
    missing = abs(inertia.value - other.value) - _half_width(inertia) - _half_width(other)
    if not missing > 0:
        return 0.0
    u = (_half_width(inertia) + missing) / NORMAL
    return float((u**2 - (inertia.standard_uncertainty or 0.0) ** 2) ** 0.5)


def _half_width(parameter: Parameter) -> float:
    low, high = parameter.interval95 or (parameter.value, parameter.value)
    return (high - low) / 2


def _alone(run: str) -> Callable[[BudgetEntry], str]:
    """A constant is the same in both answers, anything else is not."""
    return lambda entry: entry.shared_id or f"{run}: {entry.source}"
