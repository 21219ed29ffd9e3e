"""What is computed once for an object, as a cached property with further arguments."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

Of = TypeVar("Of")
P = ParamSpec("P")
Result = TypeVar("Result")


def once(function: Callable[Concatenate[Of, P], Result]) -> Callable[Concatenate[Of, P], Result]:
    """Keep each result with the first argument, for further ones that are equal (text, numbers) or the same objects."""

    @wraps(function)
    def asked(of: Of, /, *further: P.args, **named: P.kwargs) -> Result:
        results: dict[Any, tuple[Any, Result]] = vars(of).setdefault("_once", {})
        arguments = (*further, *named.values())
        key = function, *(argument if isinstance(argument, str | float) else id(argument) for argument in arguments)
        if key not in results:
            results[key] = arguments, function(of, *further, **named)  # their ids stay theirs as long as they are kept
        return results[key][1]

    return asked
