"""Identification: from a log, a rig and the name of a method to a result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from swingid.errors import InputError, SwingidError, UnanswerableError, UsageError, require_rig
from swingid.methods.table import DEFAULT, Answers, Method, method_of
from swingid.methods.unscaled import unscaled
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.pooling.selected import Log, Logs, Span, decays_of, in_parts, of_releases, parts_of, releases, with_parts
from swingid.preparation.reference import GAIN, WHEEL, Reference, reference_of, turns_freely
from swingid.preparation.scale import refuse_motor
from swingid.recording.large import LargeLog
from swingid.recording.recording import Finding, Recording, no_log
from swingid.result.result import Result, refusal
from swingid.units import Quantity, parse_quantity

NO_OPTIONS = ("log", "rig", "method", "part", "more")
"""Parameters of `identify` that are no options of a method."""


def identify(
    log: Logs,
    rig: Rig,
    method: str = DEFAULT,
    *,
    part: object = None,
    added: object = None,
    friction: object = None,
    memory: object = None,
    variant: object = None,
    nodes: object = None,
    work: object = None,
    velocities: object = None,
    filter_time: object = None,
    cutoff: object = None,
    instruments: object = None,
    input: object = None,
    law: object = None,
    free: object = None,
    loss: object = None,
    starts: object = None,
    segment: object = None,
    gain: object = None,
    gamma1: object = None,
    gamma2: object = None,
    alpha2: object = None,
    alpha3: object = None,
    **more: object,
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
    part : (start, stop), "start:stop", or several of them, s
        Use all rows of these parts only, whatever they look like; several are parts of one result, with `per_part`.
        By default the part is chosen (docs/methods.md); where a body is released several times, each decay is one.
    added : one inertia per log, kg m² (kg), as numbers or text
        "momentum": inertia of a known body that is on the axis beside the one sought, 0 for none. The logs are then
        fitted together.
    friction : "per-log" (default) or "shared"; for "equation-error" and one log the name of a friction law
        Whether several logs of one body have friction of their own.
    memory : "auto" (default), "on" or "off"
        "momentum": whether an impulse of friction at each reversal is fitted.
    variant : "better" (default) or "printed"
        "energy": the balance fitted to all passes, or the paper's formulas as printed.
    nodes, work : see `swingid.methods.energy.method.energy`
        "energy": instants of the passes, s; "held" (default) or "trapezoid" for the work of the voltage.
    velocities, filter_time : "smoothed" (default) or "observers"; float, s
        "energy", "backstepping": how speeds are found; "energy": time constant of the filter on the voltage.
    cutoff, instruments : float, Hz; bool
        "equation-error": of the low-pass, by default by a rule; whether delayed regressors are instruments.
    input : "voltage" or "wheel"
        "output-error": what drives the simulated motion.
    law : text
        "output-error": friction law, by default the one of least BIC. "backstepping": "printed" or "consistent".
    free, loss, starts, segment : names; "linear" (default) or "huber"; int; float, s
        "output-error": constants that are sought too; loss of a residual; points to start from; length of a segment.
    gain, gamma1, gamma2, alpha2, alpha3 : float
        "backstepping": gains of the model and of the adaptation, values to start from.
    more
        Options of a method of your own. None stands for the default of each option.

    Raises
    ------
    UsageError
        Unknown method or option; a LargeLog for a method that does not read in parts; no log or no rig.
    UnanswerableError
        The log does not determine the inertia: no motion, too short, not identifiable.

    Where nothing in the rig sets a scale the result has ratios to the inertia (`Result.ratios`) and no inertia.

    Examples
    --------
    >>> import swingid as sw
    >>> rig = sw.Rig.load("paper")
    >>> log = sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=25, seed=1)
    >>> result = sw.identify(log, rig)
    >>> print(result.status, f"{result.inertia.value:.4g}", result.inertia.unit)
    ok 0.003022 kg m^2
    """
    given = {name: value for name, value in locals().items() if name not in NO_OPTIONS}
    return identify_beside(Answers(), log, rig, method, part=part, **given, **more)


def identify_beside(
    momentum: Answers, log: Logs, rig: Rig, method: str = DEFAULT, /, *, part: object = None, **given: object
) -> Result:
    """`identify` with momentum's answers, which are kept for other methods on the same log."""
    options = {name: value for name, value in given.items() if value is not None}
    chosen, spans = method_of(method), parts_of(part)
    require_rig(rig)
    if isinstance(log, str | bytes) or not isinstance(log, Recording | LargeLog | Iterable):
        raise no_log(log)
    identification = _Identification(rig, chosen, options, momentum)
    if spans:
        return identification.of_parts(log, spans)
    swings = releases(log, rig) if isinstance(log, Recording) and "added" not in options else []
    pooled = identification.of_releases(log, swings) if swings and isinstance(log, Recording) else None
    return pooled or identification.of(log)


