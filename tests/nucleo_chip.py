"""A model of the STM32F446RE as firmware/hal/nucleo uses it, register by register, with two AS5048A and an H-bridge.

The processor is unicorn's and executes the very image; what stands here are the registers (ST RM0390), the encoders
(ams AS5048 data sheet) and the bridge's truth table. A write to a part without its clock is an error, as the chip would
lose it without a word. The interface is that of `swingid.live.devices.twin.Device`, so `TwinDevice` puts the
motion of a rig behind it.
"""

from __future__ import annotations

import struct
from collections import defaultdict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from swingid.live.guard import Readings

RCC, PWR, FLASH, IWDG = 0x40023800, 0x40007000, 0x40023C00, 0x40003000
GPIOA, GPIOB, GPIOC = 0x40020000, 0x40020400, 0x40020800
TIM1, TIM2, TIM6, SPI1, USART2 = 0x40010000, 0x40000000, 0x40001000, 0x40013000, 0x40004400
DMA1, SYSTEM, CPACR = 0x40026000, 0xE000_E000, 0xE000_ED88
FROM_HOST, TO_HOST = DMA1 + 0x10 + 5 * 0x18, DMA1 + 0x10 + 6 * 0x18
RESET_VALUES = {RCC: 0x83, RCC + 4: 0x24003010, PWR: 0xC000, GPIOA: 0xA8000000}
CLOCKED = {
    GPIOA: (0x30, 0),
    GPIOB: (0x30, 1),
    GPIOC: (0x30, 2),
    DMA1: (0x30, 21),
    TIM2: (0x40, 0),
    TIM6: (0x40, 4),
    USART2: (0x40, 17),
    PWR: (0x40, 28),
    TIM1: (0x44, 0),
    SPI1: (0x44, 12),
}
"""Parts, and the register and bit of RCC that give them a clock."""

SUPPLY = 12.0
TICK = 1000
"""Microseconds of a sample; `Chip.times` computes it from the registers."""

MOST = 180_000
"""Instructions of a sample at most: one a cycle, which no Cortex-M4 exceeds."""

DOG = 20
"""Samples without a feeding after which the watchdog resets the chip: 160 periods of 8 kHz."""


def even(word: int) -> int:
    """A word of 15 bits with the parity bit that makes its ones even."""
    return word | (word.bit_count() & 1) << 15


@dataclass
class As5048a:
    """An encoder on the bus: commands in, answers with the next frame. wire: what the line makes of an answer."""

    angle: int = 0
    diagnosis: int = 0x0180
    error: bool = False
    wire: Callable[[int], int] = lambda answer: answer
    _answer: int = 0
    _command: int = 0

    def transfer(self, word: int) -> int:
        """One frame of 16 bits."""
        self._command = word
        return self.wire(even(self._answer | self.error << 14))

    def deselected(self) -> None:
        """The end of a frame: the command counts, and its answer is that of this instant."""
        word, address = self._command, self._command & 0x3FFF
        self._answer = {0x3FFF: self.angle, 0x3FFD: self.diagnosis}.get(address, 0)
        if even(word & 0x7FFF) != word:
            self.error = True
        elif address == 1:
            self.error = False


