"""The pictures of docs/theory.md and docs/uncertainty.md: one for each idea, from the package's own functions.

    python docs/figures/theory.py [FOLDER]        # docs/images by default

`make docs` runs it for the site; the files in docs/images are for readers of the pages on a code host.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("svg")

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

import swingid as sw
from swingid.numerics.test_functions import phi

IMAGES = Path(__file__).resolve().parents[1] / "images"
BLUE, ORANGE, GREY = "#0072B2", "#E69F00", "#6A737D"
MILLI = 1e3
LOOK = {
    "font.size": 11.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 11.0,
    "axes.titlelocation": "left",
    "figure.constrained_layout.use": True,
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "swingid",
}


def window() -> Figure:
    """A modulating function on a swing: the angle, φ and φ'', and the integral that the balance contains."""
    rig = sw.Rig.load("paper")
    log = sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=8.0, seed=1)
    time, angle = np.asarray(log.time), np.asarray(log.angle)
    centre, half = 6.55, 0.26
    shown = np.abs(time - centre) < 0.62
    time, angle = time[shown], angle[shown]
    s = (time - centre) / half
    inside = np.abs(s) < 1
    weight = np.where(inside, phi(np.clip(s, -1, 1), 0), 0.0)
    curvature = np.where(inside, phi(np.clip(s, -1, 1), 2), 0.0) / half**2
    figure, axes = plt.subplots(3, 1, figsize=(6.4, 4.6), sharex=True, height_ratios=(1.3, 1, 1.2))
    axes[0].plot(time, angle, color=GREY)
    axes[0].plot(time[inside], angle[inside], color=BLUE, linewidth=2.5)
    axes[0].set(title="A window (blue) uses a part of the measured angle $q_1$, rad", yticks=(-0.5, 0, 0.5))
    axes[1].fill_between(time, weight, color=BLUE, alpha=0.25)
    axes[1].plot(time, weight, color=BLUE)
    axes[1].set(title="The modulating function $\\varphi$ ends with value and slope zero", yticks=(0, 0.5, 1))
    product = curvature * angle
    axes[2].fill_between(time, product, where=inside, color=ORANGE, alpha=0.35)
    axes[2].plot(time, product, color=ORANGE)
    axes[2].axhline(0, color=GREY, linewidth=0.6)
    axes[2].set(
        title="The area of $\\varphi''\\,q_1$, rad/s², is $\\int\\varphi\\,\\ddot q_1$: no acceleration is needed",
        xlabel="time, s",
        yticks=(-25, 0, 25, 50),
    )
    return figure


def impulse() -> Figure:
    """What an impulse at a reversal is: friction keeps its old sign over a small angle; the area that this adds."""
    level, deflection, acceleration = 3e-3, 1e-3, 20.0
    time = np.linspace(-0.02, 0.06, 1601)
    speed = acceleration * time
    jump = level * np.sign(speed)
    angle = 0.5 * acceleration * time**2
    kept = np.where(time > 0, level * (1 - 2 * np.exp(-angle / deflection)), -level)
    figure, axes = plt.subplots(2, 1, figsize=(6.4, 3.6), sharex=True, height_ratios=(1, 1.6))
    axes[0].plot(MILLI * time, speed, color=GREY)
    axes[0].axhline(0, color=GREY, linewidth=0.6)
    axes[0].set(title="The body reverses at 0: speed, rad/s", yticks=(0, 0.5, 1))
    axes[1].fill_between(MILLI * time, MILLI * kept, MILLI * jump, where=time > 0, color=ORANGE, alpha=0.35)
    axes[1].plot(MILLI * time, MILLI * jump, color=GREY, linestyle="--")
    axes[1].plot(MILLI * time, MILLI * kept, color=BLUE)
    axes[1].set(title="Friction follows 1 mrad later: torque, mN m", xlabel="time after the reversal, ms")
    area = 1e6 * np.trapezoid((jump - kept)[time > 0], time[time > 0])
    axes[1].annotate(
        f"the area is the impulse, {area:.0f} µN m s", (4, 1), (19, 0), arrowprops={"arrowstyle": "-", "color": GREY}
    )
    axes[1].text(10, -1.5, "dynamic friction", color=BLUE)
    axes[1].text(-1, 3, "Coulomb friction", color=GREY, ha="right", va="center")
    return figure


def budget() -> Figure:
    """An uncertainty budget: the entries of a result, and the interval that follows from them."""
    rig = sw.Rig.load("paper").changed(
        {
            "drive.wheel.inertia": "11.34e-5 ± 0.01e-5 kg*m^2",
            "axis.gravity_torque": "0.078 ± 0.00008 N*m",
            "sensors.noise": 0.01,
        }
    )
    log = sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=25.0, seed=1)
    result = sw.identify(log, rig)
    inertia = result.inertia
    parts = [one for one in result.budget if one.parameter == "inertia"]
    parts = sorted(parts, key=lambda one: -one.standard_uncertainty)[:6]
    share = 100 / inertia.value
    figure, axis = plt.subplots(figsize=(6.4, 2.9))
    parts = [one for one in parts if one.standard_uncertainty > 0.01 * inertia.standard_uncertainty]
    names = [f"{one.source} ({one.type})" for one in parts] + [
        "all entries, combined: $u$",
        "95 % interval: $\\pm\\,k\\,u$",
    ]
    low, high = inertia.interval95
    sizes = [one.standard_uncertainty * share for one in parts]
    sizes += [inertia.standard_uncertainty * share, (high - low) / 2 * share]
    colours = [BLUE if one.type == "B" else ORANGE for one in parts] + [GREY, "#111827"]
    places = [k + 0.5 * (k >= len(parts)) for k in range(len(names))]
    axis.barh(places, sizes, color=colours)
    for place, size in zip(places, sizes, strict=True):
        axis.text(size, place, f" {size:.2g}", va="center")
    axis.set_yticks(places, names)
    axis.set(xlabel="% of the inertia", xlim=(0, 1.15 * max(sizes)), title="The stated wheel decides")
    axis.locator_params(axis="x", nbins=4)
    axis.invert_yaxis()
    return figure


def frequency() -> Figure:
    """Why one frequency cannot separate gravity from inertia: q1'' against sin q1 is nearly a straight line."""
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 3.2), sharey=True)
    time = np.linspace(0, 12, 500)
    one = ((0.3, 8.5),)
    two = ((0.3, 8.5), (0.3, 5.0))
    for axis, tones, words in zip(
        axes, (one, two), ("One frequency: $b$ and $J$ act alike", "Two frequencies separate them"), strict=True
    ):
        angle = sum(size * np.sin(rate * time) for size, rate in tones)
        second = sum(-size * rate**2 * np.sin(rate * time) for size, rate in tones)
        axis.scatter(np.sin(angle), second, s=4, color=BLUE, linewidths=0)
        axis.set(title=words, xlabel="$\\sin q_1$ (gravity)")
        axis.locator_params(axis="x", nbins=5)
    axes[0].set(ylabel="$\\ddot q_1$ (inertia), rad/s²")
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "theory-window": window,
    "theory-impulse": impulse,
    "theory-budget": budget,
    "theory-frequency": frequency,
}


def main(folder: Path) -> None:
    """Write all of them as SVG, the same bytes in every run."""
    with plt.rc_context(LOOK):
        for name, draw in FIGURES.items():
            figure = draw()
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
            plt.close(figure)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES)
