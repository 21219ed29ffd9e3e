"""
Design an experiment
====================

Which motion, and how long, gives the inertia with the uncertainty that is needed? ``swingid design`` proposes one,
``swingid rehearse`` runs it many times on the twin of the rig, before anything is built or booked.
"""

import matplotlib.pyplot as plt
import numpy as np

import swingid as sw

# %%
# The rig as it is expected: inertia and friction are guesses here, the wheel is known to 0.02 %, the gravity torque
# to 0.2 %.

rig = sw.Rig.load("paper").changed(
    {"drive.wheel.inertia": "1134 ± 0.25 g*cm^2", "axis.gravity_torque": "78 ± 0.16 mN*m"}
)
plan = sw.design(rig, "0.03 %", duration=30)
print(plan.summary())

# %%
# Which constant limits depends on the frequency. Well above the resonance of the pendulum (5.1 rad/s) the wheel sets
# the scale, close to it the gravity torque, which is known less well. A rehearsal of both, eight runs each.

errors = {}
for words in ("sine 0.8 rad 8.5 rad/s", "sine 0.8 rad 5.5 rad/s"):
    rehearsal = sw.rehearse(rig, sw.parse_reference(words), duration=15, runs=8, methods=["momentum"], workers=1)
    print(words)
    print(rehearsal.summary())
    errors[words] = rehearsal.of("momentum").errors

# %%
# The spread of the errors over the runs.

figure, axes = plt.subplots(figsize=(8, 2.5))
for k, found in enumerate(errors.values()):
    axes.plot(100 * np.array(found), np.full(len(found), k), "C0o", alpha=0.6)
axes.set_yticks(range(len(errors)), list(errors))
axes.axvline(0, color="k", lw=1, ls="--")
axes.set_xlabel("error of the inertia, %")
figure.tight_layout()
