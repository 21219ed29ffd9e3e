"""The numbers of a reproduction as tables of text, from its results alone: for the page, and for docs/paper.md."""

from __future__ import annotations

import math
from typing import Any

from swingid.study.reproduce.published import FIG8, unclear
from swingid.table import Table, plain

_UNITS = (
    "Inertias in 10⁻⁵ kg m², errors in %, f1 in 10⁻⁵ N m s; last column: s of log from the start of the run from which "
    "on J1 stays within 1.4 %. The twin: J1 = 302.2, J1 + J_e = 398.3, J_e = 96.1, f1 = 26"
)

TWINS = {
    "viscous": (
        "The experiment, friction viscous as in the paper",
        f"{_UNITS}. The true J1 of the paper's rig is not known; its a11' is read as J1 + J_e, and its "
        "118.4 for the J_e of NLS as 381.0 − 272.6 (misprints).",
    ),
    "hidden": (
        "The experiment, with dry friction that no method has in its model",
        f"{_UNITS}, and beside it Stribeck friction of 2 mN m, 4 mN m towards rest (0.3 rad/s). "
        "f1 is what a method calls the viscous part.",
    ),
}
"""Title and caption of the experiment's table, by the friction of its twin."""

NOTHING = "–"


def tables(results: dict[str, Any]) -> list[Table]:
    """All tables of `Reproduction.results`, or of the JSON it was written to."""
    every = [_glance(results), _unclear()]
    every += [_experiment(experiment, results["paper"]) for experiment in results["experiment"]]
    every += [_balanced(results), _controllers(results), _simulation(results), _convergence(results)]
    if "imperfections" in results:
        every.append(_imperfections(results["imperfections"], results["paper"]["j_e_error"]))
    if "claims" in results:
        every += [_verdicts(results["claims"]), _measurements(results["claims"])]
    return every


def _table(key: str, title: str, caption: str, headings: tuple[str, ...], rows: tuple[tuple[str, ...], ...]) -> Table:
    return Table(plain(*headings), rows, "paper", key, title, caption)


def _unclear() -> Table:
    rows = tuple(
        (row["where"], row["printed"], row["here"], ", ".join(f"`{test}`" for test in row["tests"]))
        for row in unclear()
    )
    caption = "What is printed, what stands here instead, and the test that shows it."
    return _table("unclear", "Misprints and gaps of the paper", caption, ("where", "printed", "here", "test"), rows)


def _glance(results: dict[str, Any]) -> Table:
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
    rows = (
        ("J_e, proposed method", signed(reading["proposed"]), "; ".join(here)),
        ("J_e, NLS", signed(reading["nls"], 3), "; ".join([*nls, f"{slow_nls}, {alone}"])),
        ("J_e, momentum", NOTHING, "; ".join(momentum)),
        ("J1, ideal simulation at the paper's times", f"{paper['simulation_error']:g}, average", simulated),
        ("J1, backstepping after 8 s", f"{paper['backstepping'][0]:g}", law),
    )
    return _table("glance", "At a glance", "Errors in %.", ("", "the paper", "here"), rows)


def _experiment(answers: dict[str, Any], paper: dict[str, Any]) -> Table:
    printed = [_published(paper, "proposed", "the paper: proposed method"), _published(paper, "nls", "the paper: NLS")]
    rows = [_ways(row) for row in answers["rows"]]
    return _table(
        f"experiment-{answers['friction']}",
        *TWINS[answers["friction"]],
        ("", "J1", "error", "J1 + J_e", "error", "a11'", "J_e", "error", "f1", "1.4 % from"),
        (*printed, *rows),
    )


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


def _balanced(results: dict[str, Any]) -> Table:
    rows = []
    for viscous, hidden in zip(*(experiment["rows"] for experiment in results["experiment"]), strict=True):
        cells = [viscous["words"]]
        for row in (viscous, hidden):
            cells += [signed(row["balanced"].get("error")), signed(row["j_e_balanced"].get("error"))]
        rows.append(tuple(cells))
    return _table(
        "balanced",
        "The balanced pendulum, 0.8 sin 2t",
        "Errors in %. The body is on the far side of the axis, b = 0; J_e is the difference to the run without the "
        "body. Backstepping divides by b and cannot say anything.",
        ("", "J1 + J_e, viscous", "J_e, viscous", "J1 + J_e, hidden dry", "J_e, hidden dry"),
        tuple(rows),
    )


def _controllers(results: dict[str, Any]) -> Table:
    words = {"plain": "without the body, 8.5 rad/s", "body": "with the body, 6 rad/s", "balanced": "balanced, 2 rad/s"}
    rows = []
    answers, ideal = results["experiment"][0], results["simulation"]
    for case, name in words.items():
        run, first = answers["controller"][case], answers["first_interval"].get(case, {})
        voltages = (number(run["voltage_rms"]), number(run["voltage_peak"]))
        soon = (number(first.get("within 5 %")), number(first.get("within 1.4 %")))
        rows.append((name, *_adaptation(run), number(1e3 * run["error_peak"]), *voltages, *soon))
    rows.append(("ideal simulation, gains of Fig. 7", *_adaptation(ideal), *(NOTHING,) * 5))
    return _table(
        "controllers",
        "The controller, and how soon (6) is right",
        "Times in s from the start, tracking error in mrad, voltage in V (15 to 22 s). The last two columns: from when "
        "on (6), interval by interval, stays within 5 % and 1.4 %.",
        ("", "k̃ at the end", "grows until", "e, RMS", "e, peak", "u0, RMS", "u0, peak", "5 % from", "1.4 % from"),
        tuple(rows),
    )


