"""What the device of foreign_device.py computes: the ranges of the parameters, the control law, the guard."""

from collections import deque
from collections.abc import Callable, Sequence
from math import exp, inf, isfinite

DONE, WRONG_STATE, BAD_VALUE, BAD_PARAMETERS, NO_PARAMETERS = range(5)
WRONG_SESSION, GAP, FULL, NO_REFERENCE, OVER_LIMIT = range(5, 10)

NO_FAULT, HEARTBEAT, ANGLE, SPEED, WHEEL_SPEED, VOLTAGE, CURRENT = range(7)
AXIS_FROZEN, WHEEL_FROZEN, AXIS_JUMP, WHEEL_JUMP, OVERRUN, ENCODER = range(7, 13)


def _within(low: float, high: float, whole: bool = False) -> Callable[[float], bool]:
    return lambda x: low <= x <= high and (not whole or x == int(x))


def _above(x: float) -> bool:
    return 0.0 < x < inf


_TO_INF = _within(0.0, inf)
_RANGES: list[Callable[[float], bool]] = [
    lambda x: isfinite(x) and x != 0.0,
    isfinite,
    _within(-(2.0**31), 2.0**31 - 1.0, whole=True),
    lambda x: x in (-1.0, 1.0),
    isfinite,
    lambda x: 0.0 <= x < inf,
    _above,
    _above,
    _TO_INF,
    _above,
    _TO_INF,
    _TO_INF,
    _TO_INF,
    _TO_INF,
    _within(1.0, 60000.0, whole=True),
    _within(0.0, 60000.0, whole=True),
    _within(1.0, 31.0, whole=True),
    _within(0.0, 4.0, whole=True),
    isfinite,  # h: compared with 1 / rate by parameters_fit
    isfinite,
    isfinite,
    isfinite,
    _TO_INF,
    lambda x: 0.0 <= x < 1.0,
    lambda x: 0.0 <= x < 1.0,
    isfinite,
    isfinite,
    lambda x: 0.0 < x <= inf,
    isfinite,
    isfinite,
    isfinite,
    isfinite,
]


def parameters_fit(p: Sequence[float], rate: float) -> bool:
    """Whether every value is in its range and there are as many as the controller's order asks for."""
    if len(p) < 33 or not all(fits(value) for fits, value in zip(_RANGES, p, strict=False)):
        return False
    return len(p) == 33 + 2 * int(p[17]) and p[18] == 1.0 / rate and all(map(isfinite, p[32:]))


