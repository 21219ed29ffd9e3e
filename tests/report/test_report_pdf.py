"""The report as PDF: its content, its attachments, its fonts and pages, and text that is never executed."""

from __future__ import annotations

import builtins
import io
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import factories
from swingid.cli.app import run
from swingid.errors import InputError
from swingid.model.rig import Rig
from swingid.recording.recording import Source
from swingid.report import write_report
from swingid.report.certificate import load_certificate
from swingid.report.measurement import render
from swingid.report.pdf import shown_text
from swingid.result.result import Message, Result
from swingid.uncertainty.budget import BudgetEntry, Parameter, scatter, stated
from swingid.uncertainty.freedom import coverage_factor, effective_freedom

pypdf = pytest.importorskip("pypdf", reason="needs pypdf")
pytest.importorskip("typst", reason="needs pip install 'swingid[pdf]'")

LAB = """
[laboratory]
name = "Rig laboratory"
address = "Example Street 1"
[laboratory.accreditation]
body = "Example Accreditation Service"
number = "EX-K-00001"
[customer]
name = "Customer Ltd"
[item]
description = "Aluminium body"
identification = "body 17"
[measurement]
number = "2026-017"
performed = "2026-11-20"
conditions = "(23.0 ± 0.5) °C"
traceability = "wheel inertia: W-4"
authorised_by = "A. Example"
"""


DAY = "1795305600"  # 2026-11-22


@pytest.fixture(autouse=True)
def _fixed_day(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", DAY)


def lab(tmp_path: Path, text: str = LAB) -> Path:
    path = tmp_path / "lab.toml"
    path.write_text(text, encoding="utf-8")
    return path


def read(path: Path) -> tuple[Any, list[str]]:
    """The PDF and the texts of its pages, without what only breaks lines."""
    pdf = pypdf.PdfReader(io.BytesIO(path.read_bytes()))
    return pdf, [re.sub(r"\s+", " ", page.extract_text().replace("\u200b", "")) for page in pdf.pages]


def with_checks(result: Result) -> Result:
    assert result.details is not None
    return replace(result, details=replace(result.details, checks=("signs", "angle-zero")))


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, list[str]]:
    case = with_checks(factories.clean_result()), factories.rotary_log(), factories.rotary_rig()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", DAY)
        return read(write_report(*case, tmp_path_factory.mktemp("pdf") / "r.PDF"))


def test_the_content_is_that_of_the_page_in_its_order(clean: tuple[Any, list[str]]) -> None:
    text = " ".join(clean[1])
    titles = ("Measurement report", "Identification", "Method", "Parameters", "Uncertainty budget", "Checks that were")
    places = [text.index(title, 30) for title in (*titles, "The rig: bench", "The log", "Notes", "Provenance")]
    assert places == sorted(places)
    assert "2026-11-22" in text
    assert "End of the report" in clean[1][-1]
    assert "no calibration certificate" in text
    assert "Calibration certificate" not in text


def test_every_page_has_the_number_and_says_which_of_how_many_it_is(clean: tuple[Any, list[str]]) -> None:
    pages = clean[1]
    number = re.search(r"Measurement report ([0-9a-f]{12})", pages[0])
    assert number is not None
    for k, page in enumerate(pages, 1):
        assert f"Measurement report {number[1]}" in page
        assert f"page {k} of {len(pages)}" in page


def test_it_is_a_pdf_a_3_with_result_and_rig_inside(clean: tuple[Any, list[str]]) -> None:
    pdf = clean[0]
    data = pdf.xmp_metadata.stream.get_data().decode() if pdf.xmp_metadata else ""
    assert re.search(r"pdfaid:part>\s*3|pdfaid:part=.3", data)
    files = {name: contents[0] for name, contents in pdf.attachments.items()}
    assert set(files) == {"result.json", "rig.toml"}
    assert files["result.json"] == with_checks(factories.clean_result()).to_json().encode()
    assert files["rig.toml"].decode() == factories.rotary_rig().text
    fonts = {
        font.get_object()["/BaseFont"] for page in pdf.pages for font in page["/Resources"].get("/Font", {}).values()
    }
    assert fonts
    assert all(re.match(r"/[A-Z]{6}\+(Libertinus|DejaVu)", font) for font in fonts)  # embedded, and ours


