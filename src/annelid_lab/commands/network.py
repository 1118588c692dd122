"""The command `export-network`: networks and controllers for other programs and microcontrollers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli import Assignments, Force, Segments, command, config_of, overrides_of, print_paths, refuse_existing
from annelid.errors import shown, suggest


@command("export-network", "Exchange")
def export_network_command(
    source: Annotated[
        str,
        typer.Argument(metavar="PRESET|FILE", help="A preset, a configuration, or a network as TOML."),
    ],
    to: Annotated[str, typer.Option(metavar="FORMAT", help="c, lems or toml.")] = "c",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Folder for c, else a file  [default: firmware, network.xml or network.toml]"
        ),
    ] = None,
    single: Annotated[
        bool, typer.Option("--float/--double", help="Type of all numbers in the C code.", show_default="double")
    ] = False,
    assignments: Assignments = None,
    segments: Segments = None,
    timestep_ms: Annotated[
        float | None,
        typer.Option("--timestep-ms", help="Step of a network, ms  [default: 1, in LEMS 0.1; a preset has its own]"),
    ] = None,
    scheme: Annotated[
        str | None, typer.Option(help="Scheme of a network in C: euler, toolbox or heun  [default: euler]")
    ] = None,
    wire: Annotated[
        bool, typer.Option("--wire", help="Also write the code that answers `annelid loop` over a serial line or UDP.")
    ] = False,
    force: Force = False,
) -> None:
    """Write a network for other programs, or a worm's whole controller for a microcontroller.

    \b
    c     C99 with a self-test: a header and a source file.
          Of a preset or a configuration: the controller, with the thresholds
          of its sensors, its start and the activation of the muscles.
          Of a network: from the currents of its inputs to the potentials of
          its outputs.
    lems  LEMS, the language of NeuroML 2, for pyLEMS and jNeuroML: the
          network alone
    toml  the network as text; of a preset with its senses and readout, as
          annelid run --network takes it

    \b
    annelid export-network riddle2022-planar -o firmware
    annelid export-network riddle2023-rods -o firmware --float
    annelid export-network riddle2023-rods -o firmware --float --wire
    annelid export-network network.toml -o firmware --timestep-ms 0.5
    annelid export-network riddle2023-rods --to lems -o network.xml
    """
    from typing import cast

    from annelid.config import preset_names
    from annelid.control import circuit_text
    from annelid.nervous import Network, Scheme
    from annelid.output import with_suffix, write_text
    from annelid.simulation import build_controller, build_plant
    from annelid.textfiles import read_text, read_toml
    from annelid_lab.firmware import controller_circuit, controller_firmware, network_firmware
    from annelid_lab.lems import lems_text

    files = {"c": "firmware", "lems": "network.xml", "toml": "network.toml"}
    if to not in files:
        raise typer.BadParameter(f"--to {shown(to)}: {suggest(to, files)}")
    path = Path(source)
    is_file = source not in preset_names() and path.is_file()
    is_network = is_file and path.suffix != ".xml" and "neuron" in read_toml(path)
    other = to != "c" and f"the network as {to}"
    controller = not is_network and "a controller, which has the step and the scheme of its configuration"
    for option, value, reason in (
        ("--set", assignments, is_network and "a network"),
        ("--segments", segments, is_network and "a network"),
        ("--timestep-ms", timestep_ms, other if to == "toml" else to == "c" and controller),
        ("--scheme", scheme, other or controller),
        ("--float", single or None, other),
        ("--wire", wire or None, other),
    ):
        if value is not None and reason:
            raise typer.BadParameter(f"{option} has no effect on {reason}")
    target = output or Path(files[to])
    if to != "c":
        target = with_suffix(target, (Path(files[to]).suffix,), to, default=Path(files[to]).suffix)
    real = "float" if single else "double"
    name, worm, circuit = "", None, None
    if is_network:
        network = Network.from_toml(read_text(path))
    else:
        config = config_of(source, overrides_of(assignments), segments).model_copy(update={"trial": None})
        name, worm = config.name, build_controller(config, build_plant(config))
        circuit = controller_circuit(worm)
        network = circuit.network
    if to != "c":
        refuse_existing(target, force)
        text = (
            (network.to_toml() if circuit is None else circuit_text(circuit))
            if to == "toml"
            else lems_text(network, timestep_ms=0.1 if timestep_ms is None else timestep_ms)
        )
        print_paths([write_text(target, text)])
        return
    if worm is None:
        step_ms = 1.0 if timestep_ms is None else timestep_ms
        firmware = network_firmware(network, step_ms, cast(Scheme, scheme or "euler"), real=real)
    else:
        firmware = controller_firmware(worm, name, real=real)
    print_paths(firmware.write(target, overwrite=force, wire=wire))
