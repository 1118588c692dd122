"""The command `calibrate`: identifies a robot from measured experiments."""

from __future__ import annotations

from pathlib import Path
from shutil import copyfile
from typing import Annotated, Literal

import typer

from annelid.cli import (
    Assignments,
    Force,
    Jobs,
    Output,
    Quiet,
    command,
    kept_runs,
    overrides_of,
    print_paths,
    print_results,
    refuse_existing,
    remark,
)


@command("calibrate", "Robot")
def calibrate_command(
    study: Annotated[
        Path | None,
        typer.Argument(
            metavar="[STUDY.toml]",
            help="Worm, parameters and experiments; --example writes one.  [default: the robot of annelid's data]",
        ),
    ] = None,
    output: Output = Path("calibration"),
    assignments: Assignments = None,
    free: Annotated[
        list[str] | None,
        typer.Option(metavar="PARAMETER", help="Fit only these; may be repeated.  [default: those of the study]"),
    ] = None,
    hold_out: Annotated[
        list[str] | None,
        typer.Option(metavar="EXPERIMENT", help="Predict this experiment from the others; may be repeated."),
    ] = None,
    jobs: Jobs = None,
    example: Annotated[
        Literal["walk", "robot"] | None,
        typer.Option(help="Write a study with its data into the output folder: a walk's log, or the authors' robot."),
    ] = None,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Identify a robot from several measured experiments at once.

    A study names a worm, parameters with their bounds, and experiments with their data files. Paths count from its
    folder.

    \b
    tensile     force over the elongation of the strands' tube
    load-frame  force over the displacement of a ring's cable, there and back
    ring-down   a strand that is bent, released, and vibrates
    walk        the log of a walking robot, with a map as for annelid compare

    Writes calibration.json: values, 95 % intervals, correlations and the size of the model error. It warns where the
    data do not determine a parameter, or the model lacks something. Also writes calibration.png and .svg, and
    calibrated.toml, the fitted worm. Simulated experiments are kept, so the same command continues after an
    interruption. A study with a walk or a load frame takes some minutes. Without a study, the tube and one segment of
    the authors' robot are fitted.

    \b
    annelid calibrate --example walk -o mine
    annelid calibrate mine/study.toml -o mine
    annelid calibrate --free young_modulus --free spring_rate
    annelid calibrate --hold-out frame --free young_modulus \\
        --free softening_strain
    annelid run mine/calibrated.toml --uncertainty 8 \\
        --uncertainty-from mine/calibration.json
    """
    from annelid_lab.calibration.report import REPORT, identify, tables, write_identified
    from annelid_lab.calibration.simulations import Simulations
    from annelid_lab.calibration.study import EXAMPLES, ROBOT, load_identify_study

    if example is not None:
        output.mkdir(parents=True, exist_ok=True)
        files = dict(zip(EXAMPLES[example], ("study.toml", *EXAMPLES[example][1:]), strict=True))
        for name in files.values():
            refuse_existing(output / name, force)
        print_paths([copyfile(ROBOT.with_name(source), output / name) for source, name in files.items()])
        return
    source = ROBOT if study is None else study
    loaded = load_identify_study(source)
    loaded = loaded.model_copy(update={"set": {**loaded.set, **overrides_of(assignments)}})
    loaded = loaded.only(free) if free else loaded
    loaded = loaded.holding_out(hold_out) if hold_out else loaded
    with kept_runs(output, jobs=jobs, quiet=quiet) as store:
        refuse_existing(output / REPORT, force)
        simulations = Simulations(store.folder, store.executor, store.progress)
        found = identify(loaded, source.parent, simulations, lambda note: remark(f"note: {note}"))
    for sentence in found.warnings:
        remark(f"warning: {sentence}")
    print_results(write_identified(found, output), *tables(found), quiet=quiet)
