# ruff: noqa: D301 -- the help texts need a real backspace: it keeps the lines of an example apart.
"""The commands `experiment slip` and `experiment slip-detector`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import ClusterName, Jobs
from annelid.cli.experiment.kept import Output, Quiet, kept_runs

FOLDER = Path("slip")
GAIT = "riddle2025-muscles"


def slip_command(
    output: Output = FOLDER,
    preset: Annotated[str, typer.Option(help="Gait that gets the feedback: riddle2025-muscles or crawler.")] = GAIT,
    quick: Annotated[bool, typer.Option("--quick", help="Two frictions only.")] = False,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    quiet: Quiet = False,
) -> None:
    """Measure what pressure feedback saves of the work lost to friction.

    A six-segment worm crawls on several frictions with the paper's network, and with that of controller sns-pressure,
    without and with its pressure neurons. Speed and loss are those of whole cycles; "saved" is per second and per
    metre. Writes slip.csv, .png and .svg, and keeps runs, so that an interrupted call goes on. Twenty-one runs of about
    ten seconds each; docs/slip.md explains the results.

    \b
    annelid experiment slip --quick
    annelid experiment slip --preset crawler -o slip-crawler
    """
    from annelid.terminal import Console
    from annelid_studies.slip.feedback import (
        FRICTIONS,
        QUICK,
        feedback_figure,
        feedback_table,
        slip_feedback,
        write_readings,
    )

    words = ["slip", "--preset", preset]
    with kept_runs(words, output, quick=quick, jobs=jobs, cluster=cluster, quiet=quiet) as (store, progress):
        readings = slip_feedback(store, QUICK if quick else FRICTIONS, preset=preset, jobs=jobs, progress=progress)
    if not quiet:
        Console().print(feedback_table(readings, preset))
    path = output / "slip.csv"
    write_readings(readings, path)
    for written in (path, feedback_figure(readings, preset, path.with_suffix(""))):
        typer.echo(written)


def slip_detector_command(
    output: Output = FOLDER,
    quick: Annotated[bool, typer.Option("--quick", help="Two runs only.")] = False,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    quiet: Quiet = False,
) -> None:
    """Judge the slip detector, which knows stretch and pressure only, by the slip that the simulator knows of.

    The six-segment worm crawls by several controllers on several frictions. A segment truly slips while what touches
    of it moves at more than 5 cm/s along the body. Tells precision, recall, delay and false alarms of the detector as
    it is set, and precision against recall over all limits. Writes slip_detector.csv, .png and .svg, and keeps runs,
    which it shares with `annelid experiment slip`; docs/slip.md explains the results.

    \b
    annelid experiment slip-detector --quick
    annelid experiment slip-detector -o slip
    """
    from annelid.terminal import Console
    from annelid_studies.slip.detection import (
        QUICK,
        detection_table,
        detector_figure,
        scores,
        slip_detection,
        write_scores,
    )

    words = ["slip-detector"]
    with kept_runs(words, output, quick=quick, jobs=jobs, cluster=cluster, quiet=quiet) as (store, progress):
        detections = slip_detection(store, QUICK if quick else None, jobs=jobs, progress=progress)
    told = scores(detections)
    if not quiet:
        Console().print(detection_table(told))
    path = output / "slip_detector.csv"
    write_scores(told, path)
    for written in (path, detector_figure(detections, path.with_suffix(""))):
        typer.echo(written)
