"""Which parameters of a test run with the quick tests: the others run with the long ones."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from typing import Any

import pytest
from _pytest.mark import ParameterSet


def long(case: Any) -> ParameterSet:
    """The case, marked as long; a tuple holds the values of several parameters."""
    if isinstance(case, ParameterSet):
        return pytest.param(*case.values, marks=[*case.marks, pytest.mark.long], id=case.id)
    return pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.long)


def quick_if(quick: Callable[[Any], bool], cases: Iterable[Any]) -> list[Any]:
    """The cases, of which those that are not `quick` are long."""
    return [case if quick(case) else long(case) for case in cases]


def quick_first(count: int, cases: Iterable[Any]) -> list[Any]:
    """The cases, of which all after the first `count` are long."""
    return [case if k < count else long(case) for k, case in enumerate(cases)]


def quick_of_each(key: Callable[[Any], Hashable], cases: Iterable[Any]) -> list[Any]:
    """The cases, of which all that have the key of an earlier one are long."""
    seen: set[Hashable] = set()

    def new(case: Any) -> bool:
        before = len(seen)
        seen.add(key(case))
        return len(seen) > before

    return quick_if(new, cases)
