"""
A live run on the emulator
==========================

The loop of a live rig runs in firmware; the host sends the reference, watches and records. ``twin://paper`` is the same
device without hardware: the digital twin of the paper's rig, sample by sample, in virtual time. With a board it is
``sw.live.connect("/dev/ttyACM0", "rig.toml")``, and nothing else changes. On the command line: ``swingid run``; more in
:doc:`live rigs </live>`.
"""

import matplotlib.pyplot as plt

import swingid as sw

# %%
# One experiment: the device says what it is, the run is rehearsed on the twin and refused where it would come too close
# to a limit, the body hangs still for half a second (that is the zero of the angle), then it runs. ``show`` is called
# with the progress; here it keeps the online estimate of each swing.

swings = []


def show(progress):
    """Keep each new estimate."""
    if progress.fresh and progress.estimate is not None:
        swings.append(progress.estimate)


with sw.live.connect("twin://paper") as rig:
    log = rig.run("sine 0.8 rad 8.5 rad/s", duration=15, out="run.mcap", show=show)
    given, done = rig.rig, rig.last
print(f"{len(log)} rows. {done.end.sentence}")

# %%
# The journal ``run.mcap`` is written while the rig runs, and is read as any log.

figure, (above, below) = plt.subplots(2, sharex=True, figsize=(8, 5))
above.plot(log.time, log.angle, lw=0.8)
above.set_ylabel("angle, rad")
below.plot(log.time, log.voltage, lw=0.6)
below.set(xlabel="time, s", ylabel="voltage, V")
figure.tight_layout()

# %%
# The online estimate, swing by swing, with its 95 % interval. A run can end by it: ``until=5e-4``.

known = [one for one in swings if one.inertia.standard_uncertainty is not None][3:]
low, high = zip(*(one.inertia.interval95 for one in known), strict=True)
figure, axes = plt.subplots(figsize=(8, 3.5))
axes.fill_between([one.swing for one in known], low, high, alpha=0.3)
axes.plot([one.swing for one in known], [one.inertia.value for one in known])
axes.axhline(302.2e-5, color="k", ls="--", lw=1, label="true value of the twin")
axes.set(xlabel="swing", ylabel="inertia, kg m²")
axes.legend()
figure.tight_layout()

# %%
# The estimate from the whole journal.

result = sw.identify(sw.Recording.load("run.mcap", given), given)
print(result.summary())
