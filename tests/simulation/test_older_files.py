"""Run files of older versions open, and say what acted in them and is gone."""

from __future__ import annotations

import json
import shutil
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any

import pytest
import xarray
from toy import SavedToyPlant, ToyController, toy_config, without_digest

from annelid.analysis import compare
from annelid.config import RunConfig, load_config
from annelid.errors import RunFileError
from annelid.simulation import open_run, simulate
from annelid.simulation.runfile import migrated, read_config, verify_run

NEWER_THAN_0_1 = {
    "": ["turning", "published"],
    "body": ["joints"],
    "body.strands": ["damping_time_s"],
    "body.springs": ["sensors"],
    "body.rings": ["kind"],
    "body.formulation": [
        "pins",
        "pin_stiffness_N_per_m",
        "pin_damping_Ns_per_m",
    ],
    "arena": ["kind", "backward_friction", "slope_deg", "rail_gap_m", "posts"],
    "guard": ["depth_m"],
}


def test_a_file_of_annelid_0_1_is_read(tmp_path: Path) -> None:
    run = simulate(toy_config(), tmp_path / "run", plant=SavedToyPlant(), controller=ToyController())
    config = load_config({"body": {"kind": "worm"}, "arena": {"friction": 0.4}})
    tree = config.model_dump(mode="json")
    for path, fields in NEWER_THAN_0_1.items():
        section = reduce(getitem, filter(None, path.split(".")), tree)
        for field in fields:
            del section[field]
    tree["body"]["strands"]["joint_damping_Nms_per_rad"] = 0.07
    shutil.copy(run.path, tmp_path)
    with without_digest(tmp_path / "run.nc") as file:
        del file["warnings"], file["cpu_time"]
        file.attrs["config"] = json.dumps(tree)
    old = open_run(tmp_path / "run.nc")
    assert old.config == read_config(tmp_path / "run.nc") == config
    assert (old.status, old.cpu_time_s) == (run.status, 0.0)
    assert [doubt.startswith("body.strands.joint_damping_Nms_per_rad was 0.07") for doubt in old.warnings] == [True]
    xarray.testing.assert_equal(old.data, run.data)
    assert compare([old, old]).numbers["duration_s"][0] == run.config.duration_s
    with pytest.raises(RunFileError, match=r"cannot be continued: body\.strands\.joint_damping_Nms_per_rad acted"):
        simulate(None, tmp_path / "on", resume=old, plant=SavedToyPlant(), controller=ToyController())
    assert "older version" in verify_run(tmp_path / "run.nc")


PRESSURE = {"body": {"kind": "worm"}, "controller": {"kind": "sns-pressure"}}
RODS = {"extends": "riddle2023-rods"}
ROBUST = {**RODS, "controller": {"kind": "sns-robust", "motor_time_constant_s": 0.2}}
BLIND = {**RODS, "trial": {"blind": True}}
SOFT = {**RODS, "body": {"formulation": {"pins": "separate"}}}
ROUGH = {**RODS, "arena": {"kind": "rough"}}
POSTS = {**RODS, "arena": {"kind": "floor", "posts": [[1.0, 2.0, 0.1]]}}


@pytest.mark.parametrize(
    ("worm", "schema", "gone", "says"),
    [
        (PRESSURE, 2, {"controller.landing": 0.0, "guard.stretch": 1.1}, None),
        (PRESSURE, 2, {"controller.landing": 0.1}, "controller.landing was 0.1"),
        (RODS, 3, {"body.formulation.pin_inertance_kg": 0.0094}, None),
        (SOFT, 3, {"body.formulation.pin_inertance_kg": 0.0094}, "pin_inertance_kg was 0.0094"),
        (RODS, 3, {"body.formulation.lateral_damping_Nms_per_rad": 0.1}, "lateral_damping_Nms_per_rad was 0.1"),
        (RODS, 5, {"body.formulation.solver_iterations": 100}, "solver_iterations was 100"),
        (ROUGH, 5, {"arena.posts": None, "arena.rail_gap_m": None}, None),
        (POSTS, 5, {"body.formulation.solver_tolerance": None}, None),
        (ROBUST, 6, {"controller.push_nA": 6.0, "controller.let_go_s": 0.2}, None),
        (ROBUST, 6, {"controller.entrainment": 0.0}, "controller.entrainment was 0.0"),
        (BLIND, 6, {"trial.loss_s": 0.2, "trial.push_s": 0.5, "trial.delay_s": 0.0}, None),
        (BLIND, 6, {"trial.delay_s": 0.1}, "trial.delay_s was 0.1"),
        (BLIND, 6, {"trial.loss_s": 0.2, "body.heading_deg": 0.0}, None),
        (RODS, 6, {"body.heading_deg": 90.0}, "its travel is told along -x"),
        (ROUGH, 5, {"arena.posts": [[1.0, 2.0, 0.1]]}, "arena.posts was"),
    ],
)
def test_a_run_in_which_a_field_acted_that_is_gone_says_so(
    worm: dict[str, Any], schema: int, gone: dict[str, Any], says: str | None
) -> None:
    config = load_config(worm)
    tree = config.model_dump(mode="json")
    for path, value in gone.items():
        *sections, field = path.split(".")
        reduce(getitem, sections, tree)[field] = value
    attrs = {"schema_version": schema, "config": json.dumps(tree)}
    read, (first, *doubts) = migrated(attrs, ["it was cold"])
    assert RunConfig.model_validate_json(read["config"]) == config
    assert first == "it was cold"
    assert len(doubts) == (says is not None)
    assert says is None or says in doubts[0]


def test_what_is_wrong_with_an_old_configuration_is_left_to_its_reader(subtests: pytest.Subtests) -> None:
    for config in ("{", "[]", '"riddle2023"', '{"name": 3}', "[" * 100_000):
        with subtests.test(f"{config!r:.60}"):
            assert migrated({"config": config}, [])[0]["config"] == config
