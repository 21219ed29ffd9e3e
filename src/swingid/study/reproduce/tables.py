"""The numbers of a reproduction as tables of text, from its results alone: for the page, and for docs/paper.md."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from swingid.study.reproduce.published import FIG8, stated_in
from swingid.table import Table, plain

NOTHING = "–"

Row = tuple[str, ...]


def tables(results: dict[str, Any]) -> list[Table]:
    """All tables of `Reproduction.results`, or of the JSON it was written to."""
    paper = results["paper"]
    rows: dict[str, list[Row]] = {"glance": _glance(results), "unclear": _unclear()}
    printed = [_published(paper, "proposed", "the paper: proposed method"), _published(paper, "nls", "the paper: NLS")]
    for answers in results["experiment"]:
        rows[f"experiment-{answers['friction']}"] = printed + [_ways(row) for row in answers["rows"]]
    rows["balanced"] = list(_balanced(results))
    rows["controllers"] = list(_controllers(results))
    rows["simulation"] = _simulation(results)
    rows["backstepping"] = _convergence(results)
    if "imperfections" in results:
        rows["imperfections"] = list(_imperfections(results["imperfections"], paper["j_e_error"]))
    if "claims" in results:
        claims = results["claims"]
        rows["claims"] = [(f"“{row['claim']}”", row["test"], row["criterion"], row["verdict"]) for row in claims]
        rows["measurements"] = list(_measurements(claims))
    words = stated_in("tables")
    return [
        Table(plain(*words[key]["headings"]), tuple(cells), "paper", key, words[key]["title"], words[key]["caption"])
        for key, cells in rows.items()
    ]


def _unclear() -> list[Row]:
    """The places of the paper that are unclear: where, what is printed, what is done here, the tests that show why."""
    places = stated_in("unclear")["place"]
    return [(p["where"], p["printed"], p["here"], ", ".join(f"`{test}`" for test in p["tests"])) for p in places]


def _glance(results: dict[str, Any]) -> list[Row]:
    """What the paper reports, and what comes out here."""
    paper = results["paper"]
    errors = {
        experiment["friction"]: {row["way"]: row for row in experiment["rows"]} for experiment in results["experiment"]
    }

    def j_e(words: str, friction: str, estimator: str, case: str = "body") -> str:
        return f"{words} {signed(errors[friction][estimator][f'j_e_{case}'].get('error'))}"

    reading = {
        estimator: 100 * ((paper["a11_body"][estimator] - paper["j1"][estimator]) / paper["j_e"] - 1)
        for estimator in paper["j1"]
    }
    here = (
        j_e("(6) as printed", "viscous", "printed"),
        j_e("with speeds by the observers (23)", "viscous", "observers"),
        j_e("and the voltage through W_f", "viscous", "chain"),
    )
    slow_nls = j_e("the same, balanced and slow", "hidden", "nls", "balanced")
    alone = j_e("with viscous friction in its model alone", "hidden", "nls-viscous", "balanced")
    nls, momentum = (
        [j_e("viscous friction", "viscous", estimator), j_e("hidden dry friction", "hidden", estimator)]
        for estimator in ("nls", "momentum")
    )
    letter, letter_trapezoid, held, trapezoid = (signed(row["error"]) for row in results["simulation"]["rows"][:4])
    slow = next(row for row in results["simulation"]["backstepping"] if row["frequency"] == FIG8)
    simulated = (
        f"(6) letter by letter {letter}, with the work by the trapezoid {letter_trapezoid}; with the potential "
        f"energy of each pass's own nodes {held}, {trapezoid}"
    )
    law = f"printed law at {FIG8:g} rad/s {signed(slow['after_8_s'])}"
    return [
        ("J_e, proposed method", signed(reading["proposed"]), "; ".join(here)),
        ("J_e, NLS", signed(reading["nls"], 3), "; ".join([*nls, f"{slow_nls}, {alone}"])),
        ("J_e, momentum", NOTHING, "; ".join(momentum)),
        ("J1, ideal simulation at the paper's times", f"{paper['simulation_error']:g}, average", simulated),
        ("J1, backstepping after 8 s", f"{paper['backstepping'][0]:g}", law),
    ]


def _published(paper: dict[str, Any], estimator: str, words: str) -> tuple[str, ...]:
    j1, a11 = paper["j1"][estimator], paper["a11_body"][estimator]
    j_e = a11 - j1
    error = 100 * (j_e / paper["j_e"] - 1)
    read, ours = inertia(a11, 1), (inertia(j_e, 1), f"{error:+.1f}")
    return (words, inertia(j1, 1), NOTHING, read, NOTHING, read, *ours, NOTHING, NOTHING)


def _ways(row: dict[str, Any]) -> tuple[str, ...]:
    plain, body, j_e = row["plain"], row["body"], row["j_e_body"]
    loaded = (*_inertia(body), inertia(body.get("a11")))
    return (row["words"], *_inertia(plain), *loaded, *_inertia(j_e), _f1(plain), number(row["converged"], 2))


def _inertia(answer: dict[str, Any]) -> tuple[str, str]:
    """An identified inertia and its error; dashes where the method refused."""
    return inertia(answer.get("inertia")), signed(answer.get("error"))


def _f1(answer: dict[str, Any]) -> str:
    f1 = answer.get("f1")
    return NOTHING if f1 is None else number(1e5 * f1)


def _balanced(results: dict[str, Any]) -> Iterator[Row]:
    for pair in zip(*(experiment["rows"] for experiment in results["experiment"]), strict=True):
        errors = [signed(row[case].get("error")) for row in pair for case in ("balanced", "j_e_balanced")]
        yield pair[0]["words"], *errors


def _controllers(results: dict[str, Any]) -> Iterator[Row]:
    words = {"plain": "without the body, 8.5 rad/s", "body": "with the body, 6 rad/s", "balanced": "balanced, 2 rad/s"}
    answers, ideal = results["experiment"][0], results["simulation"]
    for case, name in words.items():
        run, first = answers["controller"][case], answers["first_interval"].get(case, {})
        voltages = (number(run["voltage_rms"]), number(run["voltage_peak"]))
        soon = (number(first.get("within 5 %")), number(first.get("within 1.4 %")))
        yield name, *_adaptation(run), number(1e3 * run["error_peak"]), *voltages, *soon
    yield "ideal simulation, gains of Fig. 7", *_adaptation(ideal), *(NOTHING,) * 5


def _adaptation(run: dict[str, Any]) -> tuple[str, str, str]:
    return number(run["k_tilde"]), number(run["settled"]), number(1e3 * run["error_rms"])


def _simulation(results: dict[str, Any]) -> list[Row]:
    average = f"{results['paper']['simulation_error']:g} (average)"
    rows = [(row["words"], *_inertia(row), _f1(row)) for row in results["simulation"]["rows"]]
    return [("the paper: its four times", NOTHING, average, NOTHING), *rows]


def _convergence(results: dict[str, Any]) -> list[Row]:
    error, after = results["paper"]["backstepping"]
    rows: list[Row] = [("the paper", "not printed", f"{error:g}", f"{after:g}", NOTHING)]
    for row in results["simulation"]["backstepping"]:
        times = (number(row["within_5"]), number(row["within_1"]))
        rows.append((f"{row['law']} law", number(row["frequency"], 2), signed(row["after_8_s"]), *times))
    return rows


def _imperfections(imperfections: list[dict[str, Any]], published: dict[str, float]) -> Iterator[Row]:
    for row in imperfections:
        several = row["draws"] > 1
        answers = [row.get(estimator, {}) for estimator in ("printed", "nls", "momentum")]
        texts = [signed(answer.get(key)) for answer in answers for key in ("j1", "j_e")]
        words = row["words"] + (f" (RMS of {row['draws']})" if several else "")
        shown = [text.lstrip("+") for text in texts] if several else texts
        yield words, *shown, _alone(row, published["proposed"])
        if "single" in row:
            yield "the same, (6) from one interval alone", number(row["single"], 2), *(NOTHING,) * 6


def _alone(row: dict[str, Any], wanted: float) -> str:
    """The size of an imperfection that alone gives the wanted error of J_e."""
    error = row["printed"]["j_e"]
    if row["size"] is None or not error or abs(error) * 4 < wanted:
        return NOTHING
    size, unit = row["size"]
    return f"{number(size * wanted / abs(error), 2)} {unit}"


def _measurements(claims: list[dict[str, Any]]) -> Iterator[Row]:
    for row in claims:
        groups: dict[str, list[str]] = {}
        for measured in row["measured"]:
            what, _, rest = measured["what"].rpartition(": ")
            text = _measured(measured)
            groups.setdefault(what or rest, []).append(f"{rest} {text}" if what else text)
        for place, (what, texts) in enumerate(groups.items()):
            yield f"“{row['claim']}”" if place == 0 else "", what, "; ".join(texts)


def _measured(measured: dict[str, Any]) -> str:
    """A number with its unit: errors with their sign, "±%" for sizes of errors."""
    value, unit = measured["value"], measured["unit"]
    if unit == "%":
        return f"{signed(value)}\u00a0%"
    if unit == "±%":
        return f"±\u00a0{number(value, 2, most=3)}\u00a0%"
    if unit == "" and value is not None and value == int(value):
        return f"{value:g}"
    return f"{number(value)}\u00a0{unit}".strip()


def number(value: float | None, digits: int = 3, most: int = 7) -> str:
    """A number to so many significant digits and at most so many places, without an exponent; a dash for None."""
    if value is None:
        return NOTHING
    rounded = float(f"{value:.{digits - 1}e}")
    if rounded == 0:
        return "0"
    places = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return f"{value:.{min(places, most)}f}".replace("-", "−")


def signed(value: float | None, digits: int = 2) -> str:
    """Per cent with their sign, to a thousandth at most; below half of that they are not worth one."""
    if value is None:
        return NOTHING
    if abs(value) < 5e-4:
        return "< 0.0005"
    text = number(value, digits, most=3)
    return text if text.startswith("−") else f"+{text}"


def inertia(value: float | None, places: int = 2) -> str:
    """An inertia in 10⁻⁵ kg m²."""
    return NOTHING if value is None else f"{1e5 * value:.{places}f}".replace("-", "−")
