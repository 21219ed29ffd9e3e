"""What is to be said of several logs together: refusals, doubts, and whether they agree."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from swingid.errors import UnanswerableError
from swingid.format import percent, plus_minus
from swingid.pooling.consistency import outliers
from swingid.pooling.joint import PAIR, Pairs, outlying_pair
from swingid.pooling.pooling import Pooled
from swingid.pooling.shares import Estimate
from swingid.result.result import BudgetEntry, Message, Parameter, Result

SINGLE = ("not-identifiable", "gravity-and-inertia")
"""Warnings of a single log that several logs may settle."""

HOPELESS, HARDLY = 0.3, 0.02
"""Relative uncertainty (type A) above which inertia and gravity torque are not told apart; above which hardly."""


def refused(results: Sequence[Result], names: Sequence[str]) -> list[Message]:
    """One warning for each log that gave no number, with its reason."""
    return [
        Message("log-refused", f"{name} gave no number and is left out: {result.error.message}")
        for result, name in zip(results, names, strict=True)
        if result.error is not None
    ]


def uncertain(names: Iterable[str]) -> list[Message]:
    """Logs whose inertia has no uncertainty, and so no weight beside those that have one."""
    return [
        Message("log-without-uncertainty", f"{name} gives an inertia without uncertainty and is left out of the mean.")
        for name in names
    ]


def undetermined(result: Result) -> None:
    """Raise UnanswerableError where the only log that counts does not tell inertia from gravity torque."""
    for message in result.warnings:
        if message.code == SINGLE[0]:
            raise UnanswerableError(message.message, code=message.code)


def of_logs(results: Sequence[Result], names: Sequence[str], *, settled: bool) -> list[Message]:
    """Warnings of the single logs, each once with the names of its logs."""
    found: dict[tuple[str, str], list[str]] = {}
    for result, name in zip(results, names, strict=True):
        for message in result.warnings:
            if not (settled and message.code in SINGLE):
                found.setdefault((message.code, message.message), []).append(name)
    return [Message(code, f"{', '.join(logs)}: {text}") for (code, text), logs in found.items()]


def conditioning(inertia: Parameter, budget: Sequence[BudgetEntry]) -> list[Message]:
    """Whether the logs together tell inertia from gravity torque."""
    own = sum(e.standard_uncertainty**2 for e in budget if e.parameter == "inertia" and e.type == "A") ** 0.5
    relative = own / max(abs(inertia.value), 1e-300)
    if inertia.value <= 0 or relative > HOPELESS:
        raise UnanswerableError(
            "inertia and gravity torque move together in all these logs; add one of another frequency, "
            "or give axis.gravity_torque.",
            code="not-identifiable",
        )
    if relative <= HARDLY:
        return []
    text = (
        "inertia and gravity torque can hardly be told apart in these logs; add one of another frequency "
        "or give axis.gravity_torque."
    )
    return [Message(SINGLE[1], text)]


def pair_disagreement(pairs: Pairs, names: Sequence[str]) -> list[Message]:
    """The log whose inertia and gravity torque together lie apart from those of the others."""
    found = outlying_pair(pairs)
    if found is None:
        return []
    text = (
        f"{names[found[0]]} disagrees with the others in inertia and gravity torque together "
        f"({found[1]:.2g} times what chance explains); look for what differs in that run, or leave it out."
    )
    return [Message("logs-disagree", text)]


def disagreements(
    estimates: dict[str, list[Estimate]], names: Sequence[str], parameters: dict[str, Parameter]
) -> list[Message]:
    """Which logs disagree with the rest, in which parameter."""
    return [
        Message("logs-disagree", verdict)
        for name, each in estimates.items()
        if (verdict := _verdict(name, each, names, parameters[name].unit))
    ]


def _verdict(parameter: str, estimates: list[Estimate], names: Sequence[str], unit: str) -> str:
    """One sentence on the logs that disagree in a parameter, "" where none does."""
    named = outliers(estimates)
    if not named:
        return ""
    advice = "the uncertainty of the common value holds the scatter; look for what differs between these runs"
    if len(named) == len(estimates) == 2:
        first, second = (plus_minus(e.value, e.u, unit) for e in estimates)
        gap = abs(named[0].normalised)
        return (
            f"{names[0]} and {names[1]} disagree in {parameter}: {first} and {second}, En = {gap:.2g}, more than their "
            f"intervals allow; {advice}."
        )
    if len(named) == len(estimates):
        spread = percent(_spread(estimates) / abs(sum(e.value for e in estimates) / len(estimates)))
        return f"the logs disagree in {parameter} by up to {spread} and no majority of them agrees; {advice}."
    told = ", ".join(
        f"{names[d.log]} ({percent(d.value / (estimates[d.log].value - d.value), sign=True)}, "
        f"En = {abs(d.normalised):.2g})"
        for d in named
    )
    verb, those = ("disagrees", "it") if len(named) == 1 else ("disagree", "them")
    return f"{told} {verb} with the other logs in {parameter}; {advice}, or leave {those} out."


def _spread(estimates: Sequence[Estimate]) -> float:
    values = [estimate.value for estimate in estimates]
    return max(values) - min(values)


def pooling_note(inertia: Pooled, names: Sequence[str], *, joint: bool) -> Message:
    """How the common inertia was made, and what the logs scatter beyond their own uncertainties."""
    if joint:
        text = f"inertia and gravity torque of {len(names)} logs were solved for together, by their covariances"
    else:
        shares = ", ".join(f"{name} {percent(w)}" for name, w in zip(names, inertia.weights, strict=True))
        text = f"the inertia is the weighted mean of {len(names)} logs ({shares})"
    scatter = "no scatter between the logs beyond that within them"
    if inertia.between > 0:
        scatter = f"scatter between the logs {percent(inertia.between / abs(inertia.estimate.value))}"
    return Message("several-logs", f"{text}; {scatter}; what the logs share does not average out.")


def shared_friction_note(results: Sequence[Result], pooled: Iterable[str]) -> Message:
    """Which friction parameters were pooled, and that logs with other laws have others."""
    shared, all_of_them = list(pooled), dict.fromkeys(name for result in results for name in result.parameters)
    left = [name for name in all_of_them if name not in shared]
    text = f"pooled: {', '.join(name for name in shared if name not in PAIR) or 'no friction parameter'}"
    if left:
        text += f"; not given by every log with an uncertainty, see per_log: {', '.join(left)}"
    return Message("friction-shared", text + ".")


def friction_note(results: Sequence[Result], estimates: dict[str, list[Estimate]], names: Sequence[str]) -> Message:
    """Whether friction, left to each log, agrees between them. estimates: of the parameters that all logs give."""
    own = {name: each for name, each in estimates.items() if name not in PAIR}
    laws = {tuple(name for name in result.parameters if name not in PAIR) for result in results}
    verdicts = [v for name, each in own.items() if (v := _verdict(name, each, names, results[0].parameters[name].unit))]
    if verdicts:
        return Message("friction-per-log", f"friction differs between the logs: {' '.join(verdicts)}")
    text = "friction is each log's own, see per_log"
    if own:
        text += f"; {', '.join(own)} agree{'s' if len(own) == 1 else ''} within the uncertainties"
    if len(laws) > 1:
        text += "; the logs chose different friction laws"
    return Message("friction-per-log", text + ".")


def common_notes(results: Sequence[Result]) -> list[Message]:
    """Notes that every log makes in the same words."""
    others = [set(result.notes) for result in results[1:]]
    return [note for note in results[0].notes if all(note in other for other in others)]
