"""The studies of one question each, whose commands compute runs, a table and a picture."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli import (
    RIGID_PRESET,
    Assignments,
    FidelityLevel,
    Force,
    Jobs,
    NamedPreset,
    Output,
    Quiet,
    ResultsFolder,
    SchedulerAddress,
    config_of,
    kept_runs,
    lock,
    overrides_of,
    print_results,
    refuse_existing,
    study,
)

SLIP = Path("slip")


@study("speed")
def speed_command(
    gaits: Annotated[
        list[str] | None,
        typer.Argument(metavar="[PRESET|FILE.toml]...", help="Gaits.  [default: riddle2025-muscles and crawler]"),
    ] = None,
    output: Output = Path("speed"),
    quick: Annotated[bool, typer.Option("--quick", help="Two values of each quantity.")] = False,
    jobs: Jobs = None,
    scheduler: SchedulerAddress = None,
    quiet: Quiet = False,
) -> None:
    """Find out how fast gaits crawl over friction and number of segments.

    Every gait crawls on ground of friction 0.05 to 1.5, and with 3 to 12 segments, whose inner rings are all as strong
    as its second. Speed, stride, period, cost of transport and slip are computed over complete cycles.

    Writes speed.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one goes
    on. Some 15 runs a gait of about ten seconds each; docs/speed_of_travel.md explains the results.

    \b
    annelid study speed --quick
    annelid study speed
    annelid study speed crawler tune/best.toml -o mine
    """
    from annelid_studies import crawling

    with kept_runs(output, jobs=jobs, scheduler=scheduler, quiet=quiet) as store:
        readings = crawling.crawl(store, gaits or crawling.GAITS, "quick" if quick else "full")
    path = crawling.write_readings(readings, output / "speed.csv")
    tables = (crawling.crawling_table(readings, quantity) for quantity in crawling.VALUES)
    print_results((path, crawling.write_figure(readings, path.with_suffix(""))), *tables, quiet=quiet)


@study("gaits")
def gaits_command(
    gaits: Annotated[
        list[str] | None,
        typer.Argument(metavar="[PRESET|FILE.toml]...", help="Gaits.  [default: those of the six-segment robot]"),
    ] = None,
    output: Output = Path("gaits"),
    quick: Annotated[bool, typer.Option("--quick", help="Two perturbed runs, and half the step only.")] = False,
    jobs: Jobs = None,
    scheduler: SchedulerAddress = None,
    quiet: Quiet = False,
) -> None:
    """Measure gaits with error bars: is a speed an accident of its run, or of the resolution?

    Every gait runs eight times with a friction drawn within one percent of its own, at half and a quarter of the
    physics step, and with one and two more elements a side. Of speed, stride, period, slip and cost of transport it
    gives the mean, its 95 % interval by Student's t, and the relative change at each resolution.

    Writes gaits.csv, and keeps runs, so that an interrupted call goes on. Thirteen runs a gait, of which the finer ones
    take longest; docs/speed_of_travel.md explains the results.

    \b
    annelid study gaits --quick
    annelid study gaits crawler
    annelid study gaits crawler tune/best.toml -o mine
    """
    from annelid_studies import crawling

    found: list[crawling.Headline] = []
    path = output / "gaits.csv"
    with kept_runs(output, jobs=jobs, scheduler=scheduler, quiet=quiet) as store:
        for one in crawling.headlines(store, gaits or crawling.HEADLINES, "quick" if quick else "full"):
            found.append(one)
            crawling.write_headlines(found, path)
    print_results((path,), crawling.headline_table(found), quiet=quiet)


@study("slip")
def slip_command(
    output: Output = SLIP,
    quick: Annotated[bool, typer.Option("--quick", help="Two frictions and two draws only.")] = False,
    half_step: Annotated[bool, typer.Option("--half-step", help="Bodies move in steps half as long.")] = False,
    jobs: Jobs = None,
    scheduler: SchedulerAddress = None,
    quiet: Quiet = False,
) -> None:
    """Measure what pressure feedback saves of the work lost to friction, against a wave by the clock.

    A six-segment worm crawls on several frictions by the paper's network, by controller sns-pressure with and without
    its pressure neurons, and by a timed wave, tuned with the same budget as the feedback. Speed and loss per metre are
    means over draws of the friction within one percent, computed over complete cycles; "saved" is against the timed
    wave on the same draws. Writes slip.csv, .png and .svg, and keeps runs, so that an interrupted call goes on. 48 runs
    of 14 s; docs/slip.md explains the results.

    \b
    annelid study slip --quick
    annelid study slip --half-step -o slip-half
    """
    from annelid_studies import slip

    with kept_runs(output, jobs=jobs, scheduler=scheduler, quiet=quiet) as store:
        readings = slip.slip_feedback(store, "quick" if quick else "full", half_step=half_step)
    path = slip.write_readings(readings, output / "slip.csv")
    written = path, slip.feedback_figure(readings, path.with_suffix(""))
    print_results(written, slip.feedback_table(readings), quiet=quiet)


@study("slip-detector")
def slip_detector_command(
    output: Output = SLIP,
    quick: Annotated[bool, typer.Option("--quick", help="Two runs only.")] = False,
    jobs: Jobs = None,
    scheduler: SchedulerAddress = None,
    quiet: Quiet = False,
) -> None:
    """Judge the slip detector, which knows stretch and pressure only, by the slip that the simulator knows of.

    The six-segment worm crawls by several controllers on several frictions. A segment truly slips while what touches
    of it moves at more than 5 cm/s along the body. Prints precision, recall, delay and false alarms of the detector as
    it is set, and precision against recall over all limits. Writes slip_detector.csv, .png and .svg, and keeps runs,
    which it shares with `annelid study slip`; docs/slip.md explains the results.

    \b
    annelid study slip-detector --quick
    annelid study slip-detector -o slip
    """
    from annelid_studies import slip

    with kept_runs(output, jobs=jobs, scheduler=scheduler, quiet=quiet) as store:
        found = slip.slip_detection(store, slip.QUICK_CASES if quick else tuple(slip.CASES))
    scores = slip.scores(found)
    path = slip.write_scores(scores, output / "slip_detector.csv")
    written = path, slip.detector_figure(found, path.with_suffix(""))
    print_results(written, slip.detection_table(scores), quiet=quiet)


@study("turning")
def turning_command(
    output: Output = Path("turning"),
    quick: Annotated[bool, typer.Option("--quick", help="The strongest modulation to either side only.")] = False,
    jobs: Jobs = None,
    scheduler: SchedulerAddress = None,
    quiet: Quiet = False,
) -> None:
    """Find out on which radius the worm turns.

    The authors' six-segment robot with half-rings crawls on flat ground under constant modulations of its two sides,
    with three gaits: the timed pattern 3x1 with all segments modulated alike, the same with the middle segments bent
    the other way, and the nervous system with ideal muscles.

    Writes turning.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one goes
    on. 21 runs of some seconds to a minute each; docs/turning.md explains the results.

    \b
    annelid study turning --quick
    annelid study turning -o turning
    """
    from annelid_studies.tables import write_fields
    from annelid_studies.turning import MODULATIONS, QUICK, Reading, turning, turning_picture, turning_table

    with kept_runs(output, jobs=jobs, scheduler=scheduler, quiet=quiet) as store:
        readings, tracks = turning(store, QUICK if quick else MODULATIONS)
    path = write_fields(Reading, readings, output / "turning.csv")
    written = path, turning_picture(readings, tracks, path.with_suffix(""))
    print_results(written, turning_table(readings), quiet=quiet)


@study("pipes")
def pipes_command(
    output: Output = Path("pipes"),
    quick: Annotated[bool, typer.Option("--quick", help="The taper with two gaits, and one bend.")] = False,
    jobs: Jobs = None,
    scheduler: SchedulerAddress = None,
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
    annelid study pipes --quick
    annelid study pipes -o pipes
    """
    from annelid_studies.pipes import Reading, pass_pipes, pipes_picture, pipes_table, trials
    from annelid_studies.tables import write_fields

    with kept_runs(output, jobs=jobs, scheduler=scheduler, quiet=quiet) as store:
        readings, courses = pass_pipes(store, trials(quick))
    path = write_fields(Reading, readings, output / "pipes.csv")
    written = path, pipes_picture(readings, courses, path.with_suffix(""))
    print_results(written, pipes_table(readings), quiet=quiet)


