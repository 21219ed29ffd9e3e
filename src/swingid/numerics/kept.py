"""Kernels kept in files as numba keeps them, such that a fault of the files costs time and nothing else.

A file that is damaged or cut off is compiled anew. What cannot be written (a full disk, a folder for reading alone) is
not kept. Two processes do not write at the same time: numba's index of the types of a kernel would mix them up.
"""

from __future__ import annotations

import os
import pickle
from contextlib import ExitStack, suppress
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator

from swingid.numerics.cache import CACHE
from swingid.system import locked

NOT_KEPT: list[str] = []
"""Why kernels that this process compiled could not be written."""


class _Place(UserProvidedCacheLocator):  # type: ignore[misc]
    """Below `CACHE`, whether that can be written or not; numba's setting for other packages stays as it is."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._py_file = py_file
        self._lineno = py_func.__code__.co_firstlineno
        self._cache_path = str(CACHE / self.get_suitable_cache_subpath(py_file))

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> _Place | None:
        return cls(py_func, py_file) if os.path.exists(py_file) else None

    def ensure_cache_path(self) -> None:
        os.makedirs(self._cache_path, exist_ok=True)


class _Files(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Place, *CompileResultCacheImpl._locator_classes)


class KeptKernel(FunctionCache):  # type: ignore[misc]
    """The files of one kernel."""

    _impl_class = _Files

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was compiled for these types; None where it was not, or the file is damaged."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # pickle and LLVM fail in any way
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write what was compiled for these types; where that fails, `NOT_KEPT` has the reason."""
        try:
            with ExitStack() as held:
                with suppress(OSError):  # a file system without locks
                    held.enter_context(locked(CACHE / "lock", wait=True))
                super().save_overload(sig, data)
        except (OSError, EOFError, pickle.PickleError) as error:
            NOT_KEPT.append(getattr(error, "strerror", None) or str(error))
