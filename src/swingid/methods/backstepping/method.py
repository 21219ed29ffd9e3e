"""The paper's alternative method (section 4.2) on a recorded log: an adaptive estimate that runs with the motion.

In the paper the adaptation is driven by the tracking error of its own controller (21). The tracking error of another
controller does not depend on α̂2 and α̂3, so here it is driven by the prediction error of a series-parallel model of
the swing equation; laws and (22) are the paper's. For the closed loop of the paper see `control.backstepping`.
"""

from __future__ import annotations

from dataclasses import replace

from swingid.checks.consistency import cause_of, check_energy, require_signs
from swingid.checks.momentum import MomentumCheck
from swingid.control.observer import VelocityObserver
from swingid.errors import UnanswerableError, UsageError
from swingid.methods.backstepping import signals
from swingid.methods.backstepping.adaptation import LAWS, Gains, adapted
from swingid.methods.backstepping.answer import answer, details
from swingid.methods.backstepping.curve import BANDS, Curve, Run, settled_part
from swingid.methods.backstepping.effects import effects
from swingid.methods.backstepping.signals import VELOCITIES, Channels, Widths, channels_of, signals_of, widths_of
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.motion import Motion
from swingid.preparation.scale import refuse_rates, refuse_terms, require_motor
from swingid.preparation.segment import longest_run
from swingid.recording.recording import Recording
from swingid.result.checked import Checked, noted, warned
from swingid.result.result import Message, Parameter, Result

FAR = 0.01
"""Relative distance to the extrapolated final value above which there is a warning."""