class Law:
    """The compensator of one run, its state at Arm; `voltage` is one sample of it."""

    def __init__(self, p: Sequence[float]):
        self.order, self.h = int(p[17]), p[18]
        self.threshold, self.growth, self.sigma0, self.most = p[19], p[20] * p[18], p[21], p[22]
        self.error_decay, self.wheel_share, self.sign = p[23], 1.0 - p[24], p[25]
        self.differentiate = p[26] != 0.0
        self.limit, self.coulomb, self.dead_negative, self.dead_positive, self.back_emf = p[27:32]
        self.alpha, self.k = list(p[32 : 33 + self.order]), list(p[33 + self.order :])
        self.gain, self.filtered, self.memory = p[5], 0.0, None
        self.xi = [0.0] * self.order

    def voltage(self, reference: float, angle: float, wheel: float) -> float:
        e = reference - angle
        gain = grown = self.gain
        tested = self.filtered if self.error_decay > 0.0 else e
        if abs(tested) > self.threshold:
            grown = max(gain, min(gain + self.growth, self.most))
        u = self.sign * self._output(e, gain, (grown - gain) / self.h)
        memory = wheel if self.memory is None else self.memory
        change = (wheel - memory) * self.wheel_share
        self.memory = memory + change
        speed = change / self.h
        if speed != 0.0:
            u += self.coulomb if speed > 0.0 else -self.coulomb
        switch = u - self.back_emf * speed
        if switch > 0.0:
            u += self.dead_positive
        elif switch < 0.0:
            u += self.dead_negative
        self._move(e, self.sigma0 * self.h * (gain * gain + gain * grown + grown * grown) / 3.0)
        self.filtered = e + (self.filtered - e) * self.error_decay
        self.gain = grown
        return -self.limit if u < -self.limit else self.limit if u > self.limit else u

    def _output(self, e: float, gain: float, slope: float) -> float:
        """alpha(p) of k~ xi1 (20), or k~ times alpha(p) of xi1 (15), at the start of the sample."""
        if self.order == 0:
            return self.alpha[0] * gain * e
        if self.order == 1:
            xi = self.xi[0]
            first = gain * (self.sigma0 * gain * gain * self.k[0] * (e - xi))
            if self.differentiate:
                first += slope * xi
            return self.alpha[0] * first + self.alpha[1] * gain * xi
        taylor = self._taylor(e, gain, slope)
        total, factorial = 0.0, 1.0
        for power in range(self.order + 1):
            factorial *= max(power, 1)
            term = gain * taylor[power]
            if self.differentiate and power:
                term += slope * taylor[power - 1]
            total += self.alpha[self.order - power] * factorial * term
        return total

    def _taylor(self, e: float, gain: float, slope: float) -> list[float]:
        """Coefficients of t^0 to t^n of xi1, from xi' = sigma(t) (A xi + b e), sigma(t) = sigma0 (k~ + k~' t)^2."""
        sigma = (self.sigma0 * gain * gain, 2.0 * self.sigma0 * gain * slope, self.sigma0 * slope * slope)
        states, drives = [list(self.xi)], []  # of each power of t: xi, and A xi + b e
        for power in range(self.order):
            xi = states[power]
            last = (self.k[0] * e if power == 0 else 0.0) - sum(k * x for k, x in zip(self.k, xi, strict=True))
            drives.append([*xi[1:], last])
            states.append(
                [
                    sum(sigma[m] * drives[power - m][j] for m in range(min(power, 2) + 1)) / (power + 1)
                    for j in range(self.order)
                ]
            )
        return [state[0] for state in states]

    def _move(self, e: float, turn: float) -> None:
        if self.order == 1:
            x = self.k[0] * turn
            self.xi[0] = e + (self.xi[0] - e) * (exp(-x) if x > 0.0 else 1.0)
        elif self.order > 1:
            move = _exponential(self.k, turn)
            away = [self.xi[0] - e, *self.xi[1:]]
            self.xi = [sum(m * a for m, a in zip(row, away, strict=True)) for row in move]
            self.xi[0] += e


def _product(a: list[list[float]], b: list[list[float]]) -> list[list[float]]:
    return [[sum(x * y for x, y in zip(row, column, strict=True)) for column in zip(*b, strict=True)] for row in a]


def _exponential(k: list[float], turn: float) -> list[list[float]]:
    """exp of the chain's companion matrix times `turn`: 14 terms of a halved matrix, then squared again."""
    n = len(k)
    a = [[turn if j == i + 1 else 0.0 for j in range(n)] for i in range(n - 1)] + [[-c * turn for c in k]]
    size, halvings = max(sum(map(abs, row)) for row in a), 0
    while size > 0.5 and halvings < 64:
        size, halvings = 0.5 * size, halvings + 1
    scaled = [[x * 0.5**halvings for x in row] for row in a]
    unit = [[float(i == j) for j in range(n)] for i in range(n)]
    result = unit
    for term in range(14, 0, -1):
        step = _product(scaled, result)
        result = [[unit[i][j] + step[i][j] / term for j in range(n)] for i in range(n)]
    for _ in range(halvings):
        result = _product(result, result)
    return result


