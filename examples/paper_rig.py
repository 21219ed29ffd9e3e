"""The paper's pendulum from a twin's log to a number: simulate, save, load, identify, print, plot.

Run it as ``python examples/paper_rig.py [FOLDER]``; the log and the picture go to FOLDER, or to out/paper_rig.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

import swingid as sw

mpl.use("Agg")  # figures go to files
folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/paper_rig")
folder.mkdir(parents=True, exist_ok=True)

rig = sw.Rig.load("paper")
motion = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
sw.simulate(rig, motion, sw.Compensator.paper(rig), duration=25.0, rate=1000.0, seed=1).save(folder / "run.csv", rig)

log = sw.Recording.load(folder / "run.csv", rig)  # from here on as with a log of a real rig
result = sw.identify(log, rig)
print(result.summary())
result.plot().figure.savefig(folder / "inertia.png", dpi=150)
