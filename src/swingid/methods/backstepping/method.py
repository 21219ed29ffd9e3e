"""The paper's alternative method (section 4.2) on a recorded log: an adaptive estimate that runs with the motion.

In the paper the adaptation is driven by the tracking error of its own controller (21). The tracking error of another
controller says nothing about α2 and α3, so here it is driven by the prediction error of a series-parallel model of the
swing equation; laws and (22) are the paper's. For the closed loop of the paper see `control.backstepping`.
"""

from __future__ import annotations

from dataclasses import replace

from swingid.checks.consistency import check_energy, consistency_check
from swingid.errors import UnanswerableError, UsageError
from swingid.methods.backstepping.adaptation import LAWS, Gains, adapted
from swingid.methods.backstepping.answer import answer, details
from swingid.methods.backstepping.curve import Curve, Run, settled_part
from swingid.methods.backstepping.effects import Estimates, effects
from swingid.methods.backstepping.signals import (
    VELOCITIES,
    Channels,
    channels_of,
    inertia_of,
    signals_of,
    viscous_of,
    widths_of,
)
from swingid.methods.backstepping.words import told
from swingid.model.rig import Rig
from swingid.preparation.motion import Motion
from swingid.preparation.prepared import Prepared
from swingid.preparation.scale import Scale, require_motor
from swingid.recording.recording import Recording
from swingid.result.result import Result


def backstepping(
    prepared: Prepared,
    *,
    law: str = "printed",
    velocities: str = "smoothed",
    gain: float = 10.0,
    gamma1: float = 10.0,
    gamma2: float = 100.0,
    alpha2: float = 1.0,
    alpha3: float = 1.0,
) -> Result:
    """Identify inertia and viscous friction by the adaptation laws of the paper's backstepping, over the log's time.

    law: "printed", or "consistent", which the Lyapunov function asks for; the first converges faster below the
    frequency √α2 ≈ √(b/J), the second above it. velocities: "smoothed" (local cubics, which look ahead) or "observers"
    (23), causal with the paper's gains. gain: l of the model, 1/s; gamma1, gamma2, alpha2, alpha3: gains and first
    estimates, as in section 5 unless given.

    Raises UsageError for unknown options and gains too high for the log's rate, InputError where a channel is missing
    or has the wrong sign, UnanswerableError without gravity torque, motor constants or motion. Not for friction that is
    far from viscous, nor for short logs; `momentum` needs neither law nor motor.
    """
    gains = Gains(law, gain, gamma1, gamma2, alpha2, alpha3)
    if velocities not in VELOCITIES:
        raise UsageError(
            f'unknown velocities {velocities!r} of "backstepping"; choose "smoothed" or "observers".',
            code="no-velocities",
        )
    rig = prepared.rig
    _require_gravity(rig, prepared.scale)
    require_motor(prepared.log, rig, prepared.scale, "backstepping")
    # a transient feeds the adaptation, so all of the log; a free decay from its release
    part = prepared.part(whole=rig.drive.kind != "none", at_stamps=True)
    log, scale, used, motion, noise = prepared.log, prepared.scale, part.log, part.motion, part.noise
    widths = widths_of(used, motion, noise) if velocities == "smoothed" else None
    as_read = log.segment(float(used.time[0]), float(used.time[-1]))
    consistency = consistency_check(as_read, rig, motion, scale, noise, prepared.encoders)
    channels = channels_of(used, widths)
    run = _run(channels, rig, motion, gains)
    others = {f"{_other(law)} law": _run(channels, rig, motion, replace(gains, law=_other(law)))}
    if widths is None:
        others["smoothed velocities"] = _run(channels_of(used, widths_of(used, motion, noise)), rig, motion, gains)
    else:
        others["half the smoothing"] = _run(channels_of(used, widths.halved(noise.step)), rig, motion, gains)

    if scale.drive == "reaction-wheel":
        others["reversals of the wheel within a row"] = _run(channels, rig, motion, gains, sooner=True)

    def again(changed_log: Recording, changed_rig: Rig) -> Estimates:
        seen = channels if changed_log is used else channels_of(changed_log, widths)
        return _run(seen, changed_rig, motion, gains).estimates(run.settled.first, run.settled.last)

    found = effects(used, rig, part.encoders, again)
    answered = answer(run, others, found, scale)
    parameters = answered.parameters
    compared = parameters["inertia"].standard_uncertainty if scale.drive == "reaction-wheel" else None
    warnings, notes = check_energy(answered, consistency, rig, scale, motion, compared)
    doubts, words = told(run, gains, widths, parameters["inertia"])
    warnings, notes = [*doubts, *warnings], [part.note, *words, *notes]
    options: dict[str, object] = {"law": law, "velocities": velocities}
    standard = Gains(law)
    options |= {name: value for name, value in vars(gains).items() if value != getattr(standard, name)}
    drawn = details(run, others, f"{law} law", motion, consistency.balance)
    return prepared.result("backstepping", answered, part, warnings, notes, drawn, options)


def _other(law: str) -> str:
    return LAWS[1 - LAWS.index(law)]


def _require_gravity(rig: Rig, scale: Scale) -> None:
    if scale.b is None or scale.b <= 0:
        what = "unknown" if scale.b is None else f"{scale.b:g}"
        raise UnanswerableError(
            f"rig {rig.name}: axis.gravity_torque is {what}, but (22) divides it by the estimate; give one above 0, "
            "or use the momentum method.",
            code="no-gravity-torque",
        )


def _run(channels: Channels, rig: Rig, motion: Motion, gains: Gains, *, sooner: bool = False) -> Run:
    alpha2, alpha3 = adapted(signals_of(channels, rig, sooner=sooner), gains)
    inertia = Curve(channels.time, inertia_of(alpha2, rig), motion.turning_times)
    viscous = Curve(channels.time, viscous_of(alpha2, alpha3, rig), motion.turning_times)
    return Run(inertia, viscous, settled_part(inertia))
