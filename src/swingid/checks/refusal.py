"""Refusals that name their cause: what the log contradicts in the rig file, where it leaves no answer."""

from __future__ import annotations

from swingid.balance.identifiability import HOPELESS
from swingid.checks.momentum import MomentumCheck
from swingid.checks.table import CONTRADICTIONS
from swingid.errors import UnanswerableError
from swingid.format import percent
from swingid.model.equation import Equation
from swingid.result.result import Parameter, Result

UNDETERMINED = ("not-identifiable", "poor-fit")
"""Codes of refusals of which a contradiction may be the cause."""


def explained(error: UnanswerableError, check: MomentumCheck) -> UnanswerableError:
    """The refusal of a log that does not determine the inertia; of one that contradicts its rig file, that instead."""
    if error.code not in UNDETERMINED or check.read.one_of_several or check.evidence is None:
        return error
    law = check.evidence.law
    warnings = check.tested(Parameter.of(law.inertia, law.total, law.equation.unit)).warnings
    causes = [warning.message for warning in warnings if warning.code in CONTRADICTIONS]
    return contradiction(causes[0], "is not determined") if causes else error


def require_agreement(result: Result, equation: Equation) -> Result:
    """The result. Raises UnanswerableError where what contradicts the rig file leaves no answer."""
    inertia = result.parameters.get("inertia")
    causes = [warning.message for warning in result.warnings if warning.code in CONTRADICTIONS]
    if inertia is None or not causes:
        return result
    relative = (inertia.standard_uncertainty or 0.0) / max(abs(inertia.value), 1e-300)
    if relative <= HOPELESS:
        return result
    value = f"{inertia.value:.3g} {equation.shown(inertia.unit)}"
    raise contradiction(causes[0], f"would be {value} with a standard uncertainty of {percent(relative)}")


def contradiction(cause: str, outcome: str) -> UnanswerableError:
    """The error that names the cause."""
    return UnanswerableError(
        f"log and rig file contradict each other, so that the inertia {outcome}: {cause}", code="contradiction"
    )
