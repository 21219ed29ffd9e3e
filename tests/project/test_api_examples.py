"""The examples in the docstrings of what people use run as they stand, and the entry points keep their forms."""

from __future__ import annotations

import doctest
import inspect

import numpy as np
import pytest

import swingid as sw
from swingid.methods.table import METHODS
from swingid.result.data import Details, Parameter

NAMES = ("identify", "Rig", "Recording", "simulate", "compare", "inspect", "Result", "online", "difference", "validate")
NAMES += ("design", "parse_reference", "Result.covariance")


@pytest.mark.parametrize("name", NAMES)
def test_each_example_prints_what_it_says(name: str) -> None:
    of = sw
    for part in name.split("."):
        of = getattr(of, part)
    (test,) = doctest.DocTestFinder(recurse=False).find(of, name, module=False, globs={})
    assert test.examples
    said: list[str] = []
    assert doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test, out=said.append).failed == 0, said


def test_dir_shows_public_names_only() -> None:
    assert set(dir(sw)) == {*sw.__all__, "__version__"}
    assert {"identify", "inspect", "simulate", "compare", "Rig", "Recording", "Result"} <= set(dir(sw))


@pytest.mark.parametrize("function", [sw.identify, sw.compare, sw.calibrate, sw.calibrate_encoders, sw.online])
def test_the_log_comes_first_and_then_its_rig(function: object) -> None:
    first, second, *_ = inspect.signature(function).parameters
    assert first in ("log", "logs", "samples")
    assert second == "rig"


def test_parameters_of_identify_are_all_options_of_the_methods() -> None:
    named = {name for name, one in inspect.signature(sw.identify).parameters.items() if one.kind is one.KEYWORD_ONLY}
    assert named == {"part", "added", "friction"} | {name for one in METHODS.values() for name in one.options()}


@pytest.fixture(scope="module")
def log() -> sw.Recording:
    return sw.simulate(sw.Rig.load("paper"), sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=15, seed=1)


def test_an_option_by_name_is_that_of_the_method(log: sw.Recording) -> None:
    rig = sw.Rig.load("paper")
    printed = sw.identify(log, rig, "energy", variant="printed")
    assert printed.provenance["options"]["variant"] == "printed"
    assert sw.identify(log, rig, "energy", variant=None).inertia == sw.identify(log, rig, "energy").inertia
    with pytest.raises(sw.errors.UsageError) as refused:
        sw.identify(log, rig, variant="printed")
    assert refused.value.code == "unknown-option"


def test_a_stream_takes_both_orders_of_arguments(log: sw.Recording) -> None:
    rig = sw.Rig.load("paper")
    first, second = list(sw.online(log, rig)), list(sw.online(rig, log))
    assert first[-1].inertia == second[-1].inertia


def test_covariance_is_that_of_the_correlation() -> None:
    parameters = {"a": Parameter.of(1.0, 0.1, "1"), "b": Parameter.of(2.0, 0.3, "1"), "c": Parameter.of(1.0, None, "1")}
    result = sw.Result("momentum", "ok", parameters, correlation={"a": {"a": 1.0, "b": -0.5}, "b": {"a": -0.5}})
    wanted = [[0.01, -0.015], [-0.015, 0.09]]
    np.testing.assert_allclose(result.covariance(), wanted)
    np.testing.assert_allclose(result.covariance(["b", "a"]), np.array(wanted)[::-1, ::-1])
    with pytest.raises(KeyError, match="it has a, b, c"):
        result.covariance(["d"])
    with pytest.raises(sw.errors.UnanswerableError) as refused:
        result.covariance(["c"])
    assert refused.value.code == "no-covariance"


def test_residuals_and_short_names() -> None:
    details = Details(0.0, 1.0, np.empty(0), np.empty(0), residuals=np.arange(3.0))
    result = sw.Result("momentum", "ok", {"inertia": Parameter.of(1.0, 0.1, "kg m^2")}, details=details)
    assert result.residuals.tolist() == [0.0, 1.0, 2.0]
    assert sw.Result("momentum", "refused").residuals.size == 0
    assert result.inertia.u == result.inertia.standard_uncertainty == 0.1


def test_a_simulated_log_knows_its_truth_and_a_measured_one_does_not(log: sw.Recording) -> None:
    assert log.truth["inertia"] == sw.Rig.load("paper").axis.inertia.value
    assert sw.Recording(log.time, log.angle).truth == {}
