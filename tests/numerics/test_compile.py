"""Kernels compiled ahead: the list, the processes, the command."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numba
import pytest

import swingid as sw
from refusals import coded
from swingid.cli.app import run
from swingid.cli.compile import kernels_of
from swingid.errors import UsageError
from swingid.methods.table import METHODS
from swingid.model.integrator import STEP_KERNEL
from swingid.numerics import ahead, cache

SMALL = {
    "small": [kernel for kernel in ahead._listed()["simulate"] if kernel.name == "given_command"],
}


def test_an_error_of_any_kind_is_the_answer_of_its_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    def garbled(*_: object) -> str:
        raise UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte")

    monkeypatch.setattr(ahead, "_asked", garbled)
    (answer,) = ahead._compiled(SMALL["small"], lambda part, seconds: None, 1).values()
    assert "invalid start byte" in answer


def test_the_list_names_kernels_that_exist() -> None:
    for task in ahead.tasks():
        for kernel in ahead._listed()[task]:
            function = getattr(importlib.import_module(kernel.module), kernel.name)
            assert hasattr(function, "py_func"), f"{kernel.module} has no kernel {kernel.name}: tools/list_kernels.py"
            arguments = ahead._evaluated(f"[{kernel.arguments}]")
            assert arguments is not None, f"{kernel.name}: numba has no type {kernel.arguments}"
            count = function.py_func.__code__.co_argcount
            assert len(arguments) == count, f"{kernel.name} takes {count} arguments now: run tools/list_kernels.py"
    assert {"simulate", *METHODS} <= set(ahead.tasks())


@pytest.mark.parametrize(
    "kind",
    [
        numba.float64,
        numba.float64[:, ::1],
        numba.types.UniTuple(numba.int64, 3),
        numba.types.Tuple((numba.int64, numba.float64[::1])),
        numba.types.Array(numba.float64, 1, "C", readonly=True),
        STEP_KERNEL.type,
    ],
    ids=str,
)
def test_types_survive_as_words(kind: object) -> None:
    assert ahead._evaluated(ahead.word(kind)) == kind


def test_a_task_is_compiled_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(ahead, "_listed", lambda: SMALL)
    monkeypatch.setattr(cache, "CACHE", tmp_path)
    parts: list[float] = []
    assert ahead.compile_ahead(["small"], lambda part, _: parts.append(part)) == (1, ())
    assert parts == [0.0, 1.0]
    assert ahead.is_ready("small")
    assert ahead.compile_ahead(["small"]) == (0, ())
    monkeypatch.setattr(cache, "machine", lambda: "another")
    assert not ahead.is_ready("small"), "another processor, Python or place of the package has kernels of its own"
    with pytest.raises(UsageError, check=coded("unknown-kernels", "smal")):
        ahead.compile_ahead(["smal"])


def test_a_worker_goes_on_after_what_it_cannot_compile() -> None:
    wrong = ["swingid.simulation.loop", "no_such_kernel", "float64", 1.0]
    right = [
        "swingid.model.sensors",
        "encoder_reading",
        "float64, Array(float64, 1, 'C', False, aligned=True), float64",
        1,
    ]
    done = subprocess.run(
        [sys.executable, "-m", "swingid.numerics.ahead"],
        input=f"{json.dumps(wrong)}\n{json.dumps(right)}\n",
        capture_output=True,
        text=True,
        check=True,
    )
    first, second = done.stdout.splitlines()
    assert first.startswith("not compiled: AttributeError")
    assert second == ahead.KEPT


@pytest.mark.skipif(os.name != "posix", reason="needs /bin/false")
def test_what_a_dead_process_did_not_compile_is_not_ready(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(ahead, "_listed", lambda: SMALL)
    monkeypatch.setattr(cache, "CACHE", tmp_path)
    monkeypatch.setattr(sys, "executable", "/bin/false")
    assert ahead.compile_ahead(["small"]) == (0, ("given_command: the process that compiled it has ended",))
    assert not ahead.is_ready("small")


def test_a_process_that_cannot_be_started_is_the_reason(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(ahead, "_listed", lambda: SMALL)
    monkeypatch.setattr(cache, "CACHE", tmp_path)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "nothing"))
    ((reason,),) = [ahead.compile_ahead(["small"]).failed]
    assert reason.startswith("given_command: no process could be started (")


def test_files_of_the_folder_are_not_imported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A folder with a queue.py of its own, which numba would import in place of Python's."""
    (tmp_path / "queue.py").write_text("raise SystemExit\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ahead, "_listed", lambda: SMALL)
    monkeypatch.setattr(cache, "CACHE", tmp_path)
    assert ahead.compile_ahead(["small"]) == (1, ())


def test_the_command_fails_where_kernels_are_not_kept(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    failed = ("step: /cache cannot be written: No space left on device",)
    monkeypatch.setattr(ahead, "compile_ahead", lambda *_: ahead.Compiled(5, failed))
    assert run(["compile"]) == 3
    said = capfd.readouterr().err
    assert "1 of 6 kernels were not compiled ahead (step: /cache cannot be written: No space left on device)" in said


def test_the_command_names_the_tasks_it_knows(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["compile", "nonsense"]) == 2
    assert "there are no kernels named nonsense; there are simulate" in capfd.readouterr().err


def test_output_error_gets_the_kernels_of_its_input() -> None:
    rig = sw.Rig.builtin("paper")
    log = sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=1.0)
    assert kernels_of("momentum", log, rig) == ("momentum",)
    assert kernels_of("output-error", log, rig) == ("output-error",)
    assert kernels_of("output-error", log, rig, "wheel") == ("output-error-axis",)
    assert kernels_of("output-error", replace(log, voltage=None), rig) == ("output-error-axis",)
    free = sw.Rig.from_text('[axis]\ngravity_torque = 0.08\n[drive]\nkind = "none"\n')
    assert kernels_of("output-error", log, free) == ("output-error-axis",)
    assert kernels_of("output-error", replace(log, voltage=None), rig, "voltage") == ()
    assert {"output-error", "output-error-axis"} <= set(ahead.tasks())


@pytest.mark.long
def test_nothing_is_left_to_compile_after_the_command(tmp_path: Path) -> None:
    """An empty cache, `swingid compile`, then the loop and each method without one compilation more."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    rig, log = sw.Rig.builtin("paper"), tmp_path / "experiment.parquet"
    sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=25.0, seed=1).save(log, rig)
    tasks = ["simulate", "output-error-axis", *METHODS]
    subprocess.run([sys.executable, "-m", "swingid", "compile", *tasks], env=environment, check=True)
    tools = Path(__file__).resolve().parents[2] / "tools"
    for task in tasks:
        done = subprocess.run(
            [sys.executable, tools / "list_kernels.py", "--one", task, log],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        left = json.loads(done.stdout.splitlines()[-1])
        assert left == [], f"{task}: {len(left)} kernels are not in the list; run tools/list_kernels.py"
