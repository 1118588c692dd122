from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy import ForgetfulController, SavedToyPlant, ToyController, ToyPlant, toy_config

from annelid.config import RunConfig
from annelid.errors import ConfigError, RunFileError, SimulationStopped
from annelid.simulation import Run, loop, open_run, simulate
from annelid.simulation.checkpoint import (
    generator_state,
    newest_payload,
    restore_generator,
    to_slot,
)
from annelid.simulation.runfile import read_checkpoint

NOISY = {"sensor__noise_m": 0.002, "seed": 3}


def toy_run(config: RunConfig | None, out: Path, resume: Run | Path | None = None) -> Run:
    return simulate(config, out, plant=SavedToyPlant(), controller=ToyController(), resume=resume)


def assert_joined_equal(first: Run, second: Run, whole: Run) -> None:
    """Every variable of the two parts, one after the other, equals that of the whole, bit for bit."""
    assert set(first.data.variables) == set(second.data.variables) == set(whole.data.variables)
    compared = 0
    for name, variable in whole.data.variables.items():
        if name == "wall_time":
            continue
        parts = first.data.variables[name], second.data.variables[name]
        if {"time", "frame"} & set(variable.dims):
            joined = np.concatenate([part.values for part in parts])
            np.testing.assert_array_equal(joined, variable.values, err_msg=str(name))
            compared += 1
        else:
            np.testing.assert_array_equal(parts[1].values, variable.values, err_msg=str(name))
    assert compared >= 7


def test_continued_toy_run_equals_the_whole_bit_for_bit(tmp_path: Path) -> None:
    first = toy_run(toy_config(duration_s=0.203, **NOISY), tmp_path / "1")
    second = toy_run(toy_config(duration_s=0.406, **NOISY), tmp_path / "2", resume=first)
    whole = toy_run(toy_config(duration_s=0.406, **NOISY), tmp_path / "3")
    assert_joined_equal(first, second, whole)
    assert np.ptp(whole.data["stretch_length"].values) > 0.001


def test_a_run_stopped_by_its_guard_goes_on_from_its_last_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loop.RecordedRun, "checkpoint_interval_s", 0.0)
    monkeypatch.setattr(loop, "_CHECKPOINT_SHARE", 1e9)
    config = toy_config(**NOISY)
    with pytest.raises(SimulationStopped):
        simulate(config, tmp_path / "1", plant=SavedToyPlant(alarm_at=120), controller=ToyController())
    assert read_checkpoint(tmp_path / "1").step == 119
    # Without a configuration it is that of the run before, to its end.
    second = toy_run(None, tmp_path / "2", resume=tmp_path / "1")
    whole = toy_run(config, tmp_path / "3")
    assert_joined_equal(open_run(tmp_path / "1"), second, whole)


def test_the_file_of_the_new_part_names_the_run_before(tmp_path: Path) -> None:
    first = toy_run(toy_config(), tmp_path / "crawl")
    second = toy_run(toy_config(duration_s=0.4), tmp_path / "on", resume=first.path)
    assert second.data.attrs["resumed_from"] == "crawl/run.nc"
    assert second.data.attrs["resumed_at_s"] == second.start_s == pytest.approx(0.2)
    assert first.start_s == 0
    assert second.real_time_factor == pytest.approx(0.2 / second.wall_time_s)
    third = toy_run(toy_config(duration_s=0.5), tmp_path / "further", resume=second)
    assert third.data["time"][0] == pytest.approx(0.405)
    assert third.data["time"][-1] == pytest.approx(0.5)


def test_recording_and_name_may_change(tmp_path: Path) -> None:
    first = toy_run(toy_config(**NOISY), tmp_path / "1")
    config = toy_config(
        duration_s=0.3,
        name="finer",
        published="riddle2022",
        record__signals_interval_s=0.001,
        record__frames_interval_s=0.5,
        **NOISY,
    )
    second = toy_run(config, tmp_path / "2", resume=first)
    np.testing.assert_array_equal(second.data["control_steps"], np.arange(201, 301))
    assert second.data.sizes["frame"] == 0
    assert second.config.name == "finer"


def test_what_does_not_continue_a_run_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    first = toy_run(toy_config(), tmp_path / "1")
    before = first.path.read_bytes()
    with pytest.raises(ConfigError, match=r"body\.gain, sensor\.noise_m differs"):
        toy_run(toy_config(duration_s=1.0, sensor__noise_m=0.1, body__gain=2.0), tmp_path / "2", resume=first)
    with pytest.raises(ConfigError, match=r"duration_s = 0\.2 does not go beyond the 0\.2 s"):
        toy_run(None, tmp_path / "2", resume=first)
    with pytest.raises(ConfigError, match="holds the run to continue"):
        simulate(toy_config(duration_s=1.0), tmp_path / "1", resume=first, overwrite=True)
    with pytest.raises(RunFileError, match="cannot be restored"):
        simulate(toy_config(duration_s=1.0), tmp_path / "2", plant=ToyPlant(), controller=ToyController(), resume=first)
    with pytest.raises(ConfigError, match="needs a configuration"):
        simulate(None, tmp_path / "2")
    assert [path.name for path in tmp_path.iterdir()] == ["1"]
    assert first.path.read_bytes() == before
    simulate(toy_config(), tmp_path / "3", plant=ToyPlant(), controller=ForgetfulController())
    with pytest.raises(RunFileError, match=r"no checkpoint .* cannot be saved"):
        toy_run(toy_config(duration_s=1.0), tmp_path / "4", resume=tmp_path / "3")


@given(
    old=st.binary(min_size=1, max_size=300),
    new=st.binary(min_size=1, max_size=300),
    cut=st.integers(0, 319),
    sequence=st.integers(1, 10**6),
)
def test_a_write_cut_off_anywhere_leaves_a_whole_checkpoint(old: bytes, new: bytes, cut: int, sequence: int) -> None:
    previous = to_slot(sequence, b"before").ljust(400, b"\0")
    target = to_slot(max(sequence - 1, 1), old).ljust(400, b"\0") if sequence > 1 else bytes(400)
    written = to_slot(sequence + 1, new)
    cut = min(cut, len(written))
    torn = written[:cut] + target[cut:]
    found = newest_payload([previous, torn])
    assert found == (new if torn.startswith(written) else b"before")


@given(seed=st.integers(0, 2**64), draws=st.integers(0, 5))
def test_a_restored_generator_draws_the_same_numbers(seed: int, draws: int) -> None:
    generator = np.random.Generator(np.random.PCG64(seed))
    generator.normal(size=draws)
    # A draw of 32 bits leaves half a word behind, which is part of the state.
    generator.integers(0, 2**20, size=draws, dtype=np.uint32)
    copy = restore_generator(generator_state(generator))
    np.testing.assert_array_equal(
        copy.integers(0, 2**20, 3, dtype=np.uint32), generator.integers(0, 2**20, 3, dtype=np.uint32)
    )
    np.testing.assert_array_equal(copy.normal(size=10), generator.normal(size=10))
