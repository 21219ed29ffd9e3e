"""The STM32 sketch executed on a simulated processor: what it does to the bridge, the clock and the watchdog."""

from __future__ import annotations

import functools
import importlib.util
import re
import struct
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

from firmware_build import CORE, FIRMWARE, FLAGS, folder
from live_host import encode
from swingid.live.frames import Decoder

HERE = FIRMWARE / "hal" / "stm32"
RCC, GPIOA, GPIOB, TIM1, TIM2 = 0x40023800, 0x40020000, 0x40020400, 0x40010000, 0x40000000
TIM6, SPI1, USART2, IWDG = 0x40001000, 0x40013000, 0x40004400, 0x40003000
PLLCFGR, CFGR, MODER, BSRR, CCR1 = RCC + 4, RCC + 8, 0, 0x18, TIM1 + 0x34
NMI, USART2_VECTOR = 2, 16 + 38


@functools.cache
def image(crystal: int) -> Path:
    """ELF file of the sketch without a unit for floats, which the simulated processor does not need to switch on."""
    for package in ("ziglang", "unicorn"):
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"{package} is not installed (pip install 'swingid[cortex]'), which executing the sketch needs")
    text = (HERE / "main.c").read_text().replace("#define CRYSTAL 8u", f"#define CRYSTAL {crystal}u")
    source, target = folder() / f"stm32-{crystal}.c", folder() / f"stm32-{crystal}.elf"
    source.write_text(text)
    options = ["-target", "thumb-freestanding-eabi", "-mcpu=cortex_m4", "-ffreestanding", *FLAGS]
    command = [sys.executable, "-m", "ziglang", "cc", *options, f"-I{CORE}", f"-I{FIRMWARE / 'hal' / 'encoders'}"]
    command += [*map(str, sorted(CORE.glob("*.c"))), str(source), "-T", str(HERE / "memory.ld"), "-o", str(target)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return target


class Board:
    """The processor with the registers that the sketch waits for; all writes to registers are noted.

    crystal: whether it starts. Each tick of TIM6 is a sample; `sent` is what the host got.
    """

    def __init__(self, *, crystal: bool = True, megahertz: int = 8) -> None:
        unicorn = pytest.importorskip("unicorn", reason="unicorn is not installed: pip install 'swingid[cortex]'")
        from unicorn import arm_const

        self._arm, self._crystal = arm_const, crystal
        self.cpu: Any = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self.cpu.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M4)
        self.cpu.mem_map(0x0800_0000, 1 << 20)
        self.cpu.mem_map(0x2000_0000, 1 << 17)
        self.cpu.mmio_map(0x4000_0000, 0x30000, self._read, 0x4000_0000, self._write, 0x4000_0000)
        self.cpu.mmio_map(0xE000_E000, 0x1000, self._read, 0xE000_E000, self._write, 0xE000_E000)
        elf = image(megahertz).read_bytes()
        first, count = struct.unpack_from("<I", elf, 28)[0], struct.unpack_from("<H", elf, 44)[0]
        for i in range(count):
            kind, offset, _, address, size = struct.unpack_from("<5I", elf, first + 32 * i)
            if kind == 1 and size:
                self.cpu.mem_write(address, elf[offset : offset + size])
        self.vectors = struct.unpack("<55I", bytes(self.cpu.mem_read(0x0800_0000, 220)))
        self.registers: defaultdict[int, int] = defaultdict(int)
        self.writes: list[tuple[int, int]] = []
        self.samples = self._wanted = 0
        self.waiting, self.sent = b"", bytearray()
        self.spi_answers = True

    def _read(self, _cpu: Any, offset: int, _size: int, base: int) -> int:
        address = base + offset
        value = self.registers[address]
        if address == RCC:
            value |= (value & 1 << 16 and self._crystal) << 17 | (value >> 24 & 1) << 25
        elif address == CFGR:
            value |= (value & 3) << 2
        elif address == TIM6 + 0x10:
            value = int(self.samples < self._wanted)
            self.samples += value
            if not value:
                self.cpu.emu_stop()
        elif address == TIM2 + 0x24:
            value = self.samples * 1000 % 2**32
        elif address == SPI1 + 8:
            value = int(self.spi_answers)
        elif address == USART2:
            value = 1 << 7 | bool(self.waiting) << 5
        elif address == USART2 + 4:
            value, self.waiting = self.waiting[0], self.waiting[1:]
        return int(value)

    def _write(self, _cpu: Any, offset: int, _size: int, value: int, base: int) -> None:
        self.registers[base + offset] = value
        self.writes.append((base + offset, value))
        if base + offset == USART2 + 4:
            self.sent.append(value)

    def run(self, vector: int = 1, *, samples: int = 10**9, instructions: int = 10**9) -> None:
        """Go from a vector's function; ends after so many further samples, or instructions."""
        self._wanted = self.samples + samples
        if vector == 1:
            self.cpu.reg_write(self._arm.UC_ARM_REG_SP, self.vectors[0])
        self.cpu.emu_start(self.vectors[vector] | 1, 0x2001_FFF0, count=instructions)

    def interrupt(self) -> None:
        """One interrupt of the UART; the loop goes on where it was."""
        kept = self.cpu.context_save()
        self.cpu.reg_write(self._arm.UC_ARM_REG_SP, self.cpu.reg_read(self._arm.UC_ARM_REG_SP) - 64)
        self.cpu.reg_write(self._arm.UC_ARM_REG_LR, 0x2001_FFF1)
        self.cpu.emu_start(self.vectors[USART2_VECTOR] | 1, 0x2001_FFF0)
        self.cpu.context_restore(kept)

    def go_on(self, samples: int) -> None:
        """So many further samples."""
        self._wanted = self.samples + samples
        self.cpu.emu_start(self.cpu.reg_read(self._arm.UC_ARM_REG_PC) | 1, 0x2001_FFF0)

    def place(self, address: int, bits: int = 0, value: int = 0) -> int:
        """Place among the writes of the first to a register whose bits have a value; -1 for none."""
        found = (i for i, (to, what) in enumerate(self.writes) if to == address and what & bits == value)
        return next(found, -1)

    def fed(self, since: int = 0) -> int:
        """How often the watchdog was fed after so many writes."""
        return self.writes[since:].count((IWDG, 0xAAAA))

    def bridge_is_off(self) -> bool:
        """Whether both pins are plain outputs, last set to 0."""
        a, b = ([what for to, what in self.writes if to == port + BSRR] for port in (GPIOA, GPIOB))
        outputs = self.registers[GPIOA] >> 16 & 3 == 1 and self.registers[GPIOB] & 3 == 1
        last_a = next(what for what in reversed(a) if what & (1 << 24 | 1 << 8))
        return outputs and bool(last_a & 1 << 24) and bool(b[-1] & 1 << 16)


