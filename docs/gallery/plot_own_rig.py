"""
Own rig in five minutes
=======================

From a log to the moment of inertia with its uncertainty: look at the file, state what is known of the rig, identify.
The log is that of a body on a bearing that swings freely; here the simulated one of a twin, so that the true value is
known. The same steps on the command line are ``swingid inspect``, ``swingid init --from`` and ``swingid identify``.
"""

from pathlib import Path

import matplotlib.pyplot as plt

import swingid as sw

# %%
# What is known of the rig
# ------------------------
# A free swing needs the gravity torque: mass, distance of the centre of mass from the axis, and where on earth the rig
# stands. What follows ± is one standard uncertainty.

rig = sw.Rig.from_text("""
name = "door-bell"

[axis]
mass = "107.0 ± 0.1 g"
lever = "74.0 ± 0.1 mm"
latitude = "59.9 deg"

[drive]
kind = "none"

[sensors]
counts_per_turn = 4096

[log]
time = "t"
angle = "angle"
angle_unit = "deg"
""")

# %%
# A log
# -----
# Pull the body aside, let it go, log time and angle until it hardly moves. The twin does it here, with an inertia and
# a friction that no method gets to know.

true = rig.changed({"axis.inertia": "1.9 g*m^2", "axis.friction": {"coulomb": 1e-4, "viscous": 5e-5}})
sw.simulate(true, duration=40, rate=200, initial_angle=0.8, seed=3).save("swing.csv", rig)
print(Path("swing.csv").read_text()[-60:])

# %%
# Read and look at it
# -------------------

log = sw.Recording.load("swing.csv", rig)
print(len(log), "rows,", f"{log.time[-1]:.1f} s")

figure, axes = plt.subplots(figsize=(8, 3))
axes.plot(log.time, log.angle, lw=0.8)
axes.set(xlabel="time, s", ylabel="angle, rad")
figure.tight_layout()

# %%
# Identify
# --------
# The summary has the values with their standard uncertainties, where these come from, the friction law that fits best,
# and notes on what was assumed.

result = sw.identify(log, rig)
print(result.summary())

# %%
# Each swing has an inertia of its own; the estimate is that of all together.

result.plot()
plt.gcf().set_size_inches(8, 4)

# %%
# The true value, 1.9 g m², is within the 95 % interval. Of the uncertainty nearly all is that of mass and lever: the
# log could be shorter, the ruler should be better.

low, high = result.inertia.interval95
print(f"{1e3 * low:.4f} … {1e3 * high:.4f} g m²")
assert low < 1.9e-3 < high
