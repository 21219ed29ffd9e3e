"""Whether a log is of one rig from its start to its end: slow changes that were found, and parts that must agree.

Both follow from the balance of momentum, whatever a method computes of the same log (`balance.slow`, `balance.parts`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.balance.choice import Choice
from swingid.balance.parts import MIRRORED, Comparison, Prediction, compared, divisible, predicted, unexplained
from swingid.balance.slow import SlowEffect, change_over_time, slow_effects
from swingid.checks.answer import LEAST
from swingid.checks.ran import ran
from swingid.format import number, percent, plus_minus
from swingid.result.data import Agreement, Changing
from swingid.result.result import Message
from swingid.uncertainty.significance import CERTAIN, MATTERS

PARTS = "disagreement of parts of the log"
"""Source of `parts.unexplained` in a budget."""

SOURCES = {"friction": "change of the friction over the log", "zero": "drift of the angle's zero"}
"""Sources of slow changes in a budget."""

DIVIDED = {
    "time": "the first and the second half of the log",
    "amplitude": "larger and smaller swings",
    "direction": "motion with rising and with falling angle",
    "rise": "motion away from the middle and back to it",
}
"""The parts of each comparison."""

CAUSES = {
    "time": "something changes within the log (a clock or a sensor drifts, a bearing warms, a part loosens), or, where "
    "swings decay, depends on their size, as a spring or another torque of the angle does",
    "amplitude": "a torque depends on the angle (spring, cable, magnets, stop), or a scale in the rig file is wrong",
    "direction": "something is one-sided: a cable, backlash, an encoder off centre",
    "rise": "channels are not read at the same instant, or backlash or a cable with hysteresis acts",
}
"""What makes parts disagree: for each comparison what it shows best among the faults of `study.faults`."""


@dataclass(frozen=True)
class Stability:
    """Slow changes with their effects on the inertia, and comparisons of parts of the log.

    changing: each change over time. prediction: of the second half by the first.
    """

    effects: list[SlowEffect]
    changing: list[Changing]
    parts: list[Comparison]
    prediction: Prediction | None

    @classmethod
    def of(cls, choice: Choice) -> Stability:
        """Of the windows that momentum chose."""
        law, signals = choice.law, choice.signals
        divided = divisible(law, choice.tried.values())
        return cls(
            slow_effects(law, signals, choice.slow),
            [change_over_time(law, signals, kind) for kind in choice.slow],
            compared(divided, signals),
            predicted(divided),
        )

    def common(self, u: float) -> dict[str, float]:
        """Standard uncertainties of the inertia by source, of an estimate of u that has the changes as unknowns."""
        found = {PARTS: unexplained(self.parts, u)}
        return found | {SOURCES[effect.kind]: effect.u for effect in self.effects}

    def not_corrected(self, u: float) -> dict[str, float]:
        """The same for the estimate of a method that takes friction and zero as constant."""
        found = {PARTS: unexplained(self.parts, u)}
        return found | {SOURCES[effect.kind]: abs(effect.change) + effect.u for effect in self.effects}

    def agreement(self, carried: float) -> tuple[Agreement, ...]:
        """The comparisons as data; carried: what of the axis' inertia is not the body's."""
        return tuple(
            Agreement(
                one.name,
                (one.first[0] - carried, one.first[1]),
                (one.second[0] - carried, one.second[1]),
                one.difference,
                one.variance**0.5,
            )
            for one in self.parts
        )

    def extra(self) -> dict[str, float]:
        """For the details of a result."""
        return {} if self.prediction is None else {"held_out_residual": self.prediction.ratio}

    def messages(self, inertia: float, u: float, *, corrected: bool) -> tuple[list[Message], list[Message]]:
        """Warnings and notes on slow changes, and on what the first half does not predict.

        u: standard uncertainty of the inertia. corrected: whether the estimate has the changes as unknowns. A change is
        warned of where it changes the inertia by more than its uncertainty explains.
        """
        ran("stability")
        warnings: list[Message] = []
        notes: list[Message] = []
        for effect, change in zip(self.effects, self.changing, strict=True):
            matters = abs(effect.change) > max(MATTERS * u, LEAST * abs(inertia))
            text = _changes(change) + "; " + _effect(effect.change / inertia, corrected=corrected)
            code = {"friction": "friction-changes", "zero": "zero-drifts"}[effect.kind]
            (warnings if matters else notes).append(Message(code, text))
        if self.prediction is not None and self.prediction.significance > CERTAIN and not self.effects:
            text = (
                f"the fit of the first half of the log leaves {self.prediction.ratio:.2g} times the residuals in the "
                "second half that are expected: friction or a sensor is not the same in both, or no law of the speed "
                "describes the friction."
            )
            notes.append(Message("second-half-not-predicted", text))
        return warnings, notes + self.asymmetry(inertia)

    def disagreement(self, inertia: float, u: float) -> list[Message]:
        """A warning where parts of the log certainly disagree and that matters; u: without this disagreement."""
        if self.parts:
            ran("parts")
        least = max(MATTERS * u, LEAST * abs(inertia))
        found = [one for one in self.parts if abs(one.off) > max(CERTAIN * one.u, least)]
        if not found:
            return []
        worst = max(found, key=lambda one: abs(one.off))
        text = f"{_differ(worst, inertia)}, one of {len(self.parts)} such comparisons: {CAUSES[worst.name]}."
        return [Message("parts-disagree", text)]

    def asymmetry(self, inertia: float) -> list[Message]:
        """A note where parts that mirror one another certainly differ, which is not in the inertia of the whole."""
        found = [one for one in self.parts if one.name in MIRRORED and abs(one.deviation) > CERTAIN]
        texts = (f"{_differ(one, inertia)}: {CAUSES[one.name]}; in the whole log that cancels." for one in found)
        return [Message("mirrored-parts-differ", text) for text in texts]


def _differ(one: Comparison, inertia: float) -> str:
    by = plus_minus(100 * one.difference / inertia, 100 * one.variance**0.5 / abs(inertia), "%")
    return f"{DIVIDED[one.name]} give inertias that differ by {by}"


def _changes(change: Changing) -> str:
    """What changes, by how much, where."""
    values, times = change.values, change.times
    low, high = sorted((int(np.argmin(values)), int(np.argmax(values))))
    where = f"between {number(times[low], 's', 3)} and {number(times[high], 's', 3)}"
    if change.what == "friction":
        by = percent(float(values[high] - values[low]), sign=True)
        text = f"the friction changes by {by} of its mean {where} (loss at equal motion), as of a bearing that warms"
        return f"{text} (one free decay hardly distinguishes this from friction that depends on the size of the swings)"
    by = number(1e3 * float(values[high] - values[low]), "mrad" if change.unit == "rad" else "mm", 2)
    return f"the zero of the angle drifts by {by} {where}"


def _effect(share: float, *, corrected: bool) -> str:
    """What that does to the inertia, and what to do."""
    by = percent(share, sign=True)
    done = f"this method takes it as constant, and the inertia may be off by {by}"
    if corrected:
        done = f"it was estimated beside the inertia, which it changes by {by}"
    return f"{done}; log when the rig is warm and at rest before, or use shorter parts of the log."
