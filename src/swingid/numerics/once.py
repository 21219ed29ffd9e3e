"""What is computed once for an object, as a cached property with further arguments."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import Any, Concatenate, ParamSpec, TypeVar

Of = TypeVar("Of")
P = ParamSpec("P")
Result = TypeVar("Result")


def once(function: Callable[Concatenate[Of, P], Result]) -> Callable[Concatenate[Of, P], Result]:
    """Keep each result with the first argument, for further ones that are equal (text, numbers) or the same objects.

    An argument that is left out counts as its default, one by name as one by place.
    """
    # by name and place: a copy of an object by pickle cannot hold the function itself
    name = function.__module__, function.__qualname__, function.__code__.co_firstlineno
    defaults = [(key, parameter.default) for key, parameter in signature(function).parameters.items()][1:]

    @wraps(function)
    def asked(of: Of, /, *further: P.args, **named: P.kwargs) -> Result:
        results: dict[object, list[tuple[Any, Result]]] = vars(of).setdefault("_once", {})
        kept = results.setdefault(name, [])
        arguments = (*further, *(named.get(key, default) for key, default in defaults[len(further) :]))
        for earlier, result in kept:
            if all(map(_same, earlier, arguments)):
                return result
        kept.append((arguments, function(of, *further, **named)))
        return kept[-1][1]

    return asked


def _same(first: object, second: object) -> bool:
    return first is second or (isinstance(first, str | float) and first == second)
