"""The inertia of an added body: what two results share cancels, what they do not adds; on values known beforehand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import swingid as sw
from refusals import coded
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.result.result import Message, Parameter, Result, combined, refusal
from swingid.uncertainty.budget import BudgetEntry, scatter, stated

Shared = tuple[str, float, float]
WHEEL = {"drive.wheel.inertia": {"value": 1e-4, "std": 1e-6}, "drive.motor.rotor_inertia": {"value": 0.0, "std": None}}


def made(
    value: float,
    u: float = 1e-6,
    shared: tuple[Shared, ...] = (),
    constants: dict[str, dict[str, float | None]] | None = None,
    **more: object,
) -> Result:
    """A result with scatter u, shared constants (key, standard deviation, sensitivity) and the rig's constants."""
    budget = (
        BudgetEntry(scatter("scatter of the windows"), "inertia", u),
        *(BudgetEntry(stated(key, key), "inertia", abs(slope) * std, slope) for key, std, slope in shared),
    )
    fields: dict[str, object] = {
        "method": "momentum",
        "status": "ok",
        "parameters": {"inertia": Parameter.of(value, combined(budget, "inertia"), "kg m^2")},
        "budget": budget,
        "provenance": {"constants": constants or {}},
    }
    return Result(**fields | more)  # type: ignore[arg-type]


def sources(result: Result, parameter: str = "inertia") -> dict[str, BudgetEntry]:
    return {entry.source: entry for entry in result.budget if entry.parameter == parameter}


def codes(result: Result) -> set[str]:
    return {note.code for note in result.notes}


# what is shared


def test_shared_constants_enter_with_the_difference_of_their_sensitivities() -> None:
    tare = made(3e-3, 3e-6, (("drive.wheel.inertia", 1e-6, 16.0),))
    loaded = made(4e-3, 4e-6, (("drive.wheel.inertia", 1e-6, 21.0),))
    body = sw.difference(tare, loaded)
    assert body.inertia.value == pytest.approx(1e-3)
    assert body.inertia.standard_uncertainty == pytest.approx(math.hypot(5e-6, 5e-6))
    wheel = sources(body)["drive.wheel.inertia"]
    assert wheel.sensitivity == pytest.approx(5.0)
    assert {"scatter of the windows (tare)", "scatter of the windows (loaded)"} < set(sources(body))
    assert (body.status, body.method) == ("ok", "difference")


def test_opposite_sensitivities_add() -> None:
    tare = made(3e-3, 0.0, (("sensors.latency", 1e-4, 0.03),))
    loaded = made(4e-3, 0.0, (("sensors.latency", 1e-4, -0.02),))
    assert sw.difference(tare, loaded).inertia.standard_uncertainty == pytest.approx(5e-6)


def test_a_source_without_a_sign_does_not_cancel() -> None:
    entry = BudgetEntry(stated("motor", "motor"), "inertia", 1e-6, None)
    runs = [made(value, 0.0) for value in (3e-3, 4e-3)]
    tare, loaded = (replace(run, budget=(entry,)) for run in runs)
    assert sw.difference(tare, loaded).inertia.standard_uncertainty == pytest.approx(math.sqrt(2) * 1e-6)


def test_the_gravity_torque_of_each_run_is_its_own_where_it_differs() -> None:
    key = "axis.gravity_torque"

    def run(value: float, b: float) -> Result:
        return made(value, 0.0, ((key, 1e-4, 0.013),), {key: {"value": b, "std": 1e-4}})

    apart = sw.difference(run(3e-3, 78e-3), run(4e-3, 156e-3))
    assert apart.inertia.standard_uncertainty == pytest.approx(math.sqrt(2) * 1.3e-6)
    assert "gravity-of-each-run" in codes(apart)
    same = sw.difference(run(3e-3, 78e-3), run(4e-3, 78e-3))
    assert same.inertia.standard_uncertainty == pytest.approx(0.0, abs=1e-18)
    assert "gravity-unchanged" in codes(same)


def test_doubts_of_the_runs_go_along() -> None:
    doubt = Message("near-resonance", "the motion is near resonance.")
    loaded = replace(made(4e-3), warnings=(doubt,), status="warning")
    body = sw.difference(made(3e-3), loaded)
    assert body.status == "warning"
    assert body.warnings[0].message == "the loaded result: the motion is near resonance."


def test_an_unknown_uncertainty_stays_unknown() -> None:
    bare = replace(made(4e-3), parameters={"inertia": Parameter.of(4e-3, None, "kg m^2")})
    assert sw.difference(made(3e-3), bare).inertia.standard_uncertainty is None


# the parallel axis