def test_the_same_result_gives_the_same_bytes(tmp_path: Path) -> None:
    case = factories.clean_result(), None, factories.rotary_rig()
    one, two = (write_report(*case, tmp_path / name).read_bytes() for name in ("a.pdf", "b.pdf"))
    assert one == two


def test_a_budget_of_few_degrees_of_freedom_states_k_nu_and_u(tmp_path: Path) -> None:
    """u² = 3² + 4² → u = 5e-6; ν = 5⁴/(3⁴/4) = 30.9; k = t(30.9) = 2.04; U = 10.2e-6."""
    budget = (
        BudgetEntry(scatter("scatter", 4.0), "inertia", 3e-6),
        BudgetEntry(stated("drive.wheel.inertia", "drive.wheel.inertia"), "inertia", 4e-6, 20.0),
    )
    freedom = effective_freedom([(3e-6, 4.0), (4e-6, float("inf"))])
    assert freedom == pytest.approx(625 / 81 * 4)
    inertia = Parameter.of(3e-3, 5e-6, "kg m^2", freedom)
    result = replace(
        factories.clean_result(),
        parameters={"inertia": inertia},
        budget=budget,
        provenance={"constants": {"drive.wheel.inertia": {"value": 1.134e-4, "std": 2e-7}}},
    )
    text = " ".join(read(write_report(result, None, factories.rotary_rig(), tmp_path / "r.pdf"))[1])
    text = text.replace("\u00a0", " ")
    assert "k = 2.04" in text
    assert coverage_factor(freedom) == pytest.approx(2.04, abs=0.005)
    assert re.search(r"U = k u = 10 × 10⁻⁶ kg m²", text)
    assert "= 30" in text
    for cell in ("113.4 × 10⁻⁶ kg m²", "200 × 10⁻⁹ kg m²", "20", "64 %", "36 %", "Welch and Satterthwaite"):
        assert cell in text, cell


