"""The zero-phase low-pass of the equation error, and the rule for its cut-off.

The rule: ten times the motion's frequency (Gautier's rule ω_f ≥ 10 ω_dyn for undistorted derivatives), lowered to
where white noise of the angle puts 1e-5 of the signal's power into the acceleration, for noise in that regressor
biases the inertia of least squares by the same share; never below four times the motion's frequency, so that the third
harmonic, which distinguishes Coulomb from viscous friction, passes; never above a fifth of the sampling rate. The
motion's frequency is that below which 99 % of the power of the smoothed speed lies; the noise is the declared or the
measured one, whichever is more.

That frequency is too high where noise has a share of the speed's power, and angles of a camera or a fused sensor have
more noise than sixth differences show. So of the cut-offs from the rule down to four times the frequency of the swings
(from the turning points) the one with the least *relative* uncertainty of the inertia is taken, among about equal ones
the highest (`estimate.choose_lower`): attenuation lowers the estimate and its scatter alike, but not their ratio.
(Gautier 1997, "Dynamic identification of robots with power model"; Janot, Vandanjon and Gautier 2014, "A generic
instrumental variable approach for industrial robot identification".)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.errors import UnanswerableError, UsageError
from swingid.preparation.noise import Noise
from swingid.preparation.speed import Speed

ABOVE_MOTION = 10.0
AT_LEAST = 4.0
NOISE_SHARE = 1e-5
HIGHEST = 0.2
"""Highest cut-off as a share of the sampling rate."""

BESIDE = 2**0.5
"""Factor between a cut-off and those that it is compared with."""

SETTLING = 2.0
"""Periods of the cut-off after which the transient of the filter has decayed to about 1 %."""


@dataclass(frozen=True)
class Cutoff:
    """A cut-off in Hz and the reason for it in words."""

    frequency: float
    reason: str
    given: bool = False

    def beside(self, rate: float) -> list[Cutoff]:
        """A lower and a higher cut-off, for comparison, where the sampling rate (1/s) allows them."""
        both = self.frequency / BESIDE, self.frequency * BESIDE
        return [Cutoff(frequency, self.reason) for frequency in both if frequency <= 2 * HIGHEST * rate]

    def down_to(self, least: float) -> list[Cutoff]:
        """Itself and lower cut-offs, a factor `BESIDE` apart, none below `least` (Hz)."""
        steps = int(np.log(max(self.frequency / least, 1.0)) / np.log(BESIDE) + 1e-9)
        return [Cutoff(self.frequency / BESIDE**k, self.reason) for k in range(steps + 1)]


def choose_cutoff(speed: Speed, start: float, stop: float, noise: Noise, given: object) -> Cutoff:
    """The cut-off given by the user, or that of the rule for the motion from `start` to `stop` (s).

    Raises UsageError for a cut-off that is no frequency below twice `HIGHEST` of the rate, or too low for the log.
    """
    rate = 1 / noise.step
    if given is not None:
        if isinstance(given, bool) or not isinstance(given, int | float) or not 0 < given <= 2 * HIGHEST * rate:
            raise UsageError(
                f"cutoff = {given} is no frequency between 0 and {2 * HIGHEST * rate:.4g} Hz, two fifths of the rate "
                "of the log; give another, or leave it out.",
                code="bad-cutoff",
            )
        if given * (stop - start) < 1:
            raise UsageError(
                f"cutoff = {given:g} Hz needs longer to settle than the {stop - start:.3g} s of the log that are used; "
                "give a higher one, or leave it out.",
                code="bad-cutoff",
            )
        return Cutoff(float(given), "as given", given=True)
    motion, power = motion_frequency(speed, start, stop)
    # white noise through a perfect low-pass and two derivatives: ∫ 2hσ² (2πf)⁴ df
    allowed = 5 * NOISE_SHARE * power / (2 * noise.step * (2 * np.pi) ** 4 * max(noise.angle, 1e-150) ** 2)
    quiet = float(allowed**0.2)
    wanted = {
        f"{ABOVE_MOTION:g} times the motion's {motion:.3g} Hz": ABOVE_MOTION * motion,
        f"where noise puts {100 * NOISE_SHARE:g} % of its power into the acceleration": quiet,
        "a fifth of the sampling rate": HIGHEST * rate,
    }
    reason, frequency = min(wanted.items(), key=lambda item: item[1])
    least = min(AT_LEAST * motion, HIGHEST * rate)
    if frequency < least:
        return Cutoff(
            least, f"{AT_LEAST:g} times the motion's {motion:.3g} Hz, the least that distinguishes friction terms"
        )
    return Cutoff(frequency, reason)


def motion_frequency(speed: Speed, start: float, stop: float) -> tuple[float, float]:
    """Frequency (Hz) below which 99 % of the power of the speed lies, and the mean square of the acceleration."""
    spacing = float(speed.grid[1] - speed.grid[0])
    inside = (speed.grid >= start) & (speed.grid <= stop)
    values = speed.speed[inside]
    if len(values) < 8:
        raise UnanswerableError("the usable part of the log is too short; record a longer run.", code="too-short")
    spectrum = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(len(values)))) ** 2
    frequencies = np.fft.rfftfreq(len(values), spacing)
    share = np.cumsum(spectrum) / spectrum.sum()
    motion = max(float(np.interp(0.99, share, frequencies)), float(frequencies[1]))
    return motion, float(np.mean(np.gradient(values, spacing) ** 2))
