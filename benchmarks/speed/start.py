"""First use and new processes: processor time of all processes of a command, beside fixed programs."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from case import Case, Timer

HERE = Path(__file__).parent
SIMULATE = ("simulate", "--rig", "paper", "--reference", "sine 0.8 rad 8.5 rad/s", "--duration", "25", "--out")
PACKAGES = "import numpy, scipy.signal, pyarrow.parquet, pydantic"


def command(arguments: Sequence[object], environment: Mapping[str, str], empty: bool = False) -> Timer:
    """Timer of a Python process with its children; `empty`: with a cache of kernels of its own, which is empty."""

    def timer() -> float:
        before = processor()
        with tempfile.TemporaryDirectory() as cache:
            own = {**environment, "NUMBA_CACHE_DIR": cache} if empty else environment
            subprocess.run([sys.executable, *map(str, arguments)], env=own, check=True, capture_output=True)
        return processor() - before

    return timer


def processor() -> float:
    """Seconds of all processes that this one waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def cases() -> Iterator[Case]:
    """First `simulate` and `compare` with no kernel compiled; `identify` and `--help` as new processes."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    with tempfile.TemporaryDirectory() as name:
        log = Path(name) / "run.parquet"
        cold = command([HERE / "reference_kernel.py"], environment)
        first = {"simulate": (*SIMULATE, Path(name) / "first.parquet"), "compare": ("compare", log, "--rig", "paper")}
        subprocess.run(
            [sys.executable, "-m", "swingid", *SIMULATE, log], env=environment, check=True, capture_output=True
        )
        for task, arguments in first.items():
            ours = command(["-m", "swingid", *arguments], environment, empty=True)
            yield Case(f"first {task}", "numba compiling 40 fixed lines", ours, cold, pairs=3, warm=False)
        warm = ["-m", "swingid", "identify", log, "--rig", "paper"]
        imports = command(["-c", PACKAGES], environment)
        yield Case("identify, new process", f"`{PACKAGES}`", command(warm, environment), imports)
        help_ = command(["-m", "swingid", "--help"], environment)
        yield Case("swingid --help", "`import typer.main`", help_, command(["-c", "import typer.main"], environment))
