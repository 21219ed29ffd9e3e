"""Several logs are one fit: what differs between them is an entry of the equation, and one log is no other case."""

from __future__ import annotations

import numpy as np
import pytest

import swingid as sw
from swingid.balance.fits import fit_rows, with_declared
from swingid.balance.rows import rows_of
from swingid.balance.together import Run, fit_together, with_bodies
from swingid.balance.windows import law_windows
from swingid.methods.momentum.together import part_of_run
from swingid.preparation.prepared import Prepared, prepare
from swingid.units import Quantity

TEXT = """
name = "pendulum"
[axis]
gravity_torque = {gravity}
inertia = {inertia}
model_uncertainty = 0
[axis.friction]
coulomb = 1e-4
viscous = 5e-5
[drive]
kind = "none"
[sensors]
nonlinearity = 0
latency = 0
counts_per_turn = 65536
"""

J, B, RING = 3e-3, 0.3, Quantity(2e-3, 2e-6)
"""A pendulum of unknown gravity torque, and a ring whose centre is on the axis."""


def pendulum(gravity: object = B, inertia: float = J) -> sw.Rig:
    """Without a drive; the gravity torque is known to the twin."""
    return sw.Rig.from_text(TEXT.format(gravity=gravity, inertia=inertia))


def swing(added: float, seed: int) -> sw.Recording:
    """A free swing of 20 s from 0.8 rad."""
    return sw.simulate(pendulum(inertia=J + added), duration=20.0, rate=200.0, initial_angle=0.8, seed=seed)


def run_of(name: str, prepared: Prepared, added: Quantity) -> Run:
    """A log as it is fitted."""
    return Run.of(name, part_of_run(prepared), added)


def test_gravity_unknown_in_two_logs_one_with_a_known_body_is_two_entries_of_the_equation() -> None:
    """The unknown gravity torque is sought, the body is a known term of the log that has it, nothing else changes."""
    logs, bodies = [swing(0.0, 1), swing(RING.value, 2)], [Quantity(0.0), RING]
    rig = pendulum('"unknown"')
    prepared = [prepare(log, rig, together=True, scaled_elsewhere=True) for log in logs]
    runs = [run_of(*own) for own in zip("ab", prepared, bodies, strict=True)]
    found = with_bodies(prepared[0].equation, runs)
    assert found.sought == ("inertia", "gravity_torque")
    assert {name: value for name, value in found.stated.items() if value} == {"added body of 0.002": RING.value}
    result = sw.identify(logs, rig, added=bodies)
    for name, true in (("inertia", J), ("gravity_torque", B)):
        one = result.parameters[name]
        assert one.interval95 is not None
        assert one.interval95[0] <= true <= one.interval95[1], name
        assert one.value == pytest.approx(true, rel=2e-3)
    by_ring = next(one for one in result.budget if one.parameter == "inertia" and one.source.startswith("added body"))
    assert by_ring.standard_uncertainty == pytest.approx(1e-3 * J, rel=0.01)


def test_one_log_is_fitted_as_several_are() -> None:
    """On the same windows with the same friction one log gives in `fit_together` what its own fit gives."""
    rig = pendulum()
    run = run_of("a", prepare(swing(0.0, 1), rig, together=True), Quantity(0.0))
    law = fit_together([run], run.part.equation).law
    signals = run.signals.suited(law.half)
    alone = fit_rows(rows_of(signals, law_windows(signals, law.half)), law.equation, run.part.noise, law.friction)
    assert alone is not None
    alone = with_declared(alone, rig, signals)
    np.testing.assert_allclose(law.fit.values, alone.fit.values, rtol=1e-10, atol=1e-18)
    np.testing.assert_allclose(law.covariance, alone.covariance, rtol=1e-9, atol=1e-30)
    assert law.total == pytest.approx(alone.total, rel=1e-9)
    assert [one.item.source for one in law.declared] == [one.item.source for one in alone.declared]


def test_a_log_given_twice_halves_the_variance_of_its_scatter() -> None:
    """Two logs of one motion are twice the rows: the same values."""
    run = run_of("a", prepare(swing(0.0, 1), pendulum(), together=True), Quantity(0.0))
    one, two = (fit_together([run] * count, run.part.equation).law for count in (1, 2))
    assert two.a11 == pytest.approx(one.a11, rel=1e-6)
    assert two.u < one.u
