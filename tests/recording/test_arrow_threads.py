"""Arrow reads with one thread: one that outlives its call aborts a process that ends (`csv.read_rows`)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import swingid as sw

ROWS = 200_000

COUNT = """
import os, sys
from pathlib import Path
import pyarrow.csv, pyarrow.parquet
from swingid.recording.formats import read_table

content = Path(sys.argv[1]).read_bytes()
before = len(os.listdir("/proc/self/task"))
table = read_table(content, sys.argv[1])
assert len(table.numbers("q1")[0]) > 0
print(len(os.listdir("/proc/self/task")) - before)
"""


@pytest.fixture(scope="module")
def log() -> sw.Recording:
    t = np.arange(ROWS) / 1000
    return sw.Recording(t, 0.5 * np.sin(3 * t), np.cos(t))


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="counts threads in /proc, which this system has not")
@pytest.mark.skipif(os.cpu_count() == 1, reason="on one processor Arrow has one thread in any case")
@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_reading_leaves_no_thread_of_arrow(tmp_path, log, ending):
    path = tmp_path / f"log.{ending}"
    log.save(path)
    done = subprocess.run([sys.executable, "-c", COUNT, path], capture_output=True, text=True, check=True)
    assert int(done.stdout) <= 1  # the one that waits for signals
