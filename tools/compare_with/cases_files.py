"""Cases of files: dialects of text, faults of rows, damaged files of every format, and rig files."""

from __future__ import annotations

import io
import json
import random
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from compare_with.case import Case, command
from compare_with.outcomes import JSON, of_call, of_recording
from compare_with.rigs import FREE, LINEAR, PAPER, STATED, changed, to_toml, twin_of

FOLDER = "files"
MUTANTS = 12
"""Damaged copies of each file."""

TOKENS = (b"nan", b"inf", b"1e400", b"-", b",", b";", b"\n", b"\x00", b'"', b"#", b"\xff", b"1,5", b"12:00:00", b"null")


def _columns(rows: int = 3000, rate: float = 250.0) -> dict[str, np.ndarray]:
    """A swing that starts at rest, in the steps of 14-bit encoders; the wheel turns against it."""
    time = np.arange(rows) / rate
    start = np.minimum(1.0, time) ** 2
    count = 2 * np.pi / 16384
    angle, wheel = (np.round(a * np.sin(8.5 * time - 0.02) * start / count) * count for a in (0.8, -20.0))
    return {"t": time, "q1": angle, "q2": wheel, "u": 5 * np.cos(8.5 * time)}


def _text(columns: dict[str, np.ndarray], separator: str = ",", decimal: str = ".", head: str | None = None) -> bytes:
    header = separator.join(columns) if head is None else head
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    cells = [separator.join(f"{x:.9g}".replace(".", decimal) for x in row) for row in rows]
    return "\n".join([header, *cells, ""]).encode()


def _dialects() -> dict[str, bytes]:
    """Small text tables as other programs write them."""
    small = {name: values[:300] for name, values in _columns().items()}
    plain = _text(small)
    rows = [dict(zip(small, row, strict=True)) for row in zip(*(v.tolist() for v in small.values()), strict=True)]
    return {
        "plain.csv": plain,
        "german.csv": _text(small, ";", ",", 't [s];"q1 [deg]";q2 (rad);u [V]'),
        "tabs.txt": _text(small, "\t", ".", "t\tq1\tq2\tu\ns\trad\trad\tV"),
        "spaces.csv": _text(small, " ", ".", "# t q1 q2 u"),
        "preamble.csv": _text(small, "|", ".", "Measurement 7\nOperator: A\n\nt|q1|q2|u"),
        "headless.csv": plain.partition(b"\n")[2],
        "bom.csv": b"\xef\xbb\xbf" + plain,
        "utf16.csv": plain.decode().encode("utf-16"),
        "crlf.csv": plain.replace(b"\n", b"\r\n"),
        "lines.jsonl": "\n".join(map(json.dumps, rows)).encode(),
        "rows.json": json.dumps(rows).encode(),
        "arrays.json": json.dumps({name: values.tolist() for name, values in small.items()}).encode(),
        "empty.csv": b"",
        "header-only.csv": b"t,q1,q2,u\n",
        "one-row.csv": b"t,q1,q2,u\n0,0,0,0\n",
        "page.csv": b"<html><body>404</body></html>",
        "picture.csv": b"\x89PNG\r\n\x1a\n" + bytes(200),
        "result.json": b'{"schema": "swingid.result/1", "method": "momentum"}',
        "words.csv": b"t,q1,q2,u\n" + b"a,b,c,d\n" * 50,
    }


def _faults() -> dict[str, bytes]:
    """Logs with one fault of their rows each."""
    draw = np.random.default_rng(1)

    def with_changes(**changes: Any) -> bytes:
        columns = _columns()
        rows = changes.pop("rows", np.arange(len(columns["t"])))
        for name, change in changes.items():
            columns[name] = change(columns[name].copy())
        return _text({name: values[rows] for name, values in columns.items()})

    def put(at: Any, values: Any) -> Any:
        def change(column: np.ndarray) -> np.ndarray:
            column[at] = values
            return column

        return change

    order, every = np.arange(3000), np.arange(3000)
    order[[400, 401]] = order[[401, 400]]
    return {
        "blanks.csv": with_changes(q1=put(slice(700, 703), np.nan)),
        "many-blanks.csv": with_changes(q1=put(slice(0, 2000, 2), np.nan)),
        "sort.csv": with_changes(rows=order),
        "backwards.csv": with_changes(rows=every[::-1]),
        "repeats.csv": with_changes(rows=np.sort(np.r_[every, [900, 900]])),
        "gap.csv": with_changes(rows=np.r_[every[:1000], every[1200:]]),
        "clock.csv": with_changes(t=lambda t: t + draw.normal(0, 4e-4, len(t))),
        "coarse-clock.csv": with_changes(t=lambda t: np.round(t, 2)),
        "milliseconds.csv": with_changes(t=lambda t: 1000 * t),
        "epoch.csv": with_changes(t=lambda t: t + 1.7e9),
        "still-clock.csv": with_changes(t=lambda t: 0 * t),
        "wrapped.csv": with_changes(q2=lambda q: (q + np.pi) % (2 * np.pi) - np.pi),
        "spikes.csv": with_changes(q1=put([800, 2500], [2.0, -2.0])),
        "absurd.csv": with_changes(q1=put(1500, 1e12)),
        "jump.csv": with_changes(q1=lambda q: q + 0.3 * (np.arange(len(q)) > 1500)),
        "dead-angle.csv": with_changes(q1=lambda q: 0 * q),
        "dead-wheel.csv": with_changes(q2=lambda q: 0 * q),
        "degrees.csv": with_changes(q1=np.degrees, q2=np.degrees),
        "infinite.csv": with_changes(u=put(10, np.inf)),
        "beyond-limit.csv": with_changes(u=lambda u: 3 * u),
    }


