"""A run and its pictures as a notebook shows them: HTML that needs nothing else."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from html import escape
from mimetypes import guess_type
from pathlib import Path
from tempfile import TemporaryDirectory

from annelid.analysis import summary
from annelid.draw.figures import RUN_FIGURES
from annelid.draw.gallery import VIDEO_TASK, frame_time_s, task_bar
from annelid.draw.plots import figure7, plot_path
from annelid.draw.render import render_frame, render_video
from annelid.draw.summary_table import COMPARED, closing_sentence, legend, summary_rows
from annelid.errors import AnnelidError
from annelid.simulation.runfile import VIEWS, Run, open_run
from annelid.text import printable

VIDEO_NAME = "video.mp4"
MOST_BYTES = 12_000_000
"""Largest file that is put into a page."""
_LEFT = 'style="text-align:left"'


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture or video in a file, which a notebook shows; it stands wherever a path may.

    Attributes:
        path: The file.
    """

    path: Path

    def __fspath__(self) -> str:
        return str(self.path)

    def __str__(self) -> str:
        return str(self.path)

    def _repr_html_(self) -> str:
        kind = guess_type(self.path.name)[0] or ""
        # Other videos are played by some browsers only.
        if not kind.startswith(("image/", "video/mp4")) or self.path.stat().st_size > MOST_BYTES:
            return f"<p>In the file <code>{_words(self.path)}</code></p>"
        source = f'src="data:{kind};base64,{base64.b64encode(self.path.read_bytes()).decode()}" style="max-width:100%"'
        if kind.startswith("video"):
            return f"<video controls loop muted {source}></video>"
        return f'<img alt="{_words(self.path.stem)}" {source}>'


def plot(run: Run | str | Path, path: str | Path | None = None, *, figure: str = "figure7") -> Picture:
    """Draws a figure of a run: its potentials and lengths over time, or another one.

    Args:
        run: The run, or the path of its folder or file.
        path: File to write (``.png``, ``.pdf``, ``.svg``); by default ``FIGURE.png`` in the run's folder.
        figure: ``figure7``, ``track`` (seen from above), ``network`` (with its potentials), or one of another package.

    Returns:
        The picture, which a notebook shows; ``.path`` is its file.

    Raises:
        RunFileError: There is no such figure or run, the run lacks what is to be drawn, or the file cannot be written.
    """
    draw, opened = RUN_FIGURES.find(figure), _opened(run)
    return Picture(draw(opened, opened.path.with_name(f"{figure}.png") if path is None else plot_path(path)))


def video(
    run: Run | str | Path,
    path: str | Path | None = None,
    *,
    fps: float = 25.0,
    speed: float = 1.0,
    camera: str | None = None,
    background: str | None = None,
) -> Picture:
    """Draws a run as a video, some thirty pictures a second.

    Args:
        run: The run, or the path of its folder or file.
        path: File to write (``.mp4``, ``.mov``, ``.mkv``, ``.gif``); by default ``video.mp4`` in the run's folder.
        fps: Frames per second of the video, 1 to 240.
        speed: Simulated seconds per second of video.
        camera: View of a 3D worm: ``isometric`` (default), ``side``, ``top``, ``front`` or ``course``.
        background: ``white`` or ``dark``; by default a floor with squares of 10 cm.

    Returns:
        The video, which a notebook plays; ``.path`` is its file.

    Raises:
        RunFileError: There is no such run or camera, a number is out of range, or the file cannot be written.
        RenderingUnavailable: The worm is a 3D one, and no OpenGL back-end works.
        MissingDependency: There is no ffmpeg to write videos with.
    """
    opened = _opened(run)
    target = opened.path.with_name(VIDEO_NAME) if path is None else path
    with task_bar(VIDEO_TASK) as bar:
        drawn = render_video(opened, target, fps=fps, speed=speed, camera=camera, background=background, progress=bar)
    return Picture(drawn)


def run_html(run: Run) -> str:
    """Returns a picture of a run, its headline numbers, and a player where there is a video of it.

    A part that cannot be shown leaves the reason in its place.
    """
    parts = [f"<p><code>{_words(repr(run))}</code></p>"]
    for part in (_still, _numbers, _player):
        try:
            parts.append(part(run))
        except Exception as error:  # A cell must not end in a traceback because of how its result is shown.
            parts.append(_paragraph(f"not shown: {error}"))
    return f"<div>{''.join(parts)}</div>"


VIEWS.add("html", run_html)


def _opened(run: Run | str | Path) -> Run:
    return run if isinstance(run, Run) else open_run(run)


def _words(text: object) -> str:
    return escape(printable(str(text)))


def _paragraph(text: str) -> str:
    return f"<p>{_words(text)}</p>" if text else ""


def _still(run: Run) -> str:
    """A frame, or where none can be drawn, as without OpenGL, the plot."""
    with TemporaryDirectory() as folder:
        file, below = Path(folder) / "run.png", ""
        try:
            render_frame(run, frame_time_s(run), file, size=run.config.body.video_size)
        except AnnelidError as error:
            below = _paragraph(f"The worm is not drawn: {error}")
            figure7(run, file)
        return Picture(file)._repr_html_() + below


def _numbers(run: Run) -> str:
    numbers = summary(run)
    beside = legend(numbers, run.config)
    header = ("quantity", "this run", *(COMPARED if beside else ()))
    rows = summary_rows(numbers, run.config)
    lines = "".join(
        f"<tr>{''.join(f'<td {_LEFT}>{_words(cell)}</td>' for cell in row[: len(header)])}</tr>" for row in rows
    )
    head = "".join(f"<th {_LEFT}>{_words(name)}</th>" for name in header)
    below = [beside, closing_sentence(numbers, run.config), *(f"warning: {doubt}" for doubt in numbers.warnings)]
    return f"<table><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>{''.join(map(_paragraph, below))}"


def _player(run: Run) -> str:
    made = run.path.with_name(VIDEO_NAME)
    # An older one is of a run that was replaced; a link may lead to a file that is nobody else's business.
    if made.is_symlink() or not made.exists() or made.stat().st_mtime < run.path.stat().st_mtime:
        return "<p><code>annelid.video(run)</code> makes a video.</p>"
    return Picture(made)._repr_html_()