class Limits:
    """The guard: follows readings in every state (`track`), judges them in a run (`verdict`, `hold`)."""

    def __init__(self, rate: float, board_limit: float):
        period = 1e6 / rate
        self.late_after = int(1.5 * period)
        self.dead_after = 100_000 - int(min(period, 50_000.0))
        self.board_limit = board_limit
        self.past: deque[tuple[int, int]] = deque(maxlen=32)
        self.late, self.time, self.calm, self.heard = False, 0, 0, 0
        self.axis = self.wheel = self.axis_change = self.wheel_change = self._raw_axis = self._raw_wheel = 0
        self._clear()

    def _clear(self) -> None:
        self.fresh, self.missing, self.axis_still, self.wheel_still, self.saturated = True, 0, 0, 0, 0

    def arm(self, p: Sequence[float]) -> None:
        self._clear()
        self.axis_step, self.wheel_step, self.zero = p[0], p[1], int(p[2])
        self.angle, self.speed, self.wheel_speed, self.voltage, self.current, self.axis_jump, self.wheel_jump = p[6:13]
        self.frozen_voltage, self.frozen, self.most_saturated, self.span = p[13], p[14], p[15], int(p[16])
        self.voltage = min(self.voltage, self.board_limit)
        self.duration = p[16] * p[18]

    def track(self, time: int, axis: int, wheel: int, valid: bool, busy: bool) -> None:
        if not self.past:
            self.axis, self.wheel, self.calm = axis, wheel, time
            self.past.extend([(axis, wheel)] * 31)
        else:
            self.late = (time - self.time) & 0xFFFFFFFF > self.late_after
            change = (axis - self._raw_axis) & 0xFFFFFFFF
            self.axis_change = change - 2**32 if change >= 2**31 else change
            change = (wheel - self._raw_wheel) & 0xFFFFFFFF
            self.wheel_change = change - 2**32 if change >= 2**31 else change
            self.axis += self.axis_change
            self.wheel += self.wheel_change
        self.time, self._raw_axis, self._raw_wheel = time, axis, wheel
        self.past.append((self.axis, self.wheel))
        if not busy:
            self.calm = time
        if self.fresh:
            self.fresh, self.heard = False, self.calm
        self.missing = 0 if valid else min(self.missing + 1, 60000)

    def verdict(self, held: float, current: float) -> tuple[int, float]:
        """The fault of this sample and its value; `held`: the voltage up to it."""
        driven, wheeled = abs(held) >= self.frozen_voltage, self.wheel_step != 0.0
        self.axis_still = self.axis_still + 1 if driven and not self.axis_change else 0
        self.wheel_still = self.wheel_still + 1 if driven and wheeled and not self.wheel_change else 0
        if self.late:
            return OVERRUN, 0.0
        age = (self.time - self.heard) & 0xFFFFFFFF
        if age >= self.dead_after:
            return HEARTBEAT, float(age)
        if self.missing >= 5:
            return ENCODER, float(self.missing)
        if abs(self.axis_change) > self.axis_jump:
            return AXIS_JUMP, float(self.axis_change)
        if wheeled and abs(self.wheel_change) > self.wheel_jump:
            return WHEEL_JUMP, float(self.wheel_change)
        angle = (self.axis - self.zero) * self.axis_step
        if abs(angle) > self.angle:
            return ANGLE, angle
        axis, wheel = self.past[-1 - self.span]
        speed = (self.axis - axis) * self.axis_step / self.duration
        if abs(speed) > self.speed:
            return SPEED, speed
        speed = (self.wheel - wheel) * self.wheel_step / self.duration
        if abs(speed) > self.wheel_speed:
            return WHEEL_SPEED, speed
        if abs(current) > self.current:
            return CURRENT, current
        if self.axis_still >= self.frozen:
            return AXIS_FROZEN, float(self.axis_still)
        if self.wheel_still >= self.frozen:
            return WHEEL_FROZEN, float(self.wheel_still)
        return NO_FAULT, 0.0

    def hold(self, voltage: float) -> tuple[int, float, bool]:
        """The fault, the voltage to apply, whether it was clamped."""
        if not isfinite(voltage):
            return VOLTAGE, 0.0, False
        size, clamped = abs(voltage), False
        self.saturated = self.saturated + 1 if size >= self.voltage else 0
        if size > self.voltage:
            clamped, voltage = True, self.voltage if voltage > 0.0 else -self.voltage
        return (VOLTAGE if self.saturated > self.most_saturated else NO_FAULT), voltage, clamped
