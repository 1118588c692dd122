from __future__ import annotations

import math
import sys
from pathlib import Path

import imageio.v3
import mujoco
import numpy as np
import pytest

from annelid.analysis import nearest_time
from annelid.body.worm import WormBody
from annelid.config import load_config
from annelid.draw.drawn_worm import DrawnWorm
from annelid.draw.overlay import Entry, Overlay, bar_length, length_name
from annelid.draw.render import render_frame, render_video
from annelid.draw.scene import WormScene
from annelid.errors import MissingDependency, RunFileError
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run
from opengl import needs_gl


def reddish(pixels: np.ndarray) -> np.ndarray:
    red, green, blue = (pixels[:, :, i].astype(int) for i in range(3))
    return (red > 150) & (green < 90) & (blue < 90)


def test_planar_frame_shows_the_contracted_segment_in_its_place(planar_run: Run, picture: Path) -> None:
    data = planar_run.data
    contracted = int(data["activation"].sel(time=1.5, method="nearest").values.argmax())
    render_frame(planar_run, 1.5, picture, size=(640, 320))
    pixels = imageio.v3.imread(picture)
    assert pixels.shape[:2] == (320, 640)
    column = np.flatnonzero(reddish(pixels[:, :, :3]).any(axis=0)).mean()
    assert int(3 * column / 640) == contracted


def test_planar_video_has_one_picture_for_each_moment(planar_run: Run, tmp_path: Path) -> None:
    target = tmp_path / "video.mp4"
    calls: list[tuple[int, int]] = []
    render_video(
        planar_run, target, fps=10, speed=2.0, size=(320, 160), progress=lambda done, total: calls.append((done, total))
    )
    # 3 s at double speed and 10 frames a second: 0, 0.2, .. 3.0 s.
    assert calls == [(k, 16) for k in range(1, 17)]
    frames = imageio.v3.imread(target)
    assert frames.shape == (16, 160, 320, 3)
    assert np.abs(frames[0].astype(int) - frames[8]).max() > 50
    assert [entry.name for entry in tmp_path.iterdir()] == ["video.mp4"]


@needs_gl
def test_worm_frame_fits_the_whole_worm_and_shows_its_contracted_ring(rods_run: Run, picture: Path) -> None:
    render_frame(rods_run, 0.2, picture, size=(320, 200))
    pixels = imageio.v3.imread(picture)[:, :, :3].astype(int)
    blue = (pixels[:, :, 2] > pixels[:, :, 0] + 60) & (pixels[:, :, 2] > 120)
    rows, columns = np.nonzero(blue)
    assert columns.max() - columns.min() > 120, "the strands span a good part of the picture"
    assert columns.min() > 0
    assert columns.max() < 319
    assert rows.min() > 0
    assert rows.max() < 199
    ring = np.flatnonzero(reddish(pixels).any(axis=0))
    assert ring.size, "segment 1 is contracted and red"
    assert ring.mean() < columns.mean(), "segment 1 is on the left"


@needs_gl
def test_waypoints_are_seen_where_they_count_as_reached(tmp_path: Path) -> None:
    course = {"kind": "course", "waypoints": [[-0.2, 0.0]], "reach_m": 0.2}
    config = load_config("riddle2023-rods", {"body.rings.layout": "halves", "turning": course, "duration_s": 0.04})
    run = simulate(config, tmp_path / "run", progress=False)
    with WormScene(run, 240, 120, "top", fine=False) as scene:
        red, green, blue = scene.picture(0).astype(int).transpose(2, 0, 1)
    rows, columns = np.nonzero((green > red + 20) & (green > blue + 5))
    assert columns.size > 100
    assert columns.mean() < 100, "in front of the worm"
    assert rows.mean() == pytest.approx(60, abs=10)


def test_impossible_frames_are_refused(planar_run: Run, tmp_path: Path) -> None:
    for time_s, name, camera, background, says in (
        (9.0, "a.png", None, None, "recorded from 0 to 3 s"),
        (math.nan, "a.png", None, None, "recorded from 0 to 3 s"),
        (1.0, "a.bmp2", None, None, r"\.png"),
        (1.0, "a.png", "side", None, "one view"),
        (1.0, "a.png", None, "whit", r"unknown background 'whit'.*white"),
    ):
        with pytest.raises(RunFileError, match=says):
            render_frame(planar_run, time_s, tmp_path / name, camera=camera, background=background)
    assert list(tmp_path.iterdir()) == []


def test_the_only_frame_is_that_of_times_up_to_the_next(planar_run: Run) -> None:
    interval_s = planar_run.config.record.frames_interval_s
    assert nearest_time(planar_run, np.zeros(1), 0.9 * interval_s) == 0
    with pytest.raises(RunFileError, match="recorded from 0 to 0 s"):
        nearest_time(planar_run, np.zeros(1), 1.1 * interval_s)


def test_impossible_videos_are_refused(planar_run: Run, tmp_path: Path) -> None:
    for fps, speed, says in (
        (0.99, 1.0, "fps = 0.99: .* 1 to 240"),
        (240.1, 1.0, "fps = 240.1"),
        (math.nan, 1.0, "fps = nan"),
        (25.0, 0.0, "speed = 0"),
        (25.0, math.inf, "speed = inf"),
    ):
        with pytest.raises(RunFileError, match=says):
            render_video(planar_run, tmp_path / "a.mp4", fps=fps, speed=speed)
    assert list(tmp_path.iterdir()) == []


