"""The option ``--table`` of ``swingid identify``: many logs, each by itself, as rows of one file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swingid.cli import output
from swingid.cli.progress import Progress
from swingid.errors import UnanswerableError, UsageError
from swingid.progress import shown
from swingid.system import write_whole

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.recording.large import LargeLog
    from swingid.recording.recording import Recording


def tabulate(
    logs: Sequence[str],
    rig: str,
    methods: Sequence[str],
    part: list[str] | None,
    load: Callable[[str, Rig], Recording | LargeLog],
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
            logs, lambda log: load(log, plant), plant, list(dict.fromkeys(methods)), part=spans or None
        )
    write_whole(Path(target), table.to_csv().encode())
    output.tell(f"{table.summary()}\nwrote {target}")
    if not table.answered:
        raise UnanswerableError(f"none of the logs has a number; {target} has the reasons.", code="all-refused")