def test_only_an_accredited_laboratory_issues_a_certificate(tmp_path: Path) -> None:
    accredited = load_certificate(lab(tmp_path))
    case = factories.clean_result(), None, factories.rotary_rig()
    _, pages = read(write_report(*case, tmp_path / "c.pdf", accredited))
    assert all("Calibration certificate 2026-017" in page and "Rig laboratory" in page for page in pages)
    for words in ("EX-K-00001", "Customer Ltd", "body 17", "2026-11-20", "(23.0 ± 0.5) °C", "W-4", "A. Example"):
        assert words in pages[0]
    plain = load_certificate(lab(tmp_path, re.sub(r"\[laboratory.acc.*?(?=\[customer)", "", LAB, flags=re.S)))
    assert "no calibration certificate" in render(*case, plain)
    assert "Calibration certificate" not in render(*case, plain)
    refused = render(factories.refused_result(), None, None, accredited)
    assert "Calibration certificate" not in refused


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("[customer]\n", "[costumer]\n"), "costumer is not a known key; did you mean customer"),
        (('authorised_by = "A. Example"\n', ""), "measurement.authorised_by is missing"),
        (('name = "Rig laboratory"', "name = 3"), "laboratory.name must be text"),
        (("[item]", "[item"), "is not TOML"),
    ],
)
def test_a_laboratory_file_with_an_error_names_the_key(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        load_certificate(lab(tmp_path, LAB.replace(*change)))


EVIL = '#panic("x") $1/0$ <script> \\ [*b*] `c` @ref "q" 中 \u202e\x07 ' + "y" * 90


def test_hostile_names_are_shown_and_never_executed(tmp_path: Path) -> None:
    rig = Rig.from_text(factories.ROTARY.replace('"bench"', json.dumps(EVIL.replace("\x07", ""))), EVIL)
    log = replace(factories.rotary_log(), source=Source(EVIL, None), metadata={EVIL: EVIL})
    result = factories.clean_result(log)
    assert result.details is not None
    assert result.details.friction is not None
    message = Message(EVIL, EVIL)
    result = replace(
        result,
        notes=(message,),
        warnings=(message,),
        budget=(BudgetEntry(scatter(EVIL), "inertia", 1e-6),),
        provenance={EVIL: EVIL, "log": EVIL + "\udcff"},
        details=replace(
            result.details,
            friction=replace(result.details.friction, law=EVIL, candidates={EVIL: 0.0, "b": 1.0}),
            estimates={EVIL: (3e-3, 1e-6), "b": (3e-3, 1e-6)},
        ),
    )
    pdf, pages = read(write_report(result, log, rig, tmp_path / "r.pdf"))
    text = "".join(pages)
    assert text.count('#panic("x") $1/0$ <script>') >= 8
    assert "<U+4E2D>" in text
    assert "<U+DCFF>" in text
    assert text.count("y" * 90) >= 3
    assert "rig.toml" in pdf.attachments


def test_text_that_no_font_has_becomes_its_code() -> None:
    assert shown_text("J₁ = 3 × 10⁻³ kg m², ν") == "J₁ = 3 × 10⁻³ kg m², ν"
    assert shown_text("中\x00a\tb") == "<U+4E2D><U+0000>a b"


def test_a_refusal_and_a_log_without_a_rig_make_a_pdf(tmp_path: Path) -> None:
    pdf, pages = read(write_report(factories.refused_result(), None, None, tmp_path / "r.pdf"))
    assert "No number" in pages[0]
    assert set(pdf.attachments) == {"result.json"}


def test_the_report_of_a_refusal_has_what_the_laboratory_states(tmp_path: Path) -> None:
    log, report = tmp_path / "still.csv", tmp_path / "r.pdf"
    log.write_text("t,q1,q2,u\n" + "".join(f"{k / 100},0,0,0\n" for k in range(500)), encoding="utf-8")
    given = ["--rig", "paper", "--report", str(report), "--certificate", str(lab(tmp_path))]
    assert run(["identify", str(log), *given]) == 4
    _, pages = read(report)
    assert "Measurement report 2026-017" in pages[0]
    assert "No number" in pages[0]
    assert "Customer Ltd" in pages[0]
    assert "are not stated" not in pages[0]


def without(name: str) -> Callable[..., Any]:
    real = builtins.__import__

    def load(module: str, *args: Any, **kwargs: Any) -> Any:
        if module == name:
            raise ImportError(name)
        return real(module, *args, **kwargs)

    return load


def test_without_the_extra_the_command_says_what_to_install_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(builtins, "__import__", without("typst"))
    target = tmp_path / "r.pdf"
    assert run(["identify", str(tmp_path / "missing.csv"), "--rig", "paper", "--report", str(target)]) == 3
    assert "pip install 'swingid[pdf]'" in capsys.readouterr().err
    assert not target.exists()


def test_a_certificate_needs_a_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["identify", "x.csv", "--rig", "paper", "--certificate", str(lab(tmp_path))]) == 2
    assert "--report" in capsys.readouterr().err


def test_every_page_can_be_drawn(tmp_path: Path) -> None:
    pdfium = pytest.importorskip("pypdfium2", reason="needs pypdfium2")
    case = factories.doubtful_result(), factories.rotary_log(), factories.rotary_rig()
    pdf = write_report(*case, tmp_path / "r.pdf")
    with pdfium.PdfDocument(pdf) as document:
        greys = [page.render(scale=0.5, grayscale=True).to_numpy() for page in document]
    for grey in greys:
        assert (grey < 220).mean() > 1e-3  # no page is empty
        assert (grey[:, -10:] > 250).all()  # nothing leaves the paper at the right