@study("riddle2025")
def riddle2025_command(
    output: Output = Path("riddle2025"),
    quick: Annotated[bool, typer.Option("--quick", help="One friction, and one bend.")] = False,
    jobs: Jobs = None,
    scheduler: SchedulerAddress = None,
    quiet: Quiet = False,
) -> None:
    """Compare the six-segment robot with its authors' model, on their axes.

    The timed patterns 3x1 and 2x2 on flat ground over friction, with servos and with the muscles of the authors' model;
    and 3x1, straight ahead and turning away from contact, through bends of 90 degrees in a pipe of 0.20 m. Speeds are
    defined as in the authors' scripts. Each point is at least three runs, whose frictions differ by a percent.

    Writes riddle2025.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one
    goes on. 52 runs of a quarter of a minute to two minutes each; docs/validation.md explains the results.

    \b
    annelid study riddle2025 --quick
    annelid study riddle2025 -o riddle2025
    """
    from annelid_studies.riddle2025 import Reading, compare, comparison_picture, comparison_table, points
    from annelid_studies.tables import write_fields

    with kept_runs(output, jobs=jobs, scheduler=scheduler, quiet=quiet) as store:
        readings = compare(store, points(quick))
    path = write_fields(Reading, readings, output / "riddle2025.csv")
    print_results((path, comparison_picture(readings, path.with_suffix(""))), comparison_table(readings), quiet=quiet)


