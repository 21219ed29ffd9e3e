"""What differs between operating systems, and paths that are no files."""

import ast
import hashlib
import os
import pickle
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import swingid as sw
from refusals import coded
from swingid import processes, system
from swingid.cli import main
from swingid.errors import InputError, NotIdentifiableError, SwingidError

SOURCE = Path(sw.__file__).parent
POSIX = os.name == "posix"

POSIX_MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "spwd", "syslog", "termios", "tty"}
OF_OS = """chown chroot fork forkpty fchmod fchown getegid geteuid getgid getgroups getloadavg getpgid getpgrp
getpriority getresuid getsid getuid initgroups kill killpg lchown lockf mkfifo mknod nice openpty posix_fadvise
posix_fallocate posix_spawn pread pwrite readv sched_getaffinity sched_setaffinity sched_yield sendfile setegid seteuid
setgid setpgid setpriority setsid setuid statvfs sync sysconf tcgetpgrp uname wait wait3 wait4 waitid WEXITSTATUS
WIFSIGNALED WNOHANG WTERMSIG writev O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_NONBLOCK O_SYNC EX_OK"""
OF_SIGNAL = """SIGALRM SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGUSR1 SIGUSR2 SIGXCPU alarm setitimer
pause pthread_kill pthread_sigmask sigwait siginterrupt"""
POSIX_NAMES = {
    "os": OF_OS.split(),
    "signal": OF_SIGNAL.split(),
    "time": ["clock_gettime", "clock_getres", "tzset"],
    "socket": ["AF_UNIX"],
    "select": ["poll", "epoll", "kqueue"],
}
"""What Python's manual says is "Availability: Unix" or "not Windows"."""


def posix_only(text: str) -> list[str]:
    """Uses of what Windows does not have.

    hasattr(os, "name") in the test of an enclosing if guards a name, a handler of ImportError an import.

    """
    found: list[str] = []

    def visit(node: ast.AST, guarded: frozenset[str]) -> None:
        if isinstance(node, ast.If | ast.IfExp):
            guards = {c.args[1].value for c in ast.walk(node.test) if is_hasattr(c)}
            visit(node.test, guarded)
            for child in node.body if isinstance(node, ast.If) else [node.body]:
                visit(child, guarded | guards)
            for child in node.orelse if isinstance(node, ast.If) else [node.orelse]:
                visit(child, guarded)
            return
        if isinstance(node, ast.Try) and any("ImportError" in ast.dump(handler) for handler in node.handlers):
            for child in [*node.body, *node.handlers, *node.orelse, *node.finalbody]:
                if not (child in node.body and isinstance(child, ast.Import | ast.ImportFrom)):
                    visit(child, guarded)
            return
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.attr in POSIX_NAMES.get(node.value.id, ()) and node.attr not in guarded:
                found.append(f"{node.lineno}: {node.value.id}.{node.attr}")
        elif isinstance(node, ast.Import):
            found.extend(f"{node.lineno}: {a.name}" for a in node.names if a.name.split(".")[0] in POSIX_MODULES)
        elif isinstance(node, ast.ImportFrom):
            names = POSIX_NAMES.get(node.module or "", ())
            found.extend(f"{node.lineno}: {a.name}" for a in node.names if a.name in names)
            if (node.module or "").split(".")[0] in POSIX_MODULES:
                found.append(f"{node.lineno}: {node.module}")
        for child in ast.iter_child_nodes(node):
            visit(child, guarded)

    visit(ast.parse(text), frozenset())
    return found


