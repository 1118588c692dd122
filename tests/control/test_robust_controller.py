"""The robust controller on a body: what it reads, what it remembers, and that it walks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from annelid import load_config, open_run, simulate
from annelid.analysis import rhythm_score
from annelid.config import RunConfig
from annelid.control.robust import DescendingDrive, RobustController, RobustSns
from annelid.errors import ConfigError
from annelid.nervous.robust import ROLES, robust_network
from annelid.protocols import SIDES, Sensation

N, TIMESTEP_S, REST_M = 4, 0.001, 0.1


def sensation(lengthening_m: np.ndarray, n_sensors: int = 6) -> Sensation:
    rest = np.full((N, n_sensors), REST_M)
    nothing = np.zeros(N)
    return Sensation(0.0, rest + lengthening_m[:, np.newaxis], rest, nothing, nothing, np.zeros((N, 3)), np.zeros(3))


def controller(n_muscles: int = N, full_stretch_m: float = 0.08) -> RobustController:
    return RobustController(RobustSns(full_stretch_m=full_stretch_m), N, n_muscles, TIMESTEP_S)


def planar(**changes: object) -> RunConfig:
    return load_config("riddle2022-planar", {"controller": {"kind": "sns-robust"}, **changes})


def test_a_stride_is_its_steps_bit_for_bit() -> None:
    felt = [sensation(np.linspace(-0.02, 0.05, N) * (1 + k)) for k in range(5)]
    single, striding = controller(), controller()
    for one in felt:
        by_steps = [single.step(one) for _ in range(37)]
        assert np.array_equal(by_steps, striding.stride(one, 37))


def test_it_continues_from_its_state_bit_for_bit() -> None:
    first, second = controller(), controller()
    first.stride(sensation(np.full(N, 0.03)), 500)
    second.set_state(first.get_state())
    later = sensation(np.array([0.0, 0.05, 0.01, 0.02]))
    assert np.array_equal(first.stride(later, 300), second.stride(later, 300))
    first.reset(1)
    assert np.array_equal(first.stride(later, 300), controller().stride(later, 300))


def test_the_stretch_neurons_follow_the_mean_lengthening_in_their_range() -> None:
    made = controller(full_stretch_m=0.04)
    made.stride(sensation(np.array([-0.02, 0.01, 0.04, 0.3])), 200)
    assert made.read(frame=False)["stretch_activity"] == pytest.approx([0.0, 0.25, 1.0, 1.0], abs=1e-6)


def test_it_starts_as_it_is_told() -> None:
    def start(name: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
        made = RobustController(RobustSns(start=name), N, N, TIMESTEP_S)  # type: ignore[arg-type]
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


def test_what_it_names_it_reads() -> None:
    made = controller()
    named, values = made.recordable(), made.read(frame=False)
    assert {signal.name: signal.shape for signal in named.signals} == {name: np.shape(v) for name, v in values.items()}
    assert list(named.coords["neuron"]) == list(robust_network(N).neurons)
    gate = np.asarray(values["sodium_gate"])[:-1].reshape(N, len(ROLES))
    assert np.isfinite(gate[:, :2]).all()
    assert np.isnan(gate[:, 2:]).all()
    assert made.read(frame=True) == {}


def test_it_walks_the_planar_worm(tmp_path: Path) -> None:
    n, period_s = 6, 6 * 0.875
    simulate(planar(**{"body.n_segments": n, "duration_s": 2.6 * period_s}), tmp_path / "run", progress=False)
    found = rhythm_score(open_run(tmp_path / "run"))
    assert found.verdict == "ordered"
    assert (found.direction, found.wave_fronts) == (1, 1)
    assert found.period_s == pytest.approx(period_s, rel=0.1)


def test_a_control_step_that_is_too_long_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"clock.control_timestep_s = 0.005 must be at most 0.00"):
        RobustController(RobustSns(), 24, 24, 0.005)


def test_bad_fields_are_refused(subtests: pytest.Subtests) -> None:
    for field, value in (("turn_ms", 0), ("bifurcation_mV", 0.01), ("entrainment", 0.2), ("full_stretch_m", -1)):
        with subtests.test(f"{field!r:.60}"), pytest.raises(ConfigError, match=field):
            planar(**{f"controller.{field}": value})


def pressed(touch_N: np.ndarray) -> Sensation:
    return replace(sensation(np.zeros(N)), touch_N=touch_N)


def driven(**changes: float) -> RobustController:
    section = RobustSns(turn_ms=300.0, descending=DescendingDrive(lift=0.45, **changes))
    return RobustController(section, N, N, TIMESTEP_S)


@given(arrays(float, (N, 3), elements=st.floats(0.0, 100.0)))
@settings(max_examples=10)
def test_on_open_ground_the_adaptive_wave_is_the_fixed_one(elsewhere: np.ndarray) -> None:
    fixed = RobustController(RobustSns(turn_ms=300.0), N, N, TIMESTEP_S)
    touch = np.zeros((N, len(SIDES)))
    touch[:, [SIDES.index(side) for side in ("belly", "left", "right")]] = elsewhere
    free, adaptive = sensation(np.zeros(N)), driven()
    for _ in range(8):
        assert adaptive.stride(pressed(touch), 100) == pytest.approx(fixed.stride(free, 100), abs=1e-9)
    assert adaptive.read(frame=False)["drive"] == 0.0


def test_pressed_backs_drive_as_the_design_says() -> None:
    touch = np.zeros((N, len(SIDES)))
    touch[:2, SIDES.index("back")] = [3.0, 1.5]
    made = driven(per_segment=0.5, full_pressure_N=3.0)
    made.stride(pressed(touch), 3000)
    # Two excitatory synapses of 0.5 Gm R / E_ex each, the second half open, beside the leak.
    open_uS = 0.5 * 20.0 / 194.0 * 1.5
    assert made.read(frame=False)["drive"] == pytest.approx(open_uS * 194.0 / (1.0 + open_uS) / 20.0, abs=1e-4)
    touch[:, SIDES.index("back")] = 100.0
    made.stride(pressed(touch), 3000)
    assert made.read(frame=False)["drive"] == 1.0


def test_a_drive_is_recorded_and_a_stride_is_its_steps() -> None:
    touch = np.full((N, len(SIDES)), 2.0)
    single, striding = driven(), driven()
    by_steps = [single.step(pressed(touch)) for _ in range(150)]
    assert np.array_equal(by_steps, striding.stride(pressed(touch), 150))
    named, values = single.recordable(), single.read(frame=False)
    assert {signal.name: signal.shape for signal in named.signals} == {name: np.shape(v) for name, v in values.items()}
    assert "drive" not in controller().read(frame=False)


def test_a_body_without_skin_feels_no_pressure() -> None:
    made = driven()
    made.stride(sensation(np.zeros(N)), 500)
    assert made.read(frame=False)["drive"] == 0.0


def test_motor_neurons_let_go_with_their_time_constant() -> None:
    section = RobustSns(turn_ms=300.0, let_go_s=0.35)
    made, plain = (RobustController(each, N, N, TIMESTEP_S) for each in (section, RobustSns(turn_ms=300.0)))
    rest = sensation(np.zeros(N))
    contracted, own = np.array([[plain.step(rest)[0], made.step(rest)[0]] for _ in range(900)]).T
    assert own[290] == pytest.approx(1.0, abs=0.01)
    # The contraction neuron falls within some milliseconds; from then on Euler's steps shrink the rest alike.
    end = int(np.flatnonzero(contracted > 0.5)[-1]) + 30
    later = own[end : end + 200]
    assert later[1:] / later[:-1] == pytest.approx(np.full(199, 1.0 - 0.001 / 0.35), rel=1e-9)
    assert later[0] > 0.8
