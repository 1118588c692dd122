"""Many worms at once: each is bit for bit the worm that runs alone, and ends by itself."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import h5py
import mujoco
import numpy as np
import pytest

from annelid import RunConfig, load_config, open_run, simulate, simulate_batch, summary
from annelid.errors import AnnelidError, ConfigError, RunFileError
from annelid.protocols import Sensation
from annelid.simulation.anatomy import Anatomy
from annelid.simulation.batch import ALIKE
from annelid.simulation.checkpoint import Checkpoint
from annelid.simulation.recorder import Recorder
from annelid.simulation.runfile import read_checkpoint
from annelid.simulation.two_step import TwoStep
from annelid.simulation.worm import WormPlant

FAST = {
    "duration_s": 0.3,
    "clock.physics_timestep_s": 0.02,
    "body.mesh.elements_per_side": 2,
    "record.signals_interval_s": 0.02,
    "record.frames_interval_s": 0.1,
}
DIFFERENT: tuple[dict[str, Any], ...] = (
    {"seed": 3},
    {"arena.friction": 0.2, "sensor.noise_m": 0.004, "seed": 8, "body.springs.stiffness_N_per_m": 30.0},
    {
        "sensor.noise_m": 0.001,
        "sensor.tolerance_m": 0.01,
        "sensor.hysteresis_m": 0.002,
        "body.strands.young_modulus_Pa": 0.4e9,
        "body.strands.linear_density_kg_per_m": 0.02,
    },
)
CHAIN = {"body.formulation.kind": "chain", "clock.physics_timestep_s": 0.005, "duration_s": 0.05}


def config(**changes: Any) -> RunConfig:
    return load_config("riddle2023-rods", FAST | changes)


def stored(folder: Path) -> tuple[dict[str, str], dict[str, tuple[list[Any], dict[str, str], Any]]]:
    """What a run file holds: its attributes, and of every variable the dimensions, the attributes and the values."""
    # Read as plain HDF5, ten times as fast as through xarray, since a test compares a dozen files.
    with h5py.File(folder / "run.nc") as file:
        variables = {
            name: (
                [scale.name for axis in item.dims for scale in axis.values()],
                {key: str(value) for key, value in item.attrs.items() if not key.endswith("_LIST")},
                item[()],
            )
            for name, item in file.items()
            if isinstance(item, h5py.Dataset)
        }
        return {key: str(value) for key, value in file.attrs.items() if key != "created"}, variables


def bits(values: Any) -> np.ndarray:
    """Numbers as their bits, so that NaN equals NaN and 0 differs from -0."""
    values = np.asarray(values)
    return values.view(np.int64) if values.dtype == np.float64 else values


def parts(checkpoint: Checkpoint) -> dict[str, Any]:
    named = {"step": checkpoint.step, "noise": checkpoint.noise, **checkpoint.plant, **checkpoint.controller}
    return named | {field.name: getattr(checkpoint.sensation, field.name) for field in fields(Sensation)}


def assert_the_same(alone: Path, batched: Path) -> None:
    (attributes, expected), (attributes_batched, actual) = stored(alone), stored(batched)
    assert attributes == attributes_batched
    assert list(expected) == list(actual)
    for name, (dims, described, values) in expected.items():
        dims_batched, described_batched, values_batched = actual[name]
        assert (dims, described) == (dims_batched, described_batched), name
        if name not in ("wall_time", "cpu_time"):
            assert np.array_equal(bits(values), bits(values_batched)), name


def run_alone(one: RunConfig, folder: Path) -> str:
    """Runs it by itself and returns why it ended before its time."""
    try:
        return simulate(one, folder, progress=False).message
    except AnnelidError as error:
        return str(error)


VARIANTS: dict[str, dict[str, Any]] = {
    "rods": {},
    "record between movements": {"record.signals_interval_s": 0.015, "record.frames_interval_s": 0.05},
    "physics finer than control": {"clock.physics_timestep_s": 0.0005, "duration_s": 0.02},
    "separate pins": {"body.formulation.pins": "separate", "clock.physics_timestep_s": 0.002, "duration_s": 0.04},
    "heteroclinic channel": {"controller.kind": "shc", "body.rings.layout": "halves"},
    "adaptive network": {"controller.kind": "adaptive"},
    "pressure feedback": {"controller.kind": "sns-pressure"},
    "waiting network": {"controller.kind": "sns-waiting"},
    "chain": CHAIN | {},
    "chain with direct pins, RK4": CHAIN | {"body.formulation.pins": "direct"},
}


QUICK = ("record between movements", "heteroclinic channel", "chain")


@pytest.mark.parametrize(
    "variant", [pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK)) for name in VARIANTS]
)
def test_each_worm_is_bit_for_bit_the_worm_that_runs_alone(variant: str, tmp_path: Path) -> None:
    configs = [config(**VARIANTS[variant], **own) for own in DIFFERENT[1:]]
    result = simulate_batch(configs, tmp_path / "batch", threads=2, progress=False)
    assert result.statuses == ("complete",) * 2
    for one, folder in zip(configs, result.folders, strict=True):
        simulate(one, tmp_path / "alone", progress=False, overwrite=True)
        assert_the_same(tmp_path / "alone", folder)
        expected, actual = (parts(read_checkpoint(path / "run.nc")) for path in (tmp_path / "alone", folder))
        assert all(np.array_equal(expected[name], actual[name]) for name in expected)


@pytest.mark.slow
def test_the_number_of_threads_and_of_worms_changes_nothing(tmp_path: Path) -> None:
    configs = [config(**own) for own in DIFFERENT[1:]] * 2
    one = simulate_batch(configs, tmp_path / "one", threads=1, progress=False)
    three = simulate_batch(configs[:2], tmp_path / "three", threads=3, progress=False)
    for number, folder in enumerate(one.folders):
        assert_the_same(folder, three.folders[number % 2])
    assert not np.array_equal(one[0].data["qpos"], one[1].data["qpos"]), "they must differ from one another"


def test_a_run_of_a_batch_is_a_run_like_any_other(tmp_path: Path) -> None:
    result = simulate_batch(config(seed=5), tmp_path, n_worms=2, progress=False)
    assert len(result) == 2
    assert [result[i].config.seed for i in range(2)] == [5, 6]
    assert [run.status for run in result] == ["complete", "complete"]
    assert summary(result[1]).duration_s == pytest.approx(0.3)


def test_a_worm_that_fails_ends_as_it_does_alone_and_the_others_go_on(tmp_path: Path) -> None:
    limits = [{}, {"guard.height_m": 0.3}, {"guard.kinetic_energy_J": 1e-4}, {"guard.edge_strain": 1e-9}, {}]
    configs = [config(seed=i, **limit) for i, limit in enumerate(limits)]
    result = simulate_batch(configs, tmp_path / "batch", progress=False)
    assert result.failed == [1, 2, 3]
    assert result.statuses == ("complete", *["stopped_by_guard"] * 3, "complete")
    for i, (one, folder) in enumerate(zip(configs, result.folders, strict=True)):
        assert run_alone(one, tmp_path / str(i)) == result.messages[i] == open_run(folder).message
        assert_the_same(tmp_path / str(i), folder)


def test_an_error_of_the_engine_ends_one_worm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    step, configs = TwoStep.step, [config(**own) for own in DIFFERENT]

    def failing(of: TwoStep, prepare: Callable[[], None]) -> None:
        if of is broken and of._data.time > 0.09:
            raise mujoco.FatalError("broken")
        step(of, prepare)

    broken = None
    placed = WormPlant.__init__

    def made(plant: WormPlant, own: RunConfig, anatomy: Anatomy | None = None) -> None:
        nonlocal broken
        placed(plant, own, anatomy)
        broken = plant.two_step if own == configs[1] else broken

    with monkeypatch.context() as patched:
        patched.setattr(TwoStep, "step", failing)
        patched.setattr(WormPlant, "__init__", made)
        result = simulate_batch(configs, tmp_path / "batch", threads=1, progress=False)
    assert result.statuses == ("complete", "stopped_by_guard", "complete")
    assert "the engine stopped at 0.100 s" in result.messages[1]
    assert float(result[1].data["time"][-1]) == pytest.approx(0.1)
    for i in (0, 2):
        simulate(configs[i], tmp_path / "alone", progress=False, overwrite=True)
        assert_the_same(tmp_path / "alone", result.folders[i])


def test_a_full_disk_ends_one_worm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    taken: dict[int, int] = {}
    sample = Recorder.sample

    def failing(recorder: Recorder, *sources: Any) -> None:
        taken[id(recorder)] = taken.get(id(recorder), 0) + 1
        if list(taken).index(id(recorder)) == 1 and taken[id(recorder)] > 5:
            raise RunFileError("no room")
        sample(recorder, *sources)

    monkeypatch.setattr(Recorder, "sample", failing)
    result = simulate_batch(config(), tmp_path, n_worms=3, threads=1, progress=False)
    assert result.statuses == ("complete", "disk_failure", "complete")
    assert result.messages[1] == "no room"


def interrupt_at(time_s: float) -> Any:
    sent: list[float] = []

    def interrupt(simulated_s: float, wall_s: float) -> None:
        if simulated_s >= time_s and not sent:
            sent.append(simulated_s)
            os.kill(os.getpid(), signal.SIGINT)

    return interrupt


@pytest.mark.slow
def test_ctrl_c_ends_all_worms_and_each_can_be_continued_bit_for_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("annelid.simulation.batch.PROGRESS_INTERVAL_S", 0.0)
    configs = [config(**own) for own in DIFFERENT[1:]]
    result = simulate_batch(configs, tmp_path / "batch", progress=interrupt_at(0.1))
    assert result.statuses == ("interrupted",) * 2
    assert result.failed == []
    for i, one in enumerate(configs):
        whole = simulate(one, tmp_path / f"alone-{i}", progress=False).data
        assert "SIGINT" in result.messages[i]
        assert 0.1 <= float(result[i].data["time"][-1]) < 0.3
        rest = simulate(None, tmp_path / f"rest-{i}", resume=result.folders[i], progress=False).data
        for name in ("stretch_length", "contact_force", "potential", "kinetic_energy"):
            pieces = np.concatenate([result[i].data[name], rest[name]])
            assert np.array_equal(pieces, whole[name]), name


def test_a_second_ctrl_c_leaves_at_once_with_all_files_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("annelid.simulation.batch.PROGRESS_INTERVAL_S", 0.0)

    def twice(simulated_s: float, wall_s: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_batch(config(), tmp_path, n_worms=2, progress=twice)
    assert [open_run(tmp_path / f"worm-00{i}").status for i in range(2)] == ["interrupted"] * 2


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("body.mesh.n_segments", 4),
        ("body.mesh.elements_per_side", 3),
        ("body.rings.layout", "halves"),
        ("body.rings.activation_dynamics", False),
        ("body.formulation.pins", "separate"),
        ("clock.physics_timestep_s", 0.01),
        ("controller.kind", "shc"),
        ("duration_s", 0.4),
        ("record.frames_interval_s", 0.2),
    ],
)
def test_worms_of_different_structure_are_refused_by_the_field_s_name(field: str, value: Any, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=f"^{field} is {value!r} for worm 1") as refusal:
        simulate_batch([config(), config(**{field: value})], tmp_path / "batch")
    assert all(path in str(refusal.value) for path in ALIKE)
    assert not (tmp_path / "batch").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"configs": config()}, "n_worms or seeds"),
        ({"configs": config(), "n_worms": 0}, "at least one worm"),
        ({"configs": []}, "at least one worm"),
        ({"configs": config(), "n_worms": 3, "seeds": [1, 2]}, "2 numbers for 3 worms"),
        ({"configs": [config()], "n_worms": 3}, "n_worms = 3"),
        ({"configs": config(), "seeds": [1, -2]}, "-2"),
        ({"configs": config(), "n_worms": 2, "threads": 0}, "threads = 0"),
        ({"configs": "riddle2022-planar", "n_worms": 2}, "body.kind = 'riddle2022'"),
    ],
)
def test_numbers_that_do_not_fit_are_refused(arguments: dict[str, Any], words: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=words):
        simulate_batch(out=tmp_path / "batch", **arguments)
    assert not (tmp_path / "batch").exists()


def test_a_folder_in_use_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    used = tmp_path / "worm-001"
    used.mkdir()
    (used / "notes.txt").write_text("mine")
    with pytest.raises(ConfigError, match="worm-001"):
        simulate_batch(config(), tmp_path, n_worms=3, progress=False)
    assert [path.name for path in tmp_path.iterdir()] == ["worm-001"]


def test_nothing_is_left_running_where_a_file_cannot_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Recorder.__init__

    def third_fails(recorder: Recorder, path: Path, *arguments: Any) -> None:
        if "worm-002" in str(path):
            raise RunFileError("no room for it")
        made(recorder, path, *arguments)

    monkeypatch.setattr(Recorder, "__init__", third_fails)
    with pytest.raises(RunFileError, match="no room for it"):
        simulate_batch(config(), tmp_path, n_worms=4, progress=False)
    assert [open_run(tmp_path / f"worm-00{i}").status for i in range(2)] == ["disk_failure"] * 2
