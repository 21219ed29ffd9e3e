"""Public data sets: the catalogue says what the files are, and `get` gives these files or one sentence."""

from __future__ import annotations

import functools
import hashlib
import http.server
import json
import re
import socket
import sys
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from refusals import coded
from swingid.cli import main
from swingid.errors import InputError, UsageError
from swingid.recording.datasets import CATALOGUE, DataFile, DataSet, find, get

ROOT = Path(__file__).resolve().parents[2]
CONTENT = b"t,q1\n0,0\n1,1\n"


def made_up(address: str | None) -> DataSet:
    """A data set of one small file."""
    file = DataFile("log.csv", hashlib.sha256(CONTENT).hexdigest(), address, "two rows")
    return replace(CATALOGUE[0], name="made_up", files=(file,))


@pytest.fixture(autouse=True)
def no_copy(monkeypatch):
    monkeypatch.delenv("SWINGID_DATA", raising=False)


@pytest.fixture
def server(tmp_path):
    """The address of a web server on this machine, which serves good.csv and bad.csv."""
    folder = tmp_path / "served"
    folder.mkdir()
    (folder / "good.csv").write_bytes(CONTENT)
    (folder / "bad.csv").write_bytes(CONTENT + b"2,2\n")

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    served = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(folder)))
    threading.Thread(target=served.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{served.server_address[1]}"
    served.shutdown()
    served.server_close()


def test_checksums_are_those_of_the_real_files(data_dir):
    held = 0
    for dataset in CATALOGUE:
        for file in dataset.files:
            path = data_dir / dataset.name / file.name
            if path.exists():  # the copy holds most data sets, not all
                held += 1
                assert hashlib.sha256(path.read_bytes()).hexdigest() == file.sha256
    assert held >= 9


@pytest.mark.parametrize("dataset", CATALOGUE, ids=lambda one: one.name)
def test_entries_are_whole_and_addresses_name_a_commit(dataset):
    assert dataset.citation
    assert dataset.licence
    assert (ROOT / "examples" / "rigs" / dataset.rig).is_file()
    for file in dataset.files:
        assert re.fullmatch(r"[0-9a-f]{64}", file.sha256)
        if file.address is not None:
            assert re.match(rf"https://raw\.githubusercontent\.com/{dataset.repository}/[0-9a-f]{{40}}/", file.address)
    assert any(file.address for file in dataset.files)


def test_names_are_found_in_both_spellings_and_the_nearest_is_named():
    assert find("free-pendulum") is find("free_pendulum")
    with pytest.raises(UsageError, check=coded("unknown-dataset", "emps")):
        find("emsp")


def test_a_copy_is_used_and_verified(tmp_path, monkeypatch):
    copy = tmp_path / "copy" / "made_up"
    copy.mkdir(parents=True)
    (copy / "log.csv").write_bytes(CONTENT)
    dataset = made_up(None)
    for place in (copy, copy.parent):  # the files themselves, or a folder of folders
        target = tmp_path / place.name / "out"
        assert list(get(dataset, target, place)) == [(target / "log.csv", "copied")]
        assert (target / "log.csv").read_bytes() == CONTENT
        assert list(get(dataset, target, place)) == [(target / "log.csv", "there")]
    monkeypatch.setenv("SWINGID_DATA", str(copy.parent))
    assert next(get(dataset, tmp_path / "third"))[1] == "copied"
    (copy / "log.csv").write_bytes(CONTENT[:-2])
    with pytest.raises(InputError) as caught:
        list(get(dataset, tmp_path / "fourth"))
    assert caught.value.code == "wrong-checksum"
    assert not (tmp_path / "fourth").exists()


def test_a_file_that_was_changed_is_not_overwritten(tmp_path):
    (tmp_path / "log.csv").write_bytes(b"mine")
    with pytest.raises(InputError) as caught:
        list(get(made_up(None), tmp_path))
    assert caught.value.code == "wrong-checksum"
    assert (tmp_path / "log.csv").read_bytes() == b"mine"


def test_what_a_stated_copy_lacks_is_not_downloaded(tmp_path, server):
    with pytest.raises(InputError, check=coded("missing-file", "log.csv")):
        list(get(made_up(f"{server}/good.csv"), tmp_path / "out", tmp_path))
    with pytest.raises(InputError) as caught:
        list(get(made_up(None), tmp_path / "out", tmp_path / "nowhere"))
    assert caught.value.code == "missing-folder"


def test_download(tmp_path, server):
    assert list(get(made_up(f"{server}/good.csv"), tmp_path / "out")) == [(tmp_path / "out" / "log.csv", "downloaded")]
    assert (tmp_path / "out" / "log.csv").read_bytes() == CONTENT
    assert next(get(made_up(None), tmp_path / "other"))[1] == "copy-only"


@pytest.mark.parametrize(("page", "code"), [("bad.csv", "wrong-checksum"), ("none.csv", "download-failed")])
def test_a_download_that_fails_is_one_sentence(tmp_path, server, page, code):
    with pytest.raises(InputError, match=r"--from DIR\.$") as caught:
        list(get(made_up(f"{server}/{page}"), tmp_path / "out"))
    assert caught.value.code == code
    assert not (tmp_path / "out").exists()


def test_no_network_is_one_sentence(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(InputError, match=rf"^no network: 127\.0\.0\.1:{port} cannot be reached") as caught:
        list(get(made_up(f"http://127.0.0.1:{port}/log.csv"), tmp_path / "out"))
    assert caught.value.code == "no-network"


def test_without_pooch_the_line_that_installs_it_is_given(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(InputError, check=coded("missing-package", "'swingid[datasets]'")):
        list(get(made_up("http://127.0.0.1:1/log.csv"), tmp_path / "out"))


def test_command_lists_what_there_is(capsys):
    assert main(["datasets"]) == 0
    text = capsys.readouterr().out
    assert main(["datasets", "--json", "-"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert listed["schema"] == "swingid.datasets/1"
    assert [one["name"] for one in listed["datasets"]] == [one.name for one in CATALOGUE]
    for one in listed["datasets"]:
        for word in (one["name"], one["citation"], one["licence"], *(file["sha256"] for file in one["files"])):
            assert word in text


def test_command_gets_a_copy(data_dir, tmp_path, capsys):
    assert main(["datasets", "get", "dfki-pendulum", "--from", str(data_dir), "--to", str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    assert out.count("(copied)") == 2
    assert (tmp_path / "dfki_pendulum" / "sac.csv").is_file()
    assert "BSD-3-Clause" in err
    assert "examples/rigs/dfki_pendulum.toml" in err


@pytest.mark.parametrize("words", [["fetch", "emps"], ["get"], ["get", "emps", "more"], ["get", "nothing"]])
def test_wrong_words_are_usage_errors(words, capsys):
    assert main(["datasets", *words]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
