"""The Recording: what a rig logged, in the model's units and conventions, read-only."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.numerics.arrays import median
from swingid.recording.findings import Finding, Source

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import ArrayLike

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.recording.formats.table import Table

CHANNELS = (
    *("time", "angle", "angle_speed", "wheel_angle", "wheel_speed", "voltage", "torque"),
    *("reference", "adaptive_gain", "bridge"),
)
FINITE = CHANNELS[:7]

__all__ = ["CHANNELS", "Finding", "Recording", "Source"]


@dataclass(frozen=True, eq=False)
class Recording:
    """Measured channels of one run, all of one length, float64 and not writeable.

    Velocities that were not measured are not stored: a method that needs one documents how it is found.

    Parameters
    ----------
    time : (n,) s
        Strictly increasing, not necessarily evenly spaced.
    angle : (n,) rad, on a linear axis m
        0 hanging, positive counter-clockwise, continuous over turns.
    wheel_angle : (n,) rad
        Relative to the pendulum, continuous.
    angle_speed : (n,) rad/s or m/s
        The rate of the angle as logged; where no angle is, that is its integral without a straight line.
    wheel_speed : (n,) rad/s
        As logged (absolute where the rig states so), only in place of the wheel's angle, which then is its integral.
    voltage, torque : (n,) V; N m or N
        Of the motor; what the direct drive applied.
    bridge : (n,)
        0 while that of a motor on the axis is open, and no current flows.
    reference, adaptive_gain : (n,)
        As angle; k tilde of the compensator or alpha_2^ of backstepping. These two may hold NaN.
    drive_held : bool
        True: row k's voltage or torque acts from t_k to t_(k+1). False: it is a measurement at t_k.
    averaged : int
        Rows of the log that each row is the mean of (`recording.large`).
    left_out : (k, 2) s
        From when to when rows are excluded, as an external torque acted; nothing is continued across.
    selected : bool
        Whether a user chose these rows, all of which are used.
    repairs_off : frozenset of str
        Repairs that are switched off, also those that a method would make (`findings.REPAIRS`).
    done : frozenset of str
        Repairs that a method made, which it does not make again; a file does not hold them.

    Raises
    ------
    InputError
        Channels that do not fit together.

    Examples
    --------
    >>> import numpy as np
    >>> import swingid as sw
    >>> rig = sw.Rig.from_text('drive = {kind = "none"}')
    >>> t = np.arange(1000) / 100
    >>> log = sw.Recording.from_columns({"t": t, "q1": 0.3 * np.cos(5 * t)}, rig)
    >>> len(log), round(log.rate), log.segment(2, 4).duration
    (1000, 100, 2.0)
    """

    time: Array
    angle: Array
    wheel_angle: Array | None = None
    voltage: Array | None = None
    torque: Array | None = None
    reference: Array | None = None
    adaptive_gain: Array | None = None
    drive_held: bool = True
    metadata: dict[str, object] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    source: Source = field(default_factory=Source)
    wheel_speed: Array | None = None
    angle_speed: Array | None = None
    averaged: int = 1
    left_out: Array = field(default_factory=lambda: np.empty((0, 2)))
    bridge: Array | None = None
    selected: bool = False
    repairs_off: frozenset[str] = frozenset()
    done: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        for name in CHANNELS:
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, _frozen(name, values, None if name == "time" else len(self.time)))
        for name in FINITE:
            values = getattr(self, name)
            if values is not None and not np.isfinite(values).all():
                raise InputError(f"the recording's {name} has NaN or infinity; drop those rows.", code="not-finite")
        if not (np.diff(self.time) > 0).all():
            raise InputError(
                "the recording's time does not increase from row to row; sort it first.", code="time-order"
            )
        object.__setattr__(self, "metadata", dict(self.metadata))
        object.__setattr__(self, "findings", tuple(self.findings))

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.time)

    @property
    def is_live(self) -> bool:
        """Return whether this is the journal of a live run, which does not read [log]."""
        return bool(self.metadata.get("live"))

    @property
    def truth(self) -> dict[str, Any]:
        """The true values of a simulated log (SI) by the names of parameters; empty for a log of a real rig.

        No method reads them. `simulation.simulate_run` gives the true motion, too.
        """
        truth = self.metadata.get("truth")
        return dict(truth) if isinstance(truth, dict) else {}

    @property
    def duration(self) -> float:
        """Time from the first row to the last, s."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def rate(self) -> float:
        """Median number of rows per second, 1/s; UnanswerableError when there are fewer than two rows."""
        if len(self) < 2:
            raise UnanswerableError("a recording of one row has no rate; log a longer run.", code="too-short")
        return 1.0 / median(np.diff(self.time))

    def segment(self, start: float, stop: float) -> Recording:
        """The rows with start <= time <= stop (s), as a recording of its own.

        Raises UnanswerableError when there are none.
        """
        first, last = np.searchsorted(self.time, start, "left"), np.searchsorted(self.time, stop, "right")
        if last <= first:
            message = f"no rows between {start:g} s and {stop:g} s"
            message += f"; the log runs from {self.time[0]:g} s to {self.time[-1]:g} s."
            raise UnanswerableError(message, code="empty-segment")
        cut = {name: values[first:last] for name in CHANNELS if (values := getattr(self, name)) is not None}
        return replace(self, **cut)

    @classmethod
    def load(
        cls, path: str | Path, rig: Rig, *, still_axis: bool = False, repairs: Mapping[str, bool] | None = None
    ) -> Recording:
        """Read a log of any format (see docs/formats.md) by the conventions of `rig.log`, and repair plain faults.

        Repairs are listed in `findings`. still_axis: the axis may be held while the wheel turns, as in a test of
        the motor. repairs: switches by name, such as ``{"spikes": False}``, see `findings.REPAIRS`; all are on.
        Raises InputError for a file that cannot be used, UnanswerableError for one without motion or with too few rows,
        UsageError for an unknown repair.
        """
        from swingid.recording.load import read_log  # which needs numba, as a Recording itself does not

        table, source = read_log(path, rig, repairs)
        return cls.from_table(table, rig, source, still_axis=still_axis, repairs=repairs)

    @classmethod
    def from_columns(
        cls, data: object, rig: Rig, *, still_axis: bool = False, repairs: Mapping[str, bool] | None = None
    ) -> Recording:
        """A log that is in memory: a mapping of arrays by column, or a pandas, polars or Arrow table.

        Read and repaired as `load` does, by the columns, units and signs of `rig.log`. Raises UsageError for data of
        another kind, else as `load`.
        """
        from swingid.recording.formats.arrow import table_of

        return cls.from_table(table_of(data), rig, still_axis=still_axis, repairs=repairs)

    @classmethod
    def from_table(
        cls,
        table: Table,
        rig: Rig,
        source: Source | None = None,
        *,
        still_axis: bool = False,
        repairs: Mapping[str, bool] | None = None,
    ) -> Recording:
        """Make a Recording as `from_columns` does of a file format's table; `source` None: made in memory."""
        from swingid.recording.load import contents_of

        return cls(**contents_of(table, rig, source or Source(), still_axis=still_axis, repairs=repairs))

    def save(self, path: str | Path, rig: Rig | None = None) -> Path:
        """Write a file in the format of its ending, metadata inside, so that ``load(path, rig)`` gives it back.

        Columns, units and signs are those of `rig.log`; without a rig t, q1, q2, u, tau, ym, k in SI units.
        Raises InputError when the ending is another or the file cannot be written.
        """
        from swingid.recording.save import write_log

        channels = {name: values for name in CHANNELS if (values := getattr(self, name)) is not None}
        return write_log(path, rig, channels, self.metadata, self.findings, held=self.drive_held)

    def __repr__(self) -> str:
        names = [f.name for f in fields(self) if f.name in CHANNELS and getattr(self, f.name) is not None]
        return f"Recording({len(self)} rows, {', '.join(names)}, source={self.source.path!r})"