@study("load-frame")
def load_frame_command(
    preset: NamedPreset = RIGID_PRESET,
    output: ResultsFolder = Path("load-frame"),
    assignments: Assignments = None,
    fidelity: FidelityLevel = None,
    displacement: Annotated[float, typer.Option(help="How far the cable is wound, mm.")] = 330.0,
    speed: Annotated[float, typer.Option(help="Speed of the cable, mm/s.")] = 10.0,
    cable_friction: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=20.0,
            help="Friction of the cable, a number without unit: coefficient times its wrap angle in rad.",
        ),
    ] = 0.0,
    data: Annotated[
        Path | None, typer.Option(help="Measured loop to compare with: CSV of mm, N.  [default: the one of annelid]")
    ] = None,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Close one ring by its cable and open it again.

    The middle ring of a weightless worm is wound in slowly and let out; the cable's force is compared with what
    the authors measured on one segment of the robot. A few seconds. Writes load_frame.csv, .png and .svg.

    \b
    annelid study load-frame
    annelid study load-frame --set body.strands.young_modulus_Pa=1e9 --set body.joints.dry_friction_Nm=0.01
    """
    from annelid.experiment import study_progress
    from annelid_lab import calibration as frame

    table = output / "load_frame.csv"
    lock(output)
    refuse_existing(table, force)
    measured = frame.read_loop(data)
    config = config_of(preset, overrides_of(assignments), fidelity=fidelity)
    with study_progress(quiet=quiet) as progress:
        report = None if progress is None else partial(progress, "load frame", 0, 0)
        sizes = {"displacement_m": displacement * 1e-3, "speed_m_per_s": speed * 1e-3}
        tension = frame.load_frame(config, **sizes, progress=report)
    loop = frame.cable_force(tension, cable_friction)
    loops = {config.name: loop, "measured": measured}
    written = frame.write_loop(loop, tension, table), frame.draw_loops(loops, table.with_suffix(""))
    found = {
        name: {"peak_N": loop.force_N.max().item(), "lost_share": loop.lost_share()} for name, loop in loops.items()
    }
    print_results(written, frame.frame_table(loops), quiet=quiet, results={"loops": found})


@study("weak-middle")
def weak_middle_command(
    output: Output = Path("weak-middle"),
    quick: Annotated[bool, typer.Option("--quick", help="Worms of 3 and 4 segments and two values a sweep.")] = False,
    jobs: Jobs = None,
    scheduler: SchedulerAddress = None,
    quiet: Quiet = False,
) -> None:
    """Find out why the middle of the worm elongates less than its ends.

    Every segment of a resting worm (the four-segment robot with the authors' rods and springs) is pulled alone, wound
    in and held until it stands still; the deficit is how far the interior segments stay below the two ends, on average.
    Swept one at a time: number of segments, Young's modulus, weight, friction; each with four kinds of actuators.
    Force-limited: a servo that stalls at a tension. Servo: one that stalls, or ends at its shortest cable. Muscle: the
    paper's, whose force falls with its length. Length-limited: wound to a length, whatever that takes. Then: which
    differences between two interior segments would make them elongate as the robot's, 3.82 and 4.78 cm.

    Writes weak_middle.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one
    goes on. About 250 runs of some seconds each; docs/weak_middle.md explains the results.

    \b
    annelid study weak-middle --quick
    annelid study weak-middle -o weak-middle
    """
    from annelid_studies.weak_middle import results
    from annelid_studies.weak_middle.sweeps import BASE_KEY, QUANTITIES, asymmetry, weak_middle

    found = None
    with kept_runs(output, jobs=jobs, scheduler=scheduler, quiet=quiet) as store:
        set_to, readings = weak_middle(store, "quick" if quick else "full")
        if not quick:
            found = asymmetry(store, set_to[BASE_KEY].force_N)
    tables = [results.settings_table(set_to), *(results.sweep_table(readings, quantity) for quantity in QUANTITIES)]
    tables += [results.checks_table(readings), results.asymmetry_table(found)] if found else []
    path = results.write_readings([*readings, *(found.readings if found else ())], output / "weak_middle.csv")
    print_results((path, results.weak_middle_figure(readings, path.with_suffix(""))), *tables, quiet=quiet)
