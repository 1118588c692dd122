from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from annelid_studies.commands.experiment import STUDIES
from outcome import Command


def test_load_frame_writes_a_table_and_its_picture(annelid: Command) -> None:
    done = annelid("study", "load-frame", "--displacement", "90", "--cable-friction", "1.0", "-o", "frame")
    assert done.exit_code == 0, done.err
    assert "work lost" in done.out
    assert done.out.splitlines()[-2:] == [str(Path("frame/load_frame.csv")), str(Path("frame/load_frame.png"))]
    assert Path("frame/load_frame.svg").exists()
    table = np.genfromtxt("frame/load_frame.csv", delimiter=",", names=True)
    assert table["displacement_mm"].max() == pytest.approx(90, abs=2)
    turn = int(table["displacement_mm"].argmax())
    assert table["force_N"][turn] == pytest.approx(table["tension_N"][turn] / (1 - np.exp(-1.0)), rel=1e-4)
    assert table["force_N"][-2] == pytest.approx(table["tension_N"][-2] / (np.exp(1.0) - 1), rel=1e-4)


def test_a_load_frame_fits_the_worm_and_leaves_out_a_loop_of_another_size(annelid: Command) -> None:
    small = (
        "--set",
        "body.mesh.radius_m=0.08",
        "--set",
        "body.mesh.angular_rate_rad_per_m=28",
        "--diameter-share",
        "0.1",
    )
    done = annelid("study", "load-frame", *small, "-o", "frame", "--json")
    assert done.exit_code == 0, done.err
    assert [*json.loads(done.out)["results"]["loops"]] == ["riddle2023-rods"]
    table = np.genfromtxt("frame/load_frame.csv", delimiter=",", names=True)
    assert table["displacement_mm"].max() == pytest.approx(0.1 * 2e3 * np.pi * 0.08, rel=0.05)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("study", "load-frame", "riddle2022-planar"), "needs the 3D worm"),
        (("study", "load-frame", "--displacement", "2000"), "four fifths"),
        (("study", "load-frame", "--data", "none.csv"), "cannot read none.csv"),
        (("calibrate", "--free", "yuong_modulus"), "did you mean 'young_modulus'"),
        (("calibrate", "none.toml"), "cannot read the study none.toml"),
    ],
)
def test_bad_input_ends_in_one_sentence(annelid: Command, arguments: tuple[str, ...], says: str) -> None:
    done = annelid(*arguments, "--quiet")
    assert done.exit_code == 2
    assert says in done.sentence()
    assert not list(Path().iterdir())


def test_results_are_kept_unless_forced(annelid: Command) -> None:
    for folder, file, command in (
        ("a", "load_frame.csv", ("study", "load-frame")),
        ("b", "calibration.json", ("calibrate",)),
    ):
        Path(folder).mkdir()
        Path(folder, file).write_text("mine")
        assert "exists" in annelid(*command, "-o", folder, "--quiet").sentence()
        assert Path(folder, file).read_text() == "mine"


def test_a_file_in_place_of_the_folder_of_runs_is_refused(annelid: Command, subtests: pytest.Subtests) -> None:
    Path("taken").write_text("mine", encoding="utf-8")
    for words in [
        *(("study", one.name) for one in STUDIES),
        ("calibrate",),
        ("tune",),
        ("study", "bench"),
        ("study", "load-frame"),
    ]:
        with subtests.test(" ".join(words)):
            done = annelid(*words, "-o", "taken", "--quiet")
            assert done.exit_code != 0
            assert "taken is a file: name a folder" in done.sentence()
            assert Path("taken").read_text(encoding="utf-8") == "mine"
