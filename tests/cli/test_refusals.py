from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import Mock

import pytest

from outcome import Command


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("run", "ridle2023"), "did you mean 'riddle2023'"),
        (("run", "--set", "arena.fricton=1"), "did you mean"),
        (("run", "--set", "body.mesh.n_helices=7"), "must be even"),
        (("run", "riddle2023-rods", "--segments", "2"), "at least 3"),
        (("run", "--set", "clock.physics_timestep_s=0.0015"), "integer multiple"),
        (("run", "riddle2023-rods", "--fidelity", "acurate"), "did you mean 'accurate'"),
        (("run", "riddle2022-planar", "--fidelity", "fast"), "fidelity = 'fast' is for the 3D worm"),
        (("export", "--to", "mjcf", "riddle2023-fast", "--fidelity", "preview"), "share their pins"),
        (("run", "nothere.toml"), "cannot read the configuration file nothere.toml"),
        (("run", "--resume", "nothere"), "there is no run file nothere"),
        (("export-network", "crawler-timed"), "only controllers that step a network can"),
        (
            ("export", "--to", "mjcf", "riddle2023-rods", "-o", "no/such/worm.xml"),
            "cannot be written: there is no folder no/such",
        ),
        (("show", "nothere"), "there is no run file nothere"),
        (("show", "--explain", "pace"), "no row is called 'pace'"),
        (("list", "presets", "ridle2023"), "did you mean 'riddle2023'"),
        (("run", "--duration", "1e300"), "duration_s = 1e+300: must be at most"),
    ],
)
def test_bad_input_ends_in_one_sentence_and_leaves_nothing(
    annelid: Command, arguments: tuple[str, ...], says: str
) -> None:
    done = annelid(*arguments)
    assert done.exit_code == 2
    assert says in done.sentence()
    assert not [path for path in Path().rglob("*") if path.is_file()]
    assert not Path("runs").exists(), "no empty folder stays behind"


def test_a_folder_that_cannot_be_written_is_refused_first(annelid: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("annelid.cli.common.os.access", lambda *_: False)
    words = ("export", "riddle2023-rods", "--to", "mjcf", "-o", "worm.xml")
    assert "worm.xml cannot be written: . does not allow it" in annelid(*words).sentence()


def test_wrong_usage_is_exit_2_without_a_traceback(annelid: Command) -> None:
    for arguments in (
        ("run", "--bogus"),
        ("run", "--duration", "nan"),
        ("crawl",),
        ("draw", "somewhere", "-o", "frame.png", "--video", "v.mp4"),
        ("draw", "somewhere", "-o", "a.png", "--figure", "track", "--time", "1"),
    ):
        done = annelid(*arguments)
        assert done.exit_code == 2
        assert "Usage:" in done.err
        assert "Traceback" not in done.err


def test_a_used_output_folder_is_refused_and_left_alone(annelid: Command) -> None:
    Path("out").mkdir()
    Path("out/notes.txt").write_text("mine")
    done = annelid("run", "riddle2022-planar", "--duration", "0.1", "--out", "out")
    assert done.exit_code == 2
    assert "out is not empty" in done.sentence()
    assert [path.name for path in Path("out").iterdir()] == ["notes.txt"]


def test_existing_pictures_are_kept_unless_forced(annelid: Command, finished: Path) -> None:
    for words, name in ((("-o",), "p.png"), (("--time", "0.5", "-o"), "p.png"), (("--video",), "v.mp4")):
        (target := Path(name)).write_text("mine")
        done = annelid("draw", finished, *words, target)
        assert done.exit_code == 2
        assert f"{target} exists" in done.sentence()
        assert "--force" in done.err
        assert target.read_text() == "mine"
        assert annelid("draw", finished, *words, target, "--force").exit_code == 0
        assert target.stat().st_size > 1000


def test_a_runs_own_pictures_are_drawn_anew(annelid: Command, finished: Path) -> None:
    for words, name in (((), "figure7.png"), (("--time", "0.5"), "frame.png")):
        (own := finished / name).write_text("old")
        assert annelid("draw", finished, *words).exit_code == 0
        assert own.stat().st_size > 1000


def test_plot_writes_three_formats_only(annelid: Command, finished: Path) -> None:
    for name in ("a.xyz", "a.jpg", ""):
        done = annelid("draw", finished, "-o", name)
        assert done.exit_code == 2
        assert ".png, .pdf, .svg" in done.sentence() or "is a folder" in done.sentence()
        assert list(Path().iterdir()) == []


def test_an_empty_name_is_not_the_default(annelid: Command) -> None:
    done = annelid("run", "")
    assert done.exit_code == 2
    assert "unknown preset ''" in done.sentence()


def test_a_last_resort_is_a_sentence(annelid: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "run.nc")
    for error, says in (
        (MemoryError(), "not enough memory"),
        (OverflowError("too big"), "too big"),
        (ZeroDivisionError(), "ZeroDivision"),
        (full, f"run.nc: {os.strerror(errno.ENOSPC)}"),
    ):
        monkeypatch.setattr("annelid.simulation.loop.simulate", Mock(side_effect=error))
        done = annelid("run", "riddle2022-planar")
        assert done.exit_code == 2
        assert says in done.sentence()
        assert not Path("runs").exists()


def test_a_back_end_that_the_engine_does_not_know_is_a_sentence(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "annelid", "export", "riddle2023-rods", "--to", "mjcf"],
        cwd=tmp_path,
        env={**os.environ, "MUJOCO_GL": "vulkan"},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("annelid: invalid value for environment variable MUJOCO_GL: vulkan")
    assert len(done.stderr.splitlines()) == 1


def test_a_run_stopped_by_its_guard_shows_what_it_has_and_exits_3(annelid: Command) -> None:
    done = annelid("run", "riddle2023-rods", "--duration", "1", "--set", "guard.kinetic_energy_J=1e-9", "--out", "g")
    assert done.exit_code == 3
    assert "g/run.nc" in done.sentence()
    assert "stopped by guard" in done.out
    assert [path.name for path in Path("g").iterdir()] == ["run.nc"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for one process")
def test_ctrl_c_prints_what_was_computed_and_exits_130(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "annelid", "run", "riddle2022-planar", "--duration", "3000", "--out", "long"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            for _ in range(600):
                if (tmp_path / "long" / "run.nc").exists() or process.poll() is not None:
                    break
                time.sleep(0.05)
            time.sleep(0.5)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert "interrupted: what was computed is in long/run.nc" in err
    assert "interrupted after" in out
    assert err.endswith("continue it with:\n  annelid run --resume long\n")
