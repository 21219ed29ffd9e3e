"""Ctrl-C at several instants of long work: exit code 130, a sentence on what is kept, no half file, no process left."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from large_logs import GIVEN, write_large_log
from long_cases import quick_first
from swingid.cli import failure, main
from swingid.processes import interruption_waits, worker_pool
from swingid.system import WRITTEN, write_whole

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends SIGINT to a group of processes")

NOTHING = "swingid: interrupted; nothing was written, so start again."


class Started:
    """A command in a group of processes of its own, as a terminal starts it."""

    def __init__(self, *arguments: object, environment: dict[str, str] | None = None) -> None:
        command = [sys.executable, "-m", "swingid", *map(str, arguments)]
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env=os.environ | (environment or {}),
        )

    def interrupt(self, *, group: bool = True) -> tuple[str, str]:
        """Send SIGINT to all its processes, or to the first alone; returns what it wrote."""
        assert self.process.poll() is None, self.process.stderr.read()
        (os.killpg if group else os.kill)(self.process.pid, signal.SIGINT)
        return self.process.communicate(timeout=120)

    def wait_for_processes(self, number: int, seconds: float = 120.0) -> None:
        """Wait until so many processes run beside the first; a busy machine takes its time."""
        end = time.monotonic() + seconds
        while self._processes() <= number:
            assert self.process.poll() is None, self.process.stderr.read()
            assert time.monotonic() < end
            time.sleep(0.05)

    def _processes(self) -> int:
        groups = subprocess.run(["ps", "-A", "-o", "pgid="], capture_output=True, text=True, check=True).stdout
        return groups.split().count(str(self.process.pid))

    def is_gone(self, seconds: float = 30.0) -> bool:
        """Whether all its processes end within this time."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                os.killpg(self.process.pid, 0)
            except ProcessLookupError:
                return True
            time.sleep(0.05)
        return False

    def kill(self) -> None:
        """End all its processes."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


@pytest.fixture
def started() -> Iterator[type[Started] | object]:
    """Start commands; those that still run in the end are killed."""
    running: list[Started] = []

    def start(*arguments: object, **options: object) -> Started:
        running.append(Started(*arguments, **options))
        return running[-1]

    yield start
    for one in running:
        one.kill()


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    """25 s of the paper's rig."""
    path = tmp_path_factory.mktemp("log") / "log.parquet"
    words = "sine 0.8 rad 8.5 rad/s"
    assert main(["simulate", "--rig", "paper", "--reference", words, "--duration", "25", "--out", str(path)]) == 0
    return path


def check(one: Started, folder: Path, *, group: bool, last: str = re.escape(NOTHING)) -> None:
    """Interrupt a command and look at what it leaves."""
    out, err = one.interrupt(group=group)
    assert one.process.returncode == 130, err
    assert re.fullmatch(last, err.strip().splitlines()[-1]), err
    assert "Traceback" not in err
    assert "Exception ignored" not in err
    assert out == ""
    assert one.is_gone()
    assert not [path for path in folder.rglob("*") if path.name.endswith(".part")]


@pytest.mark.parametrize(("seconds", "group"), quick_first(1, [(2.0, True), (0.8, False), (5.0, True)]))
def test_while_kernels_are_compiled(started, log, tmp_path, seconds, group):
    target = tmp_path / "result.json"
    target.write_text("as it was")
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    one = started("identify", log, "--rig", "paper", "--method", "output-error", "--json", target, environment=cache)
    time.sleep(seconds)
    check(one, tmp_path, group=group)
    assert target.read_text() == "as it was"


@pytest.mark.long
@pytest.mark.parametrize("group", quick_first(1, [True, False]))
def test_compilation_keeps_its_kernels(started, tmp_path, group):
    one = started("compile", "simulate", environment={"NUMBA_CACHE_DIR": str(tmp_path)})
    while not list(tmp_path.rglob("*.nbc")):
        assert one.process.poll() is None
        time.sleep(0.1)
    said = rf"swingid: interrupted; the kernels that are compiled are kept in {re.escape(str(tmp_path))}.*"
    check(one, tmp_path, group=group, last=said)
    assert not list(tmp_path.rglob("ready-*"))


@pytest.mark.parametrize(
    ("beside", "group"), quick_first(1, [(2, True), (2, False), (0, True)])
)  # 2: that of Python, a first worker
def test_while_processes_draw(started, log, tmp_path, beside, group):
    target = tmp_path / "result.json"
    one = started("identify", log, "--rig", "paper", "--monte-carlo", 20_000, "--json", target)
    one.wait_for_processes(beside)
    time.sleep(1.5)  # any instant from there on will do
    check(one, tmp_path, group=group)
    assert not target.exists()


