"""
Teach: a class exercise
=======================

Ninety minutes for a laboratory class, with a phone and a ruler, or with this page alone. Take it along as a notebook
(at the end of the page). The questions are in the text; the answers are what the code prints.

**Aim.** Determine the moment of inertia of a swinging body, first from the period as in the textbook, then from the
whole log, and say how well it is known.
"""

import matplotlib.pyplot as plt
import numpy as np

import swingid as sw

# %%
# 1. The experiment
# -----------------
# A phone (phyphox, Sensor Logger) taped to a body that swings on a bearing or a nail logs the rate of its gyroscope.
# Weigh the body with the phone, balance it on an edge to find its centre of mass. Here a twin swings.

rig = sw.Rig.from_text("""
name = "class"
[axis]
mass = "0.412 ± 0.001 kg"
lever = "181 ± 1 mm"
g = "9.812 ± 0.001 m/s^2"
[drive]
kind = "none"
[sensors.angle_speed]
noise = "0.1 deg/s"
bias = "0 ± 0.5 deg/s"
[log]
time = "Time (s)"
angle_speed = "Gyroscope z (rad/s)"
""")
J = 0.0231
twin = rig.changed({"axis.inertia": J, "axis.friction": {"viscous": 5e-4, "quadratic": 4e-4, "coulomb": 2e-4}})
log = sw.simulate(twin, duration=45, rate=100, initial_angle=1.0, seed=11)

figure, axes = plt.subplots(figsize=(8, 3))
rate = np.gradient(log.angle, log.time)
axes.plot(log.time, rate, lw=0.7)
axes.set(xlabel="time, s", ylabel="rate, rad/s")
figure.tight_layout()

# %%
# 2. By the period
# ----------------
# Question: for small swings T = 2π √(J/(m g l)). Which J follows from the first ten periods, which from the last ten?
# Why do they differ?

b = rig.axis.gravity_torque.value
zero = np.flatnonzero((log.angle[:-1] < 0) & (log.angle[1:] >= 0))
crossing = log.time[zero] - log.angle[zero] * np.diff(log.time)[zero] / np.diff(log.angle)[zero]
for name, part in (("first", crossing[:11]), ("last", crossing[-11:])):
    period = (part[-1] - part[0]) / (len(part) - 1)
    print(f"{name} ten periods: {period:.4f} s, J = {1e3 * b * (period / (2 * np.pi)) ** 2:.3f} g m²")

# %%
# Answer: the period of a pendulum grows with its amplitude, by θ²/16. Wide swings give an inertia that is too large.
#
# 3. By the balance of the torques
# --------------------------------
# Every instant fulfils J q'' + b sin q + friction = 0. Multiplied by a window and integrated by parts, no derivative of
# noisy data is needed (:doc:`theory </theory>`). All swings, wide and small, give one inertia.

result = sw.identify(log, rig)
print(result.summary())
assert abs(result.inertia.value / J - 1) < 0.02

# %%
# 4. How well is it known?
# ------------------------
# Question: which of your measurements limits the result? What would a better phone change, what a better ruler?

entries = sorted(
    (entry for entry in result.budget if entry.parameter == "inertia"), key=lambda entry: entry.standard_uncertainty
)[-5:]
figure, axes = plt.subplots(figsize=(8, 3))
axes.barh([entry.source for entry in entries], [100 * entry.standard_uncertainty / J for entry in entries])
axes.set(xscale="log", xlabel="standard uncertainty, % of the inertia")
figure.tight_layout()

# %%
# Answer: the gravity torque, so the lever: 1 mm in 181 mm is 0.55 %. The phone contributes less than a hundredth of
# that.
#
# 5. Without a scale
# ------------------
# Question: what does the same log give without mass and lever?

unknown = sw.Rig.from_text("""
[axis]
gravity_torque = "unknown"
[drive]
kind = "none"
[log]
time = "Time (s)"
angle_speed = "Gyroscope z (rad/s)"
""")
ratios = sw.identify(log, unknown)
for name, found in ratios.parameters.items():
    print(f"{name:24} {found.value:.5g} ± {found.standard_uncertainty:.2g} {found.unit}")

# %%
# Answer: ratios. The inertia alone needs one measurement with a kilogram in it.
#
# 6. Further
# ----------
# Repeat with a known ring on the body: the difference of two runs is its inertia (*Weigh a body*). Compare with m r².
