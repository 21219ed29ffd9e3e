"""The command line: exit codes, JSON in every case, one sentence for every failure, never a traceback."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from swingid.cli import main
from swingid.cli.groups import GROUPS
from swingid.cli.options import method_name

SINE = ["--reference", "sine 0.8 rad 8.5 rad/s"]
Run = Callable[..., "Outcome"]


class Outcome:
    """What a command left: exit code, standard output and error."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err

    def sentence(self) -> str:
        """The one line on standard error, after checking that it is one and no traceback."""
        lines = self.err.splitlines()
        assert len(lines) == 1, self.err
        assert lines[0].startswith("swingid: ")
        assert lines[0].endswith(".")
        assert "Input should" not in lines[0]
        assert "Value error" not in lines[0]
        return lines[0]


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str]) -> Run:
    """Run the command line in this process."""

    def call(*arguments: str) -> Outcome:
        capfd.readouterr()
        code = main([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        assert "Traceback" not in out + err
        lines = err.splitlines(keepends=True)
        kept = [line for line in lines if "compiling kernels" not in line]
        return Outcome(code, out, "".join(kept))

    return call


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """12 s of the paper's rig."""
    path = tmp_path_factory.mktemp("log") / "run.csv"
    assert main(["simulate", "--rig", "paper", *SINE, "--duration", "12", "--out", str(path)]) == 0
    return path


def refused(path: Path) -> dict[str, Any]:
    """The error of a JSON file that holds a refusal."""
    data = json.loads(path.read_text(encoding="utf-8"))
    assert data["schema"] == "swingid.result/1"
    assert (data["status"], data["parameters"]) == ("refused", {})
    assert set(data["error"]) == {"code", "message"}
    error: dict[str, Any] = data["error"]
    return error


def test_identify_finds_the_inertia_and_writes_json(run: Run, log: Path, tmp_path: Path) -> None:
    done = run("identify", log, "--rig", "paper", "--json", tmp_path / "r.json")
    assert done.code == 0
    data = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    inertia = data["parameters"]["inertia"]
    assert inertia["value"] == pytest.approx(302.2e-5, rel=2e-4)
    assert inertia["interval95"][0] < 302.2e-5 < inertia["interval95"][1]
    assert data["error"] is None
    assert data["provenance"]["log"] == str(log)
    assert "inertia" in done.out
    assert done.err == ""


def test_report_is_written_and_named(run: Run, log: Path, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    done = run("identify", log, "--rig", "paper", "--report", path)
    assert done.code == 0
    assert str(path) in done.sentence()
    assert path.read_text(encoding="utf-8").lower().startswith("<!doctype html>")


def test_json_is_alone_on_standard_output(run: Run, log: Path) -> None:
    done = run("identify", log, "--rig", "paper", "--json", "-")
    assert done.code == 0
    assert json.loads(done.out)["method"] == "momentum"
    assert "inertia" in done.err


def test_refusal_is_alone_on_standard_output(run: Run, tmp_path: Path) -> None:
    done = run("identify", tmp_path / "none.csv", "--rig", "paper", "--json", "-")
    assert done.code == 3
    assert json.loads(done.out)["status"] == "refused"
    assert "none.csv" in done.sentence()


def test_methods_of_the_command_are_those_of_the_library() -> None:
    from swingid.methods.table import METHODS

    assert [method_name(name) for name in METHODS] == list(METHODS)


def test_energy_takes_the_printed_variant(run: Run, log: Path, tmp_path: Path) -> None:
    done = run(
        "identify", log, "--rig", "paper", "--method", "energy", "--variant", "printed", "--json", tmp_path / "r.json"
    )
    assert done.code == 0
    data = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert data["method"] == "energy"
    assert data["provenance"]["options"] == {"variant": "printed"}


def test_options_of_a_method_are_named(run: Run, log: Path, tmp_path: Path) -> None:
    target = tmp_path / "r.json"
    done = run("identify", log, "--rig", "paper", "--method", "energy", "--option", "variant=printed", "--json", target)
    assert done.code == 0
    assert json.loads(target.read_text(encoding="utf-8"))["provenance"]["options"] == {"variant": "printed"}


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (["log=1"], "log"),
        (["method=energy"], "method"),
        (["varian=printed"], "variant"),
        (["variant"], "NAME=VALUE"),
        (["work=held", "work=held"], "twice"),
    ],
)
def test_wrong_options_are_named(run: Run, log: Path, given: list[str], named: str) -> None:
    options = [word for text in given for word in ("--option", text)]
    done = run("identify", log, "--rig", "paper", "--method", "energy", *options)
    assert done.code == 2
    assert named in done.sentence()


@pytest.mark.parametrize(
    ("content", "code"),
    [(None, 3), ("", 3), ("t,q1,ym\n0,0,0\n", 3), ("t,q1,q2,u,ym\n0,0,0,0,0\n", 4)],
    ids=["missing", "empty", "no wheel", "one row"],
)
def test_bad_logs_give_a_sentence_and_a_refusal(run: Run, tmp_path: Path, content: str | None, code: int) -> None:
    path = tmp_path / "log.csv"
    if content is not None:
        path.write_text(content)
    done = run("identify", path, "--rig", "paper", "--json", tmp_path / "r.json")
    assert done.code == code
    assert refused(tmp_path / "r.json")["message"].rstrip(".") in done.sentence()


def test_constant_angles_are_exit_4(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "still.csv"
    path.write_text("t,q1,q2,u,ym\n" + "".join(f"{k / 1000},0.1,0.2,0,0\n" for k in range(5000)))
    done = run("identify", path, "--rig", "paper", "--json", tmp_path / "r.json")
    assert done.code == 4
    assert done.sentence()
    refused(tmp_path / "r.json")


def test_a_missing_rig_is_exit_3_with_json(run: Run, log: Path, tmp_path: Path) -> None:
    done = run("identify", log, "--rig", tmp_path / "none.toml", "--json", tmp_path / "r.json")
    assert done.code == 3
    assert "none.toml" in done.sentence()
    refused(tmp_path / "r.json")


def test_a_refusal_replaces_an_older_result(run: Run, log: Path, tmp_path: Path) -> None:
    target = tmp_path / "r.json"
    assert run("identify", log, "--rig", "paper", "--json", target).code == 0
    assert run("identify", tmp_path / "gone.csv", "--rig", "paper", "--json", target).code == 3
    assert refused(target)["code"] == "missing-file"


@pytest.mark.parametrize(
    "arguments",
    [
        ["weigh"],
        ["identify"],
        ["identify", "a.csv"],
        ["identify", "a.csv", "a.csv", "--rig", "paper"],
        ["identify", "a.csv", "--rig", "paper", "--method", "magic"],
        ["identify", "a.csv", "--rig", "paper", "--variant", "printed"],
        ["identify", "a.csv", "--rig", "paper", "--report", "-"],
        ["identify", "a.csv", "--rig", "paper", "--json", "./a.csv"],
        ["identify", "a.csv", "--rig", "paper", "--json", "x", "--report", "./x"],
        ["identify", "a.csv", "--rig", "paper", "--colour", "red"],
        ["simulate", "--rig", "paper", "--duration", "1"],
        ["simulate", "--rig", "paper", "--duration", "1", "--out", "a.csv"],
        ["simulate", "--rig", "paper", "--duration", "1", "--out", "a.csv", "--delta0", "0.1", "--initial-angle", "1"],
        ["simulate", "--rig", "paper", "--duration", "1", "--out", "a.csv", "--initial-angle", "3 kg"],
        ["simulate", "--rig", "paper", "--duration", "1", "--out", "a.csv", "--reference", "wiggle 3"],
        ["simulate", "--rig", "paper", "--duration", "soon", "--out", "a.csv", *SINE],
        ["simulate", "--rig", "paper", "--duration", "-1", "--out", "a.csv", *SINE],
        ["simulate", "--rig", "paper", "--duration", "nan", "--out", "a.csv", *SINE],
        ["simulate", "--rig", "paper", "--duration", "1e9", "--out", "a.csv", *SINE],
        ["simulate", "--rig", "paper", "--duration", "1", "--out", "a.csv", *SINE, "--seed", "-1"],
        ["simulate", "--rig", "paper", "--duration", "1", "--out", "a.csv", *SINE, "--sigma0", "-1"],
        ["init"],
    ],
)
def test_wrong_usage_is_one_sentence_and_exit_2(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    done = run(*arguments)
    assert done.code == 2
    assert done.out == ""
    assert done.sentence()
    assert list(tmp_path.iterdir()) == []


def test_help_and_version_are_exit_0(run: Run) -> None:
    for arguments in (["--help"], ["-h"], ["identify", "--help"], ["simulate", "--help"], ["init", "--help"]):
        done = run(*arguments)
        assert (done.code, done.err) == (0, "")
        assert done.out.startswith("Usage: swingid")
    assert run("--version").out.startswith("swingid ")


def test_the_page_of_commands_begins_with_all_of_them() -> None:
    from swingid.cli.app import app

    page = (Path(__file__).parents[2] / "docs" / "cli.md").read_text(encoding="utf-8")
    named = re.findall(r"\[`(\w+)`\]\(#\1\)", page.partition("\n## ")[0])
    there = [one.callback.__name__ for one in app.registered_commands if one.callback and not one.hidden]
    assert sorted(named) == sorted(there)
    for name in there:
        assert f"\n## {name}\n" in page


@pytest.mark.parametrize("content", ["t,q1,q2,u\n", "t,q1,q2,u\n" + "0.1,0,0,0\n" * 4])
def test_a_refusal_is_reported(run: Run, tmp_path: Path, content: str) -> None:
    path, page = tmp_path / "bad.csv", tmp_path / "report.html"
    path.write_text(content)
    page.write_text("an older report")
    done = run("identify", path, "--rig", "paper", "--report", page)
    assert done.code in (3, 4)
    sentence = done.sentence().removeprefix("swingid: ")
    text = page.read_text(encoding="utf-8")
    assert "No number" in text
    assert sentence.rstrip(".") in text
    assert "an older report" not in text


@pytest.mark.parametrize("option", ["--json", "--report"])
@pytest.mark.parametrize("place", ["missing/r.html", "folder", "file/r.html", "y" * 300])
def test_unwritable_outputs_are_exit_3_and_named(run: Run, log: Path, tmp_path: Path, option: str, place: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    done = run("identify", log, "--rig", "paper", option, tmp_path / place)
    assert done.code == 3
    assert place in done.sentence()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]


def test_an_unwritable_report_leaves_a_refusal(run: Run, log: Path, tmp_path: Path) -> None:
    done = run(
        "identify", log, "--rig", "paper", "--report", tmp_path / "missing/r.html", "--json", tmp_path / "r.json"
    )
    assert done.code == 3
    assert refused(tmp_path / "r.json")["code"] == "cannot-write"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("arguments", [["identify", "LOG", "--rig", "paper", "--json", "-"], ["--help"]])
def test_a_full_disk_is_exit_3(log: Path, arguments: list[str]) -> None:
    command = [sys.executable, "-m", "swingid", *(str(log) if word == "LOG" else word for word in arguments)]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 3
    assert done.stderr.count("\n") == 1 + done.stderr.count("compiling kernels")
    assert "standard output" in done.stderr


def test_a_closed_pipe_is_silent(log: Path) -> None:
    command = [sys.executable, "-m", "swingid", "identify", str(log), "--rig", "paper"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    err = process.stderr.read()
    process.stderr.close()
    assert process.wait() == 141
    assert err.replace("compiling kernels", "") == err or err.count("\n") == 1


def test_an_interrupt_is_one_line_and_130(tmp_path: Path) -> None:
    fifo = tmp_path / "log.csv"
    os.mkfifo(fifo)
    command = [sys.executable, "-m", "swingid", "identify", str(fifo), "--rig", "paper"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    writer = None
    while writer is None:  # it can be opened as soon as the command reads it
        assert process.poll() is None
        try:
            writer = os.open(fifo, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:
            time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    os.close(writer)
    assert process.returncode == 130
    assert err == "swingid: interrupted; nothing was written, so start again.\n"


@pytest.mark.parametrize("kind", [ZeroDivisionError, EOFError])
def test_our_own_bug_is_70_with_a_file_to_report(
    run: Run, log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: type[Exception]
) -> None:
    """The end of a file too, which the package of the command line takes for Ctrl-C."""

    def broken(*_: object, **__: object) -> None:
        raise kind("on purpose")

    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setattr("swingid.methods.momentum.method.momentum", broken)
    done = run("identify", log, "--rig", "paper", "--json", tmp_path / "r.json")
    assert done.code == 70
    (kept,) = tmp_path.glob("swingid-bug-*.txt")
    done.err = done.err.lstrip("\n")  # which that package writes where it sees the end of a file
    assert str(kept) in done.sentence()
    assert f"{kind.__name__}: on purpose" in kept.read_text(encoding="utf-8")
    assert refused(tmp_path / "r.json")["code"] == "bug"


def test_strange_names_of_files_do_no_harm(run: Run, tmp_path: Path) -> None:
    name = os.fsdecode(b"bad\xff[red]\n.csv")
    done = run("identify", str(tmp_path / name), "--rig", "paper", "--json", tmp_path / "r.json")
    assert done.code == 3
    assert "[red]" in done.sentence()
    refused(tmp_path / "r.json")


def test_an_output_without_unicode_is_served(log: Path) -> None:
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-m", "swingid", "identify", str(log), "--rig", "paper"]
    done = subprocess.run(command, env=environment, capture_output=True)
    assert done.returncode == 0
    assert b"inertia" in done.stdout


def test_init_writes_a_rig_that_loads_and_works(run: Run, log: Path, tmp_path: Path) -> None:
    from swingid.model.rig import Rig

    done = run("init", tmp_path / "lab/here")
    path = tmp_path / "lab/here/rig.toml"
    assert done.code == 0
    assert str(path) in done.out
    assert Rig.load(path).drive.kind == "reaction-wheel"
    assert run("identify", log, "--rig", path).code == 0


def test_init_never_overwrites(run: Run, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text("mine")
    done = run("init", tmp_path)
    assert done.code == 3
    assert "rig.toml" in done.sentence()
    assert (tmp_path / "rig.toml").read_text() == "mine"
    assert run("init", tmp_path / "rig.toml").code == 3


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--initial-angle", "nan"], "--initial-angle is nan rad"),
        (["--initial-angle", "1e300"], "--initial-angle is 1e+300 rad"),
        (["--initial-angle", "30 ± 2 deg"], "takes no uncertainty"),
        (["--reference", "sine 1e300 rad 8.5 rad/s"], "speed of 8.5e+300"),
        (["--reference", "sine 0.8 rad 1e300 rad/s"], "speed of 8e+299"),
        ([*SINE, "--k-tilde0", "1e300"], "runs away to infinity"),
        ([*SINE, "--rate", "-1000"], "rate must be a positive number"),
        ([*SINE, "--duration", "nan"], "duration must be a positive number"),
        ([*SINE, "--duration", "25 s"], "invalid value for '--duration': "),
        ([*SINE, "--gains", "wild"], "invalid value for '--gains': 'wild' is not one of"),
        ([*SINE, "--voltage", "sine 3 V 1 Hz"], "give one of them"),
        (["--voltage", "3 V"], "--voltage '3 V': it must begin with one of sine"),
        (
            ["--voltage", "chirp 3 V 1 Hz 2 Hz"],
            "not 3; write for example 'chirp 3 V 0.5 Hz 2 Hz 20 s'",
        ),
        (["--voltage", "triangle 3 V"], "write for example 'triangle 3 V 1 Hz 0.1 s'"),
        (["--voltage", "multisine 3 V"], "write for example 'multisine 3 V 5 rad/s + 3 V 8.5 rad/s'"),
        (["--voltage", "sine -3 V 1 Hz"], "--voltage 'sine -3 V 1 Hz': amplitude must be positive"),
    ],
)
def test_what_no_rig_does_is_wrong_usage(run: Run, tmp_path: Path, given: list[str], said: str) -> None:
    done = run("simulate", "--rig", "paper", "--duration", "1", "--out", tmp_path / "x.csv", *given)
    assert done.code == 2
    assert said in done.sentence()
    assert list(tmp_path.iterdir()) == []


def test_a_rig_that_nothing_moves_is_named(run: Run, tmp_path: Path) -> None:
    def refusal(drive: str, *given: str) -> tuple[int, str]:
        path, out = tmp_path / "rig.toml", tmp_path / "x.csv"
        path.write_text(f'name = "still"\n[axis]\ninertia = 3e-3\n[drive]\nkind = {drive}\n')
        done = run("simulate", "--rig", path, "--duration", "1", "--out", out, *given)
        assert not out.exists()
        return done.code, done.sentence()

    wheel = '"reaction-wheel"\nwheel.inertia = 1e-4'
    for given in (SINE, ["--voltage", "sine 3 V 1 Hz"]):
        code, sentence = refusal(wheel, *given)
        assert code == 3
        assert "drive.motor.torque_per_volt" in sentence
    code, sentence = refusal('"none"', "--initial-angle", "0.5")
    assert code == 2
    assert "no gravity torque" in sentence


def test_simulate_is_repeatable_and_seeded(run: Run, tmp_path: Path) -> None:
    def text(name: str, seed: int) -> str:
        path = tmp_path / name
        assert run(*simulate, "--seed", seed, "--draw", "--out", path).code == 0
        return "\n".join(line for line in path.read_text().splitlines() if not line.startswith("#"))

    rig = tmp_path / "rig.toml"
    assert run("init", tmp_path).code == 0
    simulate = ["simulate", "--rig", rig, *SINE, "--duration", "6"]
    assert text("a.csv", 1) == text("b.csv", 1)
    assert text("a.csv", 1) != text("c.csv", 2)


def test_simulate_free_decay_and_direct_drive(run: Run, tmp_path: Path) -> None:
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording

    free = tmp_path / "free.toml"
    free.write_text(
        'name = "free"\n[axis]\nkind = "rotary"\ngravity_torque = 0.078\ninertia = 0.003\n[drive]\nkind = "none"\n'
    )
    out = tmp_path / "free.parquet"
    assert run("simulate", "--rig", free, "--initial-angle", "30 deg", "--duration", "5", "--out", out).code == 0
    decay = Recording.load(out, Rig.load(free))
    assert decay.angle[0] == pytest.approx(0.5235987755982988, abs=1e-9)
    refused_motion = run("simulate", "--rig", free, *SINE, "--duration", "5", "--out", out)
    assert refused_motion.code == 2
    assert refused_motion.sentence()

    direct = tmp_path / "direct.toml"
    direct.write_text(
        'name = "direct"\n[axis]\nkind = "rotary"\ninertia = 0.003\n[axis.friction]\nviscous = 0.002\n'
        '[drive]\nkind = "direct"\n[log]\ntorque = "tau"\n'
    )
    gains = ["--k-tilde0", "0.5", "--sigma0", "400", "--delta0", "1"]
    out = tmp_path / "direct.csv"
    done = run(
        "simulate", "--rig", direct, "--reference", "sine 0.5 rad 3 rad/s", *gains, "--duration", "8", "--out", out
    )
    assert done.code == 0
    followed = Recording.load(out, Rig.load(direct))
    assert followed.torque is not None
    assert 0.3 < abs(followed.angle[-4000:]).max() < 0.8


def test_help_has_every_command_whole(run: Run) -> None:
    text = run("--help").out
    assert "..." not in text.replace("[ARGS]...", "")
    names = {command.__name__ for members in GROUPS.values() for command, _ in members}
    assert names <= set(re.findall(r"^  ([a-z]+)  ", text, re.M))
    assert run("help").out == text
    assert "--part" in run("help", "identify").out
    assert run("help", "identfy").code == 2
    assert run("version").out == run("--version").out


def test_alone_it_says_where_to_begin(run: Run) -> None:
    found = run()
    assert found.code == 2
    for line in found.out.splitlines()[:3]:
        name = line.split()[1]
        assert name in {command.__name__ for members in GROUPS.values() for command, _ in members}


def test_the_first_lines_work_as_they_are_printed(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for line in run().out.splitlines()[:2]:
        assert run(*shlex.split(line.partition("   ")[0])[1:]).code == 0


def test_a_command_with_a_slip_is_named(run: Run) -> None:
    sentence = run("identfy").sentence()
    assert sentence == "swingid: no such command 'identfy'. Did you mean 'identify'? See swingid --help."


def test_a_terminal_obeys_no_column_name(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "escapes.csv"
    rows = "\n".join(f"{0.01 * k:.2f},{math.sin(0.1 * k):.6f}" for k in range(500))
    path.write_text("t,q1\x1b]0;title\x07\x1b[31m\n" + rows + "\n", encoding="utf-8")
    shown = run("inspect", path)
    assert "q1\\x1b]0;title\\x07" in shown.out
    assert all(character.isprintable() or character == "\n" for character in shown.out + shown.err)