@dataclass(frozen=True)
class _Identification:
    """A method with its options on a rig; momentum: its answers to logs, with which the method is compared."""

    rig: Rig
    method: Method
    options: Mapping[str, object]
    momentum: Answers

    def of(self, log: Logs) -> Result:
        """The result of a log, or of several of one body."""
        added, free = self.options.get("added"), turns_freely(self.rig)
        by_momentum = free and self.method.name == DEFAULT
        together = self.rig.drive.channel == "voltage" or added is not None or by_momentum
        if free and not together:
            raise _coast_down(self.rig, self.method)
        reference = None if added is not None or free else reference_of(self.rig)
        if reference is None:
            return self._together(log) if together else self._each(log)
        _require_method(reference, self.method)
        in_its_units = replace(self, rig=reference.rig)
        result = in_its_units._together(log) if together else in_its_units._each(log)
        return unscaled(result, reference, self.rig)

    def of_parts(self, log: Logs, spans: Sequence[Span]) -> Result:
        """The result of selected parts; of several of one log with the value of each."""
        chosen_rows = in_parts(log, spans)
        result = self.of(chosen_rows)
        if len(spans) == 1 or not isinstance(log, Recording | LargeLog) or not isinstance(chosen_rows, dict):
            return result
        return with_parts(result, spans, result.per_log or [self._alone(rows) for rows in chosen_rows.values()])

    def _alone(self, log: Log | SwingidError) -> Result:
        """The result of one part by the default options, refused or not."""
        if isinstance(log, SwingidError):
            return refusal(self.method.name, log)
        try:
            return replace(self, options={}).of(log)
        except SwingidError as error:
            return refusal(self.method.name, error)

    def of_releases(self, log: Recording, spans: Sequence[Span]) -> Result | None:
        """The result of all free decays of a log together; None where at most one of them has a number."""
        try:
            result = self.of(decays_of(log, spans))
        except UnanswerableError:
            return None
        kept = [span for span, of_part in zip(spans, result.per_log, strict=True) if of_part.status != "refused"]
        if len(kept) < 2:
            return None
        if len(kept) < len(spans):
            result = self.of(decays_of(log, kept))
        return with_parts(of_releases(result, kept, len(spans) - len(kept)), kept, result.per_log)

    def _each(self, log: Logs) -> Result:
        """The result of each log, pooled where there are several; something sets the scale, or is its unit."""
        from swingid.pooling.several import FRICTION, identify_several

        alone = isinstance(log, Recording | LargeLog)
        logs = [log] if isinstance(log, Recording | LargeLog) else log if isinstance(log, Mapping) else list(log)
        options = dict(self.options)
        fits_friction = not alone and ("friction" not in self.method.options() or options.get("friction") in FRICTION)
        friction = str(options.pop("friction", FRICTION[0])) if fits_friction else FRICTION[0]
        self.method.check_options(options)

        def of_all(rig: Rig, more: tuple[Finding, ...] = ()) -> Result:
            on_rig = replace(self, rig=rig, options=options)
            shown = Equation.of(rig).shown
            return identify_several(
                logs,
                lambda log_of_body: on_rig._of_one(log_of_body, more, len(logs) > 1),
                friction=friction,
                shown=shown,
            )

        try:
            each = logs.values() if isinstance(logs, Mapping) else logs
            return _calibrated(of_all(self.rig), of_all, each, self.rig)
        except UnanswerableError as error:
            path = log.path if isinstance(log, LargeLog) else log.source.path if isinstance(log, Recording) else None
            if path is None or path in error.message:
                raise
            raise UnanswerableError(f"{path}: {error.message}", code=error.code) from error

    def _of_one(self, log: Log, more: tuple[Finding, ...], one_of_several: bool) -> Result:
        """The result of one log, to whose findings `more` are added."""
        identify_one = partial(self.method.identify, rig=self.rig, options=self.options)
        if isinstance(log, Recording):
            done = log.done | {finding.repair for finding in more if finding.repair}
            log = replace(log, findings=(*log.findings, *more), done=done) if more else log
            return identify_one(log, one_of_several=one_of_several, momentum=self.momentum)
        from swingid.pooling.in_parts import identify_large, require_in_parts

        require_in_parts(log, self.method)
        return identify_large(log, partial(identify_one, one_of_several=True))

    def _together(self, log: Logs) -> Result:
        """The result of one fit to all logs: of a motor on the axis, of known bodies that differ, of a free body."""
        from swingid.methods.momentum.together import momentum_together
        from swingid.pooling.several import named_recordings
        from swingid.preparation.prepared import prepare

        rig, method, added = self.rig, self.method, self.options.get("added")
        options = {name: value for name, value in self.options.items() if name != "added"}
        if method.name != "momentum":
            refuse_motor(rig, f"the method {method.name}")
            raise UsageError(
                "logs with known bodies added are identified by the method momentum, not by "
                f"{method.name}; choose that.",
                code="unknown-option",
            )
        free = turns_freely(rig) and added is None
        if free:
            method.check_options({name: value for name, value in options.items() if name != "friction"})
        elif options:
            raise UsageError(
                f"{', '.join(options)}: no option of one fit to several logs; leave it out.", code="no-option"
            )
        logs = named_recordings([log] if isinstance(log, Recording | LargeLog) else log)
        bodies = None if added is None else bodies_of(added, len(logs), rig)
        if bodies is not None:
            _refuse_unknown_drive(rig)
        elsewhere = free or bodies is not None
        prepared = [prepare(each, rig, together=True, scaled_elsewhere=elsewhere) for each in logs.values()]
        return momentum_together(prepared, list(logs), bodies)


