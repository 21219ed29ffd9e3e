"""The inertia by IDIM-LS as a researcher writes it with SciPy: the reference of `identify` in benchmarks/speed.

Inverse dynamic identification model and least squares (M. Gautier, "Dynamic identification of robots with power
model", ICRA 1997): both ways through a Butterworth filter, central differences, the regressors, decimated by a parallel
filter, a straight line of least squares, standard deviations from the residual.
"""

import numpy as np
from scipy.signal import butter, decimate, filtfilt


def inertia(t, q1, q2, j2, jr, gear, b, cut=40.0, ratio=10):
    """J1 (kg m^2) and its standard deviation from stamps (s), angles of axis and wheel (rad) and known constants."""
    rate = 1.0 / np.mean(np.diff(t))
    low_b, low_a = butter(4, cut / (rate / 2.0))
    q1 = filtfilt(low_b, low_a, q1)
    q2 = filtfilt(low_b, low_a, q2)
    v1 = np.gradient(q1, t)
    a1 = np.gradient(v1, t)
    a2 = np.gradient(np.gradient(q2, t), t)
    torque = -(j2 + gear * jr) * a2 - (j2 + jr) * a1 - b * np.sin(q1)
    regressors = np.column_stack([a1, v1, np.sign(v1), np.ones_like(v1)])
    keep = slice(int(rate / cut), -int(rate / cut))
    y = decimate(torque[keep], ratio, zero_phase=True)
    x = np.column_stack([decimate(column, ratio, zero_phase=True) for column in regressors[keep].T])
    found, _, _, _ = np.linalg.lstsq(x, y, rcond=None)
    residual = y - x @ found
    variance = residual @ residual / (len(y) - x.shape[1])
    spread = np.sqrt(variance * np.diag(np.linalg.inv(x.T @ x)))
    return found[0], spread[0]
