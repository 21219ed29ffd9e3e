"""What a laboratory states for the head of a report: itself, its customer, the item; read from a TOML file.

ISO/IEC 17025:2017, 7.8.2.1 and 7.8.4.1, lists what a report and a calibration certificate contain; what the log and the
rig file cannot know is stated here. Dates and conditions are text as the laboratory writes them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Self

from pydantic import model_validator

from swingid.model.rig.fields import Column, Table, refuse
from swingid.model.rig.toml_file import checked, tables_of, text_of

LARGEST = 1_000_000
"""Bytes beyond which no such file is read."""

NEEDED = (
    "laboratory.address",
    "customer.name",
    "item.description",
    "item.identification",
    "measurement.performed",
    "measurement.conditions",
    "measurement.traceability",
    "measurement.authorised_by",
)
"""Keys that a calibration certificate must have beside the accreditation (ISO/IEC 17025:2017, 7.8.2.1, 7.8.4.1)."""


class Accreditation(Table):
    """[laboratory.accreditation]: who accredited the laboratory, under which number, by which standard."""

    body: Column
    number: Column
    standard: Column = "ISO/IEC 17025:2017"


class Laboratory(Table):
    """[laboratory]: who issues the report; with an accreditation the report is a calibration certificate."""

    name: Column
    address: Column | None = None
    place: Column | None = None
    accreditation: Accreditation | None = None


class Customer(Table):
    """[customer]: for whom."""

    name: Column | None = None
    address: Column | None = None


class Item(Table):
    """[item]: the body or rig that was measured."""

    description: Column | None = None
    identification: Column | None = None
    condition: Column | None = None
    received: Column | None = None


class Measurement(Table):
    """[measurement]: when and how; `issued` replaces today's date, `number` the report number made of the result."""

    number: Column | None = None
    performed: Column | None = None
    issued: Column | None = None
    conditions: Column | None = None
    traceability: Column | None = None
    deviations: Column | None = None
    remarks: Column | None = None
    authorised_by: Column | None = None


class Certificate(Table):
    """The whole file."""

    laboratory: Laboratory
    customer: Customer = Customer()
    item: Item = Item()
    measurement: Measurement = Measurement()

    @property
    def accredited(self) -> bool:
        """Return whether the laboratory states that it is accredited."""
        return self.laboratory.accreditation is not None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.accredited:
            for key in NEEDED:
                table, name = key.split(".")
                if getattr(getattr(self, table), name) is None:
                    refuse("missing-key", "is missing; a calibration certificate must state it", key)
        return self


def load_certificate(path: str | Path) -> Certificate:
    """The statements in a TOML file. Raises InputError that names the file and the key."""
    missing, folder = "docs/report.md shows one", "give the file of the laboratory in it"
    text = text_of(path, missing=missing, folder=folder, most=LARGEST)
    return checked(tables_of(text, str(path)), Certificate, str(path), "a file of a laboratory")


def stated_rows(certificate: Certificate) -> list[tuple[str, str]]:
    """What is stated, in words, in the order of a report."""
    laboratory, customer = certificate.laboratory, certificate.customer
    item, more = certificate.item, certificate.measurement
    granted = laboratory.accreditation
    rows = [
        ("laboratory", _joined(laboratory.name, laboratory.address)),
        ("accreditation", f"{granted.body}, {granted.number} ({granted.standard})" if granted else None),
        ("place of the measurement", laboratory.place),
        ("customer", _joined(customer.name, customer.address)),
        ("item", item.description),
        ("identification of the item", item.identification),
        ("condition of the item", item.condition),
        ("received", item.received),
        ("measured", more.performed),
        ("conditions", more.conditions),
        ("traceability", more.traceability),
        ("deviations from the method", more.deviations),
        ("remarks", more.remarks),
        ("authorised by", more.authorised_by),
    ]
    return [(words, text) for words, text in rows if text]


def _joined(*parts: str | None) -> str:
    return ", ".join(part for part in parts if part)
