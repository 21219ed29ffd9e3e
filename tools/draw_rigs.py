"""Draw docs/images/rigs/*.svg: one sketch per kind of rig, for docs/which-rig.md; legible on light and dark pages."""

from __future__ import annotations

import math
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "images" / "rigs"

WIDTH, HEIGHT = 260, 190

STYLE = """
.ink { stroke: #333; fill: none; stroke-width: 2.2; stroke-linecap: round; stroke-linejoin: round }
.thin { stroke: #333; fill: none; stroke-width: 1.2; stroke-linecap: round }
.body { stroke: #1f6fb2; fill: #1f6fb2; fill-opacity: .22; stroke-width: 2.2 }
.drive { stroke: #c4571a; fill: #c4571a; fill-opacity: .2; stroke-width: 2.2 }
.arrow { stroke: #c4571a; fill: none; stroke-width: 2 }
.angle { stroke: #1f6fb2; fill: none; stroke-width: 1.6 }
.size { stroke: #1f6fb2; fill: none; stroke-width: 1 }
text { font: 13px sans-serif; fill: #333 }
.b { fill: #1f6fb2 } .d { fill: #c4571a }
@media (prefers-color-scheme: dark) {
  .ink, .thin { stroke: #ddd } text { fill: #ddd }
  .body, .angle, .size { stroke: #6db3ee } .body { fill: #6db3ee } .b { fill: #6db3ee }
  .drive, .arrow { stroke: #f0955a } .drive { fill: #f0955a } .d { fill: #f0955a }
}
"""


def line(x1: float, y1: float, x2: float, y2: float, kind: str = "ink") -> str:
    """A straight line."""
    return f'<line class="{kind}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def circle(x: float, y: float, r: float, kind: str = "ink") -> str:
    """A circle."""
    return f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}"/>'


def box(x: float, y: float, w: float, h: float, kind: str = "body", round_: float = 3) -> str:
    """A rectangle with rounded corners."""
    return f'<rect class="{kind}" x="{x:.1f}" y="{y:.1f}" width="{w:.1f}" height="{h:.1f}" rx="{round_:.1f}"/>'


def words(x: float, y: float, text: str, kind: str = "", anchor: str = "middle") -> str:
    """A label."""
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'


def turned(x: float, y: float, degrees: float, parts: list[str]) -> str:
    """Parts that are drawn about the origin, hanging down, turned about it and put to a place."""
    return f'<g transform="translate({x:.1f} {y:.1f}) rotate({degrees:.1f})">{"".join(parts)}</g>'


def arc(x: float, y: float, r: float, first: float, last: float, kind: str = "angle", squash: float = 1.0) -> str:
    """An arc with an arrow head; degrees from downwards, counter-clockwise; squash: of an ellipse seen flat."""

    def at(degrees: float, radius: float) -> tuple[float, float]:
        a = math.radians(degrees)
        return x + radius * math.sin(a), y + squash * radius * math.cos(a)

    (x1, y1), (x2, y2) = at(first, r), at(last, r)
    sweep, large = int(last < first), int(abs(last - first) > 180)
    back = last - math.copysign(9 * 45 / max(r, 20), last - first)
    head = [at(back, r + 4), at(last, r), at(back, r - 4)]
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in head)
    path = (
        f'<path class="{kind}" d="M {x1:.1f} {y1:.1f} A {r:.1f} {squash * r:.1f} 0 {large} {sweep} {x2:.1f} {y2:.1f}"/>'
    )
    return path + f'<polyline class="{kind}" points="{points}"/>'


def ground(x: float, y: float, half: float = 34) -> list[str]:
    """A ceiling with hatching above it."""
    hatch = [line(x + d, y, x + d + 7, y - 7, "thin") for d in range(int(-half), int(half) - 3, 9)]
    return [line(x - half, y, x + half, y), *hatch]


def pivot(x: float, y: float) -> list[str]:
    """A bearing that hangs from a ceiling."""
    return [*ground(x, y - 18), line(x - 10, y - 18, x, y), line(x + 10, y - 18, x, y), circle(x, y, 4, "ink")]


def pendulum(x: float, y: float, degrees: float, length: float = 95, bob: float = 15) -> str:
    """A rod with a weight."""
    return turned(x, y, degrees, [box(-4, 0, 8, length, "body"), circle(0, length, bob, "body")])


def weight(x: float, y: float, degrees: float, length: float, aside: float = 22, bob: float = 15) -> list[str]:
    """Where m g and l of a pendulum are measured; aside: of the line of l from the rod."""
    a = math.radians(-degrees)
    end = x + length * math.sin(a), y + length * math.cos(a)
    far = aside * math.cos(a), -aside * math.sin(a)
    first, last = (x + far[0], y + far[1]), (end[0] + far[0], end[1] + far[1])
    middle = (first[0] + last[0]) / 2 + 8, (first[1] + last[1]) / 2
    foot = end[1] + bob + 26
    return [
        line(*first, *last, "size"),
        *[
            line(
                px - far[0] / aside * 4,
                py - far[1] / aside * 4,
                px + far[0] / aside * 4,
                py + far[1] / aside * 4,
                "size",
            )
            for px, py in (first, last)
        ],
        words(*middle, "l", "b"),
        line(end[0], end[1] + bob, end[0], foot, "size"),
        line(end[0] - 4, foot - 7, end[0], foot, "size"),
        line(end[0] + 4, foot - 7, end[0], foot, "size"),
        words(end[0] + 8, foot, "m g", "b", "start"),
    ]


