"""Valid files of phones, of axes of a body, and calculations with units: what the newer readers are fuzzed with."""

from __future__ import annotations

import io
import random
import zipfile
from functools import cache

import numpy as np

from fuzz.mutations import VALUES, mutated
from phone_files import archive, text, workbook

ROWS = 40
TIME = np.arange(ROWS) / 50.0
RATES = [0.1 * np.cos(5 * TIME), 0.2 * np.sin(5 * TIME), 2.5 * np.cos(5 * TIME)]
HEADER = "Time (s)|Gyroscope x (rad/s)|Gyroscope y (rad/s)|Gyroscope z (rad/s)"
LOGGER = "time|seconds_elapsed|z|y|x"


def _members() -> dict[str, str]:
    """Files of an archive, as both apps write them."""
    return {
        "Gyroscope": text(HEADER, TIME, *RATES),
        "Accelerometer": text("Time (s)|Acceleration x (m/s^2)", TIME, RATES[0]),
        "TotalAcceleration": text(LOGGER, 1.7e18 + 1e9 * TIME, TIME, *RATES),
        "meta__device": "property,value\nversion,1\n",
    }


@cache
def archive_files() -> tuple[bytes, ...]:
    """Zip archives, packed and not (so that a flipped bit reaches the text)."""
    members = _members()
    return (
        archive(**members),
        archive(zipfile.ZIP_DEFLATED, **members),
        archive(Gyroscope=text(LOGGER, 1.7e18 + 1e9 * TIME, TIME, *RATES)),
        archive(Raw__Data=members["Gyroscope"].replace(",", ";").replace(".", ",")),
    )


def damaged_archive(draw: random.Random) -> bytes:
    """An archive with damaged bytes, or a whole one with damaged texts."""
    if draw.random() < 0.5:
        return mutated(draw.choice(archive_files()), archive_files(), draw)
    members = {name: content.encode() for name, content in _members().items()}
    others = tuple(members.values())
    for name in draw.sample(list(members), draw.choice((1, 2))):
        members[name] = mutated(members[name], others, draw)
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", draw.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as zipped:
        for name, content in members.items():
            zipped.writestr(f"{name.replace('__', '/')}{draw.choice(('.csv', '.csv', '.txt', '.bin'))}", content)
    return sink.getvalue()


def _sheets() -> dict[str, list[list[object]]]:
    """Sheets of a workbook of phyphox."""
    numbers = [[float(cell) for cell in row] for row in zip(TIME, *RATES, strict=True)]
    return {
        "Gyroscope": [list(HEADER.split("|")), *numbers],
        "Accelerometer": [["Time (s)", "Acceleration x (m/s^2)"], *(row[:2] for row in numbers)],
        "Empty": [],
        "Metadata Device": [["property", "value"], ["version", "1.2.0"]],
    }


@cache
def workbook_files() -> tuple[bytes, ...]:
    """Workbooks of Excel, with a plain header, and with a title of merged cells and a line of units."""
    sheets = _sheets()
    titled = [["My phone", None, None, None], ["Time", "x", "y", "z"], ["s", "rad/s", "rad/s", "rad/s"]]
    return workbook(sheets), workbook({"Gyroscope": [*titled, *sheets["Gyroscope"][1:]]}, merged=("A1:D1",))


CELLS: tuple[object, ...] = (
    *(None, "", " ", "x", "1,5", "1e999", "nan", float("1e308"), float("5e-324"), -0.0, "=1/0", "#DIV/0!", "A" * 500),
    *("<c/>", "&amp;", "Time (s)", "12:00:00", "rad/s"),
)


def damaged_workbook(draw: random.Random) -> bytes:
    """A workbook with damaged bytes, or a whole one with strange cells, rows and titles."""
    if draw.random() < 0.5:
        return mutated(draw.choice(workbook_files()), workbook_files(), draw)
    sheets = _sheets()
    for rows in sheets.values():
        for _ in range(draw.choice((0, 0, 1, 5)) if rows else 0):
            row = draw.choice(rows[:3] if draw.random() < 0.6 else rows)
            if row:
                row[draw.randrange(len(row))] = draw.choice(CELLS)
        if rows and draw.random() < 0.2:
            rows.insert(draw.randrange(3), [draw.choice(CELLS)] * draw.choice((0, 1, 3, 9)))
    names = {title: draw.choice((title, title, "Gyro", title[:1])) for title in sheets}
    unique = {f"{names[title]}{k or ''}": rows for k, (title, rows) in enumerate(sheets.items())}
    return workbook(unique, merged=draw.choice(((), ("A1:D1",), ("A1:A9", "B1:C1"))))


