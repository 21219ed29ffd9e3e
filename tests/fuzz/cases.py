"""One case of fuzzing: a mutated file, read; what came of it."""

from __future__ import annotations

import contextlib
import random
import resource
import tempfile
import traceback
import warnings
from pathlib import Path

import numpy as np

from fuzz.answers import answer_case
from fuzz.corpus import FILES, csv_files, motions, parquet_files, result_files, rig_files, rig_for, rigs
from fuzz.exports import axes_files, calculation, damaged_archive, damaged_workbook
from fuzz.mutations import mutated, mutated_columns, mutated_rig
from swingid.errors import SwingidError
from swingid.recording.recording import Recording

SPARE, TIMES = 96 << 20, 40
"""Memory (bytes, and multiples of the file) that reading one more file may take."""

TARGETS = (*FILES, "pieces", "inspect", "rig", "result", "axes", "quantity", "columns", "identify", "answers")
"""What is fuzzed: the readers of logs by format, reading in parts, inspect, rig files, result files, files of axes with
the tensor that follows from them, calculations with units; and what comes after a file was read: columns with faults,
repaired, and identified by some method; and rigs and logs, both drawn, with every method, `inspect`, `validate` and
`compare`."""

DAMAGED = {"archive": damaged_archive, "workbook": damaged_workbook}
"""Formats that are damaged inside their container, too."""

METHODS = ("momentum", "momentum", "momentum", "energy", "equation-error")


def content_of(target: str, seed: int) -> tuple[bytes, str]:
    """The mutated file of a case, and its name."""
    draw = random.Random(f"{target} {seed}")
    if target in ("columns", "identify", "answers"):
        return f"{target} {seed}".encode(), "columns"
    if target == "quantity":
        raw, unit = calculation(draw)
        return repr(raw).encode("utf-8", "surrogatepass"), unit
    if target == "axes":
        return mutated_rig(draw.choice(axes_files()), axes_files(), draw), "axes.toml"
    if target in DAMAGED and draw.random() < 0.8:
        return DAMAGED[target](draw), f"log{FILES[target][1]}"
    if target == "rig":
        return mutated_rig(draw.choice(rig_files()), rig_files(), draw), "rig.toml"
    if target == "result":
        return mutated(draw.choice(result_files()), result_files(), draw), "result.json"
    if target == "pieces":
        files, ending = draw.choice(((csv_files(), ".csv"), (parquet_files(), ".parquet")))
    else:
        make, ending = FILES[target] if target in FILES else FILES[draw.choice(list(FILES))]
        files = make()
    others = files if draw.random() < 0.8 else FILES[draw.choice(list(FILES))][0]()
    name = f"log{ending if draw.random() < 0.95 else draw.choice(('.csv', '.txt', '.mat', '.parquet', ''))}"
    return mutated(draw.choice(files), others, draw), name


def warm_up(target: str) -> None:
    """Import and compile what the cases of a target need, before their memory is measured."""
    if target in FILES or target == "inspect":
        from swingid.recording.formats import read_table

        for make, ending in FILES.values():
            for content in make():
                draw = random.Random(0)
                table = read_table(content, f"log{ending}")
                with warnings.catch_warnings(), contextlib.suppress(SwingidError):
                    warnings.simplefilter("ignore")
                    read_case("inspect" if target == "inspect" else "csv", content, f"log{ending}", draw)
                    assert table.columns
    for seed in range(20):
        failure_of(target, -seed - 1)


def failure_of(target: str, seed: int) -> str | None:
    """What is wrong with a case: a traceback, or more memory than allowed; None where all is as documented."""
    draw = random.Random(seed)
    try:
        content, name = content_of(target, seed)
        before = _memory()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read_case(target, content, name, draw)
    except SwingidError as error:
        # a drawn option may be one that the rig has no use for
        documented = (2, 3, 4) if target == "answers" else (3, 4)
        if error.exit_code not in documented or not error.message.strip() or "Traceback" in error.message:
            return f"an error that is none of the documented: {error!r}"
    except BaseException:
        return traceback.format_exc()
    grown = _memory() - before
    if grown > SPARE + TIMES * len(content) and target != "answers":  # whose first cases compile kernels
        return f"{grown / 1e6:.0f} MB more memory for a file of {len(content)} bytes"
    return None


