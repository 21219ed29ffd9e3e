"""All methods on the same logs: each result, its time, its assumptions, and whether they are consistent."""

from __future__ import annotations

import textwrap
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from swingid.checks.momentum import overlapping
from swingid.errors import SwingidError, UnanswerableError, UsageError, require_rig
from swingid.format import number, percent
from swingid.identification import identify_beside
from swingid.methods.table import DEFAULT, METHODS, Answers
from swingid.model.rig import Rig
from swingid.numerics.cache import kept_kernels
from swingid.pooling.selected import each_part, parts_of
from swingid.progress import tracked
from swingid.recording.recording import Recording, listed
from swingid.result.brief import value_and_reach
from swingid.result.result import Message, Result, refusal
from swingid.result.sources import Identity, value_of
from swingid.study.output import Study
from swingid.table import NO_BREAK, WIDTH, Column, Table
from swingid.uncertainty.significance import DIFFERS

SCHEMA = "swingid.compare/1"

LONG = 2.0
"""A first run longer than this (s) is repeated for the sake of its time only where it compiled kernels."""

MATTERS = 0.5
"""Difference, in the smaller of the two methods' own uncertainties, below which it changes nothing.

Methods that depend alike on the same constants differ by far less than the uncertainty of either.
"""


@dataclass(frozen=True)
class Assumptions:
    """What a number depends on beside the angles.

    scale: what sets it, "wheel inertia", "torque" or "" (gravity alone). motor: the motor's constants and the
    voltage. gravity: the stated gravity torque b. friction: what is assumed of the friction of the axis. speed: where
    the method gets speeds from, "none" where it needs none.
    """

    scale: str
    motor: bool
    gravity: bool
    friction: str
    speed: str

    def words(self) -> str:
        """What the number depends on, in one phrase: 'wheel inertia, motor, gravity torque, friction basis'."""
        parts = [self.scale] if self.scale else []
        parts += ["motor"] if self.motor else []
        parts += ["gravity torque"] if self.gravity else []
        parts += [] if self.friction == "any" else [f"friction {self.friction}"]
        parts += [] if self.speed == "none" else [f"{self.speed} speeds"]
        return ", ".join(parts)


def assumptions(method: str, rig: Rig, result: Result) -> Assumptions:
    """Assumptions of `method` on this rig; a rig without a motor has none to rely on, nor b where it is 0 or sought."""
    needs = METHODS[method]
    motor = needs.motor != "unused"
    gravity = rig.axis.gravity_torque
    if result.origin.options.get("input") == "wheel":
        motor = False
    return Assumptions(
        scale={"reaction-wheel": "wheel inertia", "direct": "torque", "motor": "motor", "none": ""}[rig.drive.kind],
        motor=motor and rig.drive.wheel is not None,
        gravity=not isinstance(gravity, str) and gravity.value != 0,
        friction=needs.friction,
        speed=needs.speeds,
    )


@dataclass(frozen=True)
class Trial:
    """One method on one log: its result, refused or not, its wall time in s with kernels loaded, its assumptions."""

    log: str
    method: str
    result: Result
    seconds: float
    assumptions: Assumptions
    truth: float | None

    @property
    def error(self) -> float | None:
        """Relative error of the inertia against the twin's truth, None for real logs and refusals."""
        if self.truth is None or "inertia" not in self.result.parameters:
            return None
        return self.result.inertia.value / self.truth - 1

    @property
    def covered(self) -> bool | None:
        """Return whether the 95 % interval contains the true value; None where either is unknown."""
        if self.error is None or self.truth is None or self.result.inertia.interval95 is None:
            return None
        low, high = self.result.inertia.interval95
        return low <= self.truth <= high


