"""An edit of any kernel source is seen by the cache, also in files that only call it."""

from __future__ import annotations

import shutil

import pytest

from swingid.numerics.cache import CACHE, PACKAGE, kernel_hash

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
