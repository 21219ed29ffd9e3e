"""``swingid weigh``: the paper's whole experiment, with the body, without it, and the difference."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swingid.cli import output
from swingid.cli.compile import compile_first
from swingid.cli.failure import keeps
from swingid.cli.live import address_of, conduct, identified, measured
from swingid.cli.options import JsonOrRefusal, Method, RigFile
from swingid.cli.simulate import Gains, compensator_of
from swingid.errors import UsageError
from swingid.methods.table import DEFAULT
from swingid.system import write_whole

if TYPE_CHECKING:
    from swingid.live.experiment import Order
    from swingid.model.rig import Rig
    from swingid.result.result import Result


def weigh(
    rig: RigFile,
    loaded: Annotated[str, typer.Option(metavar="RIG", help="The same rig with the body: its rig file.")],
    reference: Annotated[str, typer.Option(metavar="MOTION", help='Motion, such as "sine 0.8 rad 8.5 rad/s".')],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for journals and results; made if need be.")],
    device: Annotated[
        str | None, typer.Option(metavar="DEV", help="As of swingid run; default: device.address of RIG, else twins.")
    ] = None,
    duration: Annotated[float, typer.Option(help="Length of each run, s.")] = 25.0,
    gains: Annotated[Gains | None, typer.Option(help="Of the compensator; default: the paper's experiment.")] = None,
    method: Method = DEFAULT,
    mass: Annotated[
        str | None, typer.Option(metavar="'M ± U'", help='Mass of the body, "68.0 ± 0.1 g": with --distance.')
    ] = None,
    distance: Annotated[
        str | None, typer.Option(metavar="'D ± U'", help="Its centre from the axis: gives the inertia about that.")
    ] = None,
    json: JsonOrRefusal = None,
) -> None:
    """Weigh the inertia of a body: run with it, run without it, and subtract.

    Says what to mount and waits for the Enter key; on the emulator nothing is to be mounted.
    """
    from swingid.control.references import reference_for
    from swingid.live.experiment import Order, required
    from swingid.model.rig import Rig
    from swingid.pooling import difference

    output.check_targets({"--json": json}, {rig: "the rig file", loaded: "the rig file with the body"})
    plants = {"loaded": Rig.load(loaded), "tare": Rig.load(rig)}
    if plants["tare"].text == plants["loaded"].text:
        text = "--rig and --loaded are the same; they differ in axis.gravity_torque, which the body changes"
        raise UsageError(text, code="same-rig")
    if device is not None and device.startswith("twin://"):
        text = "one twin can't be with and without the body; leave --device out, and each rig file is its own twin"
        raise UsageError(text, code="same-rig")
    orders = {
        name: Order(reference_for(reference, plant), compensator_of(plant, gains), duration)
        for name, plant in plants.items()
    }
    for order in orders.values():
        required(order)
    output.make_folder(out)
    output.check_writable(json, *(str(out / f"{name}{end}") for name in plants for end in (".mcap", ".json")))
    compile_first("simulate")
    address = address_of(device, plants["tare"])
    with output.refusals_to(json, "difference", {"tare": rig, "loaded": loaded}):
        results: dict[str, Result] = {}
        for name, plant in plants.items():
            with keeps(lambda: _kept(out, results)):
                _wait(name, address)
            results[name] = _weighed(plant, address, orders[name], out / name, method)
        answer = difference(results["tare"], results["loaded"], mass=mass, distance=distance)
    write_whole(out / "body.json", answer.to_json().encode())
    output.hand_over(answer, json, str(out / "body.json"))


def _wait(name: str, address: str) -> None:
    """Say what to do with the body, and wait until it is done."""
    if not address:
        output.say("with the body" if name == "loaded" else "without the body")
        return
    what = "mount the body" if name == "loaded" else "take the body off"
    output.say(f"{what}, let the rig hang still, then press Enter (Ctrl-C: stop here)")
    try:
        input()
    except EOFError:
        text = "weigh waits for the Enter key between its runs, and standard input is closed; run it in a terminal"
        raise UsageError(text, code="no-terminal") from None


def _kept(out: Path, results: dict[str, Result]) -> str:
    """What is kept of runs that ended before Ctrl-C, and how to go on."""
    if not results:
        return "nothing has moved, so start again"
    kept = f"{out / 'loaded.mcap'} and {out / 'loaded.json'} are kept"
    return f"{kept}: run without the body by swingid run, identify it, and subtract by swingid difference"


def _weighed(plant: Rig, address: str, order: Order, out: Path, method: str) -> Result:
    """One run and its result, beside its journal."""
    journal = f"{out}.mcap"
    provenance: dict[str, object] = {"log": journal, "rig_source": plant.source}
    with measured(journal):
        conduct(plant, address, order, journal)
        result = identified(journal, plant, method, provenance, None)
        write_whole(Path(f"{out}.json"), result.to_json().encode())
    inertia, spread = result.inertia, result.inertia.standard_uncertainty
    from swingid.format import percent

    known = "" if spread is None else f" ± {percent(spread / abs(inertia.value))}"
    output.say(f"inertia {inertia.value:.6g} {inertia.unit}{known}")
    return result
