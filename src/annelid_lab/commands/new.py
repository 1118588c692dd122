"""The command `new`: a worm of one's own size."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli import Force, command, print_paths, refuse_existing, remark, wants_json


@command("new", "Make")
def new_command(
    path: Annotated[Path, typer.Argument(metavar="FILE.toml", help="The file to write.")],
    radius: Annotated[float, typer.Option(help="Radius of the tube at rest, m.")] = 0.16,
    segments: Annotated[int, typer.Option(help="Number of segments, at least 3.")] = 3,
    helices: Annotated[
        int, typer.Option(help="Number of strands, half of them in each direction: even, at least 6.")
    ] = 12,
    length: Annotated[
        float | None, typer.Option(help="Length at rest, m  [default: the one at which rhombi have the paper's shape]")
    ] = None,
    rear_radius: Annotated[
        float | None, typer.Option(help="Radius of the last ring at rest, m  [default: --radius, no taper]")
    ] = None,
    segment_length: Annotated[
        float | None, typer.Option(help="Distance of two rings at rest, m, in place of --length")
    ] = None,
    strand_radius: Annotated[
        float | None, typer.Option(help="Radius of the strands, m, taken as solid  [default: in proportion]")
    ] = None,
    young_modulus: Annotated[
        float | None, typer.Option(help="Young's modulus of the strands, Pa  [default: by their weight]")
    ] = None,
    force: Force = False,
) -> None:
    """Write the configuration of a worm of your own size.

    Strands, springs, muscles, sensors, times and limits follow from the geometry, so that the worm moves as
    riddle2023-rods does. The file states the rule of each number. Replace what you can measure. A geometry that cannot
    work is refused. With the radius and the modulus of your own strands, springs and forces follow them.

    \b
    annelid new mine.toml --radius 0.05 --segments 5 --helices 8 --length 0.4
    annelid new taper.toml --radius 0.05 --rear-radius 0.04
    annelid new tube.toml --radius 0.05 --segment-length 0.07
    annelid new tube.toml --strand-radius 0.003 --young-modulus 2.2e8
    annelid run mine.toml
    """
    from annelid.analysis import three_digits
    from annelid.body import bearable_force_N, worm_of
    from annelid.config import load_config
    from annelid.output import write_text
    from annelid.plausibility import refuse_nonsense
    from annelid_lab.scaled_worm import similar_worm, worm_text

    if path.suffix != ".toml":
        raise typer.BadParameter(f"{path} must end in .toml")
    refuse_existing(path, force, "")
    own = similar_worm(radius, segments, helices, length, rear_radius, segment_length, strand_radius, young_modulus)
    print_paths([write_text(path, worm_text(own))])
    config = load_config(path)
    if not wants_json():
        body = worm_of(config)
        closing_N = three_digits(min(bearable_force_N(one) for _, one in body.groups()))
        size = f"{body.n_segments} segments, {body.mesh.n_helices} strands"
        typer.echo(f"{size}; a ring closes under about {closing_N} N")
        typer.echo(f"next: annelid check {shlex.quote(str(path))}")
    for doubt in refuse_nonsense(config):
        remark(f"warning: {doubt}")
