"""A running worm under changed values moves as one that was built with them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from annelid.config import RunConfig, load_config
from annelid.errors import ConfigError
from annelid.protocols import Stateful
from annelid.simulation.changed_while_running import adjusted
from annelid.simulation.stepping import Simulation, build_controller, build_plant, start
from annelid.simulation.worm import WormPlant

BEFORE_S, AFTER_STEPS = 0.5, 5


def running(config: RunConfig) -> Simulation:
    """A worm that has gone for half a second."""
    plant = build_plant(config)
    simulation = start(config, plant, build_controller(config, plant), None)
    while simulation.step * config.clock.control_timestep_s < BEFORE_S:
        simulation.advance()
    return simulation


def built_with(config: RunConfig, state_of: Simulation) -> Simulation:
    """A worm built with a configuration and brought into the state of another."""
    checkpoint = state_of.checkpoint()
    assert checkpoint is not None
    plant = build_plant(config)
    controller = build_controller(config, plant)
    assert isinstance(plant, Stateful)
    assert isinstance(controller, Stateful)
    plant.set_state(checkpoint.plant)
    controller.set_state(checkpoint.controller)
    return Simulation(config, plant, controller, state_of.sensation, np.random.default_rng(0), state_of.step)


def posture_after(simulation: Simulation) -> np.ndarray:
    for _ in range(AFTER_STEPS):
        simulation.advance()
    assert isinstance(simulation.plant, WormPlant)
    return simulation.plant.qpos.copy()


@pytest.mark.parametrize(
    ("arena", "change"),
    [
        ("pipe", {"arena.friction": 0.2}),
        ("setae", {"arena.friction": 0.2}),
        (None, {"arena.friction": 1.3}),
        (None, {"body.strands.young_modulus_Pa": 0.5e9}),
        (None, {"body.springs.stiffness_N_per_m": 40.0}),
        (None, {"sensor.tolerance_m": 0.03}),
        (None, {"controller.gate_time_constant_ms": 100.0}),
    ],
)
def test_values_changed_live_are_values_built_in(arena: str | None, change: dict[str, Any]) -> None:
    before, after = (load_config("riddle2023-rods", more, arena=arena) for more in ({}, change))
    simulation = running(before)
    step, plant, twin = simulation.step, simulation.plant, built_with(after, simulation)
    live = adjusted(simulation, before, after)
    assert live.step == step
    assert (live.plant is plant) == (arena != "setae" and "body" not in next(iter(change)))
    np.testing.assert_array_equal(posture_after(live), posture_after(twin))


def test_a_worm_under_trial_goes_on_from_where_it_is() -> None:
    trial = {"loss": 0.3, "weak_strength": 0.5}
    before = load_config("riddle2023-rods", {"trial": trial, "seed": 3})
    after = load_config("riddle2023-rods", {"trial": trial | {"loss": 0.6}, "seed": 3, "sensor.tolerance_m": 0.03})
    simulation = running(before)
    twin = built_with(after, simulation)
    live = adjusted(simulation, before, after)
    np.testing.assert_array_equal(posture_after(live), posture_after(twin))
    assert isinstance(live.controller, Stateful)
    assert isinstance(twin.controller, Stateful)
    states = live.controller.get_state(), twin.controller.get_state()
    assert all(np.array_equal(states[0][name], states[1][name]) for name in states[0] | states[1])


def test_another_body_is_refused_and_nothing_changes() -> None:
    before = load_config("riddle2023-rods")
    simulation = running(before)
    plant = simulation.plant
    assert isinstance(plant, WormPlant)
    state = plant.get_state()
    with pytest.raises(ConfigError, match="other states"):
        adjusted(simulation, before, load_config("riddle2023-rods", {"body.mesh.n_segments": 4}))
    np.testing.assert_array_equal(plant.get_state()["engine"], state["engine"])


def test_outside_forces_push_the_worm_and_end() -> None:
    config = load_config("riddle2023-rods")
    pushed, left_alone = running(config), running(config)
    plant = pushed.plant
    assert isinstance(plant, WormPlant)
    force = np.zeros((plant.geometry.n_crossings, 3))
    force[:, 1] = 10.0 / len(force)
    plant.push(force)
    for _ in range(3):
        pushed.advance()
        left_alone.advance()
    shift = pushed.sensation.center_of_mass_m - left_alone.sensation.center_of_mass_m
    assert shift[1] > 0.005
    plant.push(np.zeros_like(force))
    assert not plant.data.xfrc_applied.any()