def is_hasattr(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "hasattr"


def test_nothing_of_posix_is_used_without_a_guard() -> None:
    found = {str(path.relative_to(SOURCE)): posix_only(path.read_text("utf-8")) for path in SOURCE.rglob("*.py")}
    assert {name: lines for name, lines in found.items() if lines} == {}


def test_uses_of_posix_are_seen() -> None:
    assert posix_only("import os\nos.getuid()") == ["2: os.getuid"]
    assert posix_only("def f():\n    import fcntl, resource") == ["2: fcntl", "2: resource"]
    assert posix_only("from os import fork") == ["1: fork"]
    assert posix_only("try:\n    import pty\nexcept ImportError:\n    import grp") == ["4: grp"]
    assert posix_only("import os\nif hasattr(os, 'getuid'):\n    os.getuid()\nelse:\n    os.fork()") == ["5: os.fork"]


def test_devices_are_named_by_os_alone() -> None:
    devices = re.compile('"/dev/(null|zero|u?random|std|fd)')
    found = [path.name for path in SOURCE.rglob("*.py") if devices.search(path.read_text("utf-8"))]
    assert found == []


ELSEWHERE = """
import importlib, os, subprocess, sys, tempfile
import multiprocessing, numba, numpy, pyarrow, scipy  # they ask for what their own system has
for name in {names!r}:
    if hasattr(os, name): delattr(os, name)
for name in {modules!r}:
    sys.modules[name] = None
os.environ["XDG_CACHE_HOME"] = os.devnull  # no folder can be made in it
os.environ.pop("NUMBA_CACHE_DIR", None)
tempfile.tempdir = {folder!r}
"""


def without_posix(program: str, folder: Path, **environment: str) -> str:
    """What a program prints in a Python that lacks what Windows lacks."""
    names = [name for name in POSIX_NAMES["os"] if name not in ("waitstatus_to_exitcode", "O_CLOEXEC")]
    head = ELSEWHERE.format(names=names, modules=sorted(POSIX_MODULES - {"posix"}), folder=str(folder))
    done = subprocess.run(
        [sys.executable, "-c", head + program], capture_output=True, text=True, env=os.environ | environment
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.skipif(not POSIX, reason="takes away what is not there")
def test_the_cache_of_kernels_has_a_folder_without_posix(tmp_path: Path) -> None:
    program = "from swingid.numerics.cache import CACHE\nprint(CACHE)"
    found = Path(without_posix(program, tmp_path, LOGNAME="a b/c").strip())
    assert found.is_dir()
    assert found.parent == tmp_path / "swingid-a-b-c"


@pytest.mark.skipif(not POSIX, reason="takes away what is not there")
def test_locks_cores_and_limits_do_without_posix(tmp_path: Path) -> None:
    program = """
from pathlib import Path
from swingid import processes, system
assert processes.cores() == (os.cpu_count() or 1)
processes.limit_process(1, 1.0)  # would end this process
with system.locked(Path("{lock}"), wait=False):
    print("held")
import swingid.study.campaign.run, swingid.recording.formats.isolated, swingid.cli.app
"""
    assert without_posix(program.replace("{lock}", str(tmp_path / "lock")), tmp_path) == "held\n"


def test_a_lock_is_held_by_one(tmp_path: Path) -> None:
    with system.locked(tmp_path / "lock", wait=False):
        again = system.locked(tmp_path / "lock", wait=False)
        with pytest.raises(OSError):
            again.__enter__()
    with system.locked(tmp_path / "lock", wait=False):
        pass


def test_on_windows_msvcrt_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tries: list[int] = []

    def locking(descriptor: int, mode: int, size: int) -> None:
        tries.append(size)
        if len(tries) < 3:
            raise OSError

    msvcrt = ModuleType("msvcrt")
    msvcrt.__dict__.update(locking=locking, LK_NBLCK=2)
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", msvcrt)
    with pytest.raises(OSError), system.locked(tmp_path / "lock", wait=False):
        pass
    with system.locked(tmp_path / "lock", wait=True):
        assert tries == [1, 1, 1]


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/urandom", "/dev/null", "/dev/tty"])
@pytest.mark.parametrize("command", ["identify", "inspect", "init", "convert", "difference"])
def test_a_device_is_no_log(device: str, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if not Path(device).exists():
        pytest.skip(f"needs {device}")
    rest = {
        "identify": [device, "--rig", "paper"],
        "inspect": [device],
        "init": [str(tmp_path / "new"), "--from", device],
        "convert": [device, str(tmp_path / "log.csv")],
        "difference": [device, device],
    }
    began = time.monotonic()
    assert main([command, *rest[command]]) == 3
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said == f"swingid: {device} is a device, not a file; give the path of a file."
    assert time.monotonic() - began < 5


@pytest.fixture
def fifo(tmp_path: Path) -> Path:
    if not hasattr(os, "mkfifo"):
        pytest.skip("needs named pipes")
    path = tmp_path / "log.csv"
    os.mkfifo(path)
    return path


@pytest.mark.parametrize("opened", [False, True])
def test_a_pipe_that_nobody_closes_is_refused(
    fifo: Path, opened: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(system, "SILENCE", 0.3)
    end = os.open(fifo, os.O_RDWR) if opened else None
    if end is not None:
        os.write(end, b"t,q1,q2,u\n")
    assert main(["identify", str(fifo), "--rig", "paper"]) == 3
    said = capsys.readouterr().err.strip()
    assert said.endswith("log.csv is a pipe that nobody has written to or closed for 0.3 s; close it, or give a file.")
    if end is not None:
        os.close(end)
    else:
        os.close(os.open(fifo, os.O_WRONLY | os.O_NONBLOCK))  # the reading thread ends


def test_an_endless_pipe_is_refused(fifo: Path) -> None:
    def write() -> None:
        with fifo.open("wb") as stream:
            try:
                while True:
                    stream.write(b"0" * 65536)
            except BrokenPipeError:
                pass

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    with pytest.raises(InputError, check=coded("endless", "1000000 bytes")):
        system.read_file(fifo, 1_000_000)
    writer.join(5)
    assert not writer.is_alive()


def test_a_pipe_that_ends_is_a_log(fifo: Path) -> None:
    rows = np.random.default_rng(1).normal(size=(5000, 2))
    content = "t,q1\n" + "\n".join(f"{k / 100},{a}" for k, (a, _) in enumerate(rows)) + "\n"
    writer = threading.Thread(target=lambda: fifo.write_bytes(content.encode()), daemon=True)
    writer.start()
    assert system.read_file(fifo) == content.encode()
    writer.join(5)


def ended_by(code: int) -> None:
    """End the process, with 0 not."""
    if code:
        os._exit(code)


def test_a_worker_that_is_ended_gives_one_sentence() -> None:
    with pytest.raises(InputError, check=coded("lost-workers")):
        list(processes.map_in_processes(ended_by, [0, 1, 1], 2))


def subclasses(kind: type[SwingidError]) -> list[type[SwingidError]]:
    return [kind, *(one for below in kind.__subclasses__() for one in subclasses(below))]


@pytest.mark.parametrize("kind", subclasses(SwingidError))
def test_errors_come_from_another_process_as_they_are(kind: type[SwingidError]) -> None:
    options = {} if kind is NotIdentifiableError else {"code": "slug"}
    error = kind("what to do", **options)
    error.message = "what to do now"
    found = pickle.loads(pickle.dumps(error))
    assert type(found) is kind
    assert (found.message, found.code, found.args, found.exit_code) == (
        error.message,
        error.code,
        error.args,
        error.exit_code,
    )


def test_a_sha256_is_begun_for_a_large_file_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system, "AHEAD", 1000)
    path = tmp_path / "log"
    for content, begun in ((bytes(1000), False), (bytes(3_000_000), True)):
        path.write_bytes(content)
        with system.sha256_begun(path) as digest:
            assert (digest is not None) == begun
            if digest is not None:
                assert digest() == digest() == system.sha256_of(path) == hashlib.sha256(content).hexdigest()
    with system.sha256_begun(tmp_path / "none") as digest, system.sha256_begun("\0") as other:
        assert digest is None
        assert other is None
    with system.sha256_begun(path) as digest:
        path.unlink()  # before it is opened, or after
        path.write_bytes(bytes(2000))
    with pytest.raises(ZeroDivisionError), system.sha256_begun(path):
        raise ZeroDivisionError


def test_a_sha256_whose_process_fails_is_computed_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system, "AHEAD", 1000)
    monkeypatch.setattr(system, "HASH", "raise SystemExit(1)")
    path = tmp_path / "log"
    path.write_bytes(bytes(3000))
    with system.sha256_begun(path) as digest:
        assert digest is not None
        assert digest() == system.sha256_of(path)
    monkeypatch.setattr(sys, "executable", None)
    with system.sha256_begun(path) as digest:
        assert digest is None


def slowly(count: int) -> int:
    """Some milliseconds of work."""
    return sum(range(50_000 + count))


@pytest.mark.long
def test_work_that_is_left_at_an_interruption_is_no_error_of_the_pool(monkeypatch):
    """By `pool.map` of Python 3.11 one interruption in about 25 ends the thread of the pool, and may hang."""
    failed = []
    monkeypatch.setattr(threading, "excepthook", failed.append)
    for taken in range(60):
        found = processes.map_in_processes(slowly, range(300), 2)
        for _ in range(1 + taken % 20):
            next(found)
        found.close()  # as an exception where its values are used does
    assert failed == []
