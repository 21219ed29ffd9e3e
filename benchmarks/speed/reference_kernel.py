"""A kernel that never changes: what numba takes to compile it is the reference of our first use."""

import math

import numba
import numpy as np


@numba.njit(error_model="numpy")
def slope(t, y, p, out):
    """A pendulum with friction."""
    out[0] = y[1]
    out[1] = (-p[0] * math.sin(y[0]) - p[1] * y[1] - p[2] * np.sign(y[1]) + math.cos(t)) / p[3]


@numba.njit(error_model="numpy")
def integrate(times, y, p):
    """Classical Runge-Kutta steps."""
    stages, trial, log = np.zeros((4, 2)), np.zeros(2), np.zeros((len(times), 2))
    for k in range(len(times) - 1):
        h = times[k + 1] - times[k]
        slope(times[k], y, p, stages[0])
        for i in range(1, 4):
            part = h if i == 3 else 0.5 * h
            for j in range(2):
                trial[j] = y[j] + part * stages[i - 1, j]
            slope(times[k] + part, trial, p, stages[i])
        for j in range(2):
            y[j] += h / 6.0 * (stages[0, j] + 2.0 * stages[1, j] + 2.0 * stages[2, j] + stages[3, j])
            log[k + 1, j] = y[j]
    return log


integrate(np.linspace(0.0, 1.0, 11), np.array([0.5, 0.0]), np.ones(4))