def _adaptation(run: dict[str, Any]) -> tuple[str, str, str]:
    return number(run["k_tilde"]), number(run["settled"]), number(1e3 * run["error_rms"])


def _simulation(results: dict[str, Any]) -> Table:
    paper = results["paper"]
    rows = [("the paper: its four times", NOTHING, f"{paper['simulation_error']:g} (average)", NOTHING)]
    rows += [(row["words"], *_inertia(row), _f1(row)) for row in results["simulation"]["rows"]]
    return _table(
        "simulation",
        "The ideal simulation of Fig. 7",
        "J1 in 10⁻⁵ kg m², its error in %, f1 in 10⁻⁵ N m s. The twin: 302.2 and 26. Ideal angles, 10 kHz.",
        ("", "J1", "error", "f1"),
        tuple(rows),
    )


def _convergence(results: dict[str, Any]) -> Table:
    error, after = results["paper"]["backstepping"]
    rows = [("the paper", "not printed", f"{error:g}", f"{after:g}", NOTHING)]
    for row in results["simulation"]["backstepping"]:
        times = (number(row["within_5"]), number(row["within_1"]))
        rows.append((f"{row['law']} law", number(row["frequency"], 2), signed(row["after_8_s"]), *times))
    return _table(
        "backstepping",
        "The backstepping controller of Fig. 8",
        "Error of J1 in % after 8 s, and the times in s from which on it stays within 5 % and 1 % (12 s "
        "were simulated).",
        ("", "motion, rad/s", "after 8 s", "within 5 % from", "within 1 % from"),
        tuple(rows),
    )


def _imperfections(imperfections: list[dict[str, Any]], published: dict[str, float]) -> Table:
    rows = []
    for row in imperfections:
        several = row["draws"] > 1
        cells = [row["words"] + (f" (RMS of {row['draws']})" if several else "")]
        for estimator in ("printed", "nls", "momentum"):
            errors = row.get(estimator, {})
            texts = [signed(errors.get("j1")), signed(errors.get("j_e"))]
            cells += [text.lstrip("+") for text in texts] if several else texts
        rows.append((*cells, _alone(row, published["proposed"])))
        if "single" in row:
            rows.append(("the same, (6) from one interval alone", number(row["single"], 2), *(NOTHING,) * 6))
    return _table(
        "imperfections",
        "One imperfection at a time",
        "Errors in % of the paper's method ((6), mirrored about the measured turning points), of NLS (viscous + "
        "Coulomb, under the voltage) and of momentum; – where a search for the least squares did not converge. With "
        "wrong motor constants the sum of squares has several minima, and NLS gives only the size of its error. Last"
        " column: how large the imperfection has to be to give J_e by (6) the paper's 7 % alone, by proportion, "
        "where at most four times the size of the row. Rows on how (6) is computed have nothing to say of the other "
        "two. A nonlinearity makes the wheel drift, so that intervals meet it at other phases and their mean is off "
        "by less than one alone.",
        ("", "(6): J1", "(6): J_e", "NLS: J1", "NLS: J_e", "momentum: J1", "momentum: J_e", "for 7 %"),
        tuple(rows),
    )


def _alone(row: dict[str, Any], wanted: float) -> str:
    """The size of an imperfection that alone gives the wanted error of J_e."""
    error = row["printed"]["j_e"]
    if row["size"] is None or not error or abs(error) * 4 < wanted:
        return NOTHING
    size, unit = row["size"]
    return f"{number(size * wanted / abs(error), 2)} {unit}"


def _verdicts(claims: list[dict[str, Any]]) -> Table:
    rows = tuple((f"“{row['claim']}”", row["test"], row["criterion"], row["verdict"]) for row in claims)
    return _table(
        "claims",
        "The claims of the conclusion",
        "Each with a test on the twin and a criterion; the verdict follows from the numbers of the next table. Where a "
        "sentence names no accuracy, 1.4 % is required: what the paper reports of its own ideal simulation.",
        ("claim", "test", "criterion", "verdict"),
        rows,
    )


def _measurements(claims: list[dict[str, Any]]) -> Table:
    rows = []
    for row in claims:
        groups: dict[str, list[str]] = {}
        for measured in row["measured"]:
            what, _, rest = measured["what"].rpartition(": ")
            text = _measured(measured)
            groups.setdefault(what or rest, []).append(f"{rest} {text}" if what else text)
        for place, (what, texts) in enumerate(groups.items()):
            rows.append((f"“{row['claim']}”" if place == 0 else "", what, "; ".join(texts)))
    return _table("measurements", "What the claims were measured by", "", ("claim", "what", "measured"), tuple(rows))


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
