"""One look for all figures of the report, and their way into the page as inline SVG."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape

import numpy as np

from swingid.format import RAISED
from swingid.numerics.arrays import Array
from swingid.result.plot import GREY, INK, PALE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure


WIDTH = 6.8
"""Width of every figure in inches, 653 CSS pixels."""

PREFIXES = ((1e-7, 1e9, "n"), (1e-4, 1e6, "µ"), (0.1, 1e3, "m"))

RULES: dict[Any, Any] = {
    "figure.constrained_layout.use": True,
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.unicode_minus": True,
    "grid.color": PALE,
    "grid.linewidth": 0.7,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "text.color": INK,
    "lines.linewidth": 1.1,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "hatch.linewidth": 0.6,
    "path.simplify": True,
    "text.parse_math": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "swingid",
}
"""Text stays text (readable, searchable, small); it is measured in DejaVu Sans, which is at least as wide as what
browsers put in its place."""


@contextmanager
def house_style() -> Iterator[None]:
    """The rules above for the figures drawn inside, whatever the user's own matplotlib settings are."""
    import matplotlib

    with matplotlib.rc_context(), warnings.catch_warnings():
        # a name in a script that DejaVu lacks is measured badly, but shown well by the browser's own fonts
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(RULES)
        yield


def new_figure(height: float, rows: int = 1, **panels: Any) -> tuple[Figure, list[Axes]]:
    """A figure of the common width and so many inches of height, its panels row by row; no pyplot, so no global state.

    panels: as of matplotlib's `subplots`.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height))
    return figure, list(figure.subplots(rows, squeeze=False, **panels).ravel())


def name_rows(axes: Axes, names: Sequence[str]) -> None:
    """One row of the vertical axis per name, the first on top."""
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)


def points(colour: str, marker: str = "o", **look: Any) -> dict[str, Any]:
    """The look of points with bars, for matplotlib's `errorbar`."""
    return {"fmt": marker, "ms": 5, "mew": 0, "color": colour, "elinewidth": 1.2, "capsize": 2.5} | look


def beside(axes: Axes, row: float, text: str) -> None:
    """Text at the right of a row, outside the axes."""
    place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "va": "center"}
    axes.annotate(text, (1.0, row), (6, 0), size=8.5, **place)


def legend_above(axes: Axes, columns: int = 3) -> None:
    """A legend over the axes, where it covers no data."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=columns,
            borderaxespad=0.2,
            handlelength=1.6,
            columnspacing=1.4,
        )


def plain_powers(axis: Axis) -> None:
    """Ticks of a logarithmic axis at powers of ten: 0.01, and 10⁻⁵ where plain digits would be many.

    Where fewer than two powers are in view, 2 and 5 times a power are labelled too.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator

    def between(value: float, _: int | None) -> str:
        low, high = np.log10(axis.get_view_interval())
        leading = round(value / 10 ** np.floor(np.log10(value)))
        return f"{value:g}" if np.floor(high) - np.ceil(low) < 1 and leading in (2, 5) else ""

    axis.set_major_locator(LogLocator(numticks=7))
    axis.set_major_formatter(FuncFormatter(lambda value, _: power_text(value)))
    axis.set_minor_formatter(FuncFormatter(between))


def power_text(value: float) -> str:
    """A power of ten as text for a tick."""
    if 1e-4 < value < 1e5 or value <= 0.0:
        return f"{value:g}".replace("-", "−")
    return "10" + f"{round(np.log10(value))}".translate(RAISED)


def prefixed(values: Array, unit: str) -> tuple[float, str]:
    """Factor and unit with the prefix (m, µ, n) that makes small values readable: 0.002 rad → (1000, 'mrad')."""
    finite = np.abs(values[np.isfinite(values)])
    peak = float(finite.max()) if finite.size else 0.0
    for limit, factor, prefix in PREFIXES:
        if 0 < peak < limit:
            return factor, prefix + unit
    return 1.0, unit


def envelope(time: Array, values: Array, bins: int = 900) -> tuple[Array, Array]:
    """Choose at most about 2·`bins` of the samples, such that a drawn line covers what all of them would.

    Each of `bins` equal parts of the log keeps its smallest and its largest sample in their order, so peaks survive. A
    gap of more than five sampling steps is broken by NaN instead of bridged; NaN samples are breaks too.
    """
    if len(time) > 2 * bins:
        edges = np.unique(np.linspace(0, len(time), bins + 1).astype(np.int64))
        filled_low, filled_high = (
            np.where(np.isnan(values), np.inf, values),
            np.where(np.isnan(values), -np.inf, values),
        )
        parts = list(pairwise(edges.tolist()))
        lowest = [begin + int(np.argmin(filled_low[begin:end])) for begin, end in parts]
        highest = [begin + int(np.argmax(filled_high[begin:end])) for begin, end in parts]
        kept = np.unique([0, *lowest, *highest, len(time) - 1])
    else:
        kept = np.arange(len(time))
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    gaps = np.nonzero(np.diff(time) > 5 * step)[0]
    shown_time, shown = time[kept], values[kept]
    breaks = np.unique(np.searchsorted(kept, gaps, side="right"))
    breaks = breaks[(breaks > 0) & (breaks < len(kept))]
    return np.insert(shown_time, breaks, shown_time[breaks - 1]), np.insert(shown, breaks, np.nan)


def to_svg(figure: Figure, name: str, title: str) -> str:
    """The figure as an inline <svg> element: ids prefixed by `name`, nothing outside referred to.

    `title` is for screen readers. Two calls give the same text.
    """
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :].strip()
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    used = set(re.findall(r"(?:url\(#|href=\"#)([^)\"]+)", text))
    text = re.sub(r' id="([^"]+)"', lambda m: f' id="{name}-{m[1]}"' if m[1] in used else "", text)
    text = re.sub(r"(url\(#|href=\"#)", rf"\g<1>{name}-", text)
    label = escape(title, {'"': "&quot;"})
    width, height = figure.get_size_inches() * 96
    opening = (
        f'<svg class="plot" role="img" aria-label="{label}" viewBox="0 0 {width * 0.75:g} {height * 0.75:g}" '
        f'width="{width:.0f}" height="{height:.0f}" xmlns="http://www.w3.org/2000/svg" '
        'xmlns:xlink="http://www.w3.org/1999/xlink">'
    )
    return re.sub(r"<svg[^>]*>", lambda _: opening, text, count=1)
