"""Inertia over gravity torque of a free decay from its zero crossings: J/b = (T0 / 2 pi)^2.

    python free_decay.py FILE TIME ANGLE UNIT [FROM TO] [--linear] [--spikes]

TIME and ANGLE are column numbers of a text table (from 0) or names in a MATLAB file (a.b.c); TIME may be rate=1000.
UNIT is rad per logged unit (or "deg"). T0 is the period of small swings: each period, from the third crossing to the
first, is divided by 2 K(sin(A/2)) / pi (not with --linear), A being the mean of its two peaks about the middle of
successive peaks. --spikes: a running median of five rows first.
"""

import re
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.signal import medfilt
from scipy.special import ellipk


def column(path, names):
    """Columns of a MATLAB file by name, of a text table by number; rows of another length are no data."""
    if path.endswith(".mat"):
        table = loadmat(path, squeeze_me=True, struct_as_record=False)
        for name in names:
            value = table
            for part in name.split("."):
                value = value[part] if isinstance(value, dict) else getattr(value, part)
            yield np.ravel(np.asarray(value, float))
        return
    rows = []
    for line in Path(path).read_text(encoding="latin-1").splitlines():
        try:
            rows.append([float(cell) for cell in re.split(r"[,;\s]+", line.strip()) if cell])
        except ValueError:
            continue
    width = np.median([len(row) for row in rows[-1000:]])
    yield from (np.array([row[int(name)] for row in rows if len(row) == width]) for name in names)


def crossings(t, x, quiet):
    """Times where x changes its sign, by a line through the rows near it; signs within +-quiet of zero do not count."""
    loud = np.flatnonzero(np.abs(x) > quiet)
    turn = np.flatnonzero(np.diff(np.sign(x[loud])) != 0)
    out = []
    for i, j in zip(loud[turn], loud[turn + 1], strict=True):
        part = slice(max(i - 2, 0), j + 3)
        slope, offset = np.polyfit(t[part] - t[i], x[part], 1)
        out.append(t[i] - offset / slope)
    return np.array(out)


def main(path, time, angle, unit, *window):
    linear, spikes = "--linear" in window, "--spikes" in window
    window = [float(value) for value in window if not value.startswith("--")]
    if time.startswith("rate="):
        (q,) = column(path, [angle])
        t = np.arange(len(q)) / float(time[5:])
    else:
        t, q = column(path, [time, angle])
    q = q * (np.pi / 180 if unit == "deg" else float(unit))
    use = np.r_[True, np.diff(t) > 0] & np.isfinite(q)
    if window:
        use &= (t >= window[0]) & (t <= window[1])
    t, q = t[use], q[use]
    if spikes:
        q = medfilt(q, 5)
    middle = np.median(q)
    for _ in range(4):  # the middle of the swing, from peaks of both sides
        c = crossings(t, q - middle, 0.1 * np.percentile(np.abs(q - middle), 90))
        parts = [np.flatnonzero((t > a) & (t < b)) for a, b in pairwise(c)]
        peaks = np.array([q[part[np.argmax(np.abs(q[part] - middle))]] for part in parts])
        middles = (peaks[:-2] + 2 * peaks[1:-1] + peaks[2:]) / 4
        middle = np.median(middles)
    size = np.abs(peaks - middle)
    amplitude, period = (size[:-1] + size[1:]) / 2, c[2:] - c[:-2]
    small = period / (1 if linear else 2 / np.pi * ellipk(np.sin(amplitude / 2) ** 2))
    for part in np.array_split(np.arange(len(small)), min(8, len(small))):
        middling = np.median(small[part])
        spread = 1.48 * np.median(np.abs(small[part] - middling))
        print(f"t {c[part[0]]:9.3f}  A {np.mean(amplitude[part]):.4f}  T0 {middling:.5f}  spread {spread:.5f}")
    ratio = (np.median(small) / 2 / np.pi) ** 2
    print(f"middle {middle:+.4f} (range {np.ptp(middles):.4f})  {len(small)} periods")
    print(f"T0 {np.median(small):.5f} s  J/b {ratio:.6g} s^2")


if __name__ == "__main__":
    main(*sys.argv[1:])
