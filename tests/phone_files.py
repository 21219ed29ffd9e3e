"""Exports of phones, made by their formats: CSV of phyphox, zip archives, workbooks (.xlsx, .ods)."""

from __future__ import annotations

import io
import zipfile

import numpy as np


def text(header: str, *columns: np.ndarray, mark: str = ",") -> str:
    rows = (mark.join(f"{cell:.9E}" for cell in row) for row in zip(*columns, strict=True))
    return "\n".join([mark.join(f'"{name}"' for name in header.split("|")), *rows]) + "\n"


def archive(packed: int = zipfile.ZIP_STORED, **files: str) -> bytes:
    """A zip archive of CSV files by their names, with __ for the / of a folder."""
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", packed) as zipped:
        for name, content in files.items():
            zipped.writestr(name.replace("__", "/") + ".csv", content)
    return sink.getvalue()


def workbook(sheets: dict[str, list[list[object]]], merged: tuple[str, ...] = ()) -> bytes:
    """An .xlsx file by its parts (ECMA-376): sheets of numbers and inline texts, with merged cells in the first."""
    sink, main = io.BytesIO(), "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package, kind = "http://schemas.openxmlformats.org/package/2006", "application/vnd.openxmlformats-officedocument"
    with zipfile.ZipFile(sink, "w") as zipped:
        overrides = "".join(
            f'<Override PartName="/xl/worksheets/sheet{k}.xml" ContentType="{kind}.spreadsheetml.worksheet+xml"/>'
            for k in range(1, len(sheets) + 1)
        )
        zipped.writestr(
            "[Content_Types].xml",
            f'<Types xmlns="{package}/content-types"><Default Extension="rels" ContentType='
            '"application/vnd.openxmlformats-package.relationships+xml"/><Override PartName="/xl/workbook.xml" '
            f'ContentType="{kind}.spreadsheetml.sheet.main+xml"/>{overrides}</Types>',
        )
        link = f'<Relationship Id="r1" Type="{office}/officeDocument" Target="xl/workbook.xml"/>'
        zipped.writestr("_rels/.rels", f'<Relationships xmlns="{package}/relationships">{link}</Relationships>')
        names = "".join(f'<sheet name="{n}" sheetId="{k}" r:id="r{k}"/>' for k, n in enumerate(sheets, start=1))
        zipped.writestr(
            "xl/workbook.xml", f'<workbook xmlns="{main}" xmlns:r="{office}"><sheets>{names}</sheets></workbook>'
        )
        links = "".join(
            f'<Relationship Id="r{k}" Type="{office}/worksheet" Target="worksheets/sheet{k}.xml"/>'
            for k in range(1, len(sheets) + 1)
        )
        zipped.writestr(
            "xl/_rels/workbook.xml.rels", f'<Relationships xmlns="{package}/relationships">{links}</Relationships>'
        )
        for k, rows in enumerate(sheets.values(), start=1):
            lines = "".join(f"<row>{''.join(map(_cell, row))}</row>" for row in rows)
            ranges = "".join(f'<mergeCell ref="{one}"/>' for one in merged if k == 1)
            more = f"<mergeCells>{ranges}</mergeCells>" if ranges else ""
            zipped.writestr(
                f"xl/worksheets/sheet{k}.xml",
                f'<worksheet xmlns="{main}"><sheetData>{lines}</sheetData>{more}</worksheet>',
            )
    return sink.getvalue()


def _cell(cell: object) -> str:
    if cell is None:
        return "<c/>"
    return f"<c><v>{cell!r}</v></c>" if isinstance(cell, float) else f'<c t="inlineStr"><is><t>{cell}</t></is></c>'
