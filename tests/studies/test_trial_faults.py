"""What goes wrong on purpose: what a fault does to a reading or a command, what a blind controller sees, loads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.config import ControllerKind, load_config
from annelid.errors import ConfigError
from annelid.protocols import Plant, Sensation
from annelid.simulation import WormPlant, build_controller, simulate
from annelid_studies.faults import Faults, FaultState, FaultyController

N, STEP_S = 3, 0.01
PLANAR: dict[str, Any] = {"duration_s": 1.0}
EVERYTHING = {"loss": 0.3, "weak_segment": 2, "weak_strength": 0.5, "weak_from_s": 0.3}


class Body:
    """As much of a plant as faults ask for."""

    n_segments, n_muscles = N, 2 * N

    def reset(self, seed: int) -> Sensation:
        return felt(0, np.random.default_rng(0))


def felt(step: int, values: np.random.Generator) -> Sensation:
    """A sensation of random numbers at a control step."""
    arrays = [values.uniform(0.1, 1.0, shape) for shape in ((N, 2), (N, 2), (2 * N,), (2 * N,), (N, 3), (3,), (N, 4))]
    return Sensation(step * STEP_S, *arrays)


def sensed(trial: Faults, n_steps: int, seed: int = 1) -> tuple[list[Sensation], list[Sensation]]:
    """What is true and what is sensed at control steps."""
    faults = FaultState(trial, Body())  # type: ignore[arg-type]
    faults.reset(seed)
    random = np.random.default_rng(7)
    true = [felt(step, random) for step in range(n_steps)]
    return true, [faults.sensed(one) for one in true]


def moved(trial: Faults, commands: np.ndarray, seed: int = 1) -> np.ndarray:
    """What reaches the muscles of commands, ``(n_steps, n_muscles)``."""
    faults = FaultState(trial, Body())  # type: ignore[arg-type]
    faults.reset(seed)
    return np.array([faults.moved(command, step * STEP_S) for step, command in enumerate(commands)])


@pytest.mark.parametrize("preset", ["riddle2022-planar", "riddle2023-rods"])
def test_a_trial_in_which_nothing_goes_wrong_changes_no_bit(preset: str, tmp_path: Path) -> None:
    changes = {"duration_s": 0.2} if preset == "riddle2023-rods" else PLANAR
    plain = simulate(load_config(preset, changes), tmp_path / "plain")
    faulty = simulate(load_config(preset, changes | {"trial": {"blind": True}}), tmp_path / "faulty")
    assert all(plain.data[name].equals(faulty.data[name]) for name in plain.data if name != "wall_time")


@settings(max_examples=5)
@given(st.floats(0.1, 0.9), st.integers(0, 20))
def test_a_lost_sensor_keeps_its_last_reading(share: float, seed: int) -> None:
    true, read = sensed(Faults(loss=share), 4000, seed)
    now = np.array([one.ring_length_m for one in true])
    seen = np.array([one.ring_length_m for one in read])
    fresh = seen == now
    assert np.array_equal(seen[1:][~fresh[1:]], seen[:-1][~fresh[1:]])
    assert 1 - fresh.mean() == pytest.approx(share, abs=0.15)
    slots = fresh.reshape(-1, 20, fresh.shape[1])
    assert (slots == slots[:, :1]).all(), "a loss lasts for 0.2 s"


def test_a_weak_segment_weakens_at_its_time() -> None:
    commands = np.full((10, 2 * N), 0.8)
    done = moved(Faults(weak_segment=2, weak_strength=0.5, weak_from_s=0.05), commands)
    assert np.array_equal(done[:5], commands[:5])
    assert np.array_equal(done[5:, [0, 1, 4, 5]], commands[5:, [0, 1, 4, 5]])
    assert done[5:, 2:4] == pytest.approx(0.4)


class Reader(ControllerKind):
    """Reads all that it is given."""

    def build(self, config: Any, plant: Plant) -> Any:
        Reader.given = config, plant
        return Reader

    @staticmethod
    def reset(seed: int) -> None:
        Reader.seed = seed

    @staticmethod
    def step(sensation: Sensation) -> np.ndarray:
        return np.zeros(3)


@pytest.mark.parametrize("blind", [False, True])
def test_a_blind_controller_knows_of_no_draw(blind: bool) -> None:
    changes = {"seed": 5, "arena.friction": 0.3, "sensor.noise_m": 0.002, "trial": {"loss": 0.5, "blind": blind}}
    config = load_config("riddle2023-rods", changes).model_copy(update={"controller": Reader(kind="reader")})
    plant = WormPlant(config)
    controller = build_controller(config, plant)
    controller.reset(99)
    assert isinstance(controller, FaultyController)
    known, body = Reader.given
    hidden = load_config("riddle2023-rods")
    assert (known.seed, known.trial, known.sensor.noise_m, Reader.seed) == (
        (0, None, 0.0, 0) if blind else (5, config.trial, 0.002, 99)
    )
    assert (known.arena.friction == 0.3) != blind
    assert hasattr(body, "model") != blind
    assert body.n_segments == 3
    assert known.clock == hidden.clock


def test_a_run_under_trial_continues_bit_for_bit(tmp_path: Path) -> None:
    config = load_config("riddle2022-planar", PLANAR | {"trial": EVERYTHING, "sensor.noise_m": 0.001})
    whole = simulate(config, tmp_path / "whole")
    simulate(config.model_copy(update={"duration_s": 0.43}), tmp_path / "first")
    rest = simulate(config, tmp_path / "rest", resume=tmp_path / "first")
    later = whole.data.sel(time=rest.data["time"].values, method="nearest")
    for name in ("activation", "stretch_length", "potential"):
        assert np.array_equal(later[name].values[1:], rest.data[name].values[1:])


def test_a_load_pulls_the_last_ring_back_from_its_time_on(tmp_path: Path) -> None:
    pull = {"pull": 0.1, "pull_from_s": 0.1}
    changes = {"duration_s": 0.3, "controller": {"kind": "program", "contractions": []}, "arena.friction": 0.01}
    pulled = simulate(load_config("riddle2023-rods", changes | {"trial": pull}), tmp_path).data
    time, way = pulled["time"].values, (pulled["center_of_mass"][:, 0] - pulled["center_of_mass"][0, 0]).values
    assert way[time < 0.1] == pytest.approx(0.0, abs=1e-4)
    # The centre of mass falls backwards with a tenth of gravity, less the friction.
    assert way[-1] == pytest.approx(0.5 * (0.1 - 0.01) * 9.81 * (time[-1] - 0.1) ** 2, rel=0.05)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"trial.weak_segment = 4: must be in 1 .. 3"):
        load_config("riddle2023-rods", {"trial.weak_segment": 4})
    with pytest.raises(ConfigError, match=r"trial.pull = 0.1: body.kind = 'riddle2022' cannot be pulled"):
        load_config("riddle2022-planar", {"trial.pull": 0.1})
    with pytest.raises(ConfigError, match=r"trial.loss.*1.5"):
        load_config("riddle2023-rods", {"trial.loss": 1.5})
