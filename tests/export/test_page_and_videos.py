from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from PIL import Image

from annelid.config import fields_of
from annelid.draw.render import render_video
from annelid.export import Selection, page, selected
from annelid.export.page import write_page
from annelid.references import references_of
from annelid.simulation.runfile import Run


class Text(HTMLParser):
    """Collects what a reader sees, and what the page would load."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.seen, self.loaded = "", []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loaded += [value or "" for name, value in attrs if name in ("src", "data") or (tag == "link")]

    def handle_data(self, data: str) -> None:
        self.seen += data


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames are not rendered, which takes the longest."""
    pixel = Image.new("RGB", (1, 1))
    monkeypatch.setattr(page, "render_frame", lambda run, time, path: pixel.save(path))


@pytest.mark.usefixtures("undrawn")
def test_the_page_holds_everything_and_loads_nothing(run: Run, tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []
    path = write_page(run, tmp_path / "report.html", lambda done, total: steps.append((done, total)))
    read = Text(path.read_text(encoding="utf-8"))
    assert read.loaded
    assert all(source.startswith("data:image/png;base64,") for source in read.loaded)
    assert len(read.loaded) == steps[-1][1] == len(steps)
    assert f"{run.config.name}: {run.config.body.n_segments} segments" in read.seen
    assert all(field.rpartition(".")[2] in read.seen for field in fields_of(run.config))
    assert all(f"{{{key}," in read.seen for key in references_of(run.config))
    assert "Not drawn" not in read.seen


@pytest.mark.usefixtures("undrawn")
def test_a_figure_that_cannot_be_drawn_leaves_its_reason(planar_run: Run, tmp_path: Path) -> None:
    one = selected(planar_run, Selection(stop_s=0.0))
    html = write_page(one, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Not drawn: " in html
    assert "fewer than two samples" in html


def test_a_gif_shows_the_frames_of_the_window_at_its_rate(planar_run: Run, tmp_path: Path) -> None:
    part = selected(planar_run, Selection(start_s=0.4, stop_s=0.8))
    steps: list[int] = []
    with Image.open(
        render_video(part, tmp_path / "worm.gif", fps=12.5, progress=lambda done, total: steps.append(total))
    ) as image:
        assert image.format == "GIF"
        assert getattr(image, "n_frames", 0) == len(steps) == 6
        assert image.info["duration"] == 80
        assert image.size == (480, 216)


def test_formats_are_listed_as_the_help_says() -> None:
    from annelid.cli.see import export_command
    from annelid.export import FORMATS

    lines = re.findall(r"^    ((?:\w+ )+) +\w", export_command.__doc__ or "", re.MULTILINE)
    assert sorted(name for line in lines if line.split()[0] in FORMATS for name in line.split()) == list(FORMATS)