def driven_wheel() -> list[str]:
    """The paper's rig."""
    wheel = [box(-4, 0, 8, 92, "body"), circle(0, 92, 30, "drive"), line(-30, 92, 30, 92, "arrow"), circle(0, 92, 5)]
    return [
        *pivot(118, 34),
        line(118, 34, 118, 110, "thin"),
        turned(118, 34, -24, wheel),
        arc(118, 34, 62, 0, 22),
        words(102, 112, "q₁", "b", "start"),
        arc(155.4, 118, 39, 20, 95, "arrow"),
        words(198, 146, "q₂", "d", "start"),
        *weight(118, 34, -24, 80, aside=38, bob=45),
        words(8, 150, "wheel J₂", "d", "start"),
        words(8, 168, "weighed, measured", "", "start"),
    ]


def free_pendulum() -> list[str]:
    """A body on a bearing that swings freely."""
    return [
        *pivot(120, 34),
        line(120, 34, 120, 130, "thin"),
        pendulum(120, 34, -28),
        arc(120, 34, 66, 0, 26),
        words(131, 118, "q", "b"),
        *weight(120, 34, -28, 95),
    ]


def strings() -> list[str]:
    """A wire, two strings and three strings, seen from the side."""
    found = []
    for x, tops, ends, name in (
        (45, (0,), (0,), "wire k"),
        (130, (-22, 22), (-22, 22), "bifilar"),
        (215, (-27, 4, 27), (-24, 6, 24), "trifilar"),
    ):
        found += ground(x, 24, 32)
        found += [line(x + a, 24, x + b, 110, "thin") for a, b in zip(tops, ends, strict=True)]
        found += [f'<ellipse class="body" cx="{x}" cy="114" rx="34" ry="11"/>', arc(x, 130, 30, -55, 55, squash=0.45)]
        found.append(words(x, 172, name))
    found += [words(116, 66, "L", "b"), line(108, 100, 152, 100, "size"), words(130, 96, "d", "b")]
    found += [words(201, 66, "L", "b"), line(215, 114, 239, 110, "size"), words(229, 107, "r", "b")]
    return found


def direct() -> list[str]:
    """A known torque on the axis."""
    return [
        *pivot(120, 40),
        circle(120, 40, 17, "drive"),
        pendulum(120, 40, -28, 88),
        arc(120, 40, 30, -140, -40, "arrow"),
        words(70, 72, "τ", "d"),
        line(120, 40, 120, 128, "thin"),
        arc(120, 40, 66, 0, 26),
        words(131, 124, "q", "b"),
        *weight(120, 40, -28, 88),
    ]


def servo() -> list[str]:
    """A motor on the axis with a voltage."""
    return [
        box(84, 18, 62, 44, "drive", 6),
        words(14, 82, "motor, gear", "d", "start"),
        circle(115, 50, 6, "ink"),
        pendulum(115, 50, -28, 80, 13),
        line(84, 40, 40, 40, "arrow"),
        words(30, 44, "u", "d"),
        line(115, 50, 115, 132, "thin"),
        arc(115, 50, 62, 0, 26),
        words(126, 130, "q", "b"),
        *weight(115, 50, -28, 80, aside=45, bob=13),
    ]


def flywheel() -> list[str]:
    """A wheel that runs down, and the same wheel made to swing."""
    return [
        circle(74, 92, 46, "body"),
        circle(74, 92, 5, "ink"),
        arc(74, 92, 58, 120, 215),
        words(74, 172, "runs down"),
        line(130, 92, 152, 92, "arrow"),
        words(141, 84, "+ m", "d"),
        circle(204, 92, 40, "body"),
        circle(204, 92, 5, "ink"),
        circle(216, 122, 9, "drive"),
        arc(204, 92, 52, -18, 24),
        words(204, 172, "swings"),
    ]


def gyro() -> list[str]:
    """A phone on a swinging body."""
    phone = [box(-4, 0, 8, 70, "body"), box(-16, 62, 32, 58, "body", 5), box(-11, 69, 22, 40, "ink", 2)]
    return [
        *pivot(120, 34),
        line(120, 34, 120, 130, "thin"),
        turned(120, 34, -24, phone),
        arc(120, 34, 132, 8, 40, "arrow"),
        words(226, 132, "q′", "d"),
        words(62, 150, "rate, deg/s", "d"),
    ]


def cart() -> list[str]:
    """A carriage on a rail under a known force."""
    return [
        line(20, 126, 240, 126),
        *[line(x, 126, x - 8, 134, "thin") for x in range(28, 245, 12)],
        box(86, 76, 84, 38, "body"),
        circle(104, 119, 7, "ink"),
        circle(152, 119, 7, "ink"),
        line(34, 95, 80, 95, "arrow"),
        line(80, 95, 72, 90, "arrow"),
        line(80, 95, 72, 100, "arrow"),
        words(52, 86, "F", "d"),
        line(128, 60, 190, 60, "angle"),
        line(190, 60, 182, 55, "angle"),
        line(190, 60, 182, 65, "angle"),
        words(200, 64, "x", "b"),
        words(128, 100, "M", "b"),
    ]


RIGS = {
    "driven-wheel": driven_wheel,
    "free-pendulum": free_pendulum,
    "strings": strings,
    "direct": direct,
    "servo": servo,
    "flywheel": flywheel,
    "gyro": gyro,
    "cart": cart,
}


def picture(name: str) -> str:
    """The SVG of a kind of rig."""
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{name}">'
    return "\n".join([head, f"<style>{STYLE}</style>", *RIGS[name](), "</svg>", ""])


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    for rig in RIGS:
        (FOLDER / f"{rig}.svg").write_text(picture(rig), encoding="utf-8")
