"""
Compare methods
===============

Five methods on one log. They differ in what they need and in what they assume of the friction; where they disagree
beyond their uncertainty, an assumption is wrong. On the command line: ``swingid compare``; how each works is in
:doc:`methods </methods>`.
"""

import matplotlib.pyplot as plt

import swingid as sw

# %%
# The twin of the paper's rig with Stribeck friction, and a torque per volt in the rig file that is 2 % off, as a data
# sheet's is. Methods that need the voltage depend on it.

truth = sw.Rig.load("paper").changed(
    {"axis.friction": {"coulomb": 5e-4, "static": 8e-4, "stribeck_speed": 0.1, "viscous": 1e-3}}
)
log = sw.simulate(truth, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=20, seed=2)
gain = 1.02 * truth.drive.motor.torque_per_volt.value
rig = truth.changed({"axis.inertia": None, "axis.friction": None, "drive.motor.torque_per_volt": gain})

comparison = sw.compare(log, rig)
print(comparison.summary())

# %%
# The 95 % intervals beside the true value (dashed). The axis is logarithmic in the error of the inertia.

trials = [trial for trial in comparison.trials if trial.result is not None]
figure, axes = plt.subplots(figsize=(8, 3.5))
for k, trial in enumerate(trials):
    inertia = trial.result.inertia
    low, high = (100 * (end / 302.2e-5 - 1) for end in inertia.interval95)
    axes.plot([low, high], [k, k], "C0", lw=3)
    axes.plot(100 * (inertia.value / 302.2e-5 - 1), k, "C0o")
axes.set_yticks(range(len(trials)), [trial.method for trial in trials])
axes.axvline(0, color="k", ls="--", lw=1)
axes.set_xscale("symlog", linthresh=0.01)
axes.set_xlabel("inertia less true value, %")
figure.tight_layout()
