"""
A video of a pendulum
=====================

A camera and a mark on the body replace the encoder. This page makes the frames of a video, finds the mark in each of
them with a few lines of NumPy, and identifies the body from the angles. Frames of a real video take the same steps; a
program such as Tracker gives the columns x and y as well.
"""

import matplotlib.pyplot as plt
import numpy as np

import swingid as sw

# %%
# What is known of the rig
# ------------------------
# A ruler swings on a nail. Its mass, and the distance of its centre of mass from the nail, set the scale. What follows
# ± is one standard uncertainty. ``sensor = "camera"`` states what a camera usually does to an angle.

rig = sw.Rig.from_text("""
name = "ruler"

[axis]
mass = "85.0 ± 0.1 g"
lever = "250 ± 0.5 mm"
latitude = "52.5 deg"

[drive]
kind = "none"

[sensors]
sensor = "camera"
""")

# %%
# The video
# ---------
# 20 s at 120 frames per second. The twin gives the motion; each frame is a dark picture with a bright mark and noise.

true = rig.changed({"axis.inertia": 7.1e-3, "axis.friction": {"coulomb": 2e-4, "viscous": 1e-4}})
motion = sw.simulate(true.changed({"sensors.sensor": "ideal"}), duration=20, rate=120, initial_angle=0.5, seed=1)
pivot, radius, size = (80.0, 10.0), 90.0, (120, 160)
rows, columns = np.mgrid[: size[0], : size[1]]
noise = np.random.default_rng(1)


def frame(angle):
    """Picture of the mark at this angle: brightness of each pixel."""
    x, y = pivot[0] + radius * np.sin(angle), pivot[1] + radius * np.cos(angle)
    mark = 200 * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 18)
    return (mark + noise.uniform(0, 20, size)).astype(np.uint8)


video = [frame(angle) for angle in motion.angle]

# %%
# From frames to angles
# ---------------------
# The mark is the centre of the bright pixels. Its angle about the nail is what the log needs.


def angle_of(picture):
    """Angle of the mark in a frame, rad."""
    weight = np.where(picture > 60, picture, 0.0)
    x, y = (weight * columns).sum() / weight.sum(), (weight * rows).sum() / weight.sum()
    return np.arctan2(x - pivot[0], y - pivot[1])


time = np.arange(len(video)) / 120
log = sw.Recording.from_columns({"t": time, "q1": np.array([angle_of(one) for one in video])}, rig)

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
left.imshow(np.max(video[:40], axis=0), cmap="gray")
left.set(title="the first 40 frames in one")
right.plot(log.time, log.angle, lw=0.8)
right.set(xlabel="time (s)", ylabel="angle (rad)", title="the angles")

# %%
# The inertia
# -----------

result = sw.identify(log, rig)
print(result.summary())
result.plot()

# %%
# The true value, 7.1 g m², is within the interval. Where a camera is not square to the plane of the swing, or the nail
# is marked beside its place, the angle is wrong by a part that repeats with the turn: the kind of sensor covers that.

low, high = result.inertia.interval95
print(f"{1e3 * low:.3f} … {1e3 * high:.3f} g m²")
assert low < 7.1e-3 < high
