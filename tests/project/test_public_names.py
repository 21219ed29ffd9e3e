"""What a person finds behind ``sw.``: functions and classes, whatever was imported before, and no leftovers."""

import inspect
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from pydantic import BaseModel

import swingid as sw
from long_cases import quick_first
from swingid.result.data import Parameter

PACKAGE = Path(sw.__file__).parent

ORDERS = {
    "modules first": "import swingid.identification, swingid.simulation, swingid.simulation.twin, "
    "swingid.study.compare, swingid.study.design, swingid.study.rehearse, swingid.study.validate, "
    "swingid.calibration.motor, swingid.calibration.encoders, swingid.pooling.difference, swingid.recursive, "
    "swingid.body.tensor",
    "names first": "import swingid as sw\nfor name in sw.__all__: getattr(sw, name)\nimport swingid.cli.app, "
    "swingid.identification, swingid.simulation.twin, swingid.study.compare, swingid.pooling.difference",
    "names backwards": "import swingid as sw\nfor name in reversed(sw.__all__): getattr(sw, name)",
}

KINDS = """
import inspect, swingid as sw
found = {name: getattr(sw, name) for name in sw.__all__}
print(*(name for name, of in found.items() if not (inspect.isfunction(of) or inspect.isclass(of))))
"""


@pytest.mark.parametrize("order", quick_first(1, ORDERS.values()), ids=ORDERS)
def test_every_name_is_a_function_or_a_class_in_any_order_of_imports(order: str) -> None:
    done = subprocess.run([sys.executable, "-c", f"{order}\n{KINDS}"], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["errors", "live"]


def test_no_name_is_that_of_a_module() -> None:
    modules = {path.stem for path in PACKAGE.glob("*.py")} | {
        path.parent.name for path in PACKAGE.glob("*/__init__.py")
    }
    assert modules & {*sw.__all__} == {"errors", "live"}
    assert not any(isinstance(getattr(sw, name), ModuleType) for name in sw.__all__ if name not in ("errors", "live"))
    assert inspect.isfunction(sw.identify)
    assert inspect.isfunction(sw.simulate)


def names(of: object) -> set[str]:
    return {name for name in dir(of) if not name.startswith("_")}


def test_dir_of_a_rig_lists_what_is_its_own() -> None:
    own = {"builtin", "changed", "constants_without_uncertainty", "from_text", "load", "source", "text"}
    own |= {"reference", "in_units_of"}
    rig = sw.Rig.load("paper")
    assert names(sw.Rig) == own
    assert names(rig) == own | {"name", "axis", "device", "drive", "sensors", "log"}
    for table in (rig.axis, rig.drive.motor, rig.sensors, rig.log):
        assert {*type(table).model_fields} <= names(table)
        assert not names(table) & names(BaseModel)
        assert all(hasattr(table, name) for name in names(table))


def test_dir_of_a_recording_and_a_result_shows_nothing_of_pydantic() -> None:
    time = np.linspace(0, 1, 11)
    log = sw.Recording(time, np.sin(time))
    result = sw.Result("momentum", "ok", {"inertia": Parameter.of(1.0, 0.1, "kg m^2")})
    for of in (sw.Recording, log, sw.Result, result, sw.LargeLog, sw.Compensator, sw.Backstepping):
        assert not names(of) & names(BaseModel)
        assert all(hasattr(of, name) for name in names(of))
    assert {"summary", "plot", "to_json", "inertia", "parameters"} <= names(result)
    assert {"load", "save", "segment", "angle", "time"} <= names(log)