AXES = """
[body]
mass = "1.234 ± 0.001 kg"
gravity = "9.81265 ± 0.00002 m/s^2"
centre_of_mass = ["0 mm", "1 ± 0.1 mm", "0 mm"]
[mounting.cube]
rotation = "0.03 deg"
[every_axis]
tilt = "0.05 deg"
"""


@cache
def axes_files() -> tuple[bytes, ...]:
    """Files of axes for `swingid tensor`: distances, points, gravity torques, a mounting and a fixture."""
    directions = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, -1, 0))
    levers = ('distance = "0 mm"', 'distance = "3 ± 0.1 mm"', 'gravity_torque = "30 ± 1 mN*m"', "point = [0, 0, 0.001]")
    matrix = np.array([[2.0, 0.1, -0.05], [0.1, 1.5, 0.02], [-0.05, 0.02, 1.0]])
    found = []
    for lever in levers:
        parts = [AXES]
        for k, direction in enumerate(directions):
            unit = np.array(direction) / np.linalg.norm(direction)
            parts.append(f'[[axis]]\nname = "{k}"\ninertia = "{unit @ matrix @ unit + 0.1:.6f} ± 0.0002 g*m^2"\n')
            more = 'mounting = "cube"\nfixture = "0.1 ± 0.001 g*m^2"\n' if k < 3 else ""
            parts.append(f"direction = {list(direction)}\n{lever}\n{more}")
        found.append("".join(parts).encode())
    return tuple(found)


RIGS = (
    '[axis.bifilar]\nmass = "1.2 ± 0.001 kg"\nlength = "1.2 m"\ndistance = "0.45 ± 0.001 m"\nlatitude = "52 deg"\n',
    '[axis.trifilar]\nmass = "unknown"\nheight = "1 m"\nradius = "0.1 m"\nupper_radius = "0.15 m"\ng = 9.81\n',
    '[axis.suspension]\nstiffness = "0.05 ± 0.001 N*m/rad"\nshape = 0.1\nheight = 1\n',
    '[axis]\nmass = "107 ± 1 g"\nlever = "0.1 m + 130 ± 1 mm"\ng = "9.81 m/s^2"\n[log]\nangle_speed = "Gyroscope z"\n'
    'angle_speed_unit = "deg/s"\nangle_speed_scale = "1 ± 0.01"\n[sensors.angle_speed]\nnoise = "0.05 deg/s"\n',
    '[axis]\ngravity_torque = "0.107 ± 0.001 kg * 9.81 m/s^2 * 0.23 m"\n[log]\nangle_scale = "61 ± 0.2 deg"\n'
    'angle_offset = "0 ± 1 deg"\n',
    '[axis]\nstiffness = "unknown"\nspring_zero = "3 deg"\n',
)


@cache
def further_rigs() -> tuple[bytes, ...]:
    """Rig files of suspensions, rates, scales, springs, and of a motor on the axis."""
    motor = '[axis]\ngravity_torque = "unknown"\n[drive]\nkind = "motor"\n[drive.motor]\ntorque_constant = 0.01\n'
    motor += (
        'resistance = "2 ± 0.1 ohm"\ngear_ratio = 4\ngear_friction = "unknown"\n[log]\nvoltage_scale = "12 V/255"\n'
    )
    return (*(f'{text}[drive]\nkind = "none"\n'.encode() for text in RIGS), motor.encode())


PARTS = (
    *(
        "0.107",
        "9.81",
        "1e3",
        "1e308",
        "0",
        "-2",
        "±",
        "+/-",
        "+-",
        "0.001",
        "0.5 %",
        "kg",
        "m/s^2",
        "mm",
        "N*m",
        "rad",
    ),
    *(
        "rad",
        "deg",
        "g*cm^2",
        "1/min",
        "Hz",
        "degC",
        "dB",
        "parsec",
        "µm",
        "Ω",
        "*",
        "/",
        " + ",
        " - ",
        "^2",
        "**9",
        "^-1",
    ),
    *("(", ")", "{", ",", "π", "1_0", "nan", "inf", "__import__", "lambda", "9**9**9", "µ" * 40, " ", "²", "·", "×"),
)
UNITS = ("kg", "N*m", "kg*m^2", "m", "rad", "m/s^2", "", "N*m/rad", "rad/s", "V")


def calculation(draw: random.Random) -> tuple[object, str]:
    """A calculation with units, whole or not, and the unit that is expected."""
    if draw.random() < 0.1:
        return draw.choice(VALUES), draw.choice(UNITS)
    if draw.random() < 0.4:
        whole = "0.107 ± 0.001 kg * 9.81 m/s^2 * (0.23 ± 0.001 m + 3 cm)"
        return mutated(whole.encode(), (b"1 kg", b"(2 m)"), draw).decode("utf-8", "replace"), draw.choice(UNITS)
    return draw.choice(("", " ")).join(draw.choices(PARTS, k=draw.randint(1, 14))), draw.choice(UNITS)