@dataclass(frozen=True)
class Comparison(Study):
    """Trials, log by log and method by method, and whether they agree."""

    trials: tuple[Trial, ...]
    verdicts: tuple[Verdict, ...]

    @property
    def logs(self) -> tuple[str, ...]:
        """Names of the logs in their order."""
        return tuple(dict.fromkeys(trial.log for trial in self.trials))

    def of(self, log: str) -> tuple[Trial, ...]:
        """Trials of one log."""
        return tuple(trial for trial in self.trials if trial.log == log)

    def messages(self, log: str) -> list[tuple[str, Message]]:
        """Refusals and warnings of one log, each once with its methods; "all methods" where all have it."""
        trials = self.of(log)
        by: dict[Message, list[str]] = {}
        for trial in trials:
            messages = (trial.result.error,) if trial.result.error is not None else trial.result.warnings
            for message in dict.fromkeys(messages):
                by.setdefault(message, []).append(trial.method)
        everyone = len(trials) if len(trials) > 1 else 2
        return [("all methods" if len(who) == everyone else ", ".join(who), m) for m, who in by.items()]

    def to_dict(self) -> dict[str, Any]:
        """Plain data, schema "swingid.compare/1": the results as `identify` writes them, each with time and truth."""
        results = []
        for trial in self.trials:
            extra = {
                "seconds": trial.seconds,
                "assumptions": vars(trial.assumptions),
                "truth": trial.truth,
                "relative_error": trial.error,
            }
            results.append(trial.result.to_dict() | {"log": trial.log, "comparison": extra})
        return {"schema": SCHEMA, "results": results, "verdicts": [vars(verdict) for verdict in self.verdicts]}

    def summary(self) -> str:
        """Per log: inertia ± standard uncertainty, assumptions, time, error; friction; verdict; for a terminal."""
        return "\n\n".join(_of_log(self, log) for log in self.logs)


def compare(
    logs: Recording | Sequence[Recording], rig: Rig, methods: Sequence[str] | None = None, *, part: object = None
) -> Comparison:
    """Put every method, or the named ones, on the same logs.

    A method that refuses a log, or crashes on it, is a trial with its reason, not an error.

    Parameters
    ----------
    logs, rig
        As of `identify`; each log is compared by itself.
    methods : names
        All methods by default.
    part
        Of each log, as of `identify`.

    Raises
    ------
    UsageError
        An unknown method, no log, no rig.
    UnanswerableError
        Every method refuses every log.

    Examples
    --------
    >>> import swingid as sw
    >>> rig = sw.Rig.load("paper")
    >>> log = sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=25, seed=1)
    >>> found = sw.compare(log, rig, ["momentum", "energy"])
    >>> [(trial.method, trial.result.status) for trial in found.trials]
    [('momentum', 'ok'), ('energy', 'ok')]
    """
    require_rig(rig)
    spans, several = parts_of(part), listed(logs)
    several = each_part(several, spans) if spans else several
    trials: list[Trial] = []
    chosen = dict.fromkeys(methods or METHODS)
    momentum = Answers()
    for k, log, method in tracked([(k, log, method) for k, log in enumerate(several) for method in chosen]):
        result, seconds = _timed(log, rig, method, momentum)
        depends = assumptions(method, rig, result)
        trials.append(Trial(log.source.path or f"log {k + 1}", method, result, seconds, depends, _truth(log)))
    trials = [replace(trial, result=_warned(trial, trials[:k])) for k, trial in enumerate(trials)]
    if all(trial.result.status == "refused" for trial in trials):
        reason = trials[0].result.error
        raise UnanswerableError(
            f"no method finds an inertia; {trials[0].method}: {reason.message if reason else 'no reason.'}",
            code="all-refused" if reason is None else reason.code,
        )
    verdicts = [verdict(log, [t for t in trials if t.log == log]) for log in dict.fromkeys(t.log for t in trials)]
    return Comparison(tuple(trials), tuple(verdicts))


