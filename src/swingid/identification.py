"""The door of identification: a log, a rig, the name of a method; a result."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from swingid.errors import SwingidError, UnanswerableError, UsageError
from swingid.model.rig import Rig
from swingid.recording.large import LargeLog
from swingid.recording.recording import Finding, Recording
from swingid.result.result import Result

METHODS: dict[str, str] = {
    "momentum": "swingid.methods.momentum.method:momentum",
    "energy": "swingid.methods.energy.method:energy",
    "output-error": "swingid.methods.output_error:output_error",
    "equation-error": "swingid.methods.equation_error:equation_error",
    "backstepping": "swingid.methods.backstepping:backstepping",
}
"""Function of each method, imported when it is called. Its options are its keyword arguments."""

KINDS: dict[str, tuple[str, type]] = {"bool": ("true or false", bool), "str": ("text", str)}
"""Annotations of options whose kind is checked at the door: in words, and the type."""


Log = Recording | LargeLog

INNER = ("alone",)
"""Keyword arguments that are set for several logs at once, and are no options."""


def identify(
    log: Log | Sequence[Log] | Mapping[str, Log | SwingidError],
    rig: Rig,
    method: str = "momentum",
    **options: object,
) -> Result:
    """Moment of inertia and friction of the body that `log` shows, by the named method.

    Parameters
    ----------
    log : Recording or LargeLog, or several of one body on one rig, in a list or by name
        Measured angles, and voltage or torque where the method needs them. Nothing else of it is used. Several give
        one result with `per_log`; by name, an error may stand in the place of one that could not be read. A LargeLog
        is read and identified in parts.
    rig : Rig
        The constants of the rig with their uncertainties. `axis.inertia` and `axis.friction` are never knowledge.
    method : one of `METHODS`
        "momentum": test functions on the angles, no motor constant (default). "energy": the paper's (6) and (7).
        "backstepping": the paper's alternative (section 4.2). The others are those of the field.
    options
        Keyword arguments of the method's function, such as ``variant="printed"`` for "energy". Of several logs also
        ``friction``: "per-log" (default) or "shared".

    Raises
    ------
    UsageError
        Unknown method or option; a LargeLog for a method that does not read in parts; no log or no rig.
    UnanswerableError
        The log cannot answer: no motion, too short, not identifiable, no scale.
    """
    function = method_function(method)
    if not isinstance(rig, Rig):
        raise UsageError(f"{rig!r} is no Rig; load one with sw.Rig.load(name or path).", code="no-rig")
    if isinstance(log, str | Path):
        raise UsageError(f"{log!r} is no log yet; load it with sw.Recording.load(path, rig).", code="no-log")
    if isinstance(log, Recording | LargeLog):
        check_options(method, function, options)

        def ask(rig: Rig, more: tuple[Finding, ...] = ()) -> Result:
            return _of_one(log, rig, method, function, options, more)

        try:
            return _calibrated(ask(rig), ask, [log], rig)
        except UnanswerableError as error:
            raise _named(error, log.path if isinstance(log, LargeLog) else log.source.path) from error
    from swingid.pooling.several import FRICTION, identify_several

    known = inspect.signature(function).parameters
    own = "friction" not in known or options.get("friction") in FRICTION
    friction = str(options.pop("friction", FRICTION[0])) if own else FRICTION[0]
    check_options(method, function, options)
    if "alone" in known and len(log) > 1:
        options.setdefault("alone", False)
    logs = log if isinstance(log, Mapping) else list(log)

    def ask_all(rig: Rig, more: tuple[Finding, ...] = ()) -> Result:
        return identify_several(logs, lambda one: _of_one(one, rig, method, function, options, more), friction=friction)

    return _calibrated(ask_all(rig), ask_all, logs.values() if isinstance(logs, Mapping) else logs, rig)


def _calibrated(
    result: Result, ask: Callable[[Rig, tuple[Finding, ...]], Result], logs: Iterable[Log | SwingidError], rig: Rig
) -> Result:
    """The result, or a better one where momentum warns of encoders that the rig file does not declare."""
    if result.status != "warning":
        return result
    from swingid.calibration.encoders.undeclared import calibrated_by_itself

    return calibrated_by_itself(result, ask, [one for one in logs if isinstance(one, Recording)], rig)


def _named(error: UnanswerableError, path: str | None) -> UnanswerableError:
    """The same with the file in front, where its sentence does not name it."""
    if path is None or path in error.message:
        return error
    return UnanswerableError(f"{path}: {error.message}", code=error.code)


def _of_one(
    log: Log,
    rig: Rig,
    method: str,
    function: Callable[..., Result],
    options: Mapping[str, object],
    more: tuple[Finding, ...],
) -> Result:
    """The result of one log, to whose findings `more` are added."""
    if isinstance(log, Recording):
        log = replace(log, findings=(*log.findings, *more)) if more else log
        return function(log, rig, **options)
    from swingid.pooling.parts import identify_large, require_in_parts

    require_in_parts(log, method)
    if "alone" in inspect.signature(function).parameters:
        options = {"alone": False} | dict(options)
    return identify_large(log, lambda part: function(part, rig, **options))


def method_function(method: str) -> Callable[..., Result]:
    """The function of a method by its name. Raises UsageError for a name that is none."""
    if method not in METHODS:
        raise UsageError(f"unknown method {method!r}; choose one of {', '.join(METHODS)}.", code="unknown-method")
    module, _, name = METHODS[method].partition(":")
    function: Callable[..., Result] = getattr(import_module(module), name)
    return function


def check_options(method: str, function: Callable[..., Result], options: dict[str, object]) -> None:
    """Raise UsageError for an option that the method does not have (the nearest one is named), or of another kind.

    Kinds are checked where the method asks for text or for true or false; the rest it checks itself.
    """
    parameters = inspect.signature(function).parameters
    known = [name for name, parameter in parameters.items() if parameter.kind is parameter.KEYWORD_ONLY]
    for name, value in options.items():
        if name in known:
            words, kind = KINDS.get(str(parameters[name].annotation), ("", object))
            if not isinstance(value, kind):
                raise UsageError(f"option {name} must be {words}, and is {value!r}.", code="bad-option")
            continue
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"the nearest is {near[0]!r}." if near else f"its options: {', '.join(known) or 'none'}."
        raise UsageError(f"method {method} has no option {name!r}; {hint}", code="unknown-option")
