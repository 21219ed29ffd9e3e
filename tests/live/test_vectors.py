"""512-bit vectors: asked for by the functions that gain, on every processor that has them, and by nothing else."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from llvmlite import binding

KERNEL = """
import re, sys, numba, numpy as np
from swingid.numerics.vectors import widest
@numba.njit
def wide(x):
    widest()
    for i in range(len(x)):
        x[i] = 3.0 * x[i] + 1.0
@numba.njit
def plain(x):
    for i in range(len(x)):
        x[i] = 3.0 * x[i] + 1.0
for kernel in (wide, plain):
    x = np.arange(40.0)
    kernel(x)
    assert np.array_equal(x, 3.0 * np.arange(40.0) + 1.0)
    code = chr(10).join(kernel.inspect_asm().values())
    print(len(re.findall("%zmm", code)) > 0, len(re.findall("%ymm", code)) > 0)
"""


def widths(processor: str) -> list[list[bool]]:
    """Whether 512 and 256-bit registers are used, with `widest` and without, compiled for this kind of processor."""
    env = os.environ | {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": binding.get_host_cpu_features().flatten()}
    out = subprocess.run([sys.executable, "-c", KERNEL], env=env, check=True, capture_output=True, text=True).stdout
    return [[word == "True" for word in line.split()] for line in out.splitlines()]


@pytest.mark.skipif(
    not binding.get_host_cpu_features().get("avx512f"), reason="this processor has no 512-bit registers"
)
def test_a_processor_that_llvm_uses_by_halves_is_used_whole_where_that_is_asked_for():
    """Cascade Lake, where LLVM's own choice is 256 bits: other kernels keep it."""
    wide, plain = widths("cascadelake")
    assert wide[0]
    assert plain == [False, True]


@pytest.mark.skipif(not binding.get_host_cpu_features().get("avx2"), reason="this processor has no 256-bit registers")
def test_a_processor_without_512_bits_is_used_as_before():
    env = os.environ | {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx,+avx2,+fma"}
    out = subprocess.run([sys.executable, "-c", KERNEL], env=env, check=True, capture_output=True, text=True).stdout
    assert out.split() == ["False", "True", "False", "True"]
