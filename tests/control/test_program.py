"""Open-loop contractions: activation over time, halves, refusals, and runs from beginning to end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.analysis.paper import published
from annelid.config import RunConfig, load_config
from annelid.control import OpenLoopController
from annelid.control.open_loop import Contraction, Program
from annelid.errors import ConfigError
from annelid.protocols import Sensation
from annelid.simulation import simulate

ONE = {"segment": 1, "start_s": 0.0, "stop_s": 0.6}


def program(*contractions: tuple[int, float, float, float], ramp_s: float = 0.0) -> Program:
    several = (Contraction(segment=s, start_s=a, stop_s=b, activation=level) for s, a, b, level in contractions)
    return Program(contractions=tuple(several), ramp_s=ramp_s)


def programmed(*contractions: dict[str, Any], **fields: Any) -> dict[str, Any]:
    return {"controller": {"kind": "program", "contractions": list(contractions), **fields}}


def at(time_s: float, n_segments: int = 3) -> Sensation:
    unfelt = np.full((n_segments, 1), np.nan)
    return Sensation(time_s, unfelt, unfelt, unfelt[:, 0], unfelt[:, 0], np.zeros((n_segments, 3)), np.zeros(3))


@given(start=st.integers(0, 5000), steps=st.integers(1, 3000))
def test_a_contraction_lasts_exactly_its_number_of_control_steps(start: int, steps: int) -> None:
    """Whichever way the times of the steps are rounded."""
    dt = 0.001
    one = program((1, start * dt, (start + steps) * dt, 1.0))
    for times in (np.arange(9000) * dt, np.cumsum(np.full(9000, dt)) - dt):
        on = np.flatnonzero(one.activation(times, 1)[:, 0])
        assert (on[0], len(on)) == (start, steps)


def test_a_ramp_rises_from_the_start_and_falls_from_what_it_has_reached() -> None:
    for stop_s, ramp_s, levels in (
        (1.5, 0.0, {0.999: 0, 1.0: 0.6, 1.499: 0.6, 1.5: 0, 3.0: 0}),
        (2.0, 0.2, {0.9: 0, 1.0: 0, 1.05: 0.15, 1.1: 0.3, 1.2: 0.6, 2.0: 0.6, 2.05: 0.45, 2.2: 0, 3.0: 0}),
        (1.1, 0.4, {1.0: 0, 1.05: 0.075, 1.1: 0.15, 1.15: 0.075, 1.2: 0, 1.3: 0}),
    ):
        activation = program((2, 1.0, stop_s, 0.6), ramp_s=ramp_s).activation([*levels], 3)
        np.testing.assert_allclose(activation[:, 1], [*levels.values()], atol=1e-12)
        assert not activation[:, [0, 2]].any()


contractions = st.tuples(st.integers(1, 4), st.floats(0, 5), st.floats(0.01, 3), st.floats(0.05, 1.0)).map(
    lambda one: (one[0], one[1], one[1] + one[2], one[3])
)


@given(several=st.lists(contractions, max_size=6), ramp_s=st.sampled_from([0.0, 0.1, 0.7]))
def test_of_overlapping_contractions_the_larger_wins(
    several: list[tuple[int, float, float, float]], ramp_s: float
) -> None:
    times = np.linspace(0.0, 9.0, 400)
    alone = [program(one, ramp_s=ramp_s).activation(times, 4) for one in several]
    together = program(*several, ramp_s=ramp_s).activation(times, 4)
    np.testing.assert_array_equal(together, np.max([np.zeros((400, 4)), *alone], axis=0))
    assert together.min() >= 0
    assert together.max() <= 1


def test_halves_of_a_ring_contract_alike() -> None:
    halves = OpenLoopController(program((2, 0.0, 1.0, 0.7), (3, 0.5, 1.0, 1.0)), 3, 6)
    np.testing.assert_array_equal(halves.step(at(0.2)), [0, 0, 0.7, 0.7, 0, 0])
    np.testing.assert_array_equal(halves.step(at(0.6)), [0, 0, 0.7, 0.7, 1, 1])


def test_a_bad_contraction_is_refused_in_one_sentence(subtests: pytest.Subtests) -> None:
    for contraction, sentence in (
        ({"segment": 4}, r"controller\.contractions\.0\.segment = 4: must be in 1 \.\. 3, the segments of the body"),
        ({"start_s": 0.6}, r"stop_s = 0\.6 of a contraction of segment 1 must be greater than its start_s = 0\.6"),
        ({"activation": 1.01}, r"activation = 1\.01: must be at most 1"),
    ):
        with subtests.test(f"{contraction!r:.60}"):
            with pytest.raises(ConfigError, match=sentence) as caught:
                load_config("riddle2023-rods", programmed({**ONE, **contraction}))
            assert "\n" not in str(caught.value)


def test_it_is_listed_saved_and_not_laid_beside_the_paper() -> None:
    config = load_config("riddle2023-rods", programmed(ONE))
    assert RunConfig.model_validate_json(config.model_dump_json()) == config
    assert published(load_config("riddle2023-rods")) != {}
    assert published(config) == {}
    assert published(load_config("riddle2023-rods", {"body.mesh.radius_m": 0.08})) == {}, "a worm of another size"


def planar(duration_s: float) -> RunConfig:
    two = {"segment": 3, "start_s": 0.1, "stop_s": 0.25, "activation": 0.5}
    return load_config(
        "riddle2022-planar", {**programmed(ONE | {"stop_s": 0.2}, two, ramp_s=0.05), "duration_s": duration_s}
    )


def test_a_planar_worm_does_what_the_program_says(tmp_path: Path) -> None:
    run = simulate(planar(0.5), tmp_path, progress=False)
    assert run.data.attrs["controller"] == "program of contractions"
    time, activation = run.data["time"].values, run.data["activation"].values
    config = run.config
    assert isinstance(config.controller, Program)
    # The sample at t holds the activation of the step that ended there.
    begun = time[1:] - config.clock.control_timestep_s
    np.testing.assert_allclose(activation[1:], config.controller.activation(begun, 3), atol=1e-9)
    heights = run.data["ring_length"].values
    assert heights[:, 1] == pytest.approx(0.11)
    assert 0.07 < heights[:, 2].min() < 0.105
