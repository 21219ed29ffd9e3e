"""Several logs of one body: each identified on its own, then one pooled estimate, and whether the logs agree."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import PurePath

from swingid.balance.identifiability import HOPELESS
from swingid.errors import NotIdentifiableError, SwingidError, UnanswerableError, UsageError
from swingid.format import percent, plus_minus
from swingid.pooling.joint import PAIR, Common, Pairs, estimates_of, given_by_all, outlying_pair
from swingid.pooling.pooling import Pooled, outliers
from swingid.progress import tracked
from swingid.recording.findings import Kind
from swingid.recording.large import LargeLog
from swingid.recording.recording import Recording, require_logs
from swingid.result.provenance import of_several
from swingid.result.result import Message, Result, refusal
from swingid.uncertainty.budget import BudgetEntry, Parameter
from swingid.uncertainty.uncertain import Uncertain

Log = Recording | LargeLog
Identify = Callable[[Log], Result]
Shown = Callable[[str], str]

FRICTION = ("per-log", "shared")

SINGLE = {Kind.NOT_IDENTIFIABLE, Kind.GRAVITY_AND_INERTIA}
"""Warnings of a single log that do not hold for several logs together."""

HARDLY = 0.02
"""Relative uncertainty (type A) above which inertia and gravity torque are hardly distinguishable."""


def identify_several(
    logs: Sequence[Log] | Mapping[str, Log | SwingidError],
    identify_one: Identify,
    *,
    friction: str = "per-log",
    shown: Shown = str,
) -> Result:
    """One result from several logs of one body on one rig, with the ordinary results in `per_log`.

    logs: recordings, in a list (then called by their files) or by name; an error in the place of one that could not
    be read. One alone gives its ordinary result. identify_one: from a recording to its result. friction: "per-log"
    (each result keeps its own; a note says whether they agree) or "shared" (pooled like the inertia). shown: from a
    unit to how sentences have it.

    Raises UsageError for no log, a log given twice or an unknown choice of friction; where every log is refused, the
    error of the first.
    """
    if friction not in FRICTION:
        raise UsageError(f"unknown friction {friction!r}; choose {' or '.join(FRICTION)}.", code="no-friction-choice")
    by_name = logs_by_name(logs)
    results: list[Result] = []
    errors: list[SwingidError] = []
    for name, log in tracked(by_name.items()):
        try:
            if isinstance(log, SwingidError):
                raise log
            results.append(identify_one(log))
        except UsageError:
            raise
        except SwingidError as error:
            errors.append(error)
            source: dict[str, object] = {"log": name}
            if isinstance(log, Recording):
                source = {"log": log.source.path or name, "log_sha256": log.source.sha256, "rows": len(log)}
            results.append(refusal("", error, source))
    if len(errors) == len(results):
        raise errors[0]
    return results[0] if len(results) == 1 else combine(results, _short(list(by_name)), friction=friction, shown=shown)


def combine(
    results: Sequence[Result], names: Sequence[str], *, friction: str = "per-log", shown: Shown = str
) -> Result:
    """The common estimate of results of one method and rig, of which at least one has a number.

    Raises UnanswerableError where even together they do not distinguish inertia from gravity torque.
    """
    kept = [k for k, result in enumerate(results) if result.parameters]
    counted = [k for k in kept if results[k].inertia.standard_uncertainty is not None] or kept
    sound, called = [results[k] for k in counted], [names[k] for k in counted]
    results = [result if result.method else replace(result, method=sound[0].method) for result in results]
    warnings = [
        *(
            Message("log-refused", f"{name} gave no number and is excluded: {result.error.message}")
            for result, name in zip(results, names, strict=True)
            if result.error is not None
        ),
        *(
            Message("log-without-uncertainty", f"{names[k]} gives an inertia without uncertainty and is excluded.")
            for k in kept
            if k not in counted
        ),
    ]
    messages: list[Message] = []
    if len(sound) == 1:
        undetermined(sound[0])
        common, notes = sound[0], [Message("several-logs", f"{called[0]} alone has a weight, so nothing was pooled.")]
    else:
        common, messages, notes = _pooled(sound, called, friction, shown)
    warnings += [*of_logs(sound, called, settled=bool(common.covariance_of_fit) and len(sound) > 1), *messages]
    notes += [note for note in sound[0].notes if all(note in other.notes for other in sound[1:])]
    return replace(
        common,
        status="warning" if warnings else "ok",
        warnings=tuple(warnings),
        notes=tuple(notes),
        provenance=_provenance(sound, results, friction),
        details=None,
        per_log=tuple(results),
    )


def _pooled(
    results: Sequence[Result], names: Sequence[str], friction: str, shown: Shown
) -> tuple[Result, list[Message], list[Message]]:
    """The common parameters with their budget; warnings and notes on how the logs agree."""
    shared = Common.of(results, range(len(results)) if friction == "shared" else ())
    common, pooled = shared.result(), shared.pooled
    warnings = []
    if shared.pairs is not None:
        warnings += [*conditioning(common.inertia, common.budget), *pair_disagreement(shared.pairs, names)]
    checked = {name: each for name, each in shared.estimates.items() if shared.pairs is None or name not in PAIR}
    texts = _disagreements(checked, names, common.parameters, shown)
    warnings += [Message("logs-disagree", text) for text in texts]
    digests = {result.origin.digests for result in results}
    alike = "parts" if len(digests) == 1 and all(digests) else "logs"
    notes = [_pooling_note(pooled["inertia"], names, alike, joint=shared.pairs is not None)]
    if friction == "per-log":
        notes.append(_friction_note(results, names, alike, shown))
    else:
        notes.append(_shared_friction_note(results, pooled))
    return common, warnings, notes


def logs_by_name(
    logs: Sequence[Log] | Mapping[str, Log | SwingidError],
) -> dict[str, Log | SwingidError]:
    """The logs by name: their paths, or their numbers where paths are missing or alike.

    Raises UsageError for none, or for one given twice.
    """
    require_logs(logs.values() if isinstance(logs, Mapping) else logs, Recording | LargeLog | SwingidError)
    if not isinstance(logs, Mapping):
        paths = [log.source.path if isinstance(log, Recording) else log.path for log in logs]
        unique = len(set(paths)) == len(paths)
        names = [path if path and unique else f"log {k + 1}" for k, path in enumerate(paths)]
        logs = dict(zip(names, logs, strict=True))
    seen: dict[object, str] = {}
    for name, log in logs.items():
        if isinstance(log, Recording):
            rows = float(log.time[0]), float(log.time[-1])
            first = seen.setdefault((log.source.sha256, *rows) if log.source.sha256 else id(log), name)
            if first is not name:
                message = f"{name} and {first} are the same log; a run counts once, so leave one out."
                raise UsageError(message, code="same-log-twice")
    return dict(logs)


def named_recordings(logs: Sequence[Log] | Mapping[str, Log | SwingidError]) -> dict[str, Recording]:
    """The logs by name, for one fit to all of them.

    Raises the error of one that could not be read, UsageError for none, one given twice, or one to be read in parts.
    """
    by_name = {}
    for name, log in logs_by_name(logs).items():
        if isinstance(log, SwingidError):
            raise log
        if not isinstance(log, Recording):
            text = f"{name} is too large for one fit to several logs, which are not read in parts; give --part FROM:TO."
            raise UsageError(text, code="too-large")
        by_name[name] = log
    return dict(zip(_short(list(by_name)), by_name.values(), strict=True))


def _short(names: Sequence[str]) -> list[str]:
    """Names for people: of files without their folders, where these differ."""
    bare = [PurePath(name).name for name in names]
    return bare if len(set(bare)) == len(bare) else list(names)


def _provenance(sound: Sequence[Result], results: Sequence[Result], friction: str) -> dict[str, object]:
    """Return the provenance of the first log, with all logs in the place of one."""
    provenance = of_several(sound[0].provenance, [result.provenance for result in results])
    options = provenance.pop("options", None)
    return provenance | {"options": {"friction": friction} | (dict(options) if isinstance(options, dict) else {})}


def undetermined(result: Result) -> None:
    """Raise UnanswerableError where the only log that counts does not distinguish inertia from gravity torque."""
    for message in result.warnings:
        if message.kind is Kind.NOT_IDENTIFIABLE:
            raise NotIdentifiableError(message.message)


def of_logs(results: Sequence[Result], names: Sequence[str], *, settled: bool) -> list[Message]:
    """Warnings of the single logs, each once with the names of its logs."""
    by_message: dict[Message, list[str]] = {}
    for result, name in zip(results, names, strict=True):
        for message in result.warnings:
            if not (settled and message.kind in SINGLE):
                by_message.setdefault(message, []).append(name)
    return [replace(message, message=f"{', '.join(logs)}: {message.message}") for message, logs in by_message.items()]


def conditioning(inertia: Parameter, budget: Sequence[BudgetEntry]) -> list[Message]:
    """Return whether the logs together distinguish inertia from gravity torque."""
    scatter = sum(e.standard_uncertainty**2 for e in budget if e.parameter == "inertia" and e.type == "A") ** 0.5
    relative = scatter / max(abs(inertia.value), 1e-300)
    if inertia.value <= 0 or relative > HOPELESS:
        raise UnanswerableError(
            "inertia and gravity torque are collinear in all these logs; add one of another frequency, "
            "or give axis.gravity_torque.",
            code="not-identifiable",
        )
    if relative <= HARDLY:
        return []
    text = (
        "inertia and gravity torque are hardly distinguishable in these logs; add one of another frequency "
        "or give axis.gravity_torque."
    )
    return [Message("gravity-and-inertia", text, Kind.GRAVITY_AND_INERTIA)]


def pair_disagreement(pairs: Pairs, names: Sequence[str]) -> list[Message]:
    """The log whose inertia and gravity torque together are inconsistent with those of the others."""
    outliers = outlying_pair(pairs)
    if outliers is None:
        return []
    text = (
        f"{names[outliers[0]]} disagrees with the others in inertia and gravity torque together "
        f"({outliers[1]:.2g} times the limit of chance); check what differs in that run, or leave it out."
    )
    return [Message("logs-disagree", text)]


def _disagreements(
    estimates: Mapping[str, list[Uncertain]],
    names: Sequence[str],
    parameters: Mapping[str, Parameter],
    shown: Shown,
) -> list[str]:
    """One sentence for each parameter in which logs disagree with the rest."""
    units = {name: shown(parameter.unit) for name, parameter in parameters.items()}
    disagreements = [_disagreement(name, each, names, units[name]) for name, each in estimates.items()]
    return [text for text in disagreements if text]


def _disagreement(parameter: str, estimates: list[Uncertain], names: Sequence[str], unit: str) -> str:
    """One sentence on the logs that disagree in a parameter, "" where none does."""
    named = outliers(estimates)
    if not named:
        return ""
    advice = "the uncertainty of the common value contains the scatter; check what differs between these runs"
    if len(named) == len(estimates) == 2:
        first, second = (plus_minus(e.value, e.u, unit) for e in estimates)
        gap = abs(named[0].normalised)
        return (
            f"{names[0]} and {names[1]} disagree in {parameter}: {first} and {second}, En = {gap:.2g}, more than their "
            f"intervals allow; {advice}."
        )
    if len(named) == len(estimates):
        values = [estimate.value for estimate in estimates]
        spread = percent((max(values) - min(values)) / abs(sum(values) / len(values)))
        return f"the logs disagree in {parameter} by up to {spread} and no majority of them agrees; {advice}."
    listed = ", ".join(
        f"{names[d.index]} ({percent(d.value / (estimates[d.index].value - d.value), sign=True)}, "
        f"En = {abs(d.normalised):.2g})"
        for d in named
    )
    verb, those = ("disagrees", "it") if len(named) == 1 else ("disagree", "them")
    return f"{listed} {verb} with the other logs in {parameter}; {advice}, or leave {those} out."


def _pooling_note(inertia: Pooled, names: Sequence[str], alike: str, *, joint: bool) -> Message:
    """How the common inertia was computed, and the scatter of the logs, or parts, beyond their own uncertainties."""
    if joint:
        text = f"inertia and gravity torque of {len(names)} {alike} were solved for together, by their covariances"
    else:
        shares = ", ".join(f"{name} {percent(w)}" for name, w in zip(names, inertia.weights, strict=True))
        text = f"the inertia is the weighted mean of {len(names)} {alike} ({shares})"
    return Message("several-logs", f"{text}; {scatter_of(inertia, alike)}; {SHARED_STAY.format(alike)}")


SHARED_STAY = "sources that the {} share do not average out."


def scatter_of(inertia: Pooled, alike: str) -> str:
    """How far the logs, or parts, scatter beyond their own uncertainties, in words."""
    if inertia.between > 0:
        return f"scatter between the {alike} {percent(inertia.between / abs(inertia.estimate.value))}"
    return f"no scatter between the {alike} beyond that within them"


def _shared_friction_note(results: Sequence[Result], pooled: Iterable[str]) -> Message:
    """Which friction parameters were pooled, and that logs with other laws have others."""
    shared, all_of_them = list(pooled), dict.fromkeys(name for result in results for name in result.parameters)
    others = [name for name in all_of_them if name not in shared]
    text = f"pooled: {', '.join(name for name in shared if name not in PAIR) or 'no friction parameter'}"
    if others:
        text += f"; not given by every log with an uncertainty, see per_log: {', '.join(others)}"
    return Message("friction-shared", text + ".")


def _friction_note(results: Sequence[Result], names: Sequence[str], alike: str, shown: Shown) -> Message:
    """Return whether friction, left to each log or part, agrees between them."""
    by_name = {name: estimates_of(results, name) for name in given_by_all(results) if name not in PAIR}
    laws = {tuple(name for name in result.parameters if name not in PAIR) for result in results}
    disagreements = _disagreements(by_name, names, results[0].parameters, shown)
    if disagreements:
        return Message("friction-per-log", f"friction differs between the {alike}: {' '.join(disagreements)}")
    text = f"friction is of each of the {alike} alone"
    if by_name:
        text += f"; {', '.join(by_name)} agree{'s' if len(by_name) == 1 else ''} within the uncertainties"
    if len(laws) > 1:
        text += f"; the {alike} chose different friction laws"
    return Message("friction-per-log", text + ".")
