"""Whatever the bytes of a file: a documented error or a valid Recording; no traceback, no hang, no flood of memory."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from fuzz.batch import watched
from fuzz.cases import TARGETS, content_of, failure_of
from fuzz.corpus import FILES
from long_cases import quick_if
from refusals import coded
from swingid.errors import InputError
from swingid.model.rig import Rig
from swingid.recording.formats import isolated, read_table

QUICK = {"objects": 5, "workbook": 30, "inspect": 30, "quantity": 500, "rig": 80, "identify": 40, "answers": 300}
LONG = {
    **dict.fromkeys(("csv", "parquet", "mat", "hdf5", "mcap", "json", "rig", "columns"), 9_000),
    "pieces": 10_000,
    "identify": 8_000,
    "answers": 8_000,
    "result": 5_000,
    "inspect": 4_000,
    "objects": 1_000,
    "archive": 6_000,
    "workbook": 3_000,
    "axes": 4_000,
    "quantity": 20_000,
}
"""Cases of each reader, by what a case costs; 141 000 together."""

BATCH = 2_000


@pytest.mark.parametrize("target", quick_if(lambda target: target != "answers", TARGETS))
def test_a_few_hundred_damaged_files(target):
    failures = {seed: failure for seed in range(QUICK.get(target, 60)) if (failure := failure_of(target, seed))}
    assert not failures, "\n".join(failures.values())


@pytest.mark.parametrize("target", TARGETS)
def test_most_cases_differ(target):
    contents = {content_of(target, seed)[0] for seed in range(40)}
    assert len(contents) > 25
    assert content_of(target, 7) == content_of(target, 7)


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_a_hundred_thousand_damaged_files():
    """In processes of their own, as many as there are processors; a crash, a hang and any output are failures, too."""
    assert sum(LONG.values()) >= 100_000
    assert set(LONG) == set(TARGETS)
    batches = []
    for target, count in LONG.items():
        size = min(BATCH, max(count // 2, 1))
        batches += [(target, 1_000_000 + k, min(size, count - k)) for k in range(0, count, size)]
    batches.sort(key=lambda batch: batch[0] != "objects")  # the slowest first
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        found = list(pool.map(lambda batch: (batch[0], watched(*batch)), batches))
    failures = [f"{target} {seed}: {text}" for target, each in found for seed, text in each]
    assert not failures, "\n".join(failures[:20])


def test_the_watch_sees_what_goes_wrong(monkeypatch, tmp_path):
    """A case that hangs, one that crashes the process and one that prints are all reported, and the rest goes on."""
    from fuzz import batch

    script = tmp_path / "batch.py"
    script.write_text(
        "import os, sys, time\n"
        "first, count, state = int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]\n"
        "for seed in range(first, first + count):\n"
        "    open(state, 'w').write(str(seed))\n"
        "    if seed == 1: os.kill(os.getpid(), 11)\n"
        "    if seed == 3:\n"
        "        while True: pass\n"
        '    if seed == 4: print(\'FAILURE: {"seed": 4, "failure": "x"}\')\n'
    )
    monkeypatch.setattr(batch, "__file__", str(script))
    monkeypatch.setattr(batch, "HANG", 0.3)
    failures = dict(batch.watched("csv", 0, 6))
    assert sorted(failures) == [1, 3, 4]
    assert failures[1].startswith("crash")
    assert failures[3].startswith("hang")


@pytest.mark.parametrize(("ending", "head"), [(".mat", b"MATLAB 5.0 MAT-file"), (".h5", b""), (".parquet", b"")])
def test_a_bomb_is_refused(ending, head):
    """A small file that says it holds many more zeros than it may."""
    if ending == ".mat":
        import zlib

        size = 1 << 27
        deflate = zlib.compressobj(9)
        block = bytes(1 << 22)
        packed = b"".join(deflate.compress(block) for _ in range(size >> 22)) + deflate.flush()
        content = head.ljust(124) + b"\x00\x01IM" + (15).to_bytes(4, "little") + len(packed).to_bytes(4, "little")
        content += packed
    elif ending == ".parquet":
        import io

        import pyarrow as pa
        import pyarrow.parquet as pq

        sink = io.BytesIO()
        pq.write_table(pa.table({"t": np.zeros(1 << 24)}), sink, compression="zstd")
        content = sink.getvalue()
    else:
        import io

        import h5py

        sink = io.BytesIO()
        with h5py.File(sink, "w") as file:
            file.create_dataset("t", shape=(1 << 27,), dtype="f8", chunks=(1 << 20,), compression="gzip")
        content = sink.getvalue()
    with pytest.raises(InputError, check=coded("not-a-table")):
        read_table(content, f"log{ending}")


def test_a_reader_that_crashes_or_hangs_takes_nothing_along(monkeypatch):
    monkeypatch.setattr(isolated, "LONGEST", 0.5)
    for code, why in (("import os; os.abort()", "crashed"), ("while True: pass", "more than"), ("1/0", "ZeroDivision")):
        with pytest.raises(isolated.UnreadableError, match=why):
            isolated.read_apart("runpy", "runpy:run_path", code.encode())
    monkeypatch.undo()
    good = FILES["hdf5"][0]()[0]
    assert list(read_table(good, "log.h5").columns) == ["t", "q1", "q2", "u"]


def test_a_rig_of_absurd_numbers_is_one_sentence():
    text = Rig.builtin("paper").text
    for value in ("1e308", "1e200", '"1e300 kg*m^2"', "-1e308", "5e-324"):
        for key in ("inertia", "gravity_torque"):
            changed = "\n".join(
                f"{key} = {value}" if line.strip().startswith(f"{key} ") else line for line in text.splitlines()
            )
            try:
                Rig.from_text(changed, "rig.toml")
            except InputError as error:
                assert "\n" not in error.message
