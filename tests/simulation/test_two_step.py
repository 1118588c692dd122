"""The steps of rods: second order also where rods bend deeply, stable with much damping, restored to the bit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from annelid.body.formulations.rods.two_step import TwoStep
from annelid.config import load_config
from annelid.errors import SimulationStopped
from annelid.simulation.changed_while_running import adjusted
from annelid.simulation.stepping import build_controller, start
from annelid.simulation.worm import WormPlant

COARSE = {"body.mesh.elements_per_side": 1}
AFLOAT = {"arena.gravity_m_per_s2": 0.0, "arena.floor_gap_m": 1.0}


def plant(preset: str, **changes: Any) -> WormPlant:
    made = WormPlant(load_config(preset, changes))
    made.reset(0)
    return made


def in_flight(step_s: float, **changes: Any) -> tuple[np.ndarray, float, float]:
    """Contracts one ring smoothly to two thirds of its length, away from any ground.

    Returns:
        Lengths of the rings at the end, m, the work of the muscles, J, and what is left of it when all else is taken.
    """
    worm = plant("riddle2023-rods", **{**AFLOAT, "clock.physics_timestep_s": step_s, **changes})
    at_start = worm.elastic_energy_J()
    for step in range(round(0.3 / step_s)):
        # What a command does between two movements, the lag of the muscles makes of all of them.
        times_s = step * step_s + 0.001 * np.arange(round(step_s / 0.001))
        commands = np.zeros((len(times_s), 3))
        commands[:, 0] = 0.3 * np.sin(np.pi * np.minimum(times_s / 0.4, 0.5)) ** 2
        worm.stride(commands)
    work = float(worm.energies.muscle_work.sum())
    held = worm.elastic_energy_J() - at_start + worm.kinetic_energy_J()
    return worm.posture.ring_length, work, work - held - float(worm.energies.damping_loss)


def test_halving_the_step_divides_the_error_by_four() -> None:
    """Of lengths, work, and what the integrator takes of it."""
    lengths, works, lost = zip(*(in_flight(step_s) for step_s in (0.02, 0.01, 0.005, 0.002)), strict=True)
    errors = [np.abs(each - lengths[-1]).max() for each in lengths[:-1]]
    assert lengths[-1][0] < 0.7
    assert errors[0] < 4e-3
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    assert works[:3] == pytest.approx([works[-1]] * 3, rel=0.015)
    shares = np.abs(lost) / works[-1]
    assert shares[0] < 0.05
    assert shares[0] > 3 * shares[1]


@pytest.mark.parametrize("step_s", [0.005, 0.02, 0.06])
def test_a_much_damped_worm_loses_what_its_muscles_put_in(step_s: float) -> None:
    worm = plant("riddle2023-rods", **{"body.strands.damping_time_s": 1.45, "clock.physics_timestep_s": step_s})
    for _ in range(round(0.6 / step_s)):
        worm.stride(np.tile([1.0, 0.0, 0.0], (worm.steps_to_move(), 1)))
    held, work = worm.elastic_energy_J() + worm.kinetic_energy_J(), float(worm.energies.muscle_work.sum())
    assert 0.0 < held < work
    assert worm.kinetic_energy_J() < 0.05 * work


def test_in_a_scene_whose_bodies_move_the_step_is_the_engine_s(tmp_path: Path) -> None:
    """From an extrapolated state a box on the floor would rattle and a pendulum swing ever farther."""
    (tmp_path / "scene.xml").write_text(
        '<mujoco><worldbody><geom type="plane" size="5 5 1"/><body pos="-1 0 0.041"><freejoint/>'
        '<geom type="box" size="0.04 0.04 0.04" mass="0.5"/></body><body pos="-2 0 1.5"><joint type="hinge" '
        'axis="0 1 0"/><geom type="sphere" size="0.02" pos="0.3 0 -0.95" mass="0.1"/></body></worldbody></mujoco>'
    )
    config = load_config("riddle2023-rods", COARSE, arena=tmp_path / "scene.xml")
    worm = WormPlant(config)
    worm.reset(0)
    assert worm.model.opt.timestep == config.clock.physics_timestep_s
    highest = 0.0
    for _ in range(150):
        worm.move(np.zeros(3), 1)
        highest = max(highest, abs(float(worm.qpos[-1])))
    assert highest < 0.7
    assert np.abs(worm.data.qvel[-7:-1]).max() < 1e-3


def test_an_error_of_the_engine_stops_the_worm_with_its_words(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(own: TwoStep, prepare: Callable[[], None]) -> None:
        raise mujoco.FatalError("broken")

    worm = plant("riddle2023-rods", **COARSE)
    worm.step(np.zeros(3))
    monkeypatch.setattr(TwoStep, "step", failing)
    with pytest.raises(SimulationStopped, match=r"the engine stopped at 0\.000 s: broken"):
        worm.move(np.zeros(3), 1)


def test_a_clock_that_changes_while_it_runs_starts_from_rest() -> None:
    """What a worm was one step ago is of the old step."""
    config = load_config("riddle2023-rods", {**COARSE, "clock.physics_timestep_s": 0.04})
    finer = load_config("riddle2023-rods", {**COARSE, "clock.physics_timestep_s": 0.005})
    worm = WormPlant(config)
    running = start(config, worm, build_controller(config, worm), None)
    while running.sensation.time_s < 0.5:
        running.advance()
    going = adjusted(running, config, finer)
    assert isinstance(going.plant, WormPlant)
    assert np.array_equal(going.plant.mechanics.get_state()["qpos_before"], going.plant.qpos)


def test_soft_crossings_do_not_shake() -> None:
    """Where the end of a step was predicted from one velocity alone, they lost four times the muscles' work."""
    worm = plant("riddle2023-fast")
    for _ in range(40):
        worm.stride(np.tile([1.0, 0.0, 0.0], (worm.steps_to_move(), 1)))
    assert 0.0 < float(worm.energies.damping_loss) < float(worm.energies.muscle_work.sum())


def test_rods_without_damping_keep_swinging() -> None:
    worm = plant("riddle2023-rods", **{**COARSE, **AFLOAT, "body.strands.damping_time_s": 0.0})
    worm.move(np.array([0.0, 0.3, 0.0]), 10)
    worm.move(np.zeros(3), 10)
    assert worm.energies.damping_loss == 0.0
    assert worm.data.warning.number[int(mujoco.mjtWarning.mjWARN_BADQACC)] == 0
    assert worm.kinetic_energy_J() > 1e-4
