"""A written model is the run's, and starts where the run ended."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from annelid.body.assemble import mjcf_text
from annelid.config import load_config
from annelid.export.formats import write_mjcf
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run, read_checkpoint
from annelid.simulation.worm import WormPlant

SIX_DIGITS = 1e-5


def at_keyframe(path: Path, name: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
    mujoco.mj_forward(model, data)
    return model, data


def rings(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    names = [model.tendon(i).name for i in range(model.ntendon)]
    return np.array([data.ten_length[i] for i, name in enumerate(names) if name.startswith("ring_")])


def test_the_keyframe_is_the_last_state(rods_run: Run, tmp_path: Path) -> None:
    model, data = at_keyframe(write_mjcf(rods_run, tmp_path / "worm.xml"), "final")
    plant = WormPlant(rods_run.config)
    plant.set_state(read_checkpoint(rods_run.path).plant)
    assert data.time == pytest.approx(0.2)
    np.testing.assert_allclose(data.qpos, plant.coordinates, atol=SIX_DIGITS)
    np.testing.assert_allclose(data.qvel, plant.anatomy.written(plant.data.qvel), atol=SIX_DIGITS)
    np.testing.assert_allclose(data.ctrl, plant.data.ctrl, atol=SIX_DIGITS)
    np.testing.assert_allclose(rings(model, data), rods_run.data["ring_length"].values[-1], atol=SIX_DIGITS)


# The rods' frames are not in a keyframe, so that worm comes to rest in another twist.
@pytest.mark.parametrize(("formulation", "within_m"), [("rods", 0.005), ("chain", SIX_DIGITS)])
def test_steps_from_the_keyframe_go_on_near_the_run(
    formulation: str, within_m: float, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    run: Run = request.getfixturevalue(f"{formulation}_run")
    model, data = at_keyframe(write_mjcf(run, tmp_path / "worm.xml"), "final")
    plant = WormPlant(run.config)
    plant.set_state(read_checkpoint(run.path).plant)
    mujoco.mj_step(model, data, 5)
    plant.move(run.data["activation"].values[-1], 5)
    mujoco.mj_forward(model, data)
    mujoco.mj_forward(plant.model, plant.data)
    np.testing.assert_allclose(rings(model, data), rings(plant.model, plant.data), atol=within_m)


def test_a_run_that_cannot_be_continued_gives_its_last_posture(user_run: Run, tmp_path: Path) -> None:
    _, data = at_keyframe(write_mjcf(user_run, tmp_path / "worm.xml"), "last_posture")
    np.testing.assert_allclose(data.qpos, user_run.data["qpos"].values[-1], atol=SIX_DIGITS)
    assert not data.qvel.any()
    assert data.time == pytest.approx(float(user_run.data["frame_time"].values[-1]))


def test_servos_start_paid_out_and_go_on_from_their_slack(tmp_path: Path) -> None:
    config = load_config("wang", {"duration_s": 0.05, "body.mesh.elements_per_side": 1})
    run = simulate(config, tmp_path / "run", progress=False)
    path = write_mjcf(run, tmp_path / "worm.xml")
    model, data = at_keyframe(path, "rest")
    np.testing.assert_allclose(data.act, model.actuator_actrange[:, 1])
    np.testing.assert_allclose(data.actuator_force, 0.0)
    unset = mujoco.MjData(model)
    mujoco.mj_forward(model, unset)
    assert unset.actuator_force.min() < -1.0, "without the keyframe all cables would pull at once"
    _, final = at_keyframe(path, "final")
    assert final.act.min() < data.act.min() - 1e-3, "segment 1 has been wound"


def test_a_worm_with_muscles_needs_no_keyframe() -> None:
    model = mujoco.MjModel.from_xml_string(mjcf_text(load_config("riddle2023-rods")))
    assert model.nkey == 0
