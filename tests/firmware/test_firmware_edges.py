"""Edges of a wheel that Arduino's AVR boards count, by executing the sketch's interrupt in simavr."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from firmware_build import FIRMWARE

ARDUINO = Path("/usr/share/arduino/hardware/arduino/avr")
BOARDS = {"Uno": ("atmega328p", "standard"), "Mega": ("atmega2560", "mega")}
CLOCK = 16e6


def cycles(board: str, folder: Path) -> int:
    """Cycles of an edge at most, of eight that are all counted."""
    missing = [name for name in ("avr-g++", "simavr") if shutil.which(name) is None]
    if missing or not ARDUINO.is_dir():
        pytest.skip("apt-get install gcc-avr avr-libc simavr arduino-core-avr, which executing for an AVR needs")
    chip, variant = BOARDS[board]
    core = ARDUINO / "cores" / "arduino"
    paths = (
        core,
        ARDUINO / "variants" / variant,
        FIRMWARE / "hal" / "encoders",
        FIRMWARE / "hal" / "arduino" / "swingid",
    )
    options = ["-Os", "-flto", f"-mmcu={chip}", f"-DF_CPU={CLOCK:.0f}L", "-DARDUINO=10819", "-ffunction-sections"]
    sources = [core / name for name in ("WInterrupts.c", "wiring_digital.c", "wiring.c")]
    command = ["avr-g++", *options, "-Wl,--gc-sections", *(f"-I{path}" for path in paths)]
    command += [str(FIRMWARE / "tests" / "edges.cpp"), "-x", "c", *map(str, sources), "-o", str(folder / "edges.elf")]
    subprocess.run(command, check=True, capture_output=True)
    run = ["simavr", "-m", chip, "-f", f"{CLOCK:.0f}", str(folder / "edges.elf")]
    said = subprocess.run(run, capture_output=True, text=True, timeout=60)
    *each, counted = (int(number) for number in re.findall(r"(\d+)\.\s", said.stdout + said.stderr))
    assert (len(each), counted) == (8, 8)
    return max(each)


@pytest.mark.parametrize("board", BOARDS)
def test_the_table_of_the_readme_has_the_edges_that_a_board_follows(board: str, tmp_path: Path) -> None:
    """Two edges of one track may follow within half of their mean distance: half of what one after the other gives."""
    row = next(
        line for line in (FIRMWARE / "README.md").read_text().splitlines() if line.startswith(f"| Arduino {board} ")
    )
    stated = [int(cell.replace(" ", "")) for cell in re.findall(r"\| ([\d ]+?) (?=\|)", row)]
    most = cycles(board, tmp_path)
    assert stated[0] == pytest.approx(most, rel=0.02)
    assert stated[1] == pytest.approx(CLOCK / (2 * most), rel=0.02)
