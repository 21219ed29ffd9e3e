"""
Calibrate encoders
==================

An encoder that is mounted off centre has an error that repeats with every turn. The residuals of a fit hardly show it,
yet it changes the inertia. Ordinary logs of different motions contain it: no further instrument is needed. On the
command line: ``swingid calibrate --encoders``; more in :doc:`encoder calibration </encoders>`.
"""

import matplotlib.pyplot as plt
import numpy as np

import swingid as sw

# %%
# A twin whose axis encoder is off by 0.08° cos q + 0.09° sin q. The rig file of the methods does not know it.

known = sw.Rig.load("paper").changed({"axis.inertia": None, "axis.friction": None, "sensors.nonlinearity": "0.1 deg"})
twin = sw.Rig.load("paper").changed(
    {"sensors.nonlinearity_cosine": "0.08 deg", "sensors.nonlinearity_sine": "0.09 deg"}
)
motions = ("sine 0.8 rad 8.5 rad/s", "sine 1.2 rad 3 rad/s", "sine 0.5 rad 11 rad/s")
logs = [sw.simulate(twin, sw.parse_reference(words), duration=20, seed=k) for k, words in enumerate(motions)]

# %%
# One calibration from all three.

found = sw.calibrate_encoders(logs, known)
print(found.result.summary())

# %%
# The curve of the error, found and true.

q = np.linspace(-np.pi, np.pi, 200)
figure, axes = plt.subplots(figsize=(8, 3.5))
for label, rig, style in (("found", found.rig, "C0"), ("true", twin, "k:")):
    alpha, beta = rig.sensors.nonlinearity_cosine.value, rig.sensors.nonlinearity_sine.value
    axes.plot(np.degrees(q), np.degrees(alpha * np.cos(q) + beta * np.sin(q)), style, label=label)
axes.set(xlabel="angle, deg", ylabel="error of the encoder, deg")
axes.legend()
figure.tight_layout()

# %%
# The inertia of the first log before and after.

for label, rig in (("before", known.changed({"sensors.nonlinearity": None})), ("after", found.rig)):
    inertia = sw.identify(logs[0], rig).inertia
    print(f"{label:7} {100 * (inertia.value / 302.2e-5 - 1):+.4f} % from the true value")
