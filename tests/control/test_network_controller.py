"""A user's own network in closed loop: the same as stepped by hand, recorded by name, and resumed."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

import annelid
from annelid.control import NetworkController, Sense
from annelid.errors import ConfigError
from annelid.nervous import Network, Neuron, Synapse

N = 6
NAMES = [f"segment{number}" for number in range(1, N + 1)]


def baton() -> Network:
    network = Network("baton")
    for name in NAMES:
        network.add_neuron(name, Neuron(100.0, bias_nA=20.0), 20.0 if name == NAMES[0] else 0.0)
        network.add_output(name, name)
    for source, target in permutations(NAMES, 2):
        network.add_synapse(source, target, Synapse(0.6, -40.0))
    for name, following in zip(NAMES, NAMES[1:] + NAMES[:1], strict=True):
        network.add_input(f"stretch of {name}", following)
    return network


def controller(**options: object) -> NetworkController:
    inputs = {f"stretch of {name}": Sense("lengthening_m", place, gain=400.0) for place, name in enumerate(NAMES)}
    return NetworkController(baton(), inputs, NAMES, **options)  # type: ignore[arg-type]


def sensed(longer_m: np.ndarray, step: int = 0) -> annelid.Sensation:
    n = len(longer_m)
    zeros = np.zeros(n)
    rest = np.ones((n, 1))
    touch = np.arange(4.0 * n).reshape(n, 4)
    return annelid.Sensation(
        step * 1e-3, rest + longer_m[:, None], rest, zeros, zeros, np.zeros((n, 3)), np.zeros(3), touch
    )


def test_it_is_the_network_stepped_by_hand() -> None:
    ours, stepper = controller(), baton().compile(1.0)
    state, rng = stepper.initial_state(), np.random.default_rng(0)
    for step in range(300):
        longer_m = rng.uniform(-0.02, 0.06, N)
        activation = ours.step(sensed(longer_m, step))
        # As the body measures it, rounded.
        read = (1.0 + longer_m) - 1.0
        stepper.advance(state, 400.0 * np.maximum(read, 0.0))
        assert activation == pytest.approx(np.clip(state.potential[0] / 20.0, 0.0, 1.0), abs=1e-15)
    assert ours.read(False)["potential"] == pytest.approx(state.potential[0], abs=0.0)


def test_outputs_and_control_step_must_fit() -> None:
    with pytest.raises(ConfigError, match="1 outputs expand and 2 contract"):
        NetworkController(baton(), {}, ["segment1", ("segment2", "segment3")])
    late = controller(control_timestep_s=0.002)
    late.step(sensed(np.zeros(N)))
    with pytest.raises(ConfigError, match=r"clock\.control_timestep_s"):
        late.stride(sensed(np.zeros(N), 20), 1)


def test_a_run_goes_on_bit_for_bit_and_its_network_can_be_drawn(tmp_path: Path) -> None:
    step_s = 0.01
    changes = {"clock.physics_timestep_s": step_s, "record.signals_interval_s": step_s}
    config, half = (
        annelid.load_config("riddle2025-muscles", {**changes, "duration_s": steps * step_s}) for steps in (6, 3)
    )
    whole = annelid.simulate(config, tmp_path / "whole", controller=controller())
    first = annelid.simulate(half, tmp_path / "first", controller=controller())
    rest = annelid.simulate(config, tmp_path / "rest", resume=first, controller=controller())
    assert (whole.data["potential"].values[-1] == rest.data["potential"].values[-1]).all()
    assert list(whole.data["neuron"].values) == NAMES
    from annelid.draw.figures.network_diagram import run_network_figure

    assert run_network_figure(whole, tmp_path / "network.png").stat().st_size > 1000
