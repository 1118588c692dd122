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

from annelid.analysis.gait import cycle_marks
from annelid.analysis.track import nearest_time
from annelid.draw.canvas import WIDTH_IN, canvas, save
from annelid.errors import MissingDependency, RunFileError
from annelid.output import whole_file, with_suffix
from annelid.simulation.runfile import Run

if TYPE_CHECKING:
    from annelid.draw.planar_scene import PlanarScene
    from annelid.draw.scene import WormScene

FRAME_SUFFIXES = (".png", ".jpg", ".jpeg")
STRIP_SUFFIXES = (".png", ".pdf", ".svg")
STRIP_SIZE = (840, 525)
STRIP_RANGE, STRIP_COLUMNS, STRIP_DPI = (2, 24), 3, 300.0
VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".gif")
DEFAULT_CAMERA = "isometric"
MOST_PICTURES = 200_000  # of a video, which are drawn some 30 a second
FPS_RANGE = (1.0, 240.0)
_H264: dict[str, Any] = {"codec": "libx264", "quality": 7}
# 256 colours chosen from the whole video: the format's own palette would leave the strands in bands.
_PALETTE = "split[all][drawn];[all]palettegen=stats_mode=diff[colors];[drawn][colors]paletteuse=dither=bayer"
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


def render_strip(
    run: Run,
    path: str | Path,
    n_frames: int = 6,
    *,
    camera: str | None = None,
    background: str | None = None,
) -> Path:
    """Draws one cycle of a 3D worm as frames side by side with their times: the last whole one, or all of a run.

    Args:
        run: The run.
        path: File to write; its suffix chooses the format (``.png``, ``.pdf``, ``.svg``).
        n_frames: Number of frames, evenly spaced in time, 2 to 24.
        camera: As in `render_frame`.
        background: As in `render_frame`.

    Returns:
        The path written.

    Raises:
        RunFileError: As of `render_frame`, the body is planar, or ``n_frames`` is out of range.
        RenderingUnavailable: No OpenGL back-end works.
    """
    from annelid.draw.overlay import background_of, legend_handle, length_name

    path = with_suffix(path, STRIP_SUFFIXES, "a strip of frames")
    fewest, most = STRIP_RANGE
    if not fewest <= n_frames <= most:
        raise RunFileError(f"{n_frames} frames: a strip has {fewest} to {most}")
    if run.config.body.is_planar:
        raise RunFileError("a strip of frames shows a 3D worm, and this one is planar: draw its frames one by one")
    width, height = STRIP_SIZE
    with _worm_scene(run, STRIP_SIZE, camera, background, fine=True, words=False) as scene:
        marks = cycle_marks(run)
        start, end = marks[-2:] if len(marks) > 1 else scene.times_s[[0, -1]]
        shown = [nearest_time(run, scene.times_s, t) for t in np.linspace(start, end, n_frames, endpoint=False)]
        pictures = [scene.picture(frame) for frame in shown]
        entries, length_m, pixels_per_m = scene.legend, scene.bar_m, scene.pixels_per_m
    columns = min(n_frames, STRIP_COLUMNS)
    rows = math.ceil(n_frames / columns)
    height_in = rows * (WIDTH_IN / columns * height / width + 0.25) + 0.3
    with canvas(height_in, dark=background == "dark") as figure:
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes in panels:
            axes.axis("off")
        for axes, picture, frame in zip(panels, pictures, shown, strict=False):
            axes.imshow(picture, interpolation="antialiased")
            axes.set_title(f"{scene.times_s[frame]:.2f} s", fontsize=9.0, pad=3.0)
        # The camera keeps its distance, so one bar is right for all.
        bar, ink = [0.96 * width - length_m * pixels_per_m, 0.96 * width], background_of(background or "floor").ink
        panels[0].plot(bar, [0.94 * height] * 2, color=ink, linewidth=1.6, solid_capstyle="butt")
        panels[0].text(np.mean(bar), 0.92 * height, length_name(length_m), ha="center", fontsize=7.0, color=ink)
        handles = [legend_handle(*entry) for entry in entries]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=7.5, handlelength=1.4)
        return save(figure, path, dpi=STRIP_DPI)


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
    """Draws the whole run as a video (H.264, or an animated GIF); its edges are less smooth than those of a frame.

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
    with _scene(run, size, camera, background, fine=False) as scene, whole_file(path) as draft:
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
        return _worm_scene(run, size, camera, background, fine=fine, words=True)
    from annelid.draw.overlay import background_of
    from annelid.draw.planar_scene import PlanarScene

    if camera is not None:
        raise RunFileError(f"camera {camera!r} does not apply: a planar body has one view only")
    if background is not None:
        background_of(background)
    return PlanarScene(run, *size, dark=background == "dark")


def _worm_scene(
    run: Run, size: tuple[int, int], camera: str | None, background: str | None, *, fine: bool, words: bool
) -> WormScene:
    from annelid.draw.scene import WormScene

    return WormScene(run, *size, camera or DEFAULT_CAMERA, fine=fine, background=background or "floor", words=words)


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
