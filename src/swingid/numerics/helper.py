"""Functions that kernels call and Python does not (`compiled.njit_helper` and its kin): no machine code of their own.

numba makes each function one that Python can call, too: with two wrappers, machine code of its own and a file. A kernel
takes only its intermediate code, and optimises that together with its own. numba compiles inner functions of its
library so, too (its flag no_compile), but has no option for it. It is worth its lines: with numba's public `njit` the
first closed loop takes 12.9 s of the processor instead of 9.5 s, the first ensemble 10.1 s instead of 6.6 s; and where
one kernel called another by its name, there was code of the other twice, and which of both ran, with other last
bits, depended on what had been compiled before in the process.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.registry import CPUDispatcher


class _Library(JITCodeLibrary):  # type: ignore[misc]
    """The intermediate code of a function and of what it calls; no machine code."""

    def finalize(self) -> None:
        """Put what it calls beside its own."""
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True


class _Compiler(Compiler):  # type: ignore[misc]
    def compile_extra(self, function: Callable[..., Any]) -> CompileResult:
        """Types and intermediate code of the function, and the object by which its callers find them."""
        state = self.state
        state.flags.no_compile = state.flags.no_cpython_wrapper = state.flags.no_cfunc_wrapper = True
        state.library = _Library(state.targetctx.codegen(), function.__qualname__)
        result = super().compile_extra(function)
        module, kept = result.fndesc.lookup_module(), (result.library,)
        key = _dynfunc.make_function(module, function.__name__, "", 0, result.environment, kept)  # never called
        state.targetctx.insert_user_function(key, result.fndesc, [result.library])
        return result._replace(entry_point=key)


class Helper(CPUDispatcher):  # type: ignore[misc]
    """A function for kernels; where Python calls it, as a test does, it runs as Python."""

    def __init__(self, py_func: Callable[..., Any], locals: dict[str, Any], targetoptions: dict[str, Any]) -> None:
        super().__init__(py_func, locals, targetoptions, pipeline_class=_Compiler)

    def __call__(self, *arguments: Any) -> Any:
        """What the function returns."""
        return self.py_func(*arguments)