def test_about_its_own_centre() -> None:
    """J_c = J_e - m d², with the uncertainties of mass and distance."""
    body = sw.difference(made(3e-3), made(4e-3), mass="68.0 ± 0.5 g", distance="117.0 ± 0.2 mm")
    m, d, u_m, u_d = 0.068, 0.117, 0.5e-3, 0.2e-3
    assert body.inertia.value == pytest.approx(1e-3 - m * d**2)
    whole = math.sqrt(2e-12 + (d**2 * u_m) ** 2 + (2 * m * d * u_d) ** 2)
    assert body.inertia.standard_uncertainty == pytest.approx(whole)
    assert sources(body)["body.mass"].sensitivity == pytest.approx(-(d**2))
    assert sources(body)["body.distance"].sensitivity == pytest.approx(-2 * m * d)
    assert body.parameters["inertia_about_axis"].value == pytest.approx(1e-3)


def test_a_mass_without_uncertainty_counts_as_exact_and_is_named() -> None:
    body = sw.difference(made(3e-3), made(4e-3), mass=0.068, distance=0.1)
    assert body.inertia.value == pytest.approx(1e-3 - 0.068 * 0.01)
    assert any(n.code == "exact-constants" and "mass, distance" in n.message for n in body.notes)


@pytest.mark.parametrize(
    ("options", "kind", "told"),
    [
        ({"mass": 0.07}, UsageError, "go together"),
        ({"mass": "70 mm", "distance": 0.1}, UsageError, "mass is given in 'mm'"),
        ({"mass": -0.07, "distance": 0.1}, UsageError, "positive"),
        ({"mass": 0.07, "distance": 0.2}, InputError, "more than the body's inertia"),
        ({"known": "1 ± 0.1 kg"}, UsageError, "known is given in 'kg'"),
        ({"known": "heavy"}, UsageError, "known"),
    ],
)
def test_wrong_options(options: dict[str, object], kind: type[Exception], told: str) -> None:
    with pytest.raises(kind, match=told):
        sw.difference(made(3e-3), made(4e-3), **options)


def test_a_linear_axis_has_no_parallel_axis() -> None:
    tare, loaded = (replace(made(m), parameters={"inertia": Parameter.of(m, 0.01, "kg")}) for m in (95.0, 97.0))
    assert sw.difference(tare, loaded).inertia.unit == "kg"
    with pytest.raises(UsageError, match="linear"):
        sw.difference(tare, loaded, mass=1.0, distance=1.0)


# what cannot be subtracted

REFUSED = refusal("momentum", UnanswerableError("run.csv: no motion.", code="no-motion"))
OTHER_WHEEL = {"drive.wheel.inertia": {"value": 1.1e-4, "std": 1e-6}}
LEANS = (("drive.wheel.inertia", 1e-6, 16.0),)


@pytest.mark.parametrize(
    ("tare", "loaded", "code"),
    [
        (made(3e-3), REFUSED, "refused-result"),
        (made(3e-3), made(4e-3, method="energy"), "different-methods"),
        (made(3e-3), made(4e-3, parameters={"inertia": Parameter.of(4.0, 0.1, "kg")}), "different-units"),
        (made(3e-3, 1e-6, LEANS, WHEEL), made(4e-3, 1e-6, LEANS, OTHER_WHEEL), "different-rigs"),
        (made(3e-3, provenance={"log_sha256": "a"}), made(4e-3, provenance={"log_sha256": "a"}), "same-log"),
        (made(4e-3), made(3e-3), "swapped"),
    ],
)
def test_results_that_do_not_belong_together(tare: Result, loaded: Result, code: str) -> None:
    with pytest.raises(InputError) as caught:
        sw.difference(tare, loaded)
    assert caught.value.code == code
    assert caught.value.message.endswith(".")


def test_a_body_lost_in_the_uncertainty() -> None:
    with pytest.raises(UnanswerableError, check=coded("not-identifiable")):
        sw.difference(made(3e-3, 1e-5), made(3.02e-3, 1e-5))


def test_a_constant_that_the_method_does_not_use_may_differ() -> None:
    tare = made(3e-3, constants={"drive.motor.torque_per_volt": {"value": 5e-3, "std": None}})
    loaded = made(4e-3, constants={"drive.motor.torque_per_volt": {"value": 6e-3, "std": None}})
    assert sw.difference(tare, loaded).status == "ok"


# a known body as the scale