@pytest.mark.long
@pytest.mark.parametrize(("seconds", "group"), [(0.7, True), (1.0, True), (1.0, False)])
def test_a_large_log(started, tmp_path, seconds, group):
    path = write_large_log(tmp_path / "log.parquet", 6_000_000)
    (tmp_path / "rig.toml").write_text(GIVEN.text)
    one = started("identify", path, "--rig", tmp_path / "rig.toml", "--method", "energy", "--json", tmp_path / "r.json")
    time.sleep(seconds)
    check(one, tmp_path, group=group)
    assert not (tmp_path / "r.json").exists()


@pytest.mark.parametrize("command", quick_first(1, ["simulate", "design", "calibrate", "encoders"]))
def test_commands_of_one_answer(started, log, tmp_path, command):
    """Of these a kernel of many rows runs, or many small fits."""
    (tmp_path / "out").mkdir()
    motion = ["--rig", "paper", "--reference", "sine 0.8 rad 8.5 rad/s"]
    long = tmp_path / "log.parquet"
    if command in ("calibrate", "encoders"):
        assert main(["simulate", *motion, "--duration", "1000", "--out", str(long)]) == 0
    out = ["--json", tmp_path / "out" / "r.json"]
    arguments = {
        "simulate": ["simulate", *motion, "--duration", 95_000, "--rate", 200, "--out", tmp_path / "out" / "r.csv"],
        "design": ["design", "--rig", "paper", "--uncertainty", "1e-5 %", "--duration", 3000, "--rate", 5000, *out],
        "calibrate": ["calibrate", long, "--rig", "paper", "--out", tmp_path / "out" / "new.toml", *out],
        "encoders": ["calibrate", "--encoders", long, "--rig", "paper", "--out", tmp_path / "out" / "new.toml", *out],
    }[command]
    one = started(*arguments)
    time.sleep(2.0)
    begin = time.monotonic()
    check(one, tmp_path, group=True)
    assert time.monotonic() - begin < 20.0
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.long
@pytest.mark.parametrize("group", [True, False])
def test_a_campaign_keeps_its_runs_and_goes_on(started, tmp_path, group):
    folder = tmp_path / "runs"

    def started_and_further(than: int) -> Started:
        """A campaign that has done more blocks than so many."""
        one = started("campaign", "coverage", "--out", folder, "--workers", 2)
        while len(list(folder.glob("parts/part-*.parquet"))) <= than:
            assert one.process.poll() is None
            time.sleep(0.2)
        return one

    one = started_and_further(0)
    said = rf"swingid: interrupted; (\d+) of 3000 runs are kept in {re.escape(str(folder))}; the same command goes on "
    check(one, tmp_path, group=group, last=said + "from there.")
    kept = len(list(folder.glob("parts/part-*.parquet")))
    assert kept > 0
    again = started_and_further(kept)
    check(again, tmp_path, group=group, last=said + "from there.")
    assert len(list(folder.glob("parts/part-*.parquet"))) >= kept


@pytest.mark.long
@pytest.mark.parametrize("seconds", [1.0, 4.0, 9.0, 15.0])
@pytest.mark.parametrize("command", ["rehearse", "reproduce", "simulate", "compare"])
def test_other_long_commands(started, log, tmp_path, command, seconds):
    motion = ["--rig", "paper", "--reference", "sine 0.8 rad 8.5 rad/s"]
    logs = [log.with_name(f"log{k}.parquet") for k in range(60 * (command == "compare"))]  # a minute of work and more
    for one in logs:
        one.write_bytes(log.read_bytes())
    arguments = {
        "rehearse": ["rehearse", *motion, "--duration", 25, "--runs", 4000, "--json", tmp_path / "r.json"],
        "reproduce": ["reproduce", "--out", tmp_path / "paper"],
        "simulate": ["simulate", *motion, "--duration", 95_000, "--rate", 100, "--out", tmp_path / "r.parquet"],
        "compare": ["compare", *logs, "--rig", "paper", "--report", tmp_path / "r.html"],
    }[command]
    one = started(*arguments, environment={"NUMBA_CACHE_DIR": str(tmp_path / "cache")})
    time.sleep(seconds)
    check(one, tmp_path, group=True)


