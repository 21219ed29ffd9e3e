"""Several logs of one body: each identified on its own, then one answer, and whether they agree."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import PurePath

from swingid.errors import SwingidError, UsageError
from swingid.pooling.joint import PAIR, Pairs, is_joint, pool_pair
from swingid.pooling.pooling import Pooled, pool
from swingid.pooling.shares import Estimate, Identity, estimate_of, scatters
from swingid.pooling.verdicts import (
    common_notes,
    conditioning,
    disagreements,
    friction_note,
    of_logs,
    pair_disagreement,
    pooling_note,
    refused,
    shared_friction_note,
    uncertain,
    undetermined,
)
from swingid.recording.large import LargeLog
from swingid.recording.recording import Recording
from swingid.result.result import BudgetEntry, Message, Result, refusal

Identify = Callable[[Recording | LargeLog], Result]

FRICTION = ("per-log", "shared")


def identify_several(
    logs: Sequence[Recording | LargeLog] | Mapping[str, Recording | LargeLog | SwingidError],
    identify_one: Identify,
    *,
    friction: str = "per-log",
) -> Result:
    """One result from several logs of one body on one rig, with the ordinary results in `per_log`.

    logs: recordings, in a list (then called by their files) or by name; an error in the place of one that could not
    be read. One alone gives its ordinary result. identify_one: from a recording to its result. friction: "per-log"
    (each result keeps its own; a note says whether they agree) or "shared" (pooled like the inertia).

    Raises UsageError for no log, a log given twice or an unknown choice of friction; where every log is refused, the
    error of the first.
    """
    if friction not in FRICTION:
        raise UsageError(f"unknown friction {friction!r}; choose {' or '.join(FRICTION)}.", code="no-friction-choice")
    by_name = _by_name(logs)
    if not by_name:
        raise UsageError("no log was given; give one or more.", code="no-log")
    _refuse_twice(by_name)
    results: list[Result] = []
    errors: list[SwingidError] = []
    for name, log in by_name.items():
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
    return results[0] if len(results) == 1 else combine(results, _short(list(by_name)), friction=friction)


def combine(results: Sequence[Result], names: Sequence[str], *, friction: str = "per-log") -> Result:
    """The common answer of results of one method and rig, of which at least one holds a number.

    Raises UnanswerableError where even together they do not tell inertia from gravity torque.
    """
    kept = [k for k, result in enumerate(results) if result.parameters]
    certain = [k for k in kept if results[k].inertia.standard_uncertainty is not None]
    counted = certain or kept
    sound, called = [results[k] for k in counted], [names[k] for k in counted]
    results = [result if result.method else _of_method(result, sound[0].method) for result in results]
    found: list[Message] = []
    warnings = [*refused(results, names), *uncertain(names[k] for k in kept if k not in counted)]
    if len(sound) == 1:
        undetermined(sound[0])
        text = f"{called[0]} is the only log that counts, so nothing was pooled."
        common, notes = sound[0], [Message("several-logs", text)]
    else:
        common, found, notes = _pooled(sound, called, friction)
    warnings += [*of_logs(sound, called, settled=bool(common.covariance) and len(sound) > 1), *found]
    return replace(
        common,
        status="warning" if warnings else "ok",
        warnings=tuple(warnings),
        notes=(*notes, *common_notes(sound)),
        provenance=_provenance(sound, results, friction),
        details=None,
        per_log=tuple(results),
    )


def _pooled(
    results: Sequence[Result], names: Sequence[str], friction: str
) -> tuple[Result, list[Message], list[Message]]:
    """The common parameters with their budget; warnings and notes on how the logs agree."""
    estimates = estimates_of(results, friction)
    pooled: dict[str, Pooled] = {name: pool(each) for name, each in estimates.items()}
    pairs = Pairs.of(results, {name: estimates[name] for name in PAIR}) if is_joint(results) else None
    if pairs is not None:
        pooled |= pool_pair(pairs)
    parameters = {name: common.parameter(results[0].parameters[name].unit) for name, common in pooled.items()}
    budget = [entry for name, common in pooled.items() for entry in common.estimate.entries(name)]
    warnings = []
    if pairs is not None:
        warnings += [*conditioning(parameters["inertia"], budget), *pair_disagreement(pairs, names)]
    judged = {name: estimates[name] for name in pooled if pairs is None or name not in PAIR}
    warnings += disagreements(judged, names, parameters)
    notes = [pooling_note(pooled["inertia"], names, joint=pairs is not None)]
    if friction == "per-log":
        notes.append(friction_note(results, estimates_of(results, "shared"), names))
    else:
        notes.append(shared_friction_note(results, pooled))
    common = Result(
        method=results[0].method,
        status="ok",
        parameters=parameters,
        budget=tuple(budget),
        sensitivities={} if pairs is not None else _sensitivities(results, pooled["inertia"]),
        covariance={} if pairs is None else pairs.common_covariance(),
    )
    return common, warnings, notes


def estimates_of(
    results: Sequence[Result], friction: str, *, scatter_is_shared: bool = False
) -> dict[str, list[Estimate]]:
    """Estimates, per log, of every parameter that all logs give with an uncertainty and that is to be pooled.

    scatter_is_shared: what each states as its scatter does not average out.
    """
    return {
        name: [estimate_of(result, name, _identity(k, scatter_is_shared)) for k, result in enumerate(results)]
        for name in results[0].parameters
        if (friction == "shared" or name in PAIR)
        and all(any(entry.parameter == name for entry in result.budget) for result in results)
    }


def _by_name(
    logs: Sequence[Recording | LargeLog] | Mapping[str, Recording | LargeLog | SwingidError],
) -> dict[str, Recording | LargeLog | SwingidError]:
    """The logs by name: their paths, or their numbers where paths are missing or alike."""
    if isinstance(logs, Mapping):
        return dict(logs)
    paths = [log.source.path if isinstance(log, Recording) else log.path for log in logs]
    unique = len(set(paths)) == len(paths)
    return {
        path if path and unique else f"log {k + 1}": log for k, (path, log) in enumerate(zip(paths, logs, strict=True))
    }


def _short(names: Sequence[str]) -> list[str]:
    """Names for people: of files without their folders, where that tells them apart."""
    bare = [PurePath(name).name for name in names]
    return bare if len(set(bare)) == len(bare) else list(names)


def _refuse_twice(logs: Mapping[str, Recording | LargeLog | SwingidError]) -> None:
    seen: dict[object, str] = {}
    for name, log in logs.items():
        if not isinstance(log, Recording):
            continue
        key = log.source.sha256 or id(log)
        if key in seen:
            message = f"{name} and {seen[key]} are the same log; a run counts once, so leave one out."
            raise UsageError(message, code="same-log-twice")
        seen[key] = name


def _of_method(result: Result, method: str) -> Result:
    return Result(method, result.status, error=result.error, provenance=result.provenance)


def _identity(log: int, scatter_is_shared: bool) -> Identity:
    """Scatter is each log's own; the rig's constants, and type A errors of a nature that all logs share, are not."""

    def key(entry: BudgetEntry) -> str:
        if entry.type == "B":
            return entry.shared_id or f"log {log}: {entry.source}"
        return f"log {log}: {entry.source}" if scatters(entry) and not scatter_is_shared else entry.source

    return key


def _provenance(sound: Sequence[Result], results: Sequence[Result], friction: str) -> dict[str, object]:
    """That of the first log, with all logs in the place of one."""
    first = dict(sound[0].provenance)
    options = first.pop("options", None)
    for key in ("log", "log_sha256", "rows"):
        first.pop(key, None)
    logs = {f"{key}": [result.provenance.get(name) for result in results] for key, name in _LISTED.items()}
    own = {"friction": friction} | (dict(options) if isinstance(options, dict) else {})
    return logs | first | {"options": own}


_LISTED = {"logs": "log", "logs_sha256": "log_sha256"}


def _sensitivities(results: Sequence[Result], inertia: Pooled) -> dict[str, float]:
    """Of the pooled inertia, where every log knows its own."""
    keys = [key for key in results[0].sensitivities if all(key in result.sensitivities for result in results)]
    return {
        key: float(sum(w * r.sensitivities[key] for w, r in zip(inertia.weights, results, strict=True))) for key in keys
    }
