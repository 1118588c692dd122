"""Makes the pictures of the documentation again, from the list in ``gallery.toml``.

    python docs/site/gallery.py                         the pictures that take a few minutes or less
    python docs/site/gallery.py slip.png arenas.png     only these, however long they take
    python docs/site/gallery.py --list                  every picture with its command and its minutes

Pictures of numbers in docs/results are redrawn from there; others are drawn from runs, which are kept in build/gallery.
"""

from __future__ import annotations

import csv
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

from annelid.cli import app, config_of, overrides_of
from annelid.errors import ConfigError, RunKilled, suggest
from annelid.experiment import Case, Store, study_progress
from annelid.textfiles import parse_toml, read_json, read_text
from overview import overview_picture

ROOT = Path(__file__).parent.parent.parent
IMAGES, RESULTS, KEPT = ROOT / "docs" / "images", ROOT / "docs" / "results", ROOT / "build" / "gallery"
QUICK_MINUTES = 3.0
"""Pictures that take longer are made only if they are named."""
TILE_PX, TILE_COLUMNS = (560, 350), 4
OF_ONE_RUN = ("frame", "figure7", "track", "network", "video", "overview")


@dataclass(frozen=True, slots=True)
class Picture:
    """An entry of the list, which explains the fields."""

    command: str
    maker: str
    minutes: float
    pages: Sequence[str]
    results: str = ""
    time_s: float = 0.0
    camera: str | None = None
    cameras: Mapping[str, str] = field(default_factory=dict)
    size: Sequence[int] = (640, 400)
    fps: float = 15.0
    speed: float = 1.0
    study: Mapping[str, Any] = field(default_factory=dict)


class Job(NamedTuple):
    """A picture to make, with where things are."""

    picture: Picture
    path: Path  # Where to draw
    results: Path  # The file that it is redrawn from
    store: Store

    @property
    def stem(self) -> Path:
        """The path without a suffix."""
        return self.path.with_suffix("")


@cache
def pictures() -> dict[str, Picture]:
    """Reads the list: every picture by the name of its file."""
    name = "gallery.toml"
    listed = parse_toml((Path(__file__).parent / name).read_text(encoding="utf-8"), name)
    return {picture: Picture(**entry) for picture, entry in listed.items()}


def make(names: Sequence[str], output: Path = IMAGES, kept: Path = KEPT) -> list[Path]:
    """Makes pictures.

    Args:
        names: Their names; none for all that take minutes.
        output: Folder of the pictures.
        kept: Folder in which runs are kept.

    Returns:
        Paths of the pictures.

    Raises:
        ConfigError: There is no such picture, or it is made by hand.
    """
    made_by, known = makers(), pictures()
    for name in names:
        if name not in known:
            raise ConfigError(f"there is no picture {name!r}: {suggest(name, known)}")
        if known[name].maker == "by-hand":
            raise ConfigError(f"{name} is not remade here, but with: {known[name].command}")
    chosen = names or [name for name, one in known.items() if one.maker != "by-hand" and one.minutes <= QUICK_MINUTES]
    for folder in (output, kept):
        folder.mkdir(parents=True, exist_ok=True)
    with study_progress() as progress:
        store = Store(kept / "runs", progress=progress)
        store.compute([case for name in chosen for case in cases(known[name]).values()], "gallery")
        written = []
        for name in chosen:
            one = known[name]
            drawn = made_by[one.maker](Job(one, kept / name, RESULTS / one.results, store))
            written.append(Path(shutil.copyfile(drawn, output / name)))
    return written


def cases(picture: Picture) -> Mapping[str, Case]:
    """Returns the runs that a picture is drawn from: one, or that in every arena by the arena's name."""
    if picture.maker not in (*OF_ONE_RUN, "arenas"):
        return {}
    from typer.main import get_command

    from annelid.config import arena_names

    program: Any = get_command(app)
    above = program.make_context("annelid", [], resilient_parsing=True)
    given = program.commands["run"].make_context("run", shlex.split(picture.command)[2:], parent=above).params
    preset, segments, fidelity = given["preset"], given["segments"], given["fidelity"]
    changes = overrides_of(given["assignments"], duration_s=given["duration"], seed=given["seed"])
    arenas = arena_names() if picture.maker == "arenas" else [given["arena"]]
    return {one: Case(preset, base=config_of(preset, dict(changes), segments, fidelity, one)) for one in arenas}


def _of_run(job: Job) -> Path:
    from annelid.draw import RUN_FIGURES, render_frame, render_video

    one, path = job.picture, job.path
    (case,) = cases(one).values()
    run = job.store.run(case)
    if one.maker == "frame":
        return render_frame(run, one.time_s, path, camera=one.camera)
    if one.maker == "video":
        width, height = one.size
        return render_video(run, path, fps=one.fps, speed=one.speed, camera=one.camera, size=(width, height))
    if one.maker == "overview":
        return overview_picture(run, one.time_s, path)
    return RUN_FIGURES.find(one.maker)(run, path)