def _warned(trial: Trial, before: Sequence[Trial]) -> Result:
    """The result, with a warning where its interval excludes that of a trial before on the same log, both green.

    Each method is compared with momentum by itself; two others may still exclude each other, or momentum refuses.
    """
    for other in before:
        pair = (trial.result, other.result)
        if other.log != trial.log or any(trial_of_pair.status != "ok" for trial_of_pair in pair):
            continue
        if overlapping(trial.result.main, other.result.main) > 0:
            text = (
                f"the 95 % interval excludes that of {other.method}: both stand beside each other only with a source "
                "of error that neither budget has."
            )
            warnings = (*trial.result.warnings, Message("excludes-another-method", text))
            return replace(trial.result, status="warning", warnings=warnings)
    return trial.result


def _timed(log: Recording, rig: Rig, method: str, momentum: Answers) -> tuple[Result, float]:
    """The result and the time it takes, timed again where a first run is short or has compiled kernels.

    That of another method is its own, without momentum's answer, which is made once for all of them.
    """
    seconds = float("inf")
    result: Result | None = None
    for _ in range(2):
        compiled = kept_kernels()
        if method == DEFAULT:
            momentum.forget()
        begin = time.perf_counter()
        try:
            result = identify_beside(momentum, log, rig, method)
        except UsageError:
            raise
        except SwingidError as error:
            result = refusal(method, error)
        except Exception as error:  # a bug of one method, which concerns it alone
            kind = type(error).__name__
            what = f"this is a bug of swingid, {kind} ({error})"
            text = f"{what}; swingid identify --method {method} writes a file to report it with."
            result = refusal(method, SwingidError(" ".join(text.split()), code=f"bug-{kind}"))
        seconds = min(seconds, time.perf_counter() - begin)
        if seconds > LONG and kept_kernels() == compiled:
            break
    assert result is not None
    return result, seconds


def _truth(log: Recording) -> float | None:
    """The inertia that a twin's log was made with: for the comparison only, no method reads it."""
    truth = log.metadata.get("truth")
    inertia = truth.get("inertia") if isinstance(truth, dict) else None
    return float(inertia) if isinstance(inertia, int | float) and inertia > 0 else None


@dataclass(frozen=True)
class Verdict:
    """The verdict on one log: the method that the others are held against, who disagrees with it, and the reason."""

    log: str
    reference: str | None
    apart: tuple[str, ...]
    message: str


def verdict(log: str, trials: Sequence[Trial]) -> Verdict:
    """Compare every method with the one of fewest assumptions (the first that gives a number)."""
    answered = [t for t in trials if t.result.leading in t.result.parameters]
    if len(answered) < 2:
        return Verdict(
            log, answered[0].method if answered else None, (), "only one method gives a number; nothing to compare."
        )
    reference, others = answered[0], answered[1:]
    deviations = {t.method: deviation(t.result, reference.result) for t in others}
    apart = tuple(
        t.method
        for t in others
        if (far := deviations[t.method]) is not None and abs(far) > DIFFERS and _matters(t.result, reference.result)
    )
    if not apart:
        codes = ", ".join(dict.fromkeys(w.code for w in reference.result.warnings))
        warned = f", but {codes} of {reference.method} may concern them all" if codes else ""
        return Verdict(
            log, reference.method, (), f"all methods agree with {reference.method} within their intervals{warned}."
        )
    named = ", ".join(f"{name} ({deviations[name]:+.1f} standard uncertainties)" for name in apart)
    verb = "is" if len(apart) == 1 else "are"
    return Verdict(
        log, reference.method, apart, f"{named} {verb} inconsistent with {reference.method}: {_why(answered, apart)}"
    )


def deviation(a: Result, b: Result) -> float | None:
    """(a − b) over the standard uncertainty of the difference; constants that both share partly cancel in it.

    Scatter counts as independent although both saw the same noise, which errs on the side of agreement. None where an
    uncertainty is unknown.
    """
    if a.main.standard_uncertainty is None or b.main.standard_uncertainty is None:
        return None
    gap = value_of(a, a.leading, _source("a")) - value_of(b, b.leading, _source("b"))
    return gap.value / gap.u if gap.u > 0 else None


def _matters(a: Result, b: Result) -> bool:
    """Return whether the difference is a good part of what either is uncertain by anyway."""
    u = min(a.main.standard_uncertainty or 0.0, b.main.standard_uncertainty or 0.0)
    return abs(a.main.value - b.main.value) > MATTERS * u


