"""Logs of millions of rows, made cheaply: a prescribed periodic motion, exact, read by encoders, written in pieces."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from closed_form_logs import INERTIA, Sines, integrals, wheel_log
from swingid.model.rig import Rig

if TYPE_CHECKING:
    import pytest

RATE = 10_000.0
PERIOD = 20.0
"""s, after which the motion repeats itself; two sines of odd numbers of cycles, so that nothing drifts."""

MOTION = Sines((0.7, 27 * 2 * np.pi / PERIOD, 0.0), (0.1, 5 * 2 * np.pi / PERIOD, 0.0))
VISCOUS, COULOMB = 1.144e-3, 1e-3
GRID, NOISE = 2 * np.pi / 16384, 5e-5
"""Step of the encoders, and the standard deviation of what else they err by (rad)."""

GIVEN = Rig.builtin("paper").changed(
    {"axis.inertia": None, "axis.friction": None, "sensors.noise": NOISE, "log.drive_held": False}
)
"""What identification is told."""


def friction(speed: np.ndarray) -> np.ndarray:
    """Torque of the bearing."""
    return VISCOUS * speed + COULOMB * np.sign(speed)


@lru_cache(maxsize=1)
def period() -> dict[str, np.ndarray]:
    """One period: angle, the wheel's angle by row (I) and its end, the voltage that row (II) asks for."""
    time = np.arange(round(PERIOD * RATE) + 1) / RATE
    log = wheel_log(GIVEN, MOTION, friction, time)
    drive, motor, b = GIVEN.drive, GIVEN.drive.motor, GIVEN.axis.gravity_torque.value
    a11, a12 = INERTIA + drive.wheel.inertia.value + motor.rotor_inertia.value, drive.a12

    def load(t):
        return b * np.sin(MOTION(t)) + friction(MOTION(t, 1))

    rate = 3.0 - (a11 * MOTION(time, 1) + integrals(load, time, MOTION.reversals(0, PERIOD))[0]) / a12
    speeding = -(a11 * MOTION(time, 2) + load(time)) / a12
    gear = motor.gear_ratio.value
    shaft = (a12 * MOTION(time, 2) + drive.a22 * speeding) / gear
    shaft += motor.viscous.value * gear * rate + motor.coulomb.value * np.sign(rate)
    low, high = motor.dead_zone
    ideal = shaft + np.where(shaft > 0, high, low)
    voltage = (ideal / motor.efficiency.value + motor.back_emf.value * rate) / motor.torque_per_volt.value
    return {"angle": log.angle[:-1], "wheel": log.wheel_angle - log.wheel_angle[0], "voltage": voltage[:-1]}


def pieces(rows: int, *, seed: int = 0, piece: int = 1_000_000):
    """The columns t, q1, q2, u of such a log, `piece` rows at a time."""
    rng = np.random.default_rng(seed)
    exact = period()
    length = len(exact["angle"])
    zeros = rng.uniform(0, GRID, 2)
    for begin in range(0, rows, piece):
        at = np.arange(begin, min(begin + piece, rows))
        turn, place = np.divmod(at, length)
        angles = exact["angle"][place], exact["wheel"][place] + turn * exact["wheel"][-1]
        noise = rng.normal(0, NOISE, (2, len(at)))
        read = [GRID * np.round((x + z + e) / GRID) - z for x, z, e in zip(angles, zeros, noise, strict=True)]
        yield {"t": at / RATE, "q1": read[0], "q2": read[1], "u": exact["voltage"][place]}


def write_large_log(path: Path, rows: int, *, seed: int = 0, row_group: int = 1_000_000) -> Path:
    """A log of `rows` rows at 10 kHz as a plain Parquet file, or CSV, HDF5, MCAP by the ending, in bounded memory."""
    import pyarrow as pa
    import pyarrow.csv as pc
    import pyarrow.parquet as pq

    if path.suffix in (".h5", ".mcap"):
        writes = _write_hdf5 if path.suffix == ".h5" else _write_mcap
        writes(path, rows, pieces(rows, seed=seed, piece=row_group))
        return path
    tables = (pa.table(columns) for columns in pieces(rows, seed=seed, piece=row_group))
    if path.suffix == ".csv":
        with path.open("wb") as stream:
            for k, table in enumerate(tables):
                pc.write_csv(table, stream, pc.WriteOptions(include_header=k == 0))
        return path
    with pq.ParquetWriter(path, pa.schema([(name, pa.float64()) for name in ("t", "q1", "q2", "u")])) as writer:
        for table in tables:
            writer.write_table(table, row_group_size=row_group)
    return path


def _write_hdf5(path: Path, rows: int, parts) -> None:
    """Compressed columns, in chunks of 64 000 rows."""
    import h5py

    done = 0
    with h5py.File(path, "w", track_order=True) as file:
        for part in parts:
            for name, values in part.items():
                if name not in file:
                    file.create_dataset(
                        name, (rows,), "f8", chunks=(min(64_000, rows),), compression="gzip", shuffle=True
                    )
                file[name][done : done + len(values)] = values
            done += len(values)


def _write_mcap(path: Path, rows: int, parts) -> None:
    """JSON messages, one per row, in compressed chunks, as `swingid convert` writes them."""
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/swingid", "json", writer.register_schema("row", "jsonschema", b"{}"))
        for part in parts:
            for row in zip(*(values.tolist() for values in part.values()), strict=True):
                text = json.dumps(dict(zip(part, row, strict=True)))
                stamp = round(1e9 * row[0])
                writer.add_message(channel, log_time=stamp, publish_time=stamp, data=text.encode())
        writer.finish()


def make_parts_small(monkeypatch: pytest.MonkeyPatch, piece: int, enough: int) -> None:
    """Logs count as large from 100 000 rows on, and parts are small, so that tests are quick."""
    from swingid.recording.large import log, parts

    monkeypatch.setattr(log, "LARGE", 100_000)
    monkeypatch.setattr(log, "PIECE", piece)
    monkeypatch.setattr(parts, "ENOUGH", enough)
