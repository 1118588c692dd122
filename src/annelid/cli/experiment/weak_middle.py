"""The command `experiment weak-middle`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import ClusterName, Jobs, Output, Quiet, kept_runs, print_results
from annelid.cli.entry import study


@study("weak-middle")
def weak_middle_command(
    output: Output = Path("weak-middle"),
    quick: Annotated[bool, typer.Option("--quick", help="Worms of 3 and 4 segments and two values a sweep.")] = False,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    quiet: Quiet = False,
) -> None:
    """Find out why the middle of the worm elongates less than its ends.

    Every segment of a resting worm (preset wang with the authors' rods and springs) is pulled alone, wound in and held
    until it stands still; the deficit is how far the interior segments stay below the two ends, on average. Swept one
    at a time: number of segments, Young's modulus, weight, friction; each with four kinds of actuators. Force-limited:
    a servo that stalls at a tension. Servo: one that stalls, or ends at its shortest cable. Muscle: the paper's, whose
    force falls with its length. Length-limited: wound to a length, whatever that takes. Then: which differences
    between two interior segments would make them elongate as the robot's, 3.82 and 4.78 cm.

    Writes weak_middle.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one
    goes on. About 250 runs of some seconds each; docs/weak_middle.md explains the results.

    \b
    annelid experiment weak-middle --quick
    annelid experiment weak-middle -o weak-middle
    """
    from annelid_studies.weak_middle.results import (
        asymmetry_table,
        checks_table,
        settings_table,
        sweep_table,
        weak_middle_figure,
        write_readings,
    )
    from annelid_studies.weak_middle.sweeps import BASE_KEY, QUANTITIES, asymmetry, weak_middle

    found = None
    with kept_runs(output, jobs=jobs, cluster=cluster, quiet=quiet) as store:
        set_to, readings = weak_middle(store, "quick" if quick else "full")
        if not quick:
            found = asymmetry(store, set_to[BASE_KEY].force_N)
    tables = [settings_table(set_to), *(sweep_table(readings, quantity) for quantity in QUANTITIES)]
    tables += [checks_table(readings), asymmetry_table(found)] if found else []
    path = write_readings([*readings, *(found.readings if found else ())], output / "weak_middle.csv")
    print_results((path, weak_middle_figure(readings, path.with_suffix(""))), *tables, quiet=quiet)
