"""
A phone on two strings
======================

The moment of inertia of a phone, by its own gyroscope: hang it level on two equal strings, twist it a little about the
vertical, and let it swing. An app such as phyphox logs the rate. Here the log is that of a twin, so that the true value
is known; a real one takes the same steps.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import swingid as sw

# %%
# What is known of the rig
# ------------------------
# Strings need the mass of what hangs, their length and their distance. What follows ± is one standard uncertainty.
# The gyroscope gives the rate in the place of an angle; its bias is found.

rig = sw.Rig.from_text("""
name = "phone"

[axis.bifilar]
mass = "182.0 ± 0.5 g"
length = "600 ± 1 mm"
distance = "120.0 ± 0.3 mm"
latitude = "52.5 deg"

[drive]
kind = "none"

[sensors.angle_speed]
noise = "0.002 rad/s"
bias = "0 ± 0.01 rad/s"

[log]
time = "Time (s)"
angle_speed = "Gyroscope z (rad/s)"
""")

# %%
# The log
# -------
# One minute at 100 rows per second, as the app exports it. The twin stands for the phone; the truth is 3.6e-4 kg m².

true = rig.changed({"axis.inertia": 3.6e-4, "axis.friction.viscous": 2e-6, "axis.friction.quadratic": 2e-7})
log = sw.simulate(true, duration=60, rate=100, initial_angle=0.4, seed=1)
file = log.save(Path(tempfile.mkdtemp()) / "Gyroscope.csv", true)
print("\n".join(file.read_text().splitlines()[1:4]))

# %%
# Look at it
# ----------

print(sw.inspect(file, rig).verdict.line)

# %%
# The inertia
# -----------

log = sw.Recording.load(file, rig)
result = sw.identify(log, rig)
print(result.summary())

# %%
# Nearly all of the uncertainty is that of the strings, whose distance counts twice: a better ruler makes it smaller.

figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6), layout="constrained")
above.plot(log.time, log.angle_speed, lw=0.8)
above.set(xlabel="time (s)", ylabel="rate (rad/s)", title="what the phone logs")
result.plot(below)

low, high = result.inertia.interval95
print(f"{1e6 * low:.1f} … {1e6 * high:.1f} kg mm²")
assert low < 3.6e-4 < high
