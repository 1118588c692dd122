"""Steps of second order: stable with much damping, exact for what the engine steps explicitly, restored to the bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.simulation.worm import WormPlant


def plant(preset: str, integrator: str, **changes: Any) -> WormPlant:
    made = WormPlant(load_config(preset, {"body.formulation.integrator": integrator, **changes}))
    made.reset(0)
    return made


@pytest.mark.parametrize("step_s", [0.005, 0.02, 0.06])
def test_a_much_damped_worm_loses_what_its_muscles_put_in(step_s: float) -> None:
    """Before twist followed the vertices, energy came from nowhere within 0.4 s."""
    changes = {"body.strands.damping_time_s": 1.45, "clock.physics_timestep_s": step_s}
    worm = plant("riddle2023-rods", "BDF2", **changes)
    worm.move(np.array([1.0, 0.0, 0.0]), round(0.6 / step_s))
    held, work = worm.elastic_energy_J() + worm.kinetic_energy_J(), float(worm.energies.muscle_work.sum())
    assert 0.0 < held < work
    assert worm.kinetic_energy_J() < 0.05 * work


def test_servos_wind_as_by_the_engine_s_step() -> None:
    pull = np.ones(6)
    slack = []
    for integrator in ("BDF2", "Euler"):
        worm = plant("riddle2025", integrator, **{"body.mesh.elements_per_side": 1})
        pull = np.ones(worm.n_muscles)
        worm.move(pull, 3)
        slack.append(worm.act.copy())
        # Paid out again, they stop at their longest.
        worm.move(np.zeros(worm.n_muscles), 5)
        slack.append(worm.act.copy())
    assert slack[0] == pytest.approx(slack[2], abs=1e-12)
    assert slack[1] == pytest.approx(worm.model.actuator_actrange[:, 1], abs=1e-12)
    assert slack[0].max() < slack[1].min()


def test_a_worm_goes_on_from_its_state_to_the_bit() -> None:
    changes = {"body.mesh.elements_per_side": 1}
    first, second = (plant("riddle2023-rods", "BDF2", **changes) for _ in range(2))
    pull = np.array([1.0, 0.0, 0.4])
    first.move(pull, 4)
    second.set_state(first.get_state())
    for worm in (first, second):
        worm.move(pull, 3)
    assert np.array_equal(first.qpos, second.qpos)
    assert np.array_equal(first.engine["qvel"], second.engine["qvel"])
    assert first.data.time == pytest.approx(7 * 0.02)


def test_material_without_damping_is_refused() -> None:
    with pytest.raises(
        ConfigError, match=r"body\.formulation\.integrator = 'BDF2': must be 'Euler' where .* no damping"
    ):
        load_config("riddle2023-rods", {"body.strands.damping_time_s": None})
