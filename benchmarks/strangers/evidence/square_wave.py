"""Mass of a cart from strokes of constant force, by parabolas.

    python square_wave.py LOG.csv N_PER_UNIT

LOG.csv has no header: time, command, position, speed. While the force is constant at F the cart first slows down, with
(F + friction)/M, and then speeds up the other way, with (F - friction)/M; the mean of both accelerations is F/M
whatever the Coulomb friction. Each half of each stroke gets a parabola; printed are the median of M and its quartiles.
"""

import itertools
import sys

import numpy as np

table = np.genfromtxt(sys.argv[1], delimiter=",")
scale = float(sys.argv[2])
t, u, x = table[:, 0], table[:, 1], table[:, 2]
edges = np.flatnonzero(np.diff(u)) + 1
masses = []
for begin, end in itertools.pairwise(edges):
    if end - begin < 30 or u[begin] == 0:
        continue
    rows = np.arange(begin + 3, end)  # the current needs some rows to follow
    turn = rows[np.argmin(x[rows])] if u[begin] > 0 else rows[np.argmax(x[rows])]
    halves = [rows[rows < turn - 2], rows[rows > turn + 2]]
    if min(len(h) for h in halves) < 10:
        continue
    bend = [2 * np.polyfit(t[h] - t[h].mean(), x[h], 2)[0] for h in halves]
    masses.append(u[begin] * scale / np.mean(bend))
print(f"{len(masses)} strokes, M = {np.median(masses):.3f} kg, quartiles {np.percentile(masses, [25, 75]).round(3)}")