def _arenas(job: Job) -> Path:
    from matplotlib.patches import Patch

    from annelid.analysis import nearest_time
    from annelid.draw import DEFAULT_CAMERA, WIDTH_IN, WormScene, canvas, save

    found, time_s, handles = cases(job.picture), job.picture.time_s, []
    width, height = TILE_PX
    rows = -(-(len(found) + 1) // TILE_COLUMNS)
    with canvas(rows * (WIDTH_IN / TILE_COLUMNS * height / width + 0.2)) as figure:
        panels = figure.subplots(rows, TILE_COLUMNS, squeeze=False).ravel()
        for axes in panels:
            axes.axis("off")
        for axes, (name, case) in zip(panels, found.items(), strict=False):
            run, camera = job.store.run(case), job.picture.cameras.get(name, DEFAULT_CAMERA)
            with WormScene(run, width, height, camera, fine=True, words=False) as scene:
                axes.imshow(scene.picture(nearest_time(run, scene.times_s, time_s)))
                handles = [Patch(color=tuple(rgb[:3]), label=name) for name, rgb, _ in scene.legend]
            axes.set_title(name, fontsize=8.0, pad=2.0)
        look: dict[str, Any] = {"loc": "center left", "alignment": "left", "fontsize": 8.0}
        panels[len(found)].legend(handles=handles, title=f"{time_s:g} s after the start", **look)
        return save(figure, job.path)


def _sweep(job: Job) -> Path:
    from annelid import sweep

    sweep(job.picture.study, job.stem, progress=job.store.progress)
    return job.stem / "sweep.png"


def _command(job: Job) -> Path:
    words = [*shlex.split(job.picture.command)[1:], "--quiet", "-o", str(job.stem)]
    done = subprocess.run([sys.executable, "-m", "annelid", *words], stdout=subprocess.DEVNULL, check=False)
    if done.returncode:
        raise RunKilled(f"{job.picture.command}: ended with exit code {done.returncode}")
    return job.stem / f"{job.stem.name}.png"


def _rows(job: Job) -> list[dict[str, str]]:
    return list(csv.DictReader(read_text(job.results).splitlines()))


def _fields(draw: Callable[[Any, Path], Path], kind: Any, job: Job) -> Path:
    """Draws rows of which every column is a field; an empty cell is NaN where it is no text."""
    from pydantic import TypeAdapter

    empty = {name: "" if of == "str" else nan for name, of in kind.__annotations__.items()}
    rows = [{name: cell or empty[name] for name, cell in row.items()} for row in _rows(job)]
    return draw([TypeAdapter(kind).validate_python(row) for row in rows], job.stem)


def _slip(job: Job) -> Path:
    from annelid_studies import slip

    readings = []
    for friction, controller, in_order, draws, *numbers in (row.values() for row in _rows(job)):
        estimates: Any = zip(*[map(float, numbers)] * 3, strict=True)
        readings.append(slip.Reading(float(friction), controller, int(in_order), int(draws), *estimates))
    return slip.feedback_figure(readings, job.stem)


def _bench(job: Job) -> Path:
    from annelid_studies.bench.report import bench_figure

    return bench_figure(read_json(job.results), job.stem)


def _tuning(job: Job) -> Path:
    from annelid.draw import progress_figure

    values = [nan if row["problem"] else float(row["speed_m_per_s"]) for row in _rows(job)]
    return progress_figure(values, "speed (m/s)", True, job.stem)


def _uncertainty(job: Job) -> Path:
    from annelid.draw import uncertainty_figure

    rows = {row["quantity"]: {name: value or nan for name, value in row.items()} for row in _rows(job)}
    return uncertainty_figure(rows, job.path)


def _challenge(job: Job) -> Path:
    from annelid_studies.challenge import report, scores

    return report.ranking_figure(scores.read_scores(job.results), job.stem)


COMPARED = ("annelid, rods", "annelid, chain", "dismech-newton", "PyElastica")
"""Programs of `_costs`; the others are annelid's with another contact."""


def _costs(job: Job) -> Path:
    """Draws how far the walk of each program lies from that of annelid's finest rods over its processor time."""
    from annelid.draw import canvas, panel_title, save_both

    rows = [row for row in _rows(job) if row["program"] in COMPARED]
    finest = max((row for row in rows if row["program"] == COMPARED[0]), key=lambda row: float(row["s_per_s"]))
    with canvas(3.4) as figure:
        panels = figure.subplots(1, 2)
        for axes, name, title in zip(panels, ("elongation_m", "travel_m"), ("elongation", "travel"), strict=True):
            columns = [column for column in finest if column.startswith(f"{name}_")]
            for program, marker in zip(COMPARED, "os^D", strict=True):
                own = [row for row in rows if row["program"] == program and row is not finest]
                means = [sum(float(row[column]) for column in columns) for row in (finest, *own)]
                axes.plot(
                    [float(row["s_per_s"]) for row in own],
                    [100.0 * abs(mean / means[0] - 1.0) for mean in means[1:]],
                    marker=marker,
                    linestyle="none",
                    label=program,
                )
            axes.set(
                xscale="log",
                yscale="log",
                xlabel="processor time for a second (s)",
                ylabel="off annelid's finest run (%)",
            )
            panel_title(axes, title)
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(COMPARED))
        return save_both(figure, job.stem)


def makers() -> Mapping[str, Callable[[Job], Path]]:
    """All that an entry of the list can ask for."""
    from annelid_studies.riddle2025 import paper, runs

    return {
        **dict.fromkeys(OF_ONE_RUN, _of_run),
        "arenas": _arenas,
        "sweep": _sweep,
        "command": _command,
        "slip": _slip,
        "challenge": _challenge,
        "riddle2025": partial(_fields, paper.speeds_picture, runs.Reading),
        "bench": _bench,
        "costs": _costs,
        "tuning": _tuning,
        "uncertainty": _uncertainty,
    }


def main() -> None:
    """Lists the pictures, or makes those that are named."""
    words = sys.argv[1:]
    if words == ["--list"]:
        for name, one in pictures().items():
            print(f"{name:28} {one.minutes:5g} min   {one.command}")
        return
    try:
        print(*make(words), sep="\n")
    except ConfigError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
