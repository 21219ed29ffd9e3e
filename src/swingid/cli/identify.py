"""``swingid identify``: the inertia and the friction that a log shows."""

from __future__ import annotations

from contextlib import nullcontext
from json import loads as parse_json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from swingid.cli import output
from swingid.cli.compile import compile_first, kernels_of
from swingid.cli.options import (
    NAMES,
    Certificate,
    JsonOrRefusal,
    LogRigFile,
    Logs,
    Parts,
    Report,
    Verbose,
    method_name,
    rig_of,
)
from swingid.cli.progress import Progress
from swingid.errors import SwingidError, UnanswerableError, UsageError
from swingid.methods.table import DEFAULT
from swingid.processes import cores, keep_memory
from swingid.progress import shown
from swingid.system import sha256_begun, write_whole

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from swingid.model.rig import Rig
    from swingid.recording.large import LargeLog
    from swingid.recording.recording import Recording
    from swingid.result.result import Result

Provenance = dict[str, object]


def identify(
    logs: Logs,
    rig: LogRigFile = None,
    method: Annotated[
        list[str] | None,
        typer.Option(
            parser=method_name,
            metavar=f"[{NAMES}]",
            help="How the inertia is found; default momentum. May be repeated with --table.",
        ),
    ] = None,
    variant: Annotated[
        Literal["printed", "better"] | None,
        typer.Option(help="Of --method energy: the paper's formulas, or the better form (default)."),
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="An option of the method; may be repeated.")
    ] = None,
    part: Parts = None,
    added: Annotated[
        list[str] | None,
        typer.Option(
            metavar="INERTIA",
            help='Inertia of a known body on the axis beside the one sought, "1.2e-3 ± 1e-6 kg*m^2"; once per LOG, 0 '
            "for none. All logs are then fitted together.",
        ),
    ] = None,
    without_repair: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Leave this fault of the log as it is; may be repeated.")
    ] = None,
    json: JsonOrRefusal = None,
    table: Annotated[
        str | None,
        typer.Option(metavar="FILE.csv", help="Each LOG by itself by each --method: a row per parameter, or a reason."),
    ] = None,
    monte_carlo: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Draw everything that is uncertain N times, 100 or more, through the method (GUM S1).",
        ),
    ] = None,
    report: Report = None,
    certificate: Certificate = None,
    verbose: Verbose = False,
) -> None:
    """Identify the moment of inertia and the friction that LOG shows, with their uncertainties.

    Several logs of one body give one inertia, how far the logs scatter, and which of them disagree.
    """
    rig, methods = rig_of(rig, logs), method or [DEFAULT]
    repairs = dict.fromkeys(without_repair or [], False)
    if table is not None:
        other = {"--json": json, "--report": report, "--monte-carlo": monte_carlo, "--added": added}
        other |= {"--variant": variant, "--option": option, "--certificate": certificate}
        _tabulate(logs, rig, methods, part, repairs, table, other)
        return
    if len(methods) > 1:
        raise UsageError(f"--method {methods[1]} is a second method; add --table FILE.csv", code="several-methods")
    name = methods[0]
    if variant is not None and name != "energy":
        raise UsageError("--variant belongs to --method energy; leave it out or give both", code="no-variant")
    inputs = {rig: "the rig file"} | dict.fromkeys(logs, "a log")
    inputs |= {certificate: "the laboratory's file"} if certificate else {}
    output.check_targets({"--json": json, "--report": report}, inputs)
    stated = output.check_report(report, certificate)
    options = _options(option or [])
    for key, value in (("variant", variant), ("added", added)):
        if value and key in options:
            raise UsageError(f"--{key} and --option {key} are the same; give one of them", code="bad-option")
        if value:
            options[key] = value
    from swingid.pooling.selected import parts_of

    spans = parts_of(part)
    source: Provenance = {"log": logs[0]} if len(logs) == 1 else {"logs": logs}
    if part:
        source["part"] = part[0] if len(part) == 1 else part
    provenance: Provenance = {**source, "rig_source": rig, "options": options}
    begun = sha256_begun(logs[0]) if len(logs) == 1 else nullcontext()  # while packages are imported
    with output.refusals_to(json, name, provenance, report, stated), begun as digest:
        output.check_writable(json, report)
        result, log, plant = _identify(logs, rig, name, options, repairs, digest, spans, provenance, monte_carlo)
        output.write_report(result, log, plant, report, stated)
    from swingid.result.brief import brief

    output.hand_over(result, json, report, text=None if verbose else brief(result))


def _options(given: list[str]) -> dict[str, object]:
    """Options of the method from NAME=VALUE: numbers, true, false and lists as in JSON, anything else is text."""
    options: dict[str, object] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals or not name.isidentifier():
            raise UsageError(f"--option {text}: write NAME=VALUE, such as variant=printed", code="bad-option")
        if name in ("log", "rig", "method"):
            raise UsageError(f"--option {name}: no method has such an option; see --help", code="unknown-option")
        if name in options:
            raise UsageError(f"--option {name} was given twice; give it once", code="bad-option")
        try:
            options[name] = parse_json(value)
        except ValueError:
            options[name] = value
    return options


