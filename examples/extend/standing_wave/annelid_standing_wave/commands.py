"""A command: how short every ring became."""

from __future__ import annotations

import typer

from annelid.cli import RunPath, command, give
from annelid.simulation import open_run


@command("rings", "See")
def rings(run: RunPath) -> None:
    """Print the shortest length of every ring of a run.

    \b
    annelid rings runs/riddle2023-rods-001
    """
    lengths = open_run(run).data["ring_length"].values.min(axis=0).tolist()
    if not give({"shortest_m": lengths}):
        typer.echo("\n".join(f"ring {i}: {100 * length:.1f} cm" for i, length in enumerate(lengths, 1)))
