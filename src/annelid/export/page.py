"""A run as one HTML page that needs nothing else: numbers, figures, configuration, and what to cite."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from annelid.analysis import summary
from annelid.config import RunConfig, field_value, fields_of, toml_value
from annelid.draw.figures.track import track_figure
from annelid.draw.page import html_page
from annelid.draw.plots import figure7
from annelid.draw.render import Progress, render_frame
from annelid.draw.summary_table import COMPARED, closing_sentence, legend, summary_rows
from annelid.errors import AnnelidError
from annelid.markdown import anchors, code, emphasis, table, words
from annelid.output import whole_file
from annelid.references import bibtex, references_of
from annelid.simulation.runfile import Run


def write_page(run: Run, path: Path, progress: Progress = lambda done, total: None) -> Path:
    """Writes the page of a run; a figure that cannot be drawn leaves the reason in its place.

    Args:
        run: The run.
        path: File to write.
        progress: Called after every figure.

    Raises:
        RunFileError: The file cannot be written.
    """
    with TemporaryDirectory() as temporary:
        figures = _figures(run, Path(temporary), progress)
        cited = ["## To cite", f"```bibtex\n{bibtex(references_of(run.config))}```"]
        blocks = [*_numbers(run), *figures, *_configuration(run.config), *cited]
        headings = [block.removeprefix("## ") for block in blocks if block.startswith("## ")]
        links = zip(headings, anchors(headings), strict=True)
        contents = "\n".join(f"- [{heading}](#{anchor})" for heading, anchor in links)
        times = run.data["time"].values
        title = f"{run.config.name}: {run.config.body.n_segments} segments, {times[0]:g} to {times[-1]:g} s"
        html = html_page(title, f"# {words(title)}\n\n{_head(run)}", contents, "\n\n".join(blocks), Path(temporary))
    with whole_file(path) as draft:
        draft.write_text(html, encoding="utf-8")
    return path


def _head(run: Run) -> str:
    attrs = run.data.attrs
    facts = [
        run.status.replace("_", " ") + (f" ({run.message})" if run.message else ""),
        f"annelid {attrs['annelid_version']}",
        f"MuJoCo {attrs['mujoco_version']}",
        f"{attrs['platform']}",
        f"run of {attrs['created']}",
    ]
    return f"{words(run.config.summary)}\n\n{' · '.join(map(words, facts))}"


def _numbers(run: Run) -> list[str]:
    numbers = summary(run)
    rows = summary_rows(numbers, run.config, everything=True)
    beside = legend(numbers, run.config)
    header = ["quantity", "this run", *(COMPARED if beside else ())]
    cells = [[words(word) for word in row[: len(header)]] for row in rows]
    below = [beside, closing_sentence(numbers, run.config)]
    return ["## Numbers", table(header, cells), *(words(text) for text in below if text)]


def _figures(run: Run, folder: Path, progress: Progress) -> list[str]:
    frames = run.data["frame_time"].values
    middle = float(frames[len(frames) // 2]) if frames.size else 0.0
    pictures: list[tuple[str, Callable[[Run, Path], object], str]] = [
        ("frame.png", lambda run, path: render_frame(run, middle, path), f"The worm at {middle:g} s."),
        ("figure7.png", figure7, "Potentials of the half-centres, contractions, and lengths of the stretch sensors."),
    ]
    if "crossing_position" in run.data:
        pictures.append(("track.png", track_figure, "Where it crawled, seen from above."))
    blocks = ["## Figures"]
    for done, (name, draw, caption) in enumerate(pictures, start=1):
        try:
            draw(run, folder / name)
            blocks += [f"![{words(caption)}]({name})", words(caption)]
        except AnnelidError as error:
            blocks.append(emphasis(f"Not drawn: {error}."))
        progress(done, len(pictures))
    return blocks


def _configuration(config: RunConfig) -> list[str]:
    """A table for every section."""
    sections: dict[str, list[list[str]]] = {}
    for path, meaning in fields_of(config).items():
        section, _, name = path.rpartition(".")
        value = field_value(config, path)
        shown = "not set" if value is None else toml_value(value)
        sections.setdefault(section or "run", []).append([code(name), code(shown), words(meaning)])
    tables = [(f"### {words(name)}", table(["field", "value", "meaning"], rows)) for name, rows in sections.items()]
    return ["## Configuration", *(block for pair in tables for block in pair)]