def test_the_bridge_is_off_before_the_clocks_are_touched() -> None:
    board = Board()
    board.run(samples=3)
    clock = board.place(RCC)
    for port, pin in ((GPIOA, 8), (GPIOB, 0)):
        low, output = (
            board.place(port + BSRR, 1 << 16 + pin, 1 << 16 + pin),
            board.place(port, 3 << 2 * pin, 1 << 2 * pin),
        )
        assert 0 <= low < output < clock
    taken_over = board.place(GPIOA, 3 << 16, 2 << 16)
    assert 0 <= board.place(CCR1) < taken_over
    assert [what for to, what in board.writes if to == CCR1] == [0] * len([1 for to, _ in board.writes if to == CCR1])


@pytest.mark.parametrize("megahertz", [8, 12, 25])
def test_it_runs_from_the_crystal_and_watches_it(megahertz: int) -> None:
    board = Board(megahertz=megahertz)
    board.run(samples=5)
    value = board.registers[PLLCFGR]
    source = megahertz if value >> 22 & 1 else 16
    assert source / (value & 63) * (value >> 6 & 511) / (2 * (value >> 16 & 3) + 2) == 168
    assert value >> 22 & 1
    watched = board.place(RCC, 1 << 19, 1 << 19)
    assert 0 <= watched < board.place(CFGR, 3, 2)
    assert board.fed(board.place(CFGR)) >= 4
    assert (IWDG, 0xCCCC) in board.writes[: board.place(RCC)]


def test_without_a_crystal_it_never_starts() -> None:
    board = Board(crystal=False)
    board.run(instructions=5_000_000)
    assert board.place(CFGR) == board.place(PLLCFGR) == board.place(TIM1) == -1
    assert board.bridge_is_off()
    assert board.samples == 0
    assert board.fed() > 100_000  # 10 cycles a look at 16 MHz: a crystal has 60 ms and more
    given_up = len(board.writes)
    board.cpu.emu_start(board.cpu.reg_read(board._arm.UC_ARM_REG_PC) | 1, 0x2001_FFF0, count=100_000)
    assert board.fed(given_up) == 0  # the watchdog resets it


@pytest.mark.parametrize("vector", [NMI, 3, 4, 5, 6])
def test_a_crystal_that_fails_and_a_fault_of_the_processor_let_go_of_the_bridge(vector: int) -> None:
    board = Board()
    board.run(samples=5)
    assert not board.bridge_is_off()
    since = len(board.writes)
    board.run(vector, instructions=100_000)
    assert board.bridge_is_off()
    assert board.fed(since) == 0


def test_a_host_is_answered_while_another_floods() -> None:
    board = Board()
    board.run(samples=3)
    board.waiting = encode("Who") + b"\x55" * 5000
    for _ in range(100):
        for _ in range(100):  # a line of 1 Mbaud that is full
            board.interrupt()
        board.go_on(1)
    frames = Decoder().feed(bytes(board.sent))
    assert frames[0].name == "Hello"
    samples = [frame.sequence for frame in frames if frame.name == "Sample"]
    assert len(samples) > 90
    assert samples == list(range(samples[0], samples[0] + len(samples)))


def test_an_encoder_that_does_not_answer_holds_nothing_up() -> None:
    board = Board()
    board.spi_answers = False
    board.run(samples=20, instructions=5_000_000)
    assert board.samples == 20


def test_a_number_that_is_no_crystals_is_refused() -> None:
    text = (HERE / "main.c").read_text()
    assert re.search(r"#if CRYSTAL < 4 \|\| CRYSTAL > 26\n#error", text)
