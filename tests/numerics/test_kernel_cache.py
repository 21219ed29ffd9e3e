"""The cache of kernels: it sees an edit of any kernel source, and a fault of its files costs time alone."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import numba
import pytest

from swingid.numerics import cache, kept
from swingid.numerics.cache import CACHE, PACKAGE, cache_folder, kernel_hash, machine
from swingid.numerics.compiled import kernels

KERNELS = [
    "model/friction.py",
    "model/integrator.py",
    "model/motion.py",
    "model/parameters.py",
    "simulation/loop.py",
    "simulation/ensemble/lanes.py",
    "control/law.py",
]


@pytest.fixture
def package(tmp_path):
    copy = tmp_path / "swingid"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


def test_the_cache_is_named_by_the_hash_of_the_sources(package):
    assert kernel_hash(package) == kernel_hash()
    assert CACHE.name == kernel_hash()


@pytest.mark.parametrize("name", KERNELS)
def test_an_edit_of_a_kernel_changes_the_hash(package, name):
    source = package / name
    source.write_text(source.read_text() + "\n# another thought\n")
    assert kernel_hash(package) != kernel_hash()


def test_other_files_do_not_count(package):
    (package / "errors.py").write_text("'''No kernels here.'''\n")
    assert kernel_hash(package) == kernel_hash()


def triple(x):
    """A kernel."""
    return 3.0 * x


def compiled_again() -> object:
    """What a new process has: the kernel, nothing of it compiled in memory."""
    kernel = kernels()(triple)
    assert kernel(2.0) == 6.0
    return kernel


def hits(kernel) -> int:
    return sum(kernel.stats.cache_hits.values())


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="NUMBA_DISABLE_JIT is set")
@pytest.mark.parametrize("damage", [b"", b"\x80", b"no pickle"], ids=["empty", "cut off", "other bytes"])
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_a_damaged_file_is_compiled_anew(monkeypatch, tmp_path, ending, damage):
    monkeypatch.setattr(kept, "CACHE", tmp_path)
    assert hits(compiled_again()) == 0
    assert hits(compiled_again()) == 1
    (path,) = tmp_path.rglob(f"*.{ending}")
    path.write_bytes(damage)
    assert hits(compiled_again()) == 0
    assert hits(compiled_again()) == 1


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="NUMBA_DISABLE_JIT is set")
def test_what_cannot_be_written_is_used_and_named(monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setattr(kept, "CACHE", tmp_path / "file")
    monkeypatch.setattr(kept, "NOT_KEPT", [])
    compiled_again()
    assert kept.NOT_KEPT == ["Not a directory"] or (os.name == "nt" and kept.NOT_KEPT)


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="NUMBA_DISABLE_JIT is set")
def test_a_file_system_without_locks_keeps_kernels_too(monkeypatch, tmp_path):
    def refuse(path: Path, *, wait: bool) -> None:
        raise OSError("no locks available")

    monkeypatch.setattr(kept, "CACHE", tmp_path)
    monkeypatch.setattr(kept, "locked", refuse)
    assert hits(compiled_again()) == 0
    assert hits(compiled_again()) == 1


def test_numba_keeps_the_kernels_of_other_packages_where_it_did():
    assert str(CACHE) != numba.config.CACHE_DIR


@pytest.fixture
def places(monkeypatch, tmp_path):
    """The variables of the environment unset, home and temporary folder below `tmp_path`."""
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "home")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    return tmp_path


def test_an_empty_variable_is_none(places, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    assert cache_folder() == places / "home" / ".cache" / "swingid" / kernel_hash()
    monkeypatch.setenv("XDG_CACHE_HOME", str(places / "xdg"))
    assert cache_folder() == places / "xdg" / "swingid" / kernel_hash()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(places / "with a blank"))
    assert cache_folder() == places / "with a blank" / kernel_hash()


def test_without_a_home_it_is_in_the_temporary_folder(places, monkeypatch):
    def nowhere() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", nowhere)
    assert cache_folder().is_relative_to(places / "tmp")


def test_a_folder_for_reading_alone_is_used_where_it_was_prepared(places, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    wanted = places / "home" / ".cache" / "swingid" / kernel_hash()
    assert cache_folder().is_relative_to(places / "tmp")
    (wanted / f"ready-simulate-{machine()}").touch()
    assert cache_folder() == wanted


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners of files")
def test_a_temporary_folder_of_another_user_is_not_read(places, monkeypatch):
    """Kernels are code: who can write the files can have it executed."""
    (places / "home").write_text("no folder")
    own = cache_folder()
    assert own.is_relative_to(places / "tmp")
    assert own.parent.stat().st_mode & 0o077 == 0
    monkeypatch.setattr(cache, "user", lambda: str(os.getuid()))
    monkeypatch.setattr(os, "getuid", lambda: 1 + own.stat().st_uid)
    assert not cache_folder().is_relative_to(places / "tmp")