def _identify(
    logs: list[str],
    rig: str,
    method: str,
    options: dict[str, object],
    repairs: Mapping[str, bool],
    digest: Callable[[], str] | None,
    spans: list[tuple[float, float]],
    provenance: Provenance,
    draws: int | None,
) -> tuple[Result, Recording | None, Rig]:
    """The result, the log if it is a single one, and the rig; `provenance` gains what becomes known on the way."""
    from swingid.identification import identify as run
    from swingid.model.rig import Rig
    from swingid.pooling.selected import selected
    from swingid.recording.findings import switched_off
    from swingid.recording.recording import Recording

    switched_off(repairs)  # a name that is none is a wrong usage, not a log that cannot be used
    plant = Rig.load(rig)
    provenance |= {"rig": plant.name, "rig_source": plant.source}
    if draws is not None and max(len(logs), len(spans)) > 1:
        raise UsageError("--monte-carlo is for one log; identify the logs or parts one by one", code="not-drawn")
    if len(logs) > 1:
        recording = None
        loaded = _loaded(logs, plant, repairs)
        whole = [log for log in loaded.values() if isinstance(log, Recording)]
        compile_first(*(task for log in whole for task in kernels_of(method, log, plant, options.get("input"))))
        with shown(Progress("logs")):
            result = run(loaded, plant, method, part=spans, **options)
    else:
        log = _load(logs[0], plant, repairs, digest)
        if len(spans) == 1:
            log, spans = selected(log, spans[0]), []
        recording = log if isinstance(log, Recording) else None
        if recording is not None:
            provenance |= {"log_sha256": recording.source.sha256, "rows": len(recording)}
            compile_first(*kernels_of(method, recording, plant, options.get("input")))
        result = run(log, plant, method, part=spans, **options)
        if draws is not None:
            if recording is None:
                raise UsageError("--monte-carlo is not for logs that are read in parts; give --part", code="not-drawn")
            from swingid.study.monte_carlo import monte_carlo

            show = Progress("draws")
            result = monte_carlo(recording, plant, result.method, result, draws, options=options, progress=show)
    return result, recording, plant


def _load(
    log: str, rig: Rig, repairs: Mapping[str, bool], digest: Callable[[], str] | None = None
) -> Recording | LargeLog:
    """The recording in a file, a `LargeLog` where it is large; raises as `Recording.load`.

    digest: gives the SHA-256 of a large log.
    """
    from swingid.recording.large import LargeLog, is_large
    from swingid.recording.recording import Recording

    if is_large(log):
        keep_memory()
        return LargeLog(log, rig, repairs, None, Progress("million rows", 1e6), cores(), digest)
    return Recording.load(log, rig, repairs=repairs)


def _loaded(logs: list[str], rig: Rig, repairs: Mapping[str, bool]) -> dict[str, Recording | LargeLog | SwingidError]:
    """The logs by their names; the error of one that cannot be used in its place, for the others still count."""
    recordings: dict[str, Recording | LargeLog | SwingidError] = {}
    for log in logs:
        if log in recordings:
            raise UsageError(f"{log} was given twice; a run counts once", code="same-log-twice")
        try:
            recordings[log] = _load(log, rig, repairs)
        except SwingidError as error:
            recordings[log] = error
    return recordings


def _tabulate(
    logs: Sequence[str],
    rig: str,
    methods: Sequence[str],
    part: list[str] | None,
    repairs: Mapping[str, bool],
    target: str,
    others: Mapping[str, Any],
) -> None:
    """Identify every log by every method and write the table to `target`; others: options that do not go with it.

    Raises UsageError for such an option, UnanswerableError where no log has a number (the table is written).
    """
    given = next((name for name, value in others.items() if value), None)
    if given is not None:
        raise UsageError(f"{given} is for one result; leave it out beside --table", code="not-in-a-table")
    output.check_files({rig: "the rig file"} | dict.fromkeys(logs, "a log"), table=target)
    output.check_once(logs)
    from swingid.model.rig import Rig
    from swingid.pooling.selected import parts_of
    from swingid.study.results_table import results_table

    plant, spans = Rig.load(rig), parts_of(part)
    with shown(Progress("logs")):
        table = results_table(
            logs, lambda log: _load(log, plant, repairs), plant, list(dict.fromkeys(methods)), part=spans or None
        )
    write_whole(Path(target), table.to_csv().encode())
    output.tell(f"{table.summary()}\nwrote {target}")
    if not table.answered:
        raise UnanswerableError(f"none of the logs has a number; {target} has the reasons.", code="all-refused")
