"""Identification: from a log, a rig and the name of a method to a result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from swingid.errors import SwingidError, UnanswerableError, UsageError
from swingid.methods.table import DEFAULT, Method, method_of
from swingid.methods.unscaled import in_units_of, require_method, unscaled
from swingid.model.rig import Rig
from swingid.preparation.reference import reference_of
from swingid.recording.large import LargeLog
from swingid.recording.recording import Finding, Recording
from swingid.result.result import Result

Log = Recording | LargeLog


def identify(
    log: Log | Sequence[Log] | Mapping[str, Log | SwingidError],
    rig: Rig,
    method: str = DEFAULT,
    **options: object,
) -> Result:
    """Moment of inertia and friction of the body from a log, by the named method.

    Parameters
    ----------
    log : Recording or LargeLog, or several of one body on one rig, in a list or by name
        Measured angles, and voltage or torque where the method needs them. Nothing else of it is used. Several give
        one result with `per_log`; by name, an error may take the place of one that could not be read. A LargeLog
        is read and identified in parts.
    rig : Rig
        The constants of the rig with their uncertainties. `axis.inertia` and `axis.friction` are never used.
    method : one of `METHODS`
        "momentum": modulating functions on the angles, no motor constant (default). "energy": the paper's (6) and (7).
        "backstepping": the paper's alternative (section 4.2). The others are those of the field.
    options
        Keyword arguments of the method's function, such as ``variant="printed"`` for "energy". Of several logs also
        ``friction``: "per-log" (default) or "shared".

    Raises
    ------
    UsageError
        Unknown method or option; a LargeLog for a method that does not read in parts; no log or no rig.
    UnanswerableError
        The log does not determine the inertia: no motion, too short, not identifiable.

    Where nothing in the rig sets a scale the result has ratios to the inertia (`Result.ratios`) and no inertia.
    """
    chosen = method_of(method)
    if not isinstance(rig, Rig):
        raise UsageError(f"{rig!r} is no Rig; load one with sw.Rig.load(name or path).", code="no-rig")
    if isinstance(log, str | Path):
        raise UsageError(f"{log!r} is no log yet; load it with sw.Recording.load(path, rig).", code="no-log")
    reference = reference_of(rig)
    if reference is None:
        return _identified(log, rig, chosen, options)
    require_method(reference, chosen)
    with in_units_of(reference):
        found = _identified(log, reference.rig, chosen, options)
    return unscaled(found, reference, rig)


def _identified(
    log: Log | Sequence[Log] | Mapping[str, Log | SwingidError],
    rig: Rig,
    chosen: Method,
    options: dict[str, object],
) -> Result:
    """`identify` with a rig in which something sets the scale, or is its unit."""
    if isinstance(log, Recording | LargeLog):
        chosen.check_options(options)

        def of_one(rig: Rig, more: tuple[Finding, ...] = ()) -> Result:
            return _of_one(log, rig, chosen, options, more)

        try:
            return _calibrated(of_one(rig), of_one, [log], rig)
        except UnanswerableError as error:
            path = log.path if isinstance(log, LargeLog) else log.source.path
            if path is None or path in error.message:
                raise
            raise UnanswerableError(f"{path}: {error.message}", code=error.code) from error
    from swingid.pooling.several import FRICTION, identify_several

    own = "friction" not in chosen.options() or options.get("friction") in FRICTION
    friction = str(options.pop("friction", FRICTION[0])) if own else FRICTION[0]
    chosen.check_options(options)
    several = len(log) > 1
    logs = log if isinstance(log, Mapping) else list(log)

    def of_all(rig: Rig, more: tuple[Finding, ...] = ()) -> Result:
        return identify_several(
            logs, lambda one: _of_one(one, rig, chosen, options, more, one_of_several=several), friction=friction
        )

    return _calibrated(of_all(rig), of_all, logs.values() if isinstance(logs, Mapping) else logs, rig)


def _calibrated(
    result: Result, again: Callable[[Rig, tuple[Finding, ...]], Result], logs: Iterable[Log | SwingidError], rig: Rig
) -> Result:
    """The result, or one with calibrated encoders where momentum warns of a nonlinearity that is not declared."""
    if result.status != "warning":
        return result
    from swingid.calibration.encoders.undeclared import calibrated_by_itself

    return calibrated_by_itself(result, again, [one for one in logs if isinstance(one, Recording)], rig)


def _of_one(
    log: Log,
    rig: Rig,
    method: Method,
    options: Mapping[str, object],
    more: tuple[Finding, ...],
    *,
    one_of_several: bool = False,
) -> Result:
    """The result of one log, to whose findings `more` are added."""
    if isinstance(log, Recording):
        log = replace(log, findings=(*log.findings, *more)) if more else log
        return method.identify(log, rig, options, one_of_several=one_of_several)
    from swingid.pooling.parts import identify_large, require_in_parts

    require_in_parts(log, method)
    return identify_large(log, lambda one: method.identify(one, rig, options, one_of_several=True))