def _frozen(name: str, values: ArrayLike, length: int | None) -> Array:
    """An own, read-only float64 copy of one channel, checked for its shape."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"the recording's {name} is not an array of numbers.", code="bad-channel") from None
    if array.ndim != 1 or array.size == 0 or (length is not None and array.size != length):
        wanted = "one value per row" if length is None else f"{length} values, one per row"
        raise InputError(f"the recording's {name} has shape {array.shape}; it needs {wanted}.", code="bad-channel")
    array.flags.writeable = False
    return array


def listed(logs: Any) -> list[Recording]:
    """One log or several as a list. Raises UsageError for none, and for what is no log, such as its path."""
    several = list(logs) if isinstance(logs, Iterable) and not isinstance(logs, str | bytes) else [logs]
    require_logs(several)
    return several


def require_logs(logs: Collection[object], kinds: Any = Recording) -> None:
    """Raise UsageError for no log, and for one of none of these types, such as its path."""
    for log in logs:
        if not isinstance(log, kinds):
            raise no_log(log)
    if not logs:
        raise UsageError("no log was given; give one or more.", code="no-log")


def no_log(given: object) -> UsageError:
    """The error of what is no log."""
    return UsageError(f"{given!r} is no log; load it with sw.Recording.load(path, rig).", code="no-log")
