"""The commands on what there is before a run: `check`, `build`, `export-network`, `presets`, `arenas` and `doctor`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import (
    FIRST_PRESET,
    ArenaName,
    Assignments,
    FidelityLevel,
    Force,
    Preset,
    Segments,
    config_of,
    overrides_of,
    print_paths,
    refuse_existing,
)
from annelid.cli.entry import EXIT_USAGE
from annelid.cli.result import give, refuse_json, wants_json
from annelid.errors import shown, suggest


def new(
    path: Annotated[Path, typer.Argument(metavar="FILE.toml", help="The file to write.")],
    radius: Annotated[float, typer.Option(help="Radius of the tube at rest, m.")] = 0.16,
    segments: Annotated[int, typer.Option(help="Segments, from 3 on.")] = 3,
    helices: Annotated[int, typer.Option(help="Strands, half of each handedness; even, from 6 on.")] = 12,
    length: Annotated[
        float | None, typer.Option(help="Length at rest, m.  [default: so that rhombi have the paper's shape]")
    ] = None,
    rear_radius: Annotated[
        float | None, typer.Option(help="Radius of the last ring at rest, m.  [default: as --radius, no taper]")
    ] = None,
    force: Force = False,
) -> None:
    """Write the configuration of a worm of your own size.

    Strands, springs, muscles, sensors, times and limits follow from the geometry, so that the worm moves as the paper's
    robot of rods does; the file states the rule of each. Replace what you can measure. A geometry that cannot work is
    refused here.

    \b
    annelid new mine.toml --radius 0.05 --segments 5 --helices 8 --length 0.4
    annelid new taper.toml --radius 0.05 --rear-radius 0.04
    annelid run mine.toml
    """
    from annelid.experiment.similar import worm_text
    from annelid.output import write_text

    if path.suffix != ".toml":
        raise typer.BadParameter(f"{path} must end in .toml")
    refuse_existing(path, force, "")
    print_paths([write_text(path, worm_text(radius, segments, helices, length, rear_radius))])


def check(
    preset: Preset = None,
    assignments: Assignments = None,
    segments: Segments = None,
    fidelity: FidelityLevel = None,
    arena: ArenaName = None,
) -> None:
    """Check, before a run, whether the numbers of a 3D worm fit.

    Lengths against the ring at rest, forces against what the mesh bears, the step against stiffness, the sensors'
    tolerance against the mesh. A finding says what is wrong and what to set instead. With an error a run can mean
    nothing, and is refused; with a warning it is doubtful, goes on, and its file says so. The exit code is 2 where
    there is an error, else 0.

    \b
    annelid check riddle2025 --set body.mesh.radius_m=0.05
    annelid check my.toml --json
    """
    from annelid.plausibility import check as findings_of

    found = findings_of(config_of(preset, overrides_of(assignments), segments, fidelity, arena))
    if not give([asdict(finding) for finding in found]):
        typer.echo("\n".join(f"{finding.severity}: {finding}" for finding in found) or "nothing found")
    if any(finding.severity == "error" for finding in found):
        raise typer.Exit(EXIT_USAGE)


def build(
    preset: Preset = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The MJCF file to write.")] = Path("worm.xml"),
    assignments: Assignments = None,
    segments: Segments = None,
    fidelity: FidelityLevel = None,
    arena: ArenaName = None,
    force: Force = False,
) -> None:
    """Write a worm and its arena as MJCF, for plain MuJoCo.

    A worm with servos has the keyframe rest, to be loaded before the first step: in it their cables are paid out.
    The last state of a run: annelid export RUN --to mjcf.

    \b
    annelid build riddle2023-rods -o worm.xml
    annelid build riddle2025 --arena pipe.s -o worm_in_pipe.xml
    annelid build riddle2023-rods --segments 6 --set body.mesh.radius_m=0.1 -o thin.xml
    """
    from annelid.body.assemble import mjcf_text
    from annelid.output import write_text

    refuse_existing(output, force)
    config = config_of(preset, overrides_of(assignments), segments, fidelity, arena)
    print_paths([write_text(output, mjcf_text(config))])


def presets(
    name: Annotated[str | None, typer.Argument(help="Print this preset or TOML file whole.")] = None,
    fields: Annotated[bool, typer.Option("--fields", help="List every field with its meaning.")] = False,
) -> None:
    """List the presets, or print one with all its fields.

    Each field has its source, and the preset that it is inherited from. What the command prints is a start for a file
    of your own. Of a file that extends a preset it prints the whole worm, too.

    \b
    annelid presets
    annelid presets riddle2023 > my.toml
    annelid presets my.toml
    annelid presets riddle2023 --fields
    """
    from annelid.config import load_config, preset_names, preset_text
    from annelid.draw.table import field_lines, presets_table
    from annelid.terminal import Console

    refuse_json(name is not None or fields, "a name or --fields")
    if wants_json():
        known = [load_config(each) for each in preset_names()]
        listing = [(c.name, c.summary, c.body.n_segments, c.duration_s) for c in known]
        keys = ("name", "summary", "n_segments", "duration_s")
        give([dict(zip(keys, each, strict=True)) for each in listing])
        return
    if name is not None and not fields:
        typer.echo(preset_text(name), nl=False)
        return
    if fields:
        typer.echo("\n".join(field_lines(load_config(FIRST_PRESET if name is None else name))))
        return
    Console().print(presets_table([load_config(each) for each in preset_names()]))


def arenas(
    name: Annotated[str | None, typer.Argument(help="Print this arena's commented TOML.")] = None,
) -> None:
    """List the arenas for a 3D worm, or print one.

    What it prints is a start for a file of your own; any field can be set with --set.

    \b
    annelid arenas
    annelid arenas pipe.bend > my_pipe.toml
    annelid run --arena my_pipe.toml --set arena.radius=0.8
    """
    from annelid.config import arena_names, arena_summary, arena_text
    from annelid.draw.table import arenas_table
    from annelid.terminal import Console

    refuse_json(name is not None, "a name")
    if name is not None:
        typer.echo(arena_text(name), nl=False)
        return
    summaries = {each: arena_summary(each) for each in arena_names()}
    if not give([{"name": each, "summary": summary} for each, summary in summaries.items()]):
        Console().print(arenas_table(summaries))


def doctor(
    report: Annotated[
        bool, typer.Option("--report", help="Print versions and machine as Markdown, to paste into a bug report.")
    ] = False,
) -> None:
    """Say what is missing and how to install it.

    The report names no user, no machine and no folder.

    \b
    annelid doctor
    annelid doctor --report
    """
    from annelid.draw.doctor import examine

    refuse_json(report, "--report")
    if report:
        from annelid.draw.doctor import bug_report

        typer.echo(bug_report(list(examine())))
        return
    found = list(examine())
    if not give([asdict(finding) for finding in found]):
        typer.echo("\n".join(finding.line() for finding in found))


def export_network(
    source: Annotated[
        str,
        typer.Argument(metavar="PRESET|FILE", help="A preset, a configuration, or a network as TOML or LEMS (.xml)."),
    ],
    to: Annotated[str, typer.Option(metavar="FORMAT", help="c, lems or toml.")] = "c",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder of c, or file  [default: firmware, network.xml or network.toml]"),
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
        bool, typer.Option("--wire", help="Also write what answers `annelid loop` over a serial line or UDP.")
    ] = False,
    force: Force = False,
) -> None:
    """Write a network for other programs, or a worm's whole controller for a microcontroller.

    \b
    c     C99: of a preset or a configuration the controller with its sensors' thresholds, its start, its turning and
          the muscles' activation; of a network from the currents of its inputs to the potentials of its outputs.
          A header, a source file and a self-test
    lems  LEMS, the language of NeuroML 2, for pyLEMS and jNeuroML: the network alone, of a preset too
    toml  the network alone as Network.to_toml writes it; reads LEMS files that annelid wrote

    \b
    annelid export-network riddle2022-planar -o firmware
    annelid export-network riddle2023-rods -o firmware --float
    annelid export-network riddle2023-rods -o firmware --float --wire
    annelid export-network network.toml -o firmware --timestep-ms 0.5
    annelid export-network riddle2023-rods --to lems -o network.xml
    annelid export-network network.xml --to toml
    """
    from typing import cast

    from annelid.config import preset_names
    from annelid.export import controller_firmware, controller_network, lems_text, network_firmware, read_lems
    from annelid.nervous import Network, Scheme
    from annelid.output import with_suffix, write_text
    from annelid.simulation import build_controller, build_plant
    from annelid.textfiles import read_text, read_toml

    files = {"c": "firmware", "lems": "network.xml", "toml": "network.toml"}
    if to not in files:
        raise typer.BadParameter(f"--to {shown(to)}: {suggest(to, files)}")
    path = Path(source)
    is_file = source not in preset_names() and path.is_file()
    is_lems = is_file and path.suffix == ".xml" and "<Lems" in read_text(path)
    is_network = is_lems or (is_file and path.suffix != ".xml" and "neuron" in read_toml(path))
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
    name, worm = "", None
    if is_network:
        network = read_lems(path) if is_lems else Network.from_toml(read_text(path))
    else:
        config = config_of(source, overrides_of(assignments), segments).model_copy(update={"trial": None})
        name, worm = config.name, build_controller(config, build_plant(config))
        network = controller_network(worm)
    if to != "c":
        refuse_existing(target, force)
        text = (
            network.to_toml()
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
    for written in firmware.paths(target, wire=wire):
        if written.exists():
            refuse_existing(written, force)
    print_paths(firmware.write(target, overwrite=force, wire=wire))
