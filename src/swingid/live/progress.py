"""What a view shows of a run: state, tracking error, gain, voltage, the estimate after each swing, time left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from swingid.errors import SwingidError
from swingid.format import percent
from swingid.live import guard as at
from swingid.live.codes import State
from swingid.live.frames import Frame
from swingid.live.rows import Row, Rows
from swingid.recursive.stream import Estimator

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.recursive import SwingEstimate

LEAST_TIME = 3.0
"""Seconds before which no estimate ends a run: the controller is still on its way to the motion."""


@dataclass
class Progress:
    """A run so far.

    time, left (s); tracking (rad): root of the mean square error against the reference over the last second; voltage,
    limit (V). estimate: after the last swing, fresh: whether that came with this call. reached: why the run
    may stop, "" while it may not. rows, lost: numbers so far; new: rows of this call.
    """

    state: State = State.IDLE
    time: float = 0.0
    left: float = 0.0
    tracking: float = 0.0
    gain: float = 0.0
    voltage: float = 0.0
    limit: float = 0.0
    estimate: SwingEstimate | None = None
    fresh: bool = False
    reached: str = ""
    rows: int = 0
    lost: int = 0
    new: list[Row] = field(default_factory=list)

    def line(self) -> str:
        """One line for a terminal."""
        parts = [
            f"{self.state.name.lower()} {self.time:.1f} s, {self.left:.0f} s left",
            f"error {self.tracking:.1e} rad",
            f"gain {self.gain:.3g}",
            f"{abs(self.voltage):.1f} of {self.limit:g} V",
        ]
        if self.estimate is not None:
            inertia = self.estimate.inertia
            spread = inertia.standard_uncertainty
            known = "" if spread is None else f" ± {percent(spread / abs(inertia.value))}"
            parts.append(f"swing {self.estimate.swing}: {inertia.value:.6g} {inertia.unit}{known}")
        return ", ".join(parts)


@dataclass
class Follower:
    """Makes the progress out of the frames of a run.

    until: relative standard uncertainty of the online estimate at which `reached` is set, 0 for never. show: called by
    `look`. notes: what the estimates could not be made of.
    """

    rig: Rig
    parameters: list[float]
    reference: list[float]
    until: float
    rate: float
    show: Callable[[Progress], None] = lambda _: None
    progress: Progress = field(default_factory=Progress)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._rows = Rows(self.parameters, self.reference)
        self.progress.limit = self.parameters[at.VOLTAGE_LIMIT]
        self._errors: list[float] = []
        self._estimator: Estimator | None = None
        self._guarded(lambda: setattr(self, "_estimator", Estimator(self.rig)))

    def look(self, frames: list[Frame], start: int | None = None) -> str:
        """Take the frames of a turn and show the progress; why the run may stop, "" while it may not."""
        progress = self.feed(frames, start)
        try:
            self.show(progress)
        except Exception as error:  # whatever a view does, the run goes on
            self.show = lambda _: None
            self.notes.append(f"the view has failed ({type(error).__name__}); the run went on without it")
        return progress.reached

    def feed(self, frames: list[Frame], start: int | None = None) -> Progress:
        """Take the frames of a turn; start: the sequence of reference 0, where it is known otherwise."""
        if start is not None:
            self._rows.start = start
        shown = self.progress
        rows = self._rows.feed(frames)
        if frames and frames[-1].name == "Sample" and frames[-1].state in set(State):
            shown.state = State(frames[-1].state)
        shown.fresh, shown.new = False, rows
        if not rows:
            return shown
        last = rows[-1]
        shown.time, shown.gain, shown.voltage = last.t, last.k, last.u
        shown.left = max(len(self.reference) / self.rate - last.t, 0.0)
        self._errors += [row.q1 - row.ym for row in rows if row.q1 is not None and row.ym is not None]
        del self._errors[: -int(self.rate)]
        if self._errors:
            shown.tracking = (sum(e * e for e in self._errors) / len(self._errors)) ** 0.5
        shown.rows, shown.lost = shown.rows + len(rows), self._rows.lost
        self._guarded(lambda: self._estimate(rows))
        return shown

    def _estimate(self, rows: list[Row]) -> None:
        if self._estimator is None:
            return
        used = [(row.t, row.q1, row.q2, row.u) for row in rows if row.q1 is not None]
        for estimate in self._estimator.push(used):
            self.progress.estimate, self.progress.fresh = estimate, True
        latest = self.progress.estimate
        if not self.until or latest is None or self.progress.time < LEAST_TIME or self.progress.reached:
            return
        spread = latest.inertia.standard_uncertainty
        if spread is not None and spread <= self.until * abs(latest.inertia.value):
            share = spread / abs(latest.inertia.value)
            self.progress.reached = f"the wanted uncertainty is reached ({percent(share)})"

    def _guarded(self, do: object) -> None:
        """Estimates are for the view: where they can't be made the run goes on without."""
        try:
            do()  # type: ignore[operator]
        except SwingidError as error:
            self._estimator = None
            self.notes.append(f"no online estimates: {error.message}")
