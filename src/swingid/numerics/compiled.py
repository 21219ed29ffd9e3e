"""The `njit` of every kernel, compiled into the folder of `numerics.cache`; an edit of any kernel compiles all anew."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
import numba.experimental.function_type  # makes numba accept `KernelPointer` as an argument
import numpy as np
from numba import types

from swingid.numerics.helper import Helper
from swingid.numerics.kept import KeptKernel

Function = TypeVar("Function", bound=Callable[..., Any])

FLOAT, INT = numba.float64, numba.int64
VECTOR, MATRIX, INTS = numba.float64[::1], numba.float64[:, ::1], numba.int64[::1]
tuple_of = types.UniTuple
"""Types of arguments, for the signatures of `KernelPointer`."""


def kernels(**options: Any) -> Callable[[Function], Function]:
    """A decorator, with some of numba's options, of kernels that Python calls; they are kept in files."""

    def made(function: Function) -> Function:
        kernel = numba.njit(error_model="numpy", **options)(function)
        if kernel is not function:  # it is with NUMBA_DISABLE_JIT
            kernel._cache = KeptKernel(function)
        return kernel  # type: ignore[no-any-return]

    return made


def helpers(**options: Any) -> Callable[[Function], Function]:
    """The same for functions that only kernels call."""

    def made(function: Function) -> Function:
        if numba.config.DISABLE_JIT:
            return function
        return Helper(function, {}, {"nopython": True, "error_model": "numpy", **options})

    return made


njit = kernels()

njit_nogil = kernels(nogil=True)
"""For kernels that take long enough to run in threads beside each other."""

njit_helper = helpers()
"""For functions that make arrays, or parts of them."""

njit_inlined = helpers(forceinline=True, _nrt=False)
"""For functions that neither make nor return an array, nor call one that does.

Without numba's runtime (_nrt) an array that is passed on is not counted as one more reference. The compiler cannot take
these counts out where a function branches, and in a hot loop they cost more than the rest of the function.
"""

njit_called = helpers(_nrt=False)
"""The same for functions that a hot loop seldom calls: they make it no longer."""


def place(number: int) -> int:
    """A constant of kernels that numba does not take as a literal: for those it compiles a kernel for every value."""
    return np.int64(number)  # type: ignore[return-value]


class KernelPointer(types.WrapperAddressProtocol):  # type: ignore[misc]
    """A kernel that other kernels get as an argument and call by its address.

    Where one kernel names another, numba compiles both together, once more for each caller. By its address a large
    kernel is compiled once, apart from its callers, for the one `signature` given here. A call takes some 4 ns longer.
    """

    def __init__(self, kernel: Any, signature: Any) -> None:
        self._kernel, self._signature = kernel, signature
        self._address: int | None = None
        self.type = self._numba_type_ = types.FunctionType(signature)
        """Its own type, for the signature of a kernel that gets it."""

    def __call__(self, *arguments: Any) -> Any:
        """The kernel as Python runs it, with NUMBA_DISABLE_JIT."""
        return self._kernel(*arguments)

    def signature(self) -> Any:
        """Types of the result and the arguments."""
        return self._signature

    def __wrapper_address__(self) -> int:
        """Address of the machine code, which is compiled or loaded where it has not been yet."""
        if self._address is None:
            self._kernel.compile(self._signature.args)
            made = self._kernel.overloads[self._signature.args]
            self._address = made.library.get_pointer_to_function(made.fndesc.llvm_cfunc_wrapper_name)
        return self._address