def read_case(target: str, content: bytes, name: str, draw: random.Random) -> None:
    if target == "rig":
        _read_rig(content)
    elif target == "result":
        _read_result(content)
    elif target == "quantity":
        _read_quantity(content, name)
    elif target == "axes":
        _read_axes(content)
    elif target in ("columns", "identify"):
        _read_columns(random.Random(content.decode()), identified=target == "identify")
    elif target == "answers":
        answer_case(random.Random(content.decode()))
    elif target == "pieces":
        _read_pieces(content, name, draw)
    elif target == "inspect":
        from swingid.recording.formats import read_table
        from swingid.study.inspect.inspection import inspect_table

        table = read_table(content, name)
        found = inspect_table(table, draw.choice((None, rig_for(table.columns, draw))))
        assert found.to_json()
        assert found.summary()
    else:
        _read_log(content, name, draw)


def _read_log(content: bytes, name: str, draw: random.Random) -> None:
    from swingid.recording import Recording
    from swingid.recording.formats import read_table
    from swingid.recording.recording import Source

    table = read_table(content, name)
    for column in table.columns:
        assert table.numbers(column)[0].dtype == np.float64
    log = Recording.from_table(table, rig_for(table.columns, draw), Source(name))
    assert isinstance(log, Recording)
    assert len(log) > 1


def _read_columns(draw: random.Random, *, identified: bool) -> None:
    """Columns in memory with faults, read; identified or inspected, too."""
    from swingid.identification import identify
    from swingid.model.rig import Rig

    columns, texts = draw.choice(motions())
    rig = Rig.from_text(draw.choice(texts), "rig.toml")
    log = Recording.from_columns(mutated_columns(columns, draw), rig)
    assert len(log) > 1
    if identified:
        result = identify(log, rig, draw.choice(METHODS))
        assert result.to_json()
        assert result.summary()
        assert np.isfinite(result.inertia.value)


def _read_rig(content: bytes) -> None:
    from swingid.model.rig import Rig

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rig.toml"
        path.write_bytes(content)
        rig = Rig.load(str(path))
    assert rig.name is not None
    assert Rig.from_text(rig.text, "again").axis == rig.axis


def _read_result(content: bytes) -> None:
    from swingid.result.file import load_result

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "result.json"
        path.write_bytes(content)
        load_result(path)


def _read_quantity(content: bytes, unit: str) -> None:
    from swingid.units import parse_quantity

    raw = eval(content.decode("utf-8", "surrogatepass"), {"nan": np.nan, "inf": np.inf, "__builtins__": {}})
    found = parse_quantity(raw, unit, "axis.key")
    assert np.isfinite(found.value)
    assert found.std is None or 0 <= found.std < np.inf


def _read_axes(content: bytes) -> None:
    from swingid.body import tensor

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "axes.toml"
        path.write_bytes(content)
        found = tensor(path)
    assert found.to_json()
    assert found.summary()
    assert all(np.isfinite(element.value) for element in found.elements.values())


def _read_pieces(content: bytes, name: str, draw: random.Random) -> None:
    """A small file read as if it were large."""
    from swingid.recording.large import LargeLog, log, parts

    kept = log.LARGE, log.PIECE, parts.ENOUGH
    log.LARGE, log.PIECE, parts.ENOUGH = 0, 40, 30
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            path.write_bytes(content)
            for _, part in LargeLog(str(path), draw.choice(rigs())).parts():
                assert isinstance(part, Recording | SwingidError)
    finally:
        log.LARGE, log.PIECE, parts.ENOUGH = kept


def _memory() -> int:
    """Most memory that this process has had, bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