@dataclass
class Chip:
    """The board: image in flash, encoders, bridge, line to the host.

    clock: whether the debugger gives its 8 MHz. line: bytes that the serial line carries in a sample, both ways; None:
    any number. hung: the processor gets the instructions of one sample a sample. `samples`: those it has begun.
    """

    image: bytes
    clock: bool = True
    line: int | None = None
    busy: bool = False
    hung: bool = False
    samples: int = 0
    resets: int = 0
    ticks: int = 0
    axis: As5048a = field(default_factory=As5048a)
    wheel: As5048a = field(default_factory=As5048a)
    writes: list[tuple[int, int]] | None = None

    def __post_init__(self) -> None:
        unicorn = pytest.importorskip("unicorn", reason="unicorn is not installed: pip install 'swingid[cortex]'")
        from unicorn import arm_const

        self._arm, self._unicorn = arm_const, unicorn
        self.cpu: Any = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self.cpu.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M4)
        self.cpu.mem_map(0x0800_0000, 1 << 19, unicorn.UC_PROT_READ | unicorn.UC_PROT_EXEC)
        self.cpu.mem_map(0x2000_0000, 1 << 17)
        self.cpu.mmio_map(0x4000_0000, 0x27000, self._read, 0x4000_0000, self._write, 0x4000_0000)
        self.cpu.mmio_map(SYSTEM, 0x1000, self._read, SYSTEM, self._write, SYSTEM)
        self.cpu.mem_write(0x0800_0000, self.image)
        self.vectors = struct.unpack("<16I", self.image[:64])
        self._waiting: deque[int] = deque()
        self._sent = bytearray()
        self._pc = 0
        self.reset()

    # ---- reset, time ----

    def reset(self, *, memory: bytes | None = None) -> None:
        """A reset: registers as RM0390 states, memory kept but where `memory` fills it, as after a loss of power."""
        self.registers: defaultdict[int, int] = defaultdict(int, RESET_VALUES)
        self._selected: As5048a | None = None
        self._received, self._spi, self._spi_time, self._frame = 0, 0, 0.0, 0.0
        self._unfed: int | None = None
        self._free = 0
        self.pending = False
        if memory is not None:
            self.cpu.mem_write(0x2000_0000, (memory * (1 << 17))[: 1 << 17])
        self.cpu.reg_write(self._arm.UC_ARM_REG_SP, self.vectors[0])
        self._pc = self.vectors[1]
        self._zero = self.ticks
        self.resets += 1

    def run(self, instructions: int = 0) -> None:
        """Let the processor go until it waits for a sample, or for so many instructions."""
        self.cpu.emu_start(self._pc | 1, 0xFFFF_FFFE, count=instructions)
        self._pc = self.cpu.reg_read(self._arm.UC_ARM_REG_PC)

    def counted(self, act: Callable[[], object]) -> list[int]:
        """Instructions while `act` lets it go, parted by the writes to the encoders' port and to the bridge's timer."""
        counts = [0]

        def count(*_: object) -> None:
            counts[-1] += 1

        def part(_cpu: Any, _kind: int, address: int, *_: object) -> None:
            if address in (SPI1 + 12, TIM1 + 0x34):
                counts.append(0)

        hooks = [
            self.cpu.hook_add(self._unicorn.UC_HOOK_CODE, count),
            self.cpu.hook_add(self._unicorn.UC_HOOK_MEM_WRITE, part),
        ]
        self.cpu.ctl_flush_tb()  # what is translated already would not be counted
        act()
        for hook in hooks:
            self.cpu.hook_del(hook)
        return counts

    def pass_time(self, samples: int = 1) -> None:
        """Samples that the firmware misses, as where it hangs: their time passes, and their instructions."""
        for _ in range(samples):
            self._pass()
            self.run(MOST)

    def _pass(self) -> None:
        """A sample's time passes: timer, line, watchdog."""
        self.ticks += 1
        self._spi_time = 0.0
        self.pending = bool(self.registers[TIM6] & 1)
        if self.registers[FROM_HOST] & 1:
            for _ in range(min(len(self._waiting), self.line or len(self._waiting))):
                self._dma_in(self._waiting.popleft())
        if self._unfed is not None:
            self._unfed += 1
            if self._unfed > DOG:
                self.reset()

    def tick(self, time: int, readings: Readings) -> float:
        """One sample: counts in, the voltage at the motor out."""
        del time
        self.axis.angle, self.wheel.angle = readings.axis % 2**14, readings.wheel % 2**14
        self._pass()
        self.run(MOST if self.hung else 0)
        return self.voltage()

    def times(self) -> dict[str, float]:
        """Frequencies (Hz) that the registers give: processor, samples, microseconds, PWM, line, encoders' clock."""
        r, pll = self.registers, self.registers[RCC + 4]
        source = 8e6 if pll >> 22 & 1 else 16e6
        core = source / (pll & 63) * (pll >> 6 & 511) / (2 * (pll >> 16 & 3) + 2)
        if r[RCC + 8] & 3 != 2:
            core = 16e6
        apb1, apb2 = (core / 2 ** max((r[RCC + 8] >> place & 7) - 3, 0) for place in (10, 13))

        def timer(base: int, bus: float) -> float:
            return bus * (1 if bus == core else 2) / (r[base + 0x28] + 1) / (r[base + 0x2C] + 1)

        return {
            "core": core,
            "samples": timer(TIM6, apb1),
            "microseconds": timer(TIM2, apb1) * (r[TIM2 + 0x2C] + 1),
            "pwm": timer(TIM1, apb2),
            "line": apb1 / r[USART2 + 8],
            "encoders": apb2 / 2 ** ((r[SPI1] >> 3 & 7) + 1),
        }

    # ---- pins ----

    def _pin(self, port: int, number: int) -> str | int:
        """ "float", "timer" (the alternate function), or the level of an output."""
        mode = self.registers[port] >> 2 * number & 3
        level = self.registers[port + 0x14] >> number & 1
        return level if mode == 1 else "timer" if mode == 2 else "float"

    def enabled(self) -> bool:
        """Whether the bridge's enable is high; a pin that floats is pulled down."""
        return self._pin(GPIOB, 10) == 1

    def voltage(self) -> float:
        """Mean voltage (V) at the motor over a cycle of the PWM."""
        r, pwm = self.registers, self._pin(GPIOA, 8)
        on = r[TIM1] & 1 and r[TIM1 + 0x20] & 1 and r[TIM1 + 0x44] >> 15
        duty = r[TIM1 + 0x34] / (r[TIM1 + 0x2C] + 1) if pwm == "timer" and on else float(pwm == 1)
        sign = 1.0 if self._pin(GPIOA, 9) == 1 else -1.0
        return sign * min(duty, 1.0) * SUPPLY if self.enabled() else 0.0

    # ---- line ----

    def receive(self, data: bytes) -> None:
        """Bytes of the host."""
        self._waiting.extend(data)

    def output(self) -> bytes:
        """What has gone to the host."""
        sent = bytes(self._sent)
        self._sent.clear()
        return sent

    def overrun(self) -> None:
        """The line loses a byte, as where nobody has taken the one before."""
        if self._waiting:
            self._waiting.popleft()
        self.registers[USART2] |= 1 << 3

    def _dma_in(self, byte: int) -> None:
        size = self.registers[FROM_HOST + 4]
        self.cpu.mem_write(self.registers[FROM_HOST + 12] + self._received % size, bytes([byte]))
        self._received += 1

    def _dma_out(self) -> None:
        assert self.registers[USART2 + 0x14] >> 7 & 1
        assert self.registers[TO_HOST + 8] == USART2 + 4
        size = self.registers[TO_HOST + 4]
        self._sent += bytes(self.cpu.mem_read(self.registers[TO_HOST + 12], size))
        self._free = self.ticks + (-(-size // self.line) if self.line else 0)

    # ---- registers ----

    def _clocked(self, address: int) -> None:
        if (clock := CLOCKED.get(address & ~0x3FF)) is not None:
            assert self.registers[RCC + clock[0]] >> clock[1] & 1, f"{address:#x} has no clock"

    def _read(self, _cpu: Any, offset: int, _size: int, base: int) -> int:
        address = base + offset
        value = self.registers[address]
        if address == TIM6 + 0x10:
            value = int(self.pending)
            self.samples += self.pending
            if not self.pending:
                self.cpu.emu_stop()
        elif address == SPI1 + 8:
            value = 1
        elif address == SPI1 + 12:
            value = self._spi
        elif address == TIM2 + 0x24:
            value = (self.ticks - self._zero) * TICK + int(self._spi_time)
        elif address == RCC:
            value |= (self.clock and value >> 16 & 1 and value >> 18 & 1) << 17 | (value >> 24 & 1) << 25
        elif address == RCC + 8:
            value |= (value & 3) << 2
        elif address == PWR + 4:
            value = self.registers[PWR] & 3 << 16
        elif address == FROM_HOST + 4:
            value = self.registers[address] - self._received % (self.registers[address] or 1)
        elif address == TO_HOST:
            value = value & ~1 | (self.ticks < self._free)
        elif address == USART2 + 4:
            self.registers[USART2] &= ~(1 << 3)
        return int(value)

    def _write(self, _cpu: Any, offset: int, _size: int, value: int, base: int) -> None:
        address = base + offset
        if self.writes is not None:
            self.writes.append((address, value))
        self._clocked(address)
        if address in (GPIOA + 0x18, GPIOB + 0x18, GPIOC + 0x18):
            level = address - 4
            self.registers[level] = self.registers[level] & ~(value >> 16) | value & 0xFFFF
            self._select()
        elif address == IWDG:
            self._feed(value)
        elif address == TIM6 + 0x10:
            self.pending = False
        else:
            self.registers[address] = value
            if address == SPI1 + 12:
                self._frame = self._frame or 16e6 / self.times()["encoders"]
                self._spi_time += self._frame
                self._spi = 0xFFFF if self._selected is None else self._selected.transfer(value)
            elif address == TIM2 and value & 1:
                self._zero = self.ticks
            elif address == TO_HOST and value & 1:
                self._dma_out()

    def _feed(self, value: int) -> None:
        if value == 0xCCCC or (value == 0xAAAA and self._unfed is not None):
            self._unfed = 0

    def _select(self) -> None:
        low = [
            encoder
            for encoder, port, pin in ((self.axis, GPIOB, 6), (self.wheel, GPIOC, 7))
            if self._pin(port, pin) == 0
        ]
        assert len(low) < 2, "both encoders drive the line"
        now = low[0] if low else None
        if self._selected is not None and now is not self._selected:
            self._selected.deselected()
        self._selected = now
