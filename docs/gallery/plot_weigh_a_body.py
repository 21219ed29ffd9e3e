"""
Weigh a body
============

The inertia of a body that is not a rig: swing the rig without it and with it, and subtract. What both runs have in
common, such as the error of the wheel's inertia, cancels in part. On the command line: ``swingid difference``.
"""

import matplotlib.pyplot as plt

import swingid as sw

# %%
# Two runs of the rig of the paper, which a reaction wheel drives: empty, and with a body of 68 g whose centre is 117 mm
# from the axis. The gravity torque of the second rig file is larger by that of the body.

empty = sw.Rig.load("paper")
loaded = sw.Rig.load("paper-body")
motion = sw.parse_reference("sine 0.8 rad 8.5 rad/s")

results = []
for rig in (empty, loaded):
    log = sw.simulate(rig, motion, duration=20, seed=5)
    results.append(sw.identify(log, rig))
    inertia = results[-1].inertia
    print(f"{rig.name:16} {1e3 * inertia.value:.5f} ± {1e3 * inertia.standard_uncertainty:.5f} g m²")

# %%
# The body alone, about the axis and about its own centre (Huygens–Steiner).

body = sw.difference(*results, mass="68.0 ± 0.1 g", distance="117.0 ± 0.1 mm")
print(body.summary())

# %%
# How much of the uncertainty comes from where: the mass and the place of the body matter more than both logs.

entries = [entry for entry in body.budget if entry.parameter == "inertia"]
entries = sorted(entries, key=lambda entry: entry.standard_uncertainty)[-6:]
figure, axes = plt.subplots(figsize=(8, 3))
axes.barh([entry.source for entry in entries], [1e9 * entry.standard_uncertainty for entry in entries], color="C0")
axes.set_xlabel("standard uncertainty about the own centre, 10⁻⁹ kg m²")
figure.tight_layout()