def weighed(scale: float, u: float = 0.0, stated: float = 0.0) -> tuple[Result, Result]:
    """Runs whose inertias are `scale` times the truth, 3e-3 and 4e-3, because the wheel is stated so much too heavy."""
    wheel = {"drive.wheel.inertia": {"value": 1e-4 * scale, "std": stated or None}}
    made_up = []
    for truth in (3e-3, 4e-3):
        slope = truth / 1e-4
        shared = (("drive.wheel.inertia", stated, slope),) if stated else ()
        run = made(truth * scale, u, shared, wheel, sensitivities={"drive.wheel.inertia": slope})
        made_up.append(run)
    return made_up[0], made_up[1]


def test_a_known_body_finds_the_wheel() -> None:
    tare, loaded = weighed(1.02, u=1e-7, stated=1e-6)
    found = sw.difference(tare, loaded, known="1e-3 ± 1e-6 kg*m^2")
    parameters = {name: parameter.value for name, parameter in found.parameters.items()}
    assert parameters["inertia"] == pytest.approx(1.02e-3)
    assert parameters["scale_factor"] == pytest.approx(1 / 1.02)
    assert parameters["wheel_inertia"] == pytest.approx(1e-4)
    assert parameters["tare_inertia"] == pytest.approx(3e-3)
    assert parameters["loaded_inertia"] == pytest.approx(4e-3)
    spread = math.hypot(1e-6, math.sqrt(2) * 1e-7) / 1.02e-3
    assert found.parameters["scale_factor"].standard_uncertainty == pytest.approx(spread)
    # the wheel's error is corrected away, the body's comes in
    assert "drive.wheel.inertia" not in sources(found, "tare_inertia")
    assert sources(found, "tare_inertia")["inertia of the known body"].sensitivity == pytest.approx(3.0)


@pytest.mark.parametrize(("scale", "stated", "warns"), [(1.02, 2e-7, True), (1.02, 2e-6, False), (1.02, 0.0, True)])
def test_a_correction_beyond_its_uncertainty_is_a_warning(scale: float, stated: float, warns: bool) -> None:
    found = sw.difference(*weighed(scale, u=1e-7, stated=stated), known="1e-3 ± 1e-6 kg*m^2")
    assert ("scale-correction" in {w.code for w in found.warnings}) is warns
    told = found.warnings if warns else found.notes
    assert any("-2.0 % ± 0.099 %" in message.message for message in told)


def test_a_difference_that_does_not_feel_the_scale_calibrates_nothing() -> None:
    tare, loaded = weighed(1.0, u=1e-7)
    loaded = replace(loaded, sensitivities=tare.sensitivities)
    with pytest.raises(UnanswerableError, check=coded("no-scale", "a12")):
        sw.difference(tare, loaded, known=1e-3)


def test_results_that_do_not_name_their_scale_calibrate_nothing() -> None:
    with pytest.raises(UnanswerableError, check=coded("no-scale")):
        sw.difference(made(3e-3), made(4e-3), known=1e-3)


def test_correlations_of_a_difference() -> None:
    """By hand: scatter of each run, and the wheel, which both runs share; the scale by a known body."""
    pairs = []
    for value, b, u in ((3e-3, 10e-3, 3e-6), (4e-3, 12e-3, 4e-6)):
        run = made(value, u, (("drive.wheel.inertia", 1e-6, 16.0 + 1e3 * value),), constants=WHEEL)
        entry = BudgetEntry(scatter("scatter of the windows"), "gravity_torque", 10 * u)
        torque = Parameter.of(b, 10 * u, "N m")
        r = -0.5 * u / run.inertia.standard_uncertainty  # of the scatters: -0.5
        table = {
            one: {two: 1.0 if one == two else r for two in ("inertia", "gravity_torque")}
            for one in ("inertia", "gravity_torque")
        }
        parameters = run.parameters | {"gravity_torque": torque}
        pairs.append(replace(run, parameters=parameters, budget=(*run.budget, entry), correlation=table))
    body = sw.difference(*pairs)
    u = body.inertia.standard_uncertainty * body.parameters["gravity_torque"].standard_uncertainty
    assert body.correlation["inertia"]["gravity_torque"] == pytest.approx(-0.5 * 10 * (3e-6**2 + 4e-6**2) / u)
    # without coefficients in the runs the gravity torque has none
    assert sw.difference(*(replace(run, correlation={}) for run in pairs)).correlation == {}
    known = sw.difference(*pairs, known="1 ± 0.01 g*m^2").correlation
    # J_e and the corrected wheel: both by the scatter of the two runs, in opposite directions
    assert known["inertia"]["wheel_inertia"] < 0
    assert known["scale_factor"]["wheel_inertia"] == pytest.approx(1.0)
    assert all(known[one][two] == pytest.approx(known[two][one]) for one in known for two in known)
