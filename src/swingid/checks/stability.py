"""The test whether one rig made the whole log: slow changes that were found, and parts that must agree.

Both follow from the balance of momentum, whatever a method computes of the same log (`balance.slow`, `balance.parts`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from swingid.balance.parts import MIRRORED, Comparison
from swingid.checks.hypothesis import Evidence, Finding, Judged
from swingid.format import number, percent, plus_minus
from swingid.result.data import Agreement, Changing
from swingid.uncertainty.significance import CERTAIN

PARTS = "disagreement of parts of the log"
"""Source of `parts.unexplained` in a budget."""

SOURCES = {"friction": "change of the friction over the log", "zero": "drift of the angle's zero"}
"""Sources of slow changes in a budget."""

DIVIDED = {
    "time": "the first and the second half of the log",
    "amplitude": "larger and smaller swings",
    "direction": "motion with rising and with falling angle",
    "rise": "motion away from the middle and back to it",
    "speed": "faster and slower swings",
    "place": "swings about larger and about smaller angles",
}
"""The parts of each comparison."""

CAUSES = {
    "time": "something changes within the log (a clock or a sensor drifts, a bearing warms, a part loosens), or, where "
    "swings decay, depends on their size, as a spring or another torque of the angle does",
    "amplitude": "a torque of the angle is not as stated (spring, cable, magnets, stop), the pivot rolls or gives way "
    "before it slides, or the angle's scale is wrong",
    "speed": "friction or drag that no law of the speed describes, a channel that is late or filtered, or two tones of "
    "which one is near resonance",
    "place": "a torque depends on the angle, or its zero or scale is wrong",
    "direction": "something is one-sided: a cable, backlash, an encoder off centre",
    "rise": "channels are not read at the same instant, or backlash or a cable with hysteresis acts",
}
"""What makes parts disagree: for each comparison what it shows best among the faults of `study.faults`."""


def slow_changes(kind: str) -> Callable[[Evidence, Judged], list[Finding]]:
    """The test of slow changes of a kind: a warning where the inertia changes by more than its uncertainty."""

    def test(evidence: Evidence, judged: Judged) -> list[Finding]:
        return [
            Finding(effect.change, f"{_changes(change)}; {_effect(effect.change / judged.value, corrected=judged.own)}")
            for effect, change in evidence.slow
            if effect.kind == kind
        ]

    return test


def slow_entries(evidence: Evidence, u: float, of_balance: bool) -> dict[str, float]:
    """Standard uncertainties by slow changes; by all of one where a method takes friction and zero as constant."""
    return {SOURCES[effect.kind]: effect.u + (0.0 if of_balance else abs(effect.change)) for effect, _ in evidence.slow}


def not_predicted(evidence: Evidence) -> list[Finding]:
    """A note where the first half of the log does not predict the second one, and no slow change was found."""
    prediction = evidence.prediction
    if prediction is None or prediction.significance <= CERTAIN or evidence.slow:
        return []
    text = (
        f"the fit of the first half of the log leaves {prediction.ratio:.2g} times the residuals in the "
        "second half that are expected: friction or a sensor is not the same in both, or no law of the speed "
        "describes the friction."
    )
    return [Finding(0.0, text)]


def disagreeing(*names: str) -> Callable[[Evidence, Judged], list[Finding] | None]:
    """The test whether the parts of the log that are compared under these names certainly disagree."""

    def test(evidence: Evidence, judged: Judged) -> list[Finding] | None:
        compared = [comparison for comparison in evidence.parts if comparison.name in names]
        significant = [comparison for comparison in compared if abs(comparison.off) > CERTAIN * comparison.u]
        worst = max(significant, key=lambda comparison: abs(comparison.off), default=None)
        if worst is None:
            return [] if compared else None
        text = f"{_differ(worst, judged.value)}, one of {len(evidence.parts)} such comparisons: {CAUSES[worst.name]}."
        return [Finding(worst.off, text)]

    return test


def impulse_fitted(evidence: Evidence) -> list[Finding]:
    """A note on an impulse at each reversal, which is an unknown beside the parameters."""
    law = evidence.law
    if "memory" not in law.unknowns:
        return []
    unit = law.equation.shown(f"{law.equation.torque_unit} s")
    text = (
        f"an impulse of {plus_minus(law.value('memory'), law.uncertainty('memory'), unit)} at each reversal was "
        "estimated beside the friction law: dynamic friction, backlash or short sticking."
    )
    return [Finding(0.0, text)]


def mirrored_differ(evidence: Evidence, judged: Judged) -> list[Finding]:
    """A note on each pair of parts that mirror one another and differ, which is not in the inertia of the whole."""
    mirrored = [
        comparison
        for comparison in evidence.parts
        if comparison.name in MIRRORED and abs(comparison.deviation) > CERTAIN
    ]
    contained = [comparison for comparison in mirrored if abs(comparison.off) <= CERTAIN * comparison.u]
    return [
        Finding(0.0, f"{_differ(comparison, judged.value)}: {CAUSES[comparison.name]}; in the whole log that cancels.")
        for comparison in contained
    ]


def agreement(parts: Sequence[Comparison], carried: float) -> tuple[Agreement, ...]:
    """Comparisons as data; carried: what of the axis' inertia is not the body's."""
    return tuple(
        Agreement(
            comparison.name,
            (comparison.first[0] - carried, comparison.first[1]),
            (comparison.second[0] - carried, comparison.second[1]),
            comparison.difference,
            comparison.variance**0.5,
        )
        for comparison in parts
    )


def _differ(comparison: Comparison, inertia: float) -> str:
    by = plus_minus(100 * comparison.difference / inertia, 100 * comparison.variance**0.5 / abs(inertia), "%")
    return f"{DIVIDED[comparison.name]} give inertias that differ by {by}"


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
