"""Frames and videos from a run's recorded states: later, and on any machine.

The 3D worm is drawn by MuJoCo and needs OpenGL; planar bodies are drawn by matplotlib and do not.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.track import nearest_time
from annelid.errors import MissingDependency, RunFileError
from annelid.output import whole_file, with_suffix
from annelid.simulation.runfile import Run

if TYPE_CHECKING:
    from annelid.draw.planar_scene import PlanarScene
    from annelid.draw.scene import WormScene

FRAME_SUFFIXES = (".png", ".jpg", ".jpeg")
VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".gif")
DEFAULT_CAMERA = "isometric"
MOST_PICTURES = 200_000  # of a video, which are drawn some 30 a second
FPS_RANGE = (1.0, 240.0)
_H264: dict[str, Any] = {"codec": "libx264", "quality": 7}
# 256 colours chosen from the whole video: the format's own palette would leave the strands in bands.
_PALETTE = "split[all][drawn];[all]palettegen[colors];[drawn][colors]paletteuse=dither=none"
_GIF: dict[str, Any] = {
    "codec": "gif",
    "pix_fmt_out": "pal8",
    "macro_block_size": 1,
    "output_params": ["-filter_complex", _PALETTE],
}
_FFMPEG_REMEDY = "unset IMAGEIO_FFMPEG_EXE where it is set, and type: pip install imageio-ffmpeg"

Progress = Callable[[int, int], object]  # called with the number of frames done and their total


def render_frame(
    run: Run,
    time_s: float,
    path: str | Path,
    *,
    camera: str | None = None,
    background: str | None = None,
    size: tuple[int, int] | None = None,
) -> Path:
    """Draws the recorded posture nearest to a time.

    Args:
        run: The run.
        time_s: Simulated time, s.
        path: Picture to write (``.png``, ``.jpg``).
        camera: Name of a view of the 3D worm, see `annelid.draw.camera.VIEWS_DEG`; by default isometric.
        background: ``white`` or ``dark``; by default a floor with squares of 10 cm, or, of a planar worm, white.
        size: Width and height, pixels; by default as the body says.

    Returns:
        The path written.

    Raises:
        RunFileError: The run does not hold that time, has no such camera, or the path has another suffix or
            cannot be written.
        RenderingUnavailable: No OpenGL back-end works.
    """
    import imageio.v3

    path = with_suffix(path, FRAME_SUFFIXES, "a picture")
    size = size or run.config.body.frame_size
    with _scene(run, size, camera, background, fine=True) as scene:
        pixels = scene.picture(nearest_time(run, scene.times_s, time_s))
    with whole_file(path) as draft:
        imageio.v3.imwrite(draft, pixels)
    return path


def render_video(
    run: Run,
    path: str | Path,
    *,
    fps: float = 25.0,
    speed: float = 1.0,
    camera: str | None = None,
    background: str | None = None,
    size: tuple[int, int] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Draws the whole run as a video: H.264, whose edges are less smooth than those of a frame, or an animated GIF.

    The file appears under its name only when it is complete.

    Args:
        run: The run.
        path: Video to write (``.mp4``, ``.mov``, ``.mkv``, ``.gif``).
        fps: Frames per second of the video, 1 to 240; the recorded posture nearest to each is shown.
        speed: Simulated seconds per second of video: 1 is real time, 0.25 a quarter of it.
        camera: Name of a view of the 3D worm, see `annelid.draw.camera.VIEWS_DEG`; by default isometric.
        background: As in `render_frame`.
        size: Width and height, pixels, multiples of 16; by default as the body says, of a GIF half of it.
        progress: Called after every frame.

    Returns:
        The path written.

    Raises:
        RunFileError: The run has no such camera, the path another suffix, ``fps`` or ``speed`` is out of range or makes
            too many pictures, or the file cannot be written whole, as on a full disk.
        RenderingUnavailable: No OpenGL back-end works.
        MissingDependency: There is no ffmpeg to write videos with.
    """
    path = with_suffix(path, VIDEO_SUFFIXES, "a video")
    slowest, fastest = FPS_RANGE
    if not slowest <= fps <= fastest:
        raise RunFileError(f"fps = {fps:g}: a video has {slowest:g} to {fastest:g} frames a second")
    if not 0 < speed < math.inf:
        raise RunFileError(f"speed = {speed:g}: the speed of a video must be positive and finite")
    if size is None:
        width, height = run.config.body.video_size
        # A GIF is large for what it shows, and so it is drawn smaller.
        size = (width // 2, height // 2) if path.suffix.lower() == ".gif" else (width, height)
    fine = path.suffix.lower() == ".gif"
    with _scene(run, size, camera, background, fine=fine) as scene, whole_file(path) as draft:
        first, last = float(scene.times_s[0]), float(scene.times_s[-1])
        pictures = (last - first) * fps / speed + 1.0
        if pictures > MOST_PICTURES:
            raise RunFileError(
                f"speed = {speed:g}: {last - first:g} s of the run at {fps:g} pictures a second make {pictures:.3g} "
                f"pictures, more than {MOST_PICTURES:,}, which take about {pictures / 30 / 3600:.2g} h: raise the speed"
            )
        total = math.floor(pictures + 1e-6)
        with _video(draft, fps, size, path, total) as write:
            for done in range(total):
                frame = nearest_time(run, scene.times_s, first + done * speed / fps)
                write(np.ascontiguousarray(scene.picture(frame)))
                if progress is not None:
                    progress(done + 1, total)
    return path


def _scene(
    run: Run, size: tuple[int, int], camera: str | None, background: str | None, *, fine: bool
) -> WormScene | PlanarScene:
    if not run.config.body.is_planar:
        from annelid.draw.scene import WormScene

        return WormScene(run, *size, camera or DEFAULT_CAMERA, fine=fine, background=background or "floor")
    from annelid.draw.overlay import background_of
    from annelid.draw.planar_scene import PlanarScene

    if camera is not None:
        raise RunFileError(f"camera {camera!r} does not apply: a planar body has one view only")
    if background is not None:
        background_of(background)
    return PlanarScene(run, *size, dark=background == "dark")


@contextmanager
def _video(
    path: Path, fps: float, size: tuple[int, int], name: Path, n_pictures: int
) -> Iterator[Callable[[NDArray[np.uint8]], object]]:
    """Opens a video, and at the end makes sure that every picture is in it, for ffmpeg's exit status is lost."""
    try:
        import imageio_ffmpeg

        ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise MissingDependency(f"no ffmpeg to write {name} with: {_FFMPEG_REMEDY}") from None
    if shutil.which(ffmpeg) is None:
        raise MissingDependency(f"no ffmpeg to write {name} with, there is no program {ffmpeg}: {_FFMPEG_REMEDY}")
    settings = _GIF if path.suffix.lower() == ".gif" else _H264
    frames = imageio_ffmpeg.write_frames(str(path), size, fps=fps, ffmpeg_log_level="quiet", **settings)  # type: ignore[arg-type]
    frames.send(None)
    broken = f"cannot write {name}: ffmpeg ({ffmpeg}) failed; is the disk full, or ffmpeg broken?"
    try:
        try:
            yield frames.send
        finally:
            frames.close()
    except OSError as error:
        raise RunFileError(broken) from error
    try:
        n_frames, _ = imageio_ffmpeg.count_frames_and_secs(path)
    except (RuntimeError, OSError, ValueError) as error:
        raise RunFileError(broken) from error
    if n_frames != n_pictures:
        raise RunFileError(f"{broken} {n_frames} of {n_pictures} pictures are in it")
