"""Inertia of a driven pendulum by regression on one smoothed motion, for filters of several widths.

    python filtered_regression.py LOG.csv TIME ANGLE TORQUE FROM TO [B]

Columns by name; angle in rad from hanging. torque = J q'' + b sin q + viscous + Coulomb + offset, all smoothed by the
same Savitzky-Golay filter (order 4) of 0.15, 0.3 and 0.5 s. Prints J, b and J/b, and J with b fixed at B N m.
"""

import sys

import numpy as np
from scipy.signal import savgol_filter

path, time, angle, torque, begin, end = sys.argv[1:7]
b = float(sys.argv[7]) if len(sys.argv) > 7 else None
data = np.genfromtxt(path, delimiter=",", names=True)
keep = (data[time] >= float(begin)) & (data[time] <= float(end))
t, q, u = data[time][keep], data[angle][keep], data[torque][keep]
dt = np.median(np.diff(t))
even = np.arange(t[0], t[-1], dt)
q, u = np.interp(even, t, q), np.interp(even, t, u)
for width in (0.15, 0.3, 0.5):
    n = max(7, int(width / dt) // 2 * 2 + 1)
    angle_s, rate, bend = (savgol_filter(q, n, 4, deriv=d, delta=dt) for d in (0, 1, 2))
    y = savgol_filter(u, n, 4)[n:-n]
    columns = np.c_[bend, np.sin(angle_s), rate, np.tanh(rate / 0.05), np.ones_like(q)][n:-n]
    p = np.linalg.lstsq(columns, y, rcond=None)[0]
    text = f"{width} s: J {p[0]:.4f}, b {p[1]:.3f}, J/b {p[0] / p[1]:.4f}"
    if b is not None:
        fixed = np.linalg.lstsq(np.delete(columns, 1, axis=1), y - b * columns[:, 1], rcond=None)[0]
        text += f"; J with b = {b}: {fixed[0]:.4f}"
    print(text)