def _rigs() -> dict[str, str]:
    """Rig files, right and wrong."""
    trees: dict[str, Any] = {
        "given": PAPER,
        "stated": twin_of(changed(PAPER, STATED)),
        "free": changed(PAPER, FREE),
        "linear": LINEAR,
        "unknown-gravity": changed(PAPER, {"axis.gravity_torque": "unknown"}),
        "balanced": changed(PAPER, {"axis.gravity_torque": 0}),
        "degrees": changed(PAPER, {"log.angle_unit": "deg", "log.angle_zero": "up"}),
    }
    bad: dict[str, dict[str, Any]] = {
        "misspelt": {"axis.gravity_torqe": 1.0},
        "no-wheel": {"drive.wheel": None},
        "kind": {"drive.kind": "magic"},
        "unit": {"axis.gravity_torque": "78 kg"},
        "negative": {"drive.wheel.inertia": -1.0},
        "negative-uncertainty": {"drive.wheel.inertia": "1 ± -1 g*cm^2"},
        "text": {"drive.motor.gear_ratio": "big"},
        "huge": {"axis.gravity_torque": "1e999 N*m"},
        "list": {"axis.gravity_torque": [1, 2]},
        "dead-zone": {"drive.motor.dead_zone": [1]},
        "latency": {"sensors.latency": "100 s"},
        "counts": {"sensors.counts_per_turn": 0},
        "column": {"log.angle": ""},
        "sign": {"log.angle_sign": 0},
        "both": {"log.rate": 100},
        "no-axis": {"axis": None},
    }
    texts = {name: to_toml(tree) for name, tree in trees.items()}
    texts |= {f"bad-{name}": to_toml(changed(PAPER, changes)) for name, changes in bad.items()}
    return texts | {"bad-toml": "name = ", "bad-empty": "", "bad-bytes": "\x00\x01"}


def mutated(content: bytes, draw: random.Random) -> bytes:
    """The bytes after one to three faults: flipped, cut, repeated, overwritten, a token or number put in."""
    for _ in range(draw.choice((1, 1, 2, 3))):
        at = draw.randrange(len(content) + 1)
        size = draw.choice((1, 4, 16, 64, 256))
        kind = draw.randrange(6)
        if kind == 0:
            content = content[:at]
        elif kind == 1:
            content = content[:at] + content[at + size :]
        elif kind == 2:
            content = content[: at + size] + content[at:]
        elif kind == 3:
            content = content[:at] + draw.randbytes(min(size, 16)) + content[at + min(size, 16) :]
        elif kind == 4:
            content = content[:at] + draw.choice(TOKENS) + content[at:]
        else:
            content = (
                content[:at] + bytes(b ^ (1 << draw.randrange(8)) for b in content[at : at + 1]) + content[at + 1 :]
            )
    return content


def write(folder: Path) -> None:
    """All files of these cases, into `folder`/files; copies of `plain.csv` in other formats by the tree's `convert`."""
    from swingid.cli import main

    own = folder / FOLDER
    own.mkdir(exist_ok=True)
    for name, content in (_dialects() | _faults()).items():
        (own / name).write_bytes(content)
    for name, rig in _rigs().items():
        (own / f"{name}.toml").write_text(rig, encoding="utf-8")
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        for ending in FORMATS:
            main(["convert", str(own / "plain.csv"), str(own / f"plain{ending}")])
    for ending in (".csv", *FORMATS):
        content = (own / f"plain{ending}").read_bytes()
        for k in range(MUTANTS):
            (own / f"mutant{k}{ending}").write_bytes(mutated(content, random.Random(f"{ending} {k}")))
    text = to_toml(twin_of(changed(PAPER, STATED))).encode()
    for k in range(2 * MUTANTS):
        (own / f"mutant{k}.toml").write_bytes(mutated(text, random.Random(f"rig {k}")))


FORMATS = (".parquet", ".mat", ".h5", ".mcap", ".jsonl")


def _read(path: str, rig: str, folder: Path) -> Any:
    import swingid as sw

    return of_call(lambda: of_recording(sw.Recording.load(path, sw.Rig.load(rig))))


def _rig(path: str, folder: Path) -> Any:
    import swingid as sw

    def load() -> Any:
        rig = sw.Rig.load(path)
        return {"name": rig.name, "exact": rig.constants_without_uncertainty(), "text": rig.text}

    return of_call(load)


def cases() -> list[Case]:
    """Every file read, inspected and, where it has rows enough, identified."""
    at, rig = f"logs/{FOLDER}", f"logs/{FOLDER}/given.toml"
    mutants = [f"mutant{k}{ending}" for ending in (".csv", *FORMATS) for k in range(MUTANTS)]
    found: list[Case] = []
    for name in (*_dialects(), *_faults(), *mutants, *(f"plain{ending}" for ending in FORMATS)):
        quick = name not in mutants or name.startswith(("mutant0", "mutant1."))
        found.append(Case(f"file/{name}/read", partial(_read, f"{at}/{name}", rig), quick))
        found.append(command(f"file/{name}/inspect", ["inspect", f"{at}/{name}", "--json", JSON], quick=quick))
        if name in _faults():
            arguments = ["identify", f"{at}/{name}", "--rig", rig, "--json", JSON]
            found.append(command(f"file/{name}/identify", arguments, quick=quick))
            found.append(command(f"file/{name}/inspect-rig", ["inspect", *arguments[1:]]))
    for name in (*_rigs(), *(f"mutant{k}" for k in range(2 * MUTANTS))):
        found.append(Case(f"rig/{name}", partial(_rig, f"{at}/{name}.toml"), quick=not name.startswith("mutant")))
    return found