def backstepping(
    check: MomentumCheck,
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

    law: "printed", or "consistent", which follows from the Lyapunov function; the first converges faster below the
    frequency √α2 ≈ √(gravity_torque/inertia), the second above it. velocities: "smoothed" (local cubics, which look
    ahead) or "observers" (23), causal with the paper's gains. gain: l of the model, 1/s; gamma1, gamma2, alpha2,
    alpha3: gains and first estimates, as in section 5 unless given.

    Raises UsageError for unknown options and given gains too high for the log's rate, InputError where a channel is
    missing or has the wrong sign, UnanswerableError without gravity torque, motor constants, motion or rows enough.
    Not for friction that is far from viscous, nor for short logs; `momentum` needs neither law nor motor.
    """
    gains = Gains(law, gain, gamma1, gamma2, alpha2, alpha3)
    if velocities not in VELOCITIES:
        raise UsageError(
            f'unknown velocities {velocities!r} of "backstepping"; choose "smoothed" or "observers".',
            code="no-velocities",
        )
    rig = check.read.rig
    refuse_rates(rig, "the method backstepping")
    prepared = replace(check.read, log=longest_run(check.read.log))
    _require_gravity(rig, prepared.equation)
    refuse_terms(rig, "the method backstepping")
    require_motor(prepared.log, rig, prepared.equation, "backstepping")
    # a transient feeds the adaptation, so all of the log; a free decay from its release
    part = prepared.part(whole=rig.drive.channel is not None, at_stamps=True)
    equation, used, motion, noise = prepared.equation, part.log, part.motion, part.noise
    smoothed, other_law = widths_of(used, motion, noise), LAWS[1 - LAWS.index(law)]
    widths = smoothed if velocities == "smoothed" else None
    require_signs(check)
    channels = channels_of(used, widths)
    run = _run(channels, rig, motion, gains)
    others = {f"{other_law} law": _run(channels, rig, motion, replace(gains, law=other_law))}
    name, other = (
        ("smoothed velocities", smoothed) if widths is None else ("half the smoothing", widths.halved(noise.step))
    )
    others[name] = _run(channels_of(used, other), rig, motion, gains)
    if "wheel" in equation.coefficients:
        others["reversals of the wheel within a row"] = _run(channels, rig, motion, gains, sooner=True)

    def again(changed_log: Recording, changed_rig: Rig) -> Array:
        inputs = channels if changed_log is used else channels_of(changed_log, widths)
        return _run(inputs, changed_rig, motion, gains).estimates(run.settled.first, run.settled.last)

    declared = effects(used, rig, equation, part.encoders, again)
    answered = answer(run, others, declared, equation, check.conflict, rig.axis.model_uncertainty)
    answered, differs = check.compared(answered, cause_of(equation))
    checked = _convergence_of(run, gains, widths, answered.parameters["inertia"])
    checked += check_energy(answered, check, equation, motion, differs)
    answered = check.widened(answered)
    options: dict[str, object] = {"law": law, "velocities": velocities}
    standard = Gains(law)
    options |= {name: value for name, value in vars(gains).items() if value != getattr(standard, name)}
    drawn = details(run, others, f"{law} law", motion, check.motor_balance)
    return prepared.result("backstepping", answered, part, checked, drawn, options)


def _require_gravity(rig: Rig, equation: Equation) -> None:
    if equation.seeks("gravity_torque") or equation.value("gravity_torque") <= 0:
        what = "unknown" if equation.seeks("gravity_torque") else f"{equation.value('gravity_torque'):g}"
        raise UnanswerableError(
            f"rig {rig.name}: axis.gravity_torque is {what}, but (22) divides it by the estimate; give one above 0, "
            "or use the momentum method.",
            code="no-gravity-torque",
        )


def _run(channels: Channels, rig: Rig, motion: Motion, gains: Gains, *, sooner: bool = False) -> Run:
    alpha2, alpha3 = adapted(signals_of(channels, rig, sooner=sooner), gains)
    inertia = Curve(channels.time, signals.inertia_of(alpha2, rig), motion.turning_times)
    viscous = Curve(channels.time, signals.viscous_of(alpha2, alpha3, rig), motion.turning_times)
    return Run(inertia, viscous, settled_part(inertia))


def _convergence_of(run: Run, gains: Gains, widths: Widths | None, inertia: Parameter) -> Checked:
    """What was adapted, and a warning where it has not converged."""
    notes = [
        Message(
            "differs-from-paper",
            "the adaptation follows the prediction error of a series-parallel model of the swing equation, not the "
            "tracking error of the paper's own controller; that of another one does not determine the inertia.",
        ),
        Message("velocities", _velocities(widths)),
        Message("friction-law", "the friction of the axis is taken as viscous; the estimate depends on that."),
        Message("convergence", _convergence(run, gains)),
    ]
    settled = run.settled
    if settled.converged and (settled.drift is not None and settled.drift < FAR * abs(settled.mean)):
        return noted(*notes)
    text = (
        "the estimate has not converged by the end of the log: record a longer or faster motion, or choose the "
        "other law, a higher gamma2 or an alpha2 nearer to gravity_torque/inertia."
    )
    if inertia.standard_uncertainty is None:
        reason = "the final value of an estimate that has not converged cannot be determined."
        notes += [Message(f"no-uncertainty-{name}", reason) for name in ("inertia", "viscous")]
    return warned(Message("not-converged", text)) + noted(*notes)


def _velocities(widths: Widths | None) -> str:
    if widths is None:
        gains = VelocityObserver()
        return (
            f"speeds by the observers (23) with the paper's gains (sigma = {gains.sigma:g} 1/s), causal; they lag "
            "by half a row, which affects the friction more than the inertia."
        )
    wheel = f", of the wheel over ±{1e3 * widths.wheel:.3g} ms" if widths.wheel else ""
    return (
        f"speeds by local cubics over ±{1e3 * widths.axis:.3g} ms of the angle{wheel}, which look ahead and so are not "
        'those of an online estimate; velocities="observers" are.'
    )


def _convergence(run: Run, gains: Gains) -> str:
    curve = run.inertia
    parts = []
    for name, band in BANDS.items():
        seconds = curve.convergence_time(band)
        parts.append(f"within {name} " + ("not by the end" if seconds is None else f"after {seconds:.3g} s"))
    begin, end = run.settled.span(curve.turning)
    return (
        f"law {gains.law}: {', '.join(parts)}, of the mean of its last quarter; the estimate is the mean from "
        f"{begin:.4g} to {end:.4g} s."
    )
