"""A run and its pictures in a notebook, and the notebook of the docs."""

from __future__ import annotations

import json
import os
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import nbformat
import pytest

import annelid
from annelid.draw import gl
from annelid.draw.notebook import Picture
from annelid.errors import RenderingUnavailable, RunFileError
from annelid.simulation.runfile import Run
from opengl import rendering_works

QUICK_START = Path(__file__).parents[2] / "docs" / "tutorials" / "quick_start.ipynb"


class Tags(HTMLParser):
    """Names of a page's tags, and all that it refers to."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.sources: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.sources += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]


@pytest.fixture
def copied(planar_run: Run, tmp_path: Path) -> Run:
    """A run in a folder of its own, to draw into."""
    return annelid.open_run(shutil.copy(planar_run.path, tmp_path))


def html_of(shown: Any) -> str:
    """What a notebook shows."""
    html = shown._repr_html_()
    assert all(source.startswith("data:") for source in Tags(html).sources), "refers to nothing outside of itself"
    return html


def test_plot_draws_a_run_or_its_file(copied: Run, tmp_path: Path) -> None:
    assert annelid.plot(copied).path == tmp_path / "figure7.png"
    for suffix, tags in ((".svg", ["img"]), (".pdf", ["p", "code"])):
        drawn = annelid.plot(str(tmp_path), tmp_path / f"mine{suffix}", figure="network")
        assert os.fspath(drawn) == str(drawn) == str(tmp_path / f"mine{suffix}")
        assert Tags(html_of(drawn)).tags == tags
    with pytest.raises(RunFileError, match="unknown figure 'figure8'"):
        annelid.plot(copied, figure="figure8")


def test_a_video_is_played_there_and_then_with_its_run(copied: Run, tmp_path: Path) -> None:
    assert "annelid.video(run)" in html_of(copied)
    drawn = annelid.video(copied, fps=5.0, speed=3.0)
    assert drawn.path == tmp_path / "video.mp4"
    assert Tags(html_of(drawn)).tags == ["video"]
    assert "video" in Tags(html_of(copied)).tags
    os.utime(drawn.path, (0.0, 0.0))
    assert "video" not in Tags(html_of(copied)).tags, "it is older than the run"
    drawn.path.unlink()
    drawn.path.symlink_to(copied.path)
    assert "video" not in Tags(html_of(copied)).tags


def test_what_no_browser_shows_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a<b>.png").write_bytes(b"12")
    assert "<img" in html_of(Picture(tmp_path / "a<b>.png"))
    monkeypatch.setattr("annelid.draw.notebook.MOST_BYTES", 1)
    assert "a&lt;b&gt;.png</code>" in html_of(Picture(tmp_path / "a<b>.png"))


def test_a_run_is_shown_with_picture_and_headline_numbers(rods_run: Run) -> None:
    html = html_of(rods_run)
    assert Tags(html).tags.count("img") == 1
    assert ("The worm is not drawn" in html) != rendering_works()
    for words in ("order", "period (s)", "travel (mm)", "2.63*", "differs from riddle2023-rods"):
        assert words in html
    assert html.count("<tr>") < 15


def test_without_opengl_the_plot_stands_in_and_a_video_is_refused(
    rods_run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(gl, "works", lambda backend: False)
    html = html_of(rods_run)
    assert Tags(html).tags.count("img") == 1
    assert "The worm is not drawn: no OpenGL back-end works here" in html
    with pytest.raises(RenderingUnavailable, match="no OpenGL back-end works here"):
        annelid.video(rods_run, tmp_path / "a.mp4")


def test_words_of_a_run_are_escaped_and_nothing_of_it_fails(planar_run: Run, tmp_path: Path) -> None:
    evil = '<script>"x"</script>'
    config = planar_run.config.model_copy(update={"name": evil, "published": None})
    attacked = replace(planar_run, config=config, warnings=(evil,), path=tmp_path / evil.replace("/", "") / "run.nc")
    assert "script" not in Tags(html_of(attacked)).tags
    nothing = attacked.with_data(planar_run.data.isel(time=slice(0), frame=slice(0)))
    html = html_of(nothing)
    assert "script" not in Tags(html).tags
    assert "not shown: " in html
    assert "too little to plot" in html


def test_a_run_without_a_network_says_so(tmp_path: Path) -> None:
    config = annelid.load_config("riddle2025-3x1", {"duration_s": 0.02})
    run = annelid.simulate(config, tmp_path, progress=False)
    with pytest.raises(RunFileError, match="no network to draw: its controller is timed"):
        annelid.plot(run, figure="network")


def test_the_quick_start_is_a_notebook_without_outputs() -> None:
    notebook = nbformat.read(QUICK_START, as_version=nbformat.NO_CONVERT)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.outputs == [] and cell.execution_count is None for cell in code)


@pytest.mark.slow
def test_the_quick_start_runs_from_top_to_bottom(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    cells = json.loads(QUICK_START.read_text(encoding="utf-8"))["cells"]
    install, *others = ("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    assert re.match(r"%pip install", install), "the one line that is the notebook's and not Python's"
    known: dict[str, Any] = {}
    for code in others:
        if "annelid.video(" in code and not rendering_works():
            with pytest.raises(RenderingUnavailable):
                exec(compile(code, QUICK_START.name, "exec"), known)
        else:
            exec(compile(code, QUICK_START.name, "exec"), known)
    assert {"run.nc", "figure7.png"} <= {path.name for path in tmp_path.rglob("*")}
    assert isinstance(known["run"], Run)
