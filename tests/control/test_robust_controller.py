"""The robust controller on a body: what it reads, what it remembers, and that it walks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from circuits import controller, felt
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from annelid import load_config, open_run, simulate
from annelid.analysis import rhythm_score
from annelid.config import RunConfig
from annelid.control import CircuitController
from annelid.errors import ConfigError
from annelid.protocols import SIDES

N, TIMESTEP_S = 4, 0.001


def robust(n_segments: int = N, **fields: Any) -> CircuitController:
    return controller("sns-robust", n_segments, **fields)


def planar(**changes: object) -> RunConfig:
    return load_config("riddle2022-planar", {"controller": {"kind": "sns-robust"}, **changes})


def test_the_stretch_neurons_follow_the_mean_lengthening_in_their_range() -> None:
    made = robust()
    made.stride(felt([-0.02, 0.02, 0.08, 0.6]), 200)
    assert made.read(frame=False)["stretch_activity"] == pytest.approx([0.0, 0.25, 1.0, 1.0], abs=1e-6)


def test_it_starts_as_its_section_says() -> None:
    def start(name: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
        made = robust(start=name)
        made.reset(seed)
        state = made.get_state()
        return np.asarray(state["potential"]), np.asarray(state["gate"])

    potential, gate = start("silent", 1)
    assert not potential.any()
    assert gate == pytest.approx(1.0 / 1.5)  # 1 / (1 + 0.5 exp(S 0))
    drawn, again, other = start("random", 1), start("random", 1), start("random", 2)
    assert all(np.array_equal(a, b) for a, b in zip(drawn, again, strict=True))
    assert not np.array_equal(drawn[0], other[0])
    assert np.ptp(drawn[0]) > 50.0
    assert drawn[0].min() >= -40.0
    assert drawn[0].max() <= 60.0


def test_it_walks_from_a_random_start_after_two_turns(tmp_path: Path) -> None:
    section = {"kind": "sns-robust", "start": "random"}
    run = simulate(planar(controller=section, duration_s=8.5), tmp_path, progress=False)
    score = rhythm_score(open_run(run.path), 1.75)
    assert (score.verdict, score.direction, score.wave_fronts) == ("ordered", 1, 1)


def test_a_control_step_that_is_too_long_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"clock.control_timestep_s = 0.005 must be at most 0.00"):
        robust(24, timestep_s=0.005)


def driven(**changes: float) -> CircuitController:
    return robust(turn_ms=300.0, descending={"lift": 0.45, **changes})


@given(arrays(float, (N, 3), elements=st.floats(0.0, 100.0)))
@settings(max_examples=10)
def test_on_open_ground_the_adaptive_wave_is_the_fixed_one(elsewhere: np.ndarray) -> None:
    fixed = robust(turn_ms=300.0)
    touch = np.zeros((N, len(SIDES)))
    touch[:, [SIDES.index(side) for side in ("belly", "left", "right")]] = elsewhere
    free, pressed, adaptive = felt(np.zeros(N)), felt(np.zeros(N), touch_N=touch), driven()
    for _ in range(8):
        assert adaptive.stride(pressed, 100) == pytest.approx(fixed.stride(free, 100), abs=1e-9)
    assert adaptive.read(frame=False)["drive"] == 0.0


def test_pressed_backs_drive_as_the_design_says() -> None:
    touch = np.zeros((N, len(SIDES)))
    touch[:2, SIDES.index("back")] = [3.0, 1.5]
    made = driven(per_segment=0.5, full_pressure_N=3.0)
    made.stride(felt(np.zeros(N), touch_N=touch), 3000)
    # Two excitatory synapses of 0.5 Gm R / E_ex each, the second half open, beside the leak.
    open_uS = 0.5 * 20.0 / 194.0 * 1.5
    assert made.read(frame=False)["drive"] == pytest.approx(open_uS * 194.0 / (1.0 + open_uS) / 20.0, abs=1e-4)
    touch[:, SIDES.index("back")] = 100.0
    made.stride(felt(np.zeros(N), touch_N=touch), 3000)
    assert made.read(frame=False)["drive"] == 1.0


def test_a_body_without_skin_feels_no_pressure() -> None:
    config = planar(**{"controller.descending.lift": 0.45})
    assert not any(name.startswith("pressure") for name in config.controller.circuit(config, N).inputs)  # type: ignore[attr-defined]


def test_motor_neurons_relax_with_their_time_constant() -> None:
    made, plain = robust(turn_ms=300.0, motor_time_constant_s=0.35), robust(turn_ms=300.0)
    rest = felt(np.zeros(N))
    contracted, own = np.array([[plain.step(rest)[0], made.step(rest)[0]] for _ in range(900)]).T
    assert own[290] == pytest.approx(1.0, abs=0.01)
    # The contraction neuron falls within some milliseconds; from then on Euler's steps shrink the rest alike.
    end = int(np.flatnonzero(contracted > 0.5)[-1]) + 30
    later = own[end : end + 200]
    assert later[1:] / later[:-1] == pytest.approx(np.full(199, 1.0 - 0.001 / 0.35), rel=1e-9)
    assert later[0] > 0.8
