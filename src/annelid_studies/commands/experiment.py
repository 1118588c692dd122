"""The studies of one question each, whose commands compute runs, a table and a picture."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

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
    config_of,
    kept_runs,
    lock,
    overrides_of,
    print_results,
    refuse_existing,
    study,
)
from annelid.textfiles import parse_toml


def _gaits(default: str) -> Any:
    words = f"Gaits.  [default: {default}]"
    return Annotated[list[str] | None, typer.Argument(metavar="[PRESET|FILE.toml]...", help=words)]


@dataclass(frozen=True)
class Study:
    """A study of one shape; its help is in ``studies.toml``."""

    name: str  # As in `annelid study NAME`
    module: str  # Module of `annelid_studies`, which is imported when the study is called
    # Takes the store of its runs, the folder of its results, how much is computed and the further options
    function: str = "study"
    options: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)  # Types and defaults of further options
    output: str = ""  # Folder of its results by default; empty for its name

    def command(self) -> Any:
        """Makes the function that Typer makes the command of."""
        words = _words()[self.name]
        options = {
            **self.options,
            "output": (Output, Path(self.output or self.name)),
            "quick": (Annotated[bool, typer.Option("--quick", help=words["quick"])], False),
            "jobs": (Jobs, None),
            "quiet": (Quiet, False),
        }

        def run(output: Path, quick: bool, jobs: int | None, quiet: bool, **further: Any) -> None:
            compute = getattr(import_module(f"annelid_studies.{self.module}"), self.function)
            with kept_runs(output, jobs=jobs, quiet=quiet) as store:
                written, tables = compute(store, output, "quick" if quick else "full", **further)
            print_results(written, *tables, quiet=quiet)

        run.__doc__ = words["help"].replace("\\b", "\b")
        run.__annotations__ = {name: of for name, (of, _) in options.items()}
        run.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [
                inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=of)
                for name, (of, default) in options.items()
            ]
        )
        return run


def _words() -> Mapping[str, Mapping[str, str]]:
    name = "studies.toml"
    return parse_toml((files("annelid_studies.commands") / name).read_text(encoding="utf-8"), name)


_HALF_STEP = Annotated[bool, typer.Option("--half-step", help="Use half the physics step.")]
STUDIES = (
    Study("speed", "crawling", "speed", {"gaits": (_gaits("riddle2025-muscles and crawler"), None)}),
    Study("gaits", "crawling", "gaits", {"gaits": (_gaits("those of the six-segment robot"), None)}),
    Study("slip", "slip", "feedback", {"half_step": (_HALF_STEP, False)}),
    Study("slip-detector", "slip", "detection", output="slip"),
    Study("turning", "turning"),
    Study("pipes", "pipes"),
    Study("robustness", "robustness"),
    Study("weak-middle", "weak_middle.results"),
)
for _study in STUDIES:
    study(_study.name)(_study.command())


@study("load-frame")
def load_frame_command(
    preset: NamedPreset = RIGID_PRESET,
    output: ResultsFolder = Path("load-frame"),
    assignments: Assignments = None,
    fidelity: FidelityLevel = None,
    displacement: Annotated[
        float | None,
        typer.Option(help="How far the cable is wound, mm.  [default: 330 for a radius of 0.16 m, in proportion]"),
    ] = None,
    diameter_share: Annotated[
        float | None,
        typer.Option(help="The same as a share of the diameter, below 0.8: 0.5 halves it."),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(help="Speed of the cable, mm/s.  [default: 10 for a radius of 0.16 m, in proportion]"),
    ] = None,
    cable_friction: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=20.0,
            help="Friction of the cable: its coefficient times its wrap angle in rad.",
        ),
    ] = 0.0,
    data: Annotated[
        Path | None,
        typer.Option(
            help="Measured loop to compare with: CSV of mm, N  [default: the authors' loop, for a worm of its size]"
        ),
    ] = None,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Close one ring by its cable and open it again.

    The cable winds in the middle ring of a weightless worm slowly, and lets it out again. For a worm of the robot's
    size, the table compares its force with the authors' measurement on one segment. It takes a few seconds. Writes
    load_frame.csv, .png and .svg.

    \b
    annelid study load-frame
    annelid study load-frame mine.toml --diameter-share 0.5
    annelid study load-frame --set body.strands.young_modulus_Pa=1e9
    annelid study load-frame --set body.joints.dry_friction_Nm=0.01
    """
    from annelid.experiment import study_progress
    from annelid_lab import calibration as frame

    if displacement is not None and diameter_share is not None:
        raise typer.BadParameter("--displacement and --diameter-share say the same: give one of them")
    table = output / "load_frame.csv"
    lock(output)
    refuse_existing(table, force)
    config = config_of(preset, overrides_of(assignments), fidelity=fidelity)
    # A loop of a far larger or smaller ring says nothing of this one.
    has_measured = data is not None or abs(frame.size_of(config) - 1.0) <= 0.2
    measured = {"measured": frame.read_loop(data)} if has_measured else {}
    with study_progress(quiet=quiet) as progress:
        report = None if progress is None else partial(progress, "load frame", 0, 0)
        tension = frame.load_frame(
            config,
            displacement_m=None if displacement is None else displacement * 1e-3,
            diameter_share=diameter_share,
            speed_m_per_s=None if speed is None else speed * 1e-3,
            progress=report,
        )
    loop = frame.cable_force(tension, cable_friction)
    loops = {config.name: loop, **measured}
    ratio = frame.cable_per_diameter(config)
    written = frame.write_loop(loop, tension, table), frame.draw_loops(loops, table.with_suffix(""), ratio)
    found = {
        name: {"peak_N": loop.force_N.max().item(), "lost_share": loop.lost_share()} for name, loop in loops.items()
    }
    print_results(written, frame.frame_table(loops, ratio), quiet=quiet, results={"loops": found})
