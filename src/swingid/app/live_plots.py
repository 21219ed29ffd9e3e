"""Plots of the live page: the pulses of a check, the rehearsal with its limits, the run; rows as in `runner.Seen`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from nicegui import ui

from swingid.app.plot import Line, Plot
from swingid.format import number, percent, plus_minus
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.result.plot import BLUE, GREEN, ORANGE
from swingid.uncertainty.freedom import COVERAGE_FACTOR

WINDOW = 10.0
"""Seconds of a run that stay in view."""

RENEWED = 100
"""Rows of a run after which titles are renewed, half a second at 200 rows per second."""

ANGLE, REFERENCE = Line("angle", "rad", colour=BLUE), Line("reference", "rad", colour=ORANGE)
WHEEL, VOLTAGE = Line("wheel", "rad", colour=ORANGE), Line("voltage", "V", colour=GREEN)


class CheckPlots:
    """Voltage, wheel and body while a check listens and gives pulses. before: what the plots stand above."""

    def __init__(self, before: ui.element) -> None:
        with ui.column().classes("w-full gap-2") as self.place:
            self.voltage = Plot("Voltage", [VOLTAGE], height=110)
            self.wheel = Plot("Wheel", [WHEEL], height=110)
            self.angle = Plot("Body", [ANGLE], height=110)
        before.move(target_index=-1)
        self.begin()

    def begin(self) -> None:
        """Nothing is measured yet."""
        self.rows = np.empty((0, 6))
        self.place.set_visibility(False)
        for plot, title in ((self.voltage, "Voltage"), (self.wheel, "Wheel"), (self.angle, "Body")):
            plot.clear_rows()
            plot.entitle(title)

    def add(self, rows: Array) -> None:
        """Draw rows (n, 6)."""
        self.place.set_visibility(True)
        self.rows = np.concatenate([self.rows, rows])
        for plot, column in ((self.voltage, 4), (self.wheel, 5), (self.angle, 1)):
            plot.append(rows[:, 0], [rows[:, column]])

    def finish(self) -> None:
        """Say what was seen."""
        if not len(self.rows):
            return
        _, angle, _, _, voltage, wheel = self.rows.T
        self.voltage.entitle(f"Pulses of up to {number(_largest(voltage), 'V', 2)}")
        self.wheel.entitle(f"The wheel turns by {number(_range(wheel), 'rad', 2)}")
        self.angle.entitle(f"The body moves by {number(_range(angle), 'rad', 2)}")


class RehearsalPlots:
    """Angle and voltage of the twin against the limits of the guard. before: what the plots stand above."""

    def __init__(self, before: ui.element, rig: Rig) -> None:
        limit = rig.drive.motor.voltage_limit if rig.drive.motor else None
        self.angle_limit, self.voltage_limit = rig.device.angle_limit, limit
        with ui.column().classes("w-full gap-2") as self.place:
            self.angle = Plot("Angle", [ANGLE, REFERENCE], limits=_both(self.angle_limit), height=200)
            self.voltage = Plot("Voltage", [VOLTAGE], limits=_both(limit), height=130)
        before.move(target_index=-1)
        self.begin()

    def begin(self) -> None:
        """Nothing is rehearsed yet."""
        self.rows = np.empty((0, 6))
        self.place.set_visibility(False)
        for plot in (self.angle, self.voltage):
            plot.clear_rows()

    def add(self, rows: Array) -> None:
        """Draw rows (n, 6)."""
        self.place.set_visibility(True)
        self.rows = np.concatenate([self.rows, rows])
        self.angle.append(rows[:, 0], [rows[:, 1], rows[:, 2]])
        self.voltage.append(rows[:, 0], [rows[:, 4]])
        reach, limit = _largest(self.rows[:, 1]), self.angle_limit
        self.angle.entitle(f"On the twin the body reaches {number(reach, 'rad', 2)}; the limit is {limit:g} rad")
        self.voltage.entitle(_of_limit(_largest(self.rows[:, 4]), self.voltage_limit))

    def finish(self) -> None:
        """All is said already."""


class RunPlots:
    """Angle, error, voltage, gain and the estimate after each swing of a run."""

    def __init__(self, rig: Rig) -> None:
        self.limit = rig.drive.motor.voltage_limit if rig.drive.motor else None
        unit = "kg" if rig.axis.kind == "linear" else "kg m²"
        self.said = ui.label("").classes("text-lg swingid-numbers").props('aria-live="polite"')
        self.angle = Plot("Angle and reference", [ANGLE, REFERENCE], window=WINDOW)
        self.error = Plot("Tracking error", [Line("error", "rad", colour=BLUE)], window=WINDOW, height=120)
        self.voltage = Plot("Voltage", [VOLTAGE], window=WINDOW, height=120, limits=_both(self.limit))
        self.gain = Plot("Adaptive gain", [Line("gain", colour=BLUE)], window=WINDOW, height=110)
        names = ("estimate", "lower end", "upper end")
        self.estimates = Plot("Inertia after each swing, with its 95 % interval", [Line(name, unit) for name in names])
        self.begin()

    def begin(self) -> None:
        """Nothing runs yet."""
        self.count = 0
        self.off = self.reach = 0.0
        self.said.set_text("")
        self.estimates.set_visibility(False)
        for plot in (self.angle, self.error, self.voltage, self.gain):
            plot.clear_rows()

    def add(self, rows: Array) -> None:
        """Draw rows (n, 6)."""
        t, angle, reference, gain, voltage, _ = rows.T
        self.angle.append(t, [angle, reference])
        self.error.append(t, [angle - reference])
        self.voltage.append(t, [voltage])
        self.gain.append(t, [gain])
        self.off, self.reach = max(self.off, _largest(angle - reference)), max(self.reach, _largest(voltage))
        self.count += len(rows)
        if self.count >= RENEWED:
            self.count = 0
            self._entitle()

    def estimated(self, estimates: Sequence[Sequence[Any]]) -> None:
        """Draw all estimates so far, as in `runner.Seen`."""
        known = [(t, value, u) for _, t, value, u, _ in estimates if u is not None]
        if known:
            t, value, u = np.array(known).T
            self.estimates.set_visibility(True)
            self.estimates.show(t, [value, value - COVERAGE_FACTOR * u, value + COVERAGE_FACTOR * u])
        swing, _, value, u, unit = estimates[-1]
        reach = None if u is None else COVERAGE_FACTOR * u
        share = "" if reach is None else f" (95 %, {percent(reach / abs(value))})"
        self.said.set_text(f"after swing {swing}: {plus_minus(value, reach, unit, fine=True)}{share}")

    def finish(self) -> None:
        """The last rows stay in view, and the headings are those of all rows."""
        self._entitle()

    def _entitle(self) -> None:
        self.error.entitle(f"The body is up to {number(self.off, 'rad', 2)} from its reference")
        self.voltage.entitle(_of_limit(self.reach, self.limit))


def _both(limit: float | None) -> list[float]:
    return [] if limit is None else [limit, -limit]


def _of_limit(largest: float, limit: float | None) -> str:
    """The largest voltage against its limit."""
    reach = f"The voltage reaches {number(largest, 'V', 2)}"
    return reach if limit is None else f"{reach} of {limit:g} V"


def _largest(values: Array) -> float:
    good = np.abs(values[np.isfinite(values)])
    return float(good.max(initial=0.0))


def _range(values: Array) -> float:
    good = values[np.isfinite(values)]
    return float(np.ptp(good)) if len(good) else 0.0
