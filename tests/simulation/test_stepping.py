"""Strides: control steps taken together while the body rests give what they give one at a time, bit for bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.config import RunConfig, load_config
from annelid.protocols import Array, MultiRatePlant, Plant, Sensation
from annelid.simulation import build_controller, build_plant, simulate
from annelid.simulation.stepping import Simulation, start

N, REST_M = 3, 0.1


class StepwiseToy:
    """Segments that lengthen with their activation, every ``move_every`` control steps."""

    n_segments = N
    n_muscles = N

    def __init__(self, move_every: int) -> None:
        self.move_every = move_every
        self.reset(0)

    def reset(self, seed: int) -> Sensation:
        self._excess = np.full(N, 0.02)
        self._steps = 0
        self.strides: list[int] = []
        return self._feel()

    def step(self, activation: Array) -> Sensation:
        self._steps += 1
        self.strides.append(1)
        if self._steps % self.move_every == 0:
            self._excess = self._excess + 0.3 * (0.04 * activation - self._excess)
        return self._feel()

    def _feel(self) -> Sensation:
        nothing = np.full(N, np.nan)
        lengths = (REST_M + self._excess)[:, np.newaxis]
        return Sensation(
            self._steps * 0.001, lengths, np.full((N, 1), REST_M), nothing, nothing, np.zeros((N, 3)), np.full(3, 0.0)
        )


class StridingToy(StepwiseToy):
    """The same, asked to take its control steps together."""

    def steps_to_move(self) -> int:
        return self.move_every - self._steps % self.move_every

    def stride(self, activation: Array) -> Sensation:
        n_steps = len(activation)
        assert 1 <= n_steps <= self.steps_to_move()
        self._steps += n_steps - 1
        sensation = self.step(activation[-1])
        self.strides[-1] = n_steps
        return sensation


def toy_config(move_every: int, **changes: object) -> RunConfig:
    base = {"body.kind": "riddle2022", "duration_s": 1.0, "clock.physics_timestep_s": 0.001 * move_every}
    return load_config({}, base | {key.replace("__", "."): value for key, value in changes.items()})


def coupled(config: RunConfig, plant: Plant) -> Simulation:
    return start(config, plant, config.controller.build(config, plant), None)  # type: ignore[arg-type]


@settings(max_examples=40)
@given(
    move_every=st.integers(1, 25),
    sample_every=st.integers(1, 30),
    frame_every=st.integers(1, 60),
    hold_steps=st.integers(0, 60),
    hysteresis_m=st.sampled_from([0.0, 0.004]),
    kick_nA=st.sampled_from([0.0, 1.0]),
)
def test_strides_give_what_single_steps_give(
    move_every: int, sample_every: int, frame_every: int, hold_steps: int, hysteresis_m: float, kick_nA: float
) -> None:
    config = toy_config(
        move_every,
        duration_s=0.2,
        record__signals_interval_s=0.001 * sample_every,
        record__frames_interval_s=0.001 * frame_every,
        sensor__startup_hold_s=0.001 * hold_steps,
        sensor__hysteresis_m=hysteresis_m,
        controller__kick_nA=kick_nA,
    )
    plant = StridingToy(move_every)
    fast, slow = coupled(config, plant), coupled(config, StepwiseToy(move_every))
    while fast.step < fast.schedule.end:
        before = fast.step
        fast.advance()
        assert not any(step % sample_every == 0 or step % frame_every == 0 for step in range(before + 1, fast.step))
        while slow.step < fast.step:
            slow.advance()
        np.testing.assert_array_equal(fast.activation, slow.activation)
        np.testing.assert_array_equal(fast.sensation.stretch_m, slow.sensation.stretch_m)
        assert fast.sensation.time_s == slow.sensation.time_s
        for one, other in zip(
            fast.controller.get_state().values(),  # type: ignore[attr-defined]
            slow.controller.get_state().values(),  # type: ignore[attr-defined]
            strict=True,
        ):
            np.testing.assert_array_equal(one, other)
    assert fast.step == sum(plant.strides) == 200
    assert max(plant.strides) <= min(move_every, sample_every, frame_every)


def test_a_stride_goes_all_the_way_to_the_next_movement() -> None:
    plant = StridingToy(20)
    simulation = coupled(toy_config(20, record__signals_interval_s=0.02, record__frames_interval_s=0.04), plant)
    for _ in range(5):
        simulation.advance()
    assert plant.strides == [20] * 5


def test_noise_is_drawn_at_every_control_step() -> None:
    config = toy_config(20, sensor__noise_m=0.001, record__signals_interval_s=0.02, record__frames_interval_s=0.04)
    plant = StridingToy(20)
    fast, slow = coupled(config, plant), coupled(config, StepwiseToy(20))
    for _ in range(100):
        fast.advance()
        slow.advance()
        np.testing.assert_array_equal(fast.activation, slow.activation)
    assert plant.strides == [1] * 100


class OneAtATime:
    """A plant without its capability of strides."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant

    def __getattr__(self, name: str) -> object:
        if name in ("stride", "steps_to_move"):
            raise AttributeError(name)
        return getattr(self._plant, name)


def test_runs_of_the_worm_with_and_without_strides_are_identical(tmp_path: Path) -> None:
    changes = {
        "duration_s": 0.5,
        "clock.physics_timestep_s": 0.02,
        "body.mesh.elements_per_side": 1,
        "sensor.startup_hold_s": 0.205,
        "record.signals_interval_s": 0.01,
        "record.frames_interval_s": 0.05,
    }
    config = load_config("riddle2023-rods", changes)
    assert isinstance(build_plant(config), MultiRatePlant)
    whole = simulate(config, tmp_path / "strides", progress=False).data
    plain: Plant = OneAtATime(build_plant(config))  # type: ignore[assignment]
    assert not isinstance(plain, MultiRatePlant)
    single = simulate(config, tmp_path / "single", plant=plain, controller=build_controller(config, plain)).data
    assert whole.sizes == single.sizes
    for name in whole.data_vars:
        if name != "wall_time":
            np.testing.assert_array_equal(whole[name].values, single[name].values, err_msg=str(name))
    assert np.ptp(whole["activation"].values) > 0.1
