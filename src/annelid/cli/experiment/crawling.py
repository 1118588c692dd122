"""The commands on crawling worms: `experiment speed`, `slip`, `slip-detector`, `turning` and `pipes`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import ClusterName, Jobs, Output, Quiet, kept_runs, print_results
from annelid.cli.entry import study

SLIP = Path("slip")
GAIT = "riddle2025-muscles"


@study("speed")
def speed_command(
    gaits: Annotated[
        list[str] | None,
        typer.Argument(metavar="[PRESET|FILE.toml]...", help="Gaits.  [default: riddle2025-muscles and crawler]"),
    ] = None,
    output: Output = Path("speed"),
    quick: Annotated[bool, typer.Option("--quick", help="Two values of each quantity.")] = False,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    quiet: Quiet = False,
) -> None:
    """Find out how fast gaits crawl over friction and number of segments.

    Every gait crawls on ground of friction 0.05 to 1.5, and with 3 to 12 segments, whose inner rings are all as strong
    as its second. Speed, stride, period, cost of transport and slip are those of whole cycles.

    Writes speed.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one goes
    on. Some 15 runs a gait of about ten seconds each; docs/speed_of_travel.md explains the results.

    \b
    annelid experiment speed --quick
    annelid experiment speed
    annelid experiment speed crawler tune/best.toml -o mine
    """
    from annelid_studies.crawling import GAITS, VALUES, crawl, crawling_table, write_figure, write_readings

    with kept_runs(output, jobs=jobs, cluster=cluster, quiet=quiet) as store:
        readings = crawl(store, gaits or GAITS, "quick" if quick else "full")
    path = write_readings(readings, output / "speed.csv")
    written = path, write_figure(readings, path.with_suffix(""))
    print_results(written, *(crawling_table(readings, quantity) for quantity in VALUES), quiet=quiet)


@study("slip")
def slip_command(
    output: Output = SLIP,
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
    from annelid_studies.slip import (
        FRICTIONS,
        QUICK_FRICTIONS,
        feedback_figure,
        feedback_table,
        slip_feedback,
        write_readings,
    )

    with kept_runs(output, jobs=jobs, cluster=cluster, quiet=quiet) as store:
        readings = slip_feedback(store, QUICK_FRICTIONS if quick else FRICTIONS, preset)
    path = write_readings(readings, output / "slip.csv")
    written = path, feedback_figure(readings, preset, path.with_suffix(""))
    print_results(written, feedback_table(readings, preset), quiet=quiet)


@study("slip-detector")
def slip_detector_command(
    output: Output = SLIP,
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
    from annelid_studies.slip import (
        CASES,
        QUICK_CASES,
        detection_table,
        detector_figure,
        scores,
        slip_detection,
        write_scores,
    )

    with kept_runs(output, jobs=jobs, cluster=cluster, quiet=quiet) as store:
        detections = slip_detection(store, QUICK_CASES if quick else tuple(CASES))
    found = scores(detections)
    path = write_scores(found, output / "slip_detector.csv")
    written = path, detector_figure(detections, path.with_suffix(""))
    print_results(written, detection_table(found), quiet=quiet)


@study("turning")
def turning_command(
    output: Output = Path("turning"),
    quick: Annotated[bool, typer.Option("--quick", help="The strongest modulation to either side only.")] = False,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    quiet: Quiet = False,
) -> None:
    """Find out on which radius the worm turns.

    The authors' six-segment robot with half-rings crawls on flat ground under constant modulations of its two sides,
    with three gaits: the timed pattern 3x1 with all segments modulated alike, the same with the middle segments bent
    the other way, and the nervous system with ideal muscles.

    Writes turning.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one goes
    on. 21 runs of some seconds to a minute each; docs/turning.md explains the results.

    \b
    annelid experiment turning --quick
    annelid experiment turning -o turning
    """
    from annelid_studies.tables import write_fields
    from annelid_studies.turning import MODULATIONS, QUICK, Reading, turning, turning_picture, turning_table

    with kept_runs(output, jobs=jobs, cluster=cluster, quiet=quiet) as store:
        readings, tracks = turning(store, QUICK if quick else MODULATIONS)
    path = write_fields(Reading, readings, output / "turning.csv")
    written = path, turning_picture(readings, tracks, path.with_suffix(""))
    print_results(written, turning_table(readings), quiet=quiet)


@study("pipes")
def pipes_command(
    output: Output = Path("pipes"),
    quick: Annotated[bool, typer.Option("--quick", help="The taper with two gaits, and one bend.")] = False,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    quiet: Quiet = False,
) -> None:
    """Find out which pipes the worm passes, and how fast.

    The six-segment worm with ideal muscles goes through a taper and an hourglass down to a radius of 0.13 m: with one
    nervous system whose wave keeps its pace, adapts it to the pressure on the worm's back, or is fast throughout; with
    the paper's nervous system, and with the timed pattern 3x1. And round bends of 90 degrees with that pattern, the
    same turning away from contact, the paper's nervous system and the robust one. Speeds are those along the pipe's
    centre line.

    Writes pipes.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one goes on.
    34 runs of half a minute to three minutes each; docs/pipes.md explains the results.

    \b
    annelid experiment pipes --quick
    annelid experiment pipes -o pipes
    """
    from annelid_studies.pipes import Reading, pass_pipes, pipes_picture, pipes_table, trials
    from annelid_studies.tables import write_fields

    with kept_runs(output, jobs=jobs, cluster=cluster, quiet=quiet) as store:
        readings, courses = pass_pipes(store, trials(quick))
    path = write_fields(Reading, readings, output / "pipes.csv")
    written = path, pipes_picture(readings, courses, path.with_suffix(""))
    print_results(written, pipes_table(readings), quiet=quiet)
