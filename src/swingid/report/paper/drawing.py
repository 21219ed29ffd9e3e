"""Figures 2 to 8 of the paper as files: SVG for the page, PNG for everything else, in one style."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swingid.report.style import house_style, to_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.study.reproduce import Reproduction

DOTS = 150
"""Dots per inch of the PNG files."""


@dataclass(frozen=True)
class Drawing:
    """A figure of the paper: its number, its caption there, what differs here, and its pictures."""

    number: int
    caption: str
    here: str
    svg: str
    png: bytes

    def files(self) -> dict[str, bytes]:
        """File names and contents."""
        return {f"fig{self.number}.svg": self.svg.encode("utf-8"), f"fig{self.number}.png": self.png}


def drawn_figures(reproduction: Reproduction) -> list[Drawing]:
    """All figures of a reproduction; the same one gives the same bytes."""
    from swingid.report.paper import experiment, simulation

    runs, ideal = reproduction.experiment.runs, reproduction.simulation
    with house_style():
        return [
            *(_drawing(k, *EXPERIMENT[k], experiment.DRAW[k](runs)) for k in EXPERIMENT),
            _drawing(7, *SIMULATION[7], simulation.draw_fig7(ideal.log)),
            _drawing(8, *SIMULATION[8], simulation.draw_fig8(ideal)),
        ]


def _drawing(number: int, caption: str, here: str, figure: Figure) -> Drawing:
    svg = to_svg(figure, f"fig{number}", f"Figure {number}. {caption}")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DOTS, metadata={"Software": None})
    return Drawing(number, caption, here, svg, buffer.getvalue())


WHOLE = "Above the whole run, below the last two seconds of the part that is identified."

EXPERIMENT = {
    2: ("Tracking errors e with (dashed) and without (solid) body (no filtering)", f"{WHOLE} Dotted: ± δ0."),
    3: ("Pendulum angular velocity q1' with (dashed) and without (solid) body", f"{WHOLE} The twin's true velocity."),
    4: ("Wheel angular velocity q2' with (dashed) and without (solid) body", f"{WHOLE} The twin's true velocity."),
    5: ("Control signal u0 with (dashed) and without (solid) body", f"{WHOLE} Dotted: the limit of ± 10 V."),
    6: (
        "Tuning parameter k̃ complete with filter W_f(p)",
        "With (dashed) and without (solid) body; grey: from 15 to 22 s, where the intervals lie.",
    ),
}
SIMULATION = {
    7: (
        "Pendulum angle q1 of the control system (solid), program trajectory (dashed), tracking error (1) e and "
        "tunable parameter (2)",
        "The colours are the paper's: q1 green, reference blue, e red, 0.005 k̃ brown. Below, around the paper's four "
        "times; angle and reference lie on each other, so e is drawn 100 times as large there.",
    ),
    8: (
        "Identification error J1 − Ĵ1",
        "Backstepping with the paper's gains; band: ± 5 %, dotted: the paper's 8 s; below, ten times as large. The "
        "paper does not print the motion, and leaves an error out of its proof (consistent law); its 5 % after 8 s is "
        "nearly met by the printed law at 2 rad/s (thick).",
    ),
}
