"""The pictures that a run ends with: as many as can be drawn on this machine."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from annelid.draw.plots import figure7
from annelid.draw.render import Progress, render_frame, render_video
from annelid.errors import AnnelidError
from annelid.simulation.runfile import Run
from annelid.terminal import progress_bar

FRAME_TIME_S = 1.5  # time of the frame, as in the paper's Fig. 8; half of the run where it is shorter
VIDEO_TASK = "drawing the video"


def draw_all(run: Run, folder: Path, *, video: bool, quiet: bool, complain: Callable[[object], None]) -> Iterator[Path]:
    """Draws ``figure7.png``, ``frame.png`` and ``video.mp4``, and yields the path of each once it is written.

    Each is announced on stderr unless it is to be ``quiet``, and ``complain`` is called with a sentence for each that
    could not be drawn.
    """
    frame_time = frame_time_s(run)
    frame_remedy = f"annelid draw {folder} --time {frame_time:g}"
    video_path = folder / "video.mp4"

    def draw_video(path: Path) -> Path:
        with task_bar(VIDEO_TASK, quiet=quiet) as progress:
            return render_video(run, path, progress=progress)

    pictures: list[tuple[str, Callable[[Path], Path], str]] = [
        ("figure7.png", lambda path: figure7(run, path), f"annelid draw {folder}"),
        ("frame.png", lambda path: render_frame(run, frame_time, path), frame_remedy),
    ]
    if video:
        pictures.append((video_path.name, draw_video, f"annelid draw {folder} --video {video_path}"))
    for name, draw, remedy in pictures:
        if not quiet:
            print(f"drawing {name}", file=sys.stderr, flush=True)
        try:
            path = draw(folder / name)
        except (AnnelidError, OSError) as error:
            complain(f"{name} not drawn: {error} (the run is whole; then draw with: {remedy})")
        else:
            yield path


def frame_time_s(run: Run) -> float:
    """Returns the time of a run's one frame, s."""
    times = run.data["time"].values
    if times.size and not times[0] <= FRAME_TIME_S <= times[-1]:
        return float(times[0] + times[-1]) / 2
    return FRAME_TIME_S


@contextmanager
def task_bar(task: str, *, quiet: bool = False) -> Iterator[Progress | None]:
    """Gives a progress callback with a bar on a terminal, None elsewhere."""
    if quiet or not sys.stderr.isatty():
        yield None
    else:
        with progress_bar(transient=True) as draw:
            yield lambda done, total: draw(task, done / total, "")
