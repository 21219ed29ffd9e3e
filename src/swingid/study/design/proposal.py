"""What a design is: proposals with their predictions, the chosen one, and the words and data of it."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import dataclass

from swingid.errors import SwingidError
from swingid.model.rig import Rig
from swingid.study.design.information import Prediction
from swingid.study.design.trial import Trial

SCHEMA = "swingid.design/1"


@dataclass(frozen=True)
class Proposal:
    """A motion with what is predicted of it.

    duration (s) contains `settling`; delta0 (rad): the error that the compensator may keep (18); peaks: SI, by name.
    """

    reference: str
    duration: float
    settling: float
    rate: float
    delta0: float
    peaks: dict[str, float]
    prediction: Prediction

    @property
    def relative(self) -> float:
        """Predicted standard uncertainty of the inertia as a share of it."""
        return self.prediction.relative

    def to_dict(self) -> dict[str, object]:
        """Plain data."""
        parameters = {
            name: {
                "value": p.value,
                "standard_uncertainty": p.standard_uncertainty,
                "interval95": None if p.interval95 is None else list(p.interval95),
                "unit": p.unit,
            }
            for name, p in self.prediction.parameters.items()
        }
        return {
            "reference": self.reference,
            "duration": self.duration,
            "settling": self.settling,
            "rate": self.rate,
            "delta0": self.delta0,
            "relative_uncertainty": self.relative,
            "parameters": parameters,
            "budget": [entry.__dict__ for entry in self.prediction.budget],
            "condition": _finite(self.prediction.seen.condition),
            "inflation": _finite(self.prediction.seen.inflation),
            "peaks": self.peaks,
        }


@dataclass(frozen=True)
class Design:
    """The proposal that reaches the wanted relative standard uncertainty, those beside it, and one run on the twin."""

    rig: str
    rig_source: str
    wanted: float
    proposal: Proposal
    others: tuple[Proposal, ...]
    trial: Trial | None
    notes: tuple[str, ...]

    @property
    def command(self) -> str:
        """The command that makes the log of the proposal on the twin."""
        source = self.rig_source.removeprefix("built-in ")
        p = self.proposal
        return (
            f"swingid simulate --rig {shlex.quote(source)} --reference {shlex.quote(p.reference)} "
            f"--duration {p.duration:g} --rate {p.rate:g} --delta0 {p.delta0:g} --out run.parquet"
        )

    def to_dict(self) -> dict[str, object]:
        """Plain data, schema "swingid.design/1"."""
        return {
            "schema": SCHEMA,
            "status": "ok",
            "rig": self.rig,
            "rig_source": self.rig_source,
            "wanted": self.wanted,
            "proposal": self.proposal.to_dict(),
            "command": self.command,
            "others": [other.to_dict() for other in self.others],
            "trial": None if self.trial is None else self.trial.__dict__,
            "notes": list(self.notes),
            "error": None,
        }

    def to_json(self) -> str:
        """The design as JSON text."""
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def summary(self) -> str:
        """A table to read on a terminal."""
        from swingid.study.design.text import tabulate

        return tabulate(self)


def refused(rig: Rig, error: SwingidError) -> str:
    """The JSON text that says why there is no design."""
    reason = {"code": error.code, "message": error.message}
    data = {"schema": SCHEMA, "status": "refused", "rig": rig.name, "rig_source": str(rig.source), "error": reason}
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