def test_what_was_written_is_named(monkeypatch, tmp_path, capsys, log):
    """The report is whole, and the interruption comes before the JSON."""

    def stop(*_, **__):
        raise KeyboardInterrupt

    report = tmp_path / "report.html"
    monkeypatch.setattr("swingid.cli.output.hand_over", stop)
    assert main(["identify", str(log), "--rig", "paper", "--report", str(report), "--json", str(tmp_path / "r")]) == 130
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last == f"swingid: interrupted; {report} is whole, nothing else was written; start again."
    assert "</html>" in report.read_text()[-20:]


def test_a_file_that_was_begun_is_taken_away(monkeypatch, tmp_path):
    def stop(*_):
        raise KeyboardInterrupt

    target = tmp_path / "file"
    target.write_bytes(b"before")
    monkeypatch.setattr(Path, "replace", stop)
    with pytest.raises(KeyboardInterrupt):
        write_whole(target, b"after")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert target.read_bytes() == b"before"


def test_an_interruption_in_a_callback_is_not_lost(capsys):
    """Python drops what is raised in a destructor."""

    class Dropped:
        def __del__(self):
            raise KeyboardInterrupt

    def work(_):
        Dropped()
        for _ in range(500):
            time.sleep(0.01)
        return 0

    WRITTEN.clear()
    begin = time.monotonic()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("swingid.cli.app.run", work)
        assert main([]) == 130
    assert time.monotonic() - begin < 5.0
    assert capsys.readouterr().err == NOTHING + "\n"


def test_an_error_of_what_lost_an_interruption_in_its_callback_is_no_bug(capsys, monkeypatch):
    """As the compiler's, whose callback keeps what it has made."""

    class Dropped:
        def __del__(self):
            raise KeyboardInterrupt

    def work(**_):
        Dropped()
        raise RuntimeError("no compiled object yet")

    WRITTEN.clear()
    monkeypatch.setattr("swingid.cli.app.app", work)
    assert main([]) == 130
    assert capsys.readouterr().err == NOTHING + "\n"
    time.sleep(0.5)  # what would be sent again changes nothing any more

    def broken(**_):
        raise RuntimeError("a bug")

    monkeypatch.setattr("swingid.cli.app.app", broken)
    assert main([]) == 70


def interrupted_pool(processes: list) -> None:
    """A pool that works for a minute, interrupted at once; its processes go to the list."""
    with worker_pool(2) as pool:
        with interruption_waits():
            pool.map(time.sleep, [60.0, 60.0])
        processes += pool._processes.values()
        raise KeyboardInterrupt


def test_processes_end_with_their_pool():
    processes: list = []
    with pytest.raises(KeyboardInterrupt):
        interrupted_pool(processes)
    assert len(processes) == 2
    assert not any(process.is_alive() for process in processes)


IN_THE_MIDDLE = """
import multiprocessing, sys, time
from concurrent.futures import ProcessPoolExecutor
from swingid.processes import end_workers

class Slow:
    def __reduce__(self):
        return time.sleep, (2.0,)  # to read it takes so long

def large():
    time.sleep(0.5)
    return bytes(10**7)  # more than a pipe holds

if __name__ == "__main__":
    pool = ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(sys.argv[1]))
    list(pool.map(time.sleep, [0.1, 0.1]))
    results = [pool.submit(Slow), pool.submit(large)]
    time.sleep(1.5)
    end_workers(pool)
    pool.shutdown()
    print(type(results[1].exception()).__name__)
"""


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_processes_that_send_a_result_end_with_their_pool(tmp_path, start):
    path = tmp_path / "in_the_middle.py"
    path.write_text(IN_THE_MIDDLE, encoding="utf-8")
    done = subprocess.run([sys.executable, path, start], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "BrokenProcessPool"


def test_processes_do_not_get_the_interruption():
    with worker_pool(1) as pool:
        with interruption_waits():
            blocked = pool.submit(signal.pthread_sigmask, signal.SIG_BLOCK, [])
        assert signal.SIGINT in blocked.result()
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_what_is_kept_is_said_once(capsys):
    WRITTEN.clear()
    with pytest.raises(KeyboardInterrupt), failure.keeps(lambda: "much is kept"):
        raise KeyboardInterrupt
    assert failure.interrupted() == 130
    assert failure.interrupted() == 130
    assert capsys.readouterr().err.splitlines() == ["swingid: interrupted; much is kept.", NOTHING]