def an_ffmpeg(folder: Path, while_writing: str) -> Path:
    """An ffmpeg that reads videos as ever, but writes them in another way."""
    import imageio_ffmpeg

    script = folder / "ffmpeg"
    real = imageio_ffmpeg.get_ffmpeg_exe()
    script.write_text(
        f'#!/bin/bash\ncase "$*" in *rawvideo*) {while_writing.format(real=real)} ;; *) exec "{real}" "$@" ;; esac\n'
    )
    script.chmod(0o755)
    return script


@pytest.mark.skipif(sys.platform == "win32", reason="the broken ffmpeg is a shell script")
@pytest.mark.parametrize(
    "while_writing",
    [
        # Stops after two pictures, as on a full disk, but takes the others.
        '"{real}" "${{@:1:$#-1}}" -frames:v 2 "${{@: -1}}"; cat >/dev/null; exit 1',
        "echo No space left on device >&2; exit 1",
    ],
    ids=["truncated", "broken pipe"],
)
def test_a_video_that_ffmpeg_does_not_finish_is_refused_and_removed(
    planar_run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    while_writing: str,
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(an_ffmpeg(tmp_path, while_writing)))
    with pytest.raises(RunFileError, match=r"cannot write .*a\.mp4: ffmpeg .* failed") as caught:
        render_video(planar_run, out / "a.mp4", fps=5, size=(160, 96))
    assert "\n" not in str(caught.value)
    assert list(out.iterdir()) == []


def test_a_missing_ffmpeg_is_a_sentence(planar_run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/nonexistent")
    with pytest.raises(MissingDependency, match=r"no program /nonexistent.*pip install imageio-ffmpeg"):
        render_video(planar_run, tmp_path / "a.mp4")
    assert list(tmp_path.iterdir()) == []


def test_a_failing_video_leaves_nothing_and_keeps_what_was_there(planar_run: Run, tmp_path: Path) -> None:
    target = tmp_path / "a.mp4"
    target.write_bytes(b"precious")

    def fail(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_video(planar_run, target, size=(160, 96), progress=fail)
    assert target.read_bytes() == b"precious"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.mp4"]


def test_the_scale_bar_is_as_long_as_it_says() -> None:
    entries: list[Entry] = [("strand", (0.0, 0.0, 1.0), "line")]
    for width, pixels_per_m, name in ((960, 1000.0, "10 cm"), (960, 1100.0, "10 cm"), (1280, 100.0, "2 m")):
        length_m = bar_length(width, pixels_per_m)
        assert length_name(length_m) == name
        overlay = Overlay((width, 500), entries, pixels_per_m, "black", (1.0, 1.0, 1.0))
        drawn = overlay.stamped(np.full((500, width, 3), 255, dtype=np.uint8), "")
        dark = drawn[250:, width // 2 :].max(axis=2) < 60
        assert dark.sum(axis=1).max() == pytest.approx(length_m * pixels_per_m, abs=2)


@needs_gl
def test_the_legend_has_the_colours_of_the_picture(rods_run: Run) -> None:
    with WormScene(rods_run, 480, 300, "side", fine=True) as scene:
        assert [name for name, _, _ in scene.legend] == [
            "strand",
            "axial spring",
            "ring, relaxed",
            "ring, contracted",
            "crossing",
        ]
        pixels = scene.picture(len(scene.times_s) - 1).astype(int)
        for _, color, _ in scene.legend:
            wanted = np.rint(255 * np.array(color[:3]))
            assert (np.abs(pixels[:40] - wanted).max(axis=2) <= 3).any()


@needs_gl
@pytest.mark.parametrize(("name", "corner"), [("white", 255), ("dark", 50)])
def test_a_background_is_of_one_colour_below_a_worm_with_a_shadow(rods_run: Run, name: str, corner: int) -> None:
    with WormScene(rods_run, 240, 136, "isometric", fine=False, background=name, words=False) as scene:
        pixels = scene.picture(0).astype(int)
    for row, column in ((0, 0), (0, 239), (135, 0), (135, 239), (68, 0)):
        assert (np.abs(pixels[row, column] - corner) <= (0 if name == "white" else 35)).all()
    near = pixels[135, 0]
    grey = np.ptp(pixels, axis=2) < 12
    assert np.mean(grey & (pixels.max(axis=2) < near.max() - 8)) > 0.01, "no shadow"


def test_a_planar_worm_can_be_drawn_on_a_dark_page(planar_run: Run, picture: Path) -> None:
    render_frame(planar_run, 1.0, picture, size=(320, 160), background="dark")
    assert imageio.v3.imread(picture)[0, 0, :3].max() < 60


@needs_gl
def test_soft_crossings_have_a_bar_to_each_strand() -> None:
    for preset, n_links in (("riddle2023-rods", 0), ("riddle2023", 2), ("riddle2023-fast", 2)):
        config = load_config(preset)
        assert isinstance(config.body, WormBody)
        worm = DrawnWorm(config)
        worm.pose(worm.model.qpos0)
        scene = mujoco.MjvScene(worm.model, maxgeom=1000)
        worm.complete(scene)
        assert scene.ngeom == n_links * config.body.geometry().n_crossings
        assert ("soft" in worm.legend()[-1][0]) == (n_links > 0)
