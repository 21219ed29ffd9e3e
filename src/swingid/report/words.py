"""What names stand for, in words: identified parameters, constants of a rig, their symbols and units."""

from __future__ import annotations

from dataclasses import dataclass

from swingid.model.terms import TERMS


@dataclass(frozen=True)
class Word:
    """A quantity in words, its symbol in the paper, its SI unit on a rotary and on a linear axis."""

    words: str
    symbol: str = ""
    unit: str = ""
    linear: str | None = None

    def __str__(self) -> str:
        """'gravity torque b': the words, and the symbol if there is one."""
        return f"{self.words} {self.symbol}".strip()

    def unit_on(self, *, linear: bool) -> str:
        """SI unit on this kind of axis: that of a rotary one where no other is given."""
        return self.linear if linear and self.linear is not None else self.unit


def last_part(key: str) -> str:
    """The last part of a key as words."""
    return key.rpartition(".")[2].replace("_", " ")


RIG = {
    **{term.key: Word(term.words, term.symbol, term.unit, term.linear) for term in TERMS.values() if term.key},
    **{term.shift: Word(last_part(term.shift), "", "rad", "m") for term in TERMS.values() if term.shift},
    "axis.inertia": Word("moment of inertia", "J₁", "kg m^2", "kg"),
    "drive.motor.dead_zone": Word("motor dead zone", "d₂ … d₁", "N m"),
    "drive.motor.voltage_limit": Word("voltage limit", "", "V"),
    "log.torque_gain": Word("gain of the logged torque"),
    "log.angle_scale": Word("scale of the angle"),
    "log.angle_offset": Word("zero of the angle"),
    "log.angle_speed_scale": Word("scale of the rate"),
    "log.wheel_scale": Word("scale of the wheel's angle"),
    "log.voltage_scale": Word("scale of the voltage"),
    "axis.tilt": Word("tilt of the axis against the horizontal", "", "rad"),
    "drive.wheel.tilt": Word("tilt of the wheel's axis against that of the body", "", "rad"),
    "axis.model_uncertainty": Word("relative uncertainty for what is not modelled"),
}

CALIBRATED = {
    "motor.gain": Word("motor torque per volt with efficiency", "η c₁", "N m/V"),
    "motor.damping": Word("torque lost per wheel speed, back-EMF and viscous", "η c₂ + f₂ N", "N m s"),
    "motor.breakaway_positive": Word("torque at which the wheel breaks away, forward", "f₃ + d₁", "N m"),
    "motor.breakaway_negative": Word("torque at which the wheel breaks away, backward", "f₃ − d₂", "N m"),
    "motor.dead_zone.positive": Word("dead zone, upper edge", "d₁", "N m"),
    "motor.dead_zone.negative": Word("dead zone, lower edge", "d₂", "N m"),
    "gravity_per_inertia": Word("gravity torque per inertia of the whole axis", "b/a₁₁", "1/s^2"),
    "tare_inertia": Word("moment of inertia without the known body", "", "kg m^2", "kg"),
    "loaded_inertia": Word("moment of inertia with the known body", "", "kg m^2", "kg"),
    "sensors.nonlinearity_cosine": Word("axis' encoder, cosine part once per turn", "α₁", "rad"),
    "sensors.nonlinearity_sine": Word("axis' encoder, sine part once per turn", "β₁", "rad"),
    "sensors.wheel.nonlinearity_cosine": Word("wheel's encoder, cosine part once per turn", "α₂", "rad"),
    "sensors.wheel.nonlinearity_sine": Word("wheel's encoder, sine part once per turn", "β₂", "rad"),
    "sensors.latency": Word("latency of the angle against the torque", "", "s"),
    "sensors.wheel.latency": Word("latency of the wheel's channel against the angle's", "", "s"),
}
"""What a calibration names besides the keys of a rig."""

NOT_USED = ("axis.inertia", "axis.friction.")
"""Keys that identification never reads: they are what it seeks."""

SENSORS = {
    "resolution": Word("resolution", "", "rad", "m"),
    "cosine": Word("nonlinearity once per turn, cosine part", "", "rad"),
    "sine": Word("nonlinearity once per turn, sine part", "", "rad"),
    "twice": Word("nonlinearity twice per turn, each part", "", "rad"),
    "noise": Word("white noise", "", "rad", "m"),
    "latency": Word("latency", "", "s"),
    "jitter": Word("jitter of the stamps", "", "s"),
    "dropouts": Word("share of rows dropped"),
}

KINDS = {
    "law": "windows all over the motion, friction fitted beside the inertia",
    "printed law": "α̂₂ driven by the error times −sin q₁, as the paper prints it",
    "consistent law": "α̂₂ driven by the error times its own regressor, as the proof requires",
    "smoothed velocities": "speeds by local cubics, which look ahead, in the place of observers",
    "all readings": "every reading by its sensor's noise",
    "mostly the angle": "the wheel's readings count a tenth",
    "mostly the wheel": "the angle's readings count a tenth",
    "mostly its first half": "the second half of the log counts a tenth",
    "mostly its second half": "the first half of the log counts a tenth",
    "swing": "each window inside one swing, away from the turning points",
    "even": "windows about the turning points, where friction that is odd in speed vanishes without any law",
}

EXTRA = {
    "motor_balance_residual": "left by the motor's balance",
    "angle_left": "left of the angle by the simulation",
    "wheel_left": "left of the wheel's angle by the simulation",
    "held_out_residual": "left in the second half as the first one predicts it, over what is expected",
    "loss_unexplained": "lost per swing beyond what the friction law explains",
}
"""Shares that a result may carry in `details.extra`."""

METHODS = {
    "momentum": "momentum balance on modulating functions of the measured angles; neither a speed nor a motor constant "
    "nor a friction law is needed",
    "energy": "energy balance of passes mirrored about the turning points, with speeds by smoothing",
    "output-error": "least squares of the simulated against the measured angles",
    "equation-error": "least squares of the equation of motion, with filtered angles and instrumental variables",
    "backstepping": "adaptation driven by the prediction error of the angle",
    "difference": "difference of two results of one rig, with and without the body",
}
"""The methods in words."""

DRIVES = {
    "reaction-wheel": "reaction wheel",
    "direct": "direct drive (torque or force known)",
    "motor": "motor on the axis (voltage known)",
    "none": "none (free decay)",
}


def parameter_word(name: str, *, linear: bool) -> Word:
    """An identified parameter in words; an unknown name stands for itself."""
    if name == "inertia":
        return Word("moving mass", "M") if linear else Word("moment of inertia", "J₁")
    if name == "angle_speed_bias":
        return Word("bias of the rate", "", "rad/s", "m/s")
    if name == "offset" and linear:
        return Word("constant force")
    over, slash, under = name.partition("/")
    if slash:
        ratio = [parameter_word(half, linear=linear) for half in (over, under)]
        symbol = " / ".join(half.symbol for half in ratio) if all(half.symbol for half in ratio) else name
        return Word(f"{ratio[0].words} over {ratio[1].words}", symbol)
    if name in TERMS:
        return RIG[TERMS[name].key] if TERMS[name].key else Word(TERMS[name].words)
    for table, key in ((CALIBRATED, name), (RIG, name), (RIG, f"drive.{name}")):
        if key in table:
            return table[key]
    return Word(name.replace("_", " "))
