"""Frames and videos from a run's recorded states: later, and on any machine.

The 3D worm is drawn by MuJoCo and needs OpenGL; the planar worms are drawn by matplotlib and do not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from annelid.config import PlanarBody
from annelid.errors import MissingDependency, RunFileError

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run

FRAME_SIZE = {"worm": (1280, 800), "riddle2022": (1280, 560)}
VIDEO_SIZE = {"worm": (960, 544), "riddle2022": (960, 432)}
"""Width and height in pixels by the kind of body; a video's are multiples of 16, as its codec likes them."""
FRAME_SUFFIXES = (".png", ".jpg", ".jpeg")
VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv")
DEFAULT_CAMERA = "isometric"

Progress = Callable[[int, int], object]
"""Called with the number of frames done and their total."""


class Scene(Protocol):
    """What draws a run: recorded times, and one picture for each."""

    times_s: NDArray[np.float64]

    def picture(self, frame: int) -> NDArray[np.uint8]:
        """Draws one of the recorded times, as pixels of shape ``(height, width, 3)``."""
        ...


def render_frame(
    run: Run,
    time_s: float,
    path: str | Path,
    *,
    camera: str | None = None,
    size: tuple[int, int] | None = None,
) -> Path:
    """Draws the recorded posture nearest to a time.

    Args:
        run: The run.
        time_s: Simulated time, s.
        path: Picture to write (``.png``, ``.jpg``).
        camera: Name of a view of the 3D worm, see `annelid.view.camera.VIEWS_DEG`; by default isometric.
        size: Width and height, pixels; by default `FRAME_SIZE`.

    Returns:
        The path written.

    Raises:
        RunFileError: The run does not hold that time, has no such camera, or the path has another suffix.
        RenderingUnavailable: No OpenGL back-end works.
    """
    import imageio.v3

    path = _with_suffix(path, FRAME_SUFFIXES, "a picture")
    size = size or FRAME_SIZE[run.config.body.kind]
    with _scene(run, size, camera, fine=True) as scene:
        pixels = scene.picture(_nearest(run, scene.times_s, time_s))
    imageio.v3.imwrite(path, pixels)
    return path


def render_video(
    run: Run,
    path: str | Path,
    *,
    fps: float = 25.0,
    speed: float = 1.0,
    camera: str | None = None,
    size: tuple[int, int] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Draws the whole run as a video (H.264), without shadows, which cost most of the time.

    The file appears under its name only when it is complete.

    Args:
        run: The run.
        path: Video to write (``.mp4``, ``.mov``, ``.mkv``).
        fps: Frames a second of the video; the recorded posture nearest to each is shown.
        speed: Simulated seconds a second of video: 1 is real time, 0.25 a quarter of it.
        camera: Name of a view of the 3D worm, see `annelid.view.camera.VIEWS_DEG`; by default isometric.
        size: Width and height, pixels, multiples of 16; by default `VIDEO_SIZE`.
        progress: Called after every frame.

    Returns:
        The path written.

    Raises:
        RunFileError: The run has no such camera, the path another suffix, or ``fps`` or ``speed`` not positive.
        RenderingUnavailable: No OpenGL back-end works.
        MissingDependency: There is no ffmpeg to write videos with.
    """
    path = _with_suffix(path, VIDEO_SUFFIXES, "a video")
    if not (0 < fps < math.inf and 0 < speed < math.inf):
        raise RunFileError(f"a video needs a positive fps and speed, not fps = {fps:g} and speed = {speed:g}")
    size = size or VIDEO_SIZE[run.config.body.kind]
    draft = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        with _scene(run, size, camera, fine=False) as scene, _video_writer(draft, fps) as write:
            first, last = float(scene.times_s[0]), float(scene.times_s[-1])
            total = math.floor((last - first) * fps / speed + 1e-6) + 1
            for done in range(total):
                write(scene.picture(_nearest(run, scene.times_s, first + done * speed / fps)))
                if progress is not None:
                    progress(done + 1, total)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
    return path


def _scene(run: Run, size: tuple[int, int], camera: str | None, *, fine: bool) -> AbstractContextManager[Scene]:
    if isinstance(run.config.body, PlanarBody):
        from annelid.view.planar_scene import PlanarScene

        if camera is not None:
            raise RunFileError(f"camera {camera!r} does not apply: a planar worm has one view only")
        return PlanarScene(run, *size)
    from annelid.view.scene import WormScene

    return WormScene(run, *size, camera or DEFAULT_CAMERA, fine=fine)


def _nearest(run: Run, times_s: NDArray[np.float64], time_s: float) -> int:
    """Index of the recorded time nearest to a wanted one, which must lie within the run."""
    margin = float(np.diff(times_s).max()) if len(times_s) > 1 else 0.0
    if not times_s[0] - margin <= time_s <= times_s[-1] + margin:
        raise RunFileError(
            f"{run.path} has no picture at {time_s:g} s: it was recorded from {times_s[0]:g} to {times_s[-1]:g} s"
        )
    return int(np.abs(times_s - time_s).argmin())


def _with_suffix(path: str | Path, suffixes: tuple[str, ...], what: str) -> Path:
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise RunFileError(f"{path} cannot be written as {what}: its name must end in {', '.join(suffixes)}")
    return path


@contextmanager
def _video_writer(path: Path, fps: float) -> Iterator[Callable[[Any], object]]:
    import imageio.v2

    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise MissingDependency("no ffmpeg to write videos with: install it with: pip install imageio-ffmpeg") from None
    writer = imageio.v2.get_writer(path, format="FFMPEG", fps=fps, codec="libx264", quality=7)  # type: ignore[arg-type]
    try:
        yield lambda pixels: writer.append_data(pixels)
    finally:
        writer.close()
