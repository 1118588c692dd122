"""A study of your own: how much longer the first segment gets on slippery ground, as a command of annelid's.

    python examples/extend/own_study.py --friction 0.3

In an installed package, named by an entry point `annelid.commands`, `annelid study slippery` finds it. Its runs are
kept in the folder, so that a second call takes no time. Takes a few seconds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli import give_files, main, study
from annelid.experiment import Case, Store


@study("slippery")
def slippery(
    friction: Annotated[float, typer.Option(help="Friction of the ground that is compared with 1.")] = 0.1,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder that keeps the runs.")] = Path("slippery"),
) -> None:
    """Find out how far the first segment elongates on slippery ground."""
    cases = {value: Case("riddle2023-fast", {"arena.friction": value, "duration_s": 1.0}) for value in (1.0, friction)}
    store = Store(output / "runs")
    store.compute(cases.values())
    found = {value: store[case].summary.elongation_mean_max_m[0] for value, case in cases.items()}
    for value, elongation_m in found.items():
        typer.echo(f"friction {value:g}: {100 * elongation_m:.2f} cm")
    # What `--json` prints as results; the lines above then go to stderr.
    give_files((), {"elongation_m": found})


if __name__ == "__main__":
    sys.argv[1:1] = ["study", "slippery"]
    main()