def _source(run: str) -> Identity:
    """A constant is the same in both results, anything else is not."""
    return lambda entry: entry.shared_id or f"{run}: {entry.source}"


def _why(answered: Sequence[Trial], apart: tuple[str, ...]) -> str:
    """The assumption that the inconsistent ones share and the others do not, a possible cause, with what to do."""
    odd = [t for t in answered if t.method in apart]
    even = [t for t in answered if t.method not in apart]
    if all(t.assumptions.motor for t in odd) and not all(t.assumptions.motor for t in even):
        depends = "they depend" if len(odd) > 1 else "it depends"
        return f"{depends} on the motor's constants; calibrate the motor (swingid calibrate) or trust the others."
    if all(t.assumptions.friction != "any" for t in odd):
        return (
            f"{'they assume' if len(odd) > 1 else 'it assumes'} a friction law, which may be the cause; try another "
            "law. If the difference stays, look for what the rig file states wrongly or leaves out (gravity torque, "
            "scales, timing), to which every method reacts in its own way."
        )
    return "their assumptions are alike; look at the residuals in their reports."


def _of_log(comparison: Comparison, log: str) -> str:
    answers, friction = tables_of(comparison.of(log))
    lines = [f"[[{log}]]", *answers.lines(), "", *friction.lines()]
    lines += [""] + [line for v in comparison.verdicts if v.log == log for line in _wrapped(f"verdict: {v.message}")]
    lines += [line for who, m in comparison.messages(log) for line in _wrapped(f"{who}, {m.code}: {m.message}")]
    return "\n".join(lines)


def tables_of(trials: Sequence[Trial], *, fine: bool = False) -> tuple[Table, Table]:
    """The answers of all methods on one log, and what they depend on with the friction that they found."""
    about = next((trial.result.leading for trial in trials if trial.result.parameters), "inertia")
    columns = [
        Column("method", "name"),
        Column(f"{about} (95 %)", "value-cell"),
        Column("u", "number", True),
        Column("status", "", True),
        Column("time", "number", True),
        *([Column("error", "", True)] if any(trial.truth is not None for trial in trials) else []),
    ]
    answers = Table(tuple(columns), tuple(_answer(trial, fine=fine)[: len(columns)] for trial in trials))
    friction = Table(
        (columns[0], Column("depends on"), Column("friction (95 %)", "text")),
        tuple((trial.method, trial.assumptions.words(), _friction(trial.result, fine=fine)) for trial in trials),
    )
    return answers, friction


def _answer(trial: Trial, *, fine: bool) -> tuple[str, ...]:
    """Method, value with its 95 % interval, relative standard uncertainty, status, time, error against the truth."""
    seconds = f"{1e3 * trial.seconds:.3g} ms" if trial.seconds < 1 else number(trial.seconds, "s", 3)
    value, spread, error = "none", "", ""
    if trial.result.leading in trial.result.parameters:
        inertia = trial.result.main
        u = inertia.standard_uncertainty
        value = value_and_reach(inertia, fine=fine)
        spread = "" if u is None else percent(u / abs(inertia.value), fine=fine)
    if trial.error is not None:
        outside = " (outside the interval)" if trial.covered is False else ""
        error = percent(trial.error, sign=True, fine=fine) + outside
    return (trial.method, value, spread, trial.result.status, seconds, error)


def _friction(result: Result, *, fine: bool) -> str:
    """The identified friction parameters with their 95 % intervals: 'viscous (1.144 ± 0.012)e-3 N m s, coulomb …'."""
    others = ("inertia", "gravity_torque", result.leading)
    friction = [
        f"{name} {value_and_reach(parameter, fine=fine)}"
        for name, parameter in result.parameters.items()
        if name not in others and "." not in name
    ]
    return ", ".join(item.replace(" ", NO_BREAK) for item in friction) or "none"


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent="    ", subsequent_indent="      ", break_on_hyphens=False)
