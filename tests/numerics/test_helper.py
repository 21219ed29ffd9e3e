"""Functions that only kernels call: the same results, errors and arrays, and no machine code of their own."""

from __future__ import annotations

import importlib
from types import ModuleType

import numba
import numpy as np
import pytest
from numba.core.registry import CPUDispatcher

from swingid.control import law
from swingid.model.friction import static_curve
from swingid.model.parameters import rig_vector
from swingid.model.rig import Rig
from swingid.numerics.cache import PACKAGE
from swingid.numerics.compiled import njit, njit_helper, njit_inlined
from swingid.numerics.helper import Helper


@njit_inlined
def _half(x: float) -> float:
    return 0.5 * x


@njit_helper
def _row(x: float) -> np.ndarray:
    if x < 0.0:
        raise ValueError("negative")
    return np.full(3, _half(x))


@njit
def _total(x: float) -> float:
    return float(_row(2.0 * x).sum())


@njit
def _first(x: float) -> float:
    return float(_row(x)[0])


def test_a_helper_serves_several_kernels_with_its_arrays_and_errors() -> None:
    assert _total(1.5) == 4.5
    assert _first(1.5) == 0.75
    with pytest.raises(ValueError, match="negative"):
        _total(-1.0)


def test_python_runs_a_helper_as_python() -> None:
    assert isinstance(_row, Helper)
    assert _row(3.0).tolist() == [1.5, 1.5, 1.5]
    with pytest.raises(ValueError, match="negative"):
        _row(-1.0)


def test_a_helper_has_no_machine_code() -> None:
    numba.njit(lambda x: _row(x)[0])(1.0)  # of a kernel out of a file nothing is compiled
    result = next(iter(_row.overloads.values()))
    engine = result.library.codegen._engine
    assert not engine.is_symbol_defined(result.fndesc.llvm_cpython_wrapper_name)
    assert not engine.is_symbol_defined(result.fndesc.llvm_func_name)
    assert any(function.name == result.fndesc.llvm_func_name for function in result.library.get_defined_functions())


def test_a_kernel_has_the_bits_of_python() -> None:
    p = rig_vector(Rig.builtin("paper").changed({"axis.friction.coulomb": 2e-3, "axis.friction.viscous": 1e-3}))
    speeds = np.linspace(-3.0, 3.0, 101)

    def curve(v: float) -> float:
        return static_curve(v, p) * law.decay(abs(v))

    in_kernel = njit(lambda v, p: static_curve(v, p) * law.decay(abs(v)))
    assert [in_kernel(v, p) for v in speeds] == [curve(v) for v in speeds]


def _called(function: CPUDispatcher) -> list[CPUDispatcher]:
    """The compiled functions that one names, those in modules that it names too."""
    code, known = function.py_func.__code__, function.py_func.__globals__
    found = [known[name] for name in code.co_names if name in known]
    for module in [one for one in found if isinstance(one, ModuleType)]:
        found += [getattr(module, name) for name in code.co_names if hasattr(module, name)]
    return [one for one in found if isinstance(one, CPUDispatcher)]


def test_what_kernels_call_by_name_is_a_helper() -> None:
    """Else there is code of it twice, and the bits of a result depend on which of both is found."""
    sources = [path for path in PACKAGE.rglob("*.py") if "\n@njit" in path.read_text(encoding="utf-8")]
    names = [".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts) for path in sources]
    modules = [importlib.import_module(name) for name in names]
    functions = {one for module in modules for one in vars(module).values() if isinstance(one, CPUDispatcher)}
    assert len(functions) > 100
    wrong = [(one.__name__, other.__name__) for one in functions for other in _called(one) if type(other) is not Helper]
    assert wrong == []