def _coast_down(rig: Rig, method: Method) -> UnanswerableError:
    """The refusal of a body that turns freely, which only momentum identifies."""
    return UnanswerableError(
        f"rig {rig.name}: nothing but friction acts on the axis, as in a coast-down, which {method.name} does not "
        "identify; use the method momentum, or give what draws a swinging body back (axis.gravity_torque, "
        "axis.stiffness).",
        code="no-scale",
    )


def _require_method(reference: Reference, method: Method) -> None:
    """Raise UnanswerableError for a method that needs the motor's constants in N m beside it."""
    if reference.key == WHEEL and method.motor == "needed":
        raise UnanswerableError(
            f"drive.wheel.inertia is unknown, but the {method.name} method needs it beside the motor's constants; "
            "use the method momentum, equation-error or output-error, which give ratios to it, or state it.",
            code="no-scale",
        )


def _refuse_unknown_drive(rig: Rig) -> None:
    """Raise UnanswerableError where the scale of the drive is unknown, beside which a known body would be a second one.

    The constant is the unit of such a rig, 1 in itself: a body in kg m² beside it would be in another unit.
    """
    reference = reference_of(rig)
    if reference is not None and reference.key in (WHEEL, GAIN):
        raise UnanswerableError(
            f"rig {rig.name}: {reference.key} is unknown, and known bodies (--added) do not determine it beside the "
            "inertia; state it, or identify each log by itself, which gives ratios, and give both results to swingid "
            "difference --known.",
            code="no-scale",
        )


def bodies_of(added: object, count: int, rig: Rig) -> list[Quantity]:
    """The inertias of bodies added to the axis, one per log: quantities, as text or numbers.

    Raises UsageError where they are no list of one per log, or no inertias.
    """
    unit = "kg" if rig.axis.kind == "linear" else "kg*m^2"
    if isinstance(added, str | bytes) or not isinstance(added, Sequence) or len(added) != count:
        raise UsageError(
            f"added needs one inertia per log ({count}), 0 for a log without a known body.", code="bad-added"
        )
    try:
        bodies = [parse_quantity(body, unit, f"added body {k + 1}") for k, body in enumerate(added)]
    except InputError as error:
        raise UsageError(error.message, code="bad-added") from None
    if any(body.value < 0 for body in bodies):
        raise UsageError("an added inertia is negative; give 0 for a log without a known body.", code="bad-added")
    return bodies


def _calibrated(
    result: Result, again: Callable[[Rig, tuple[Finding, ...]], Result], logs: Iterable[Log | SwingidError], rig: Rig
) -> Result:
    """The result, or one with calibrated encoders where momentum warns of a nonlinearity that is not declared."""
    if result.status != "warning":
        return result
    from swingid.calibration.encoders.undeclared import calibrated_by_itself

    return calibrated_by_itself(result, again, [log for log in logs if isinstance(log, Recording)], rig)
