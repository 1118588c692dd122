from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy import REST_M, ForgetfulController, N, SavedToyPlant, ToyController, ToyPlant, toy_config

from annelid.errors import SimulationStopped
from annelid.protocols import Array, Sensation
from annelid.simulation import loop, open_run, simulate
from annelid.simulation.recorder import Schedule


def test_samples_and_frames_come_at_their_intervals_and_include_both_ends(tmp_path: Path) -> None:
    config = toy_config(duration_s=0.3, record__signals_interval_s=0.01, record__frames_interval_s=0.1)
    data = simulate(config, tmp_path, plant=SavedToyPlant(), controller=ToyController()).data
    np.testing.assert_allclose(data["time"], np.linspace(0, 0.3, 31), atol=1e-12)
    np.testing.assert_allclose(data["frame_time"], [0, 0.1, 0.2, 0.3], atol=1e-12)
    np.testing.assert_array_equal(data["control_steps"], np.arange(31) * 10)
    assert (data["stretch_length"][0] == REST_M).all()
    assert (data["activation"][0] == 0).all()
    assert (data["qpos"][0] == 0).all()
    assert not any(data[name].isnull().any() for name in ("stretch_length", "potential", "activation", "qpos"))


@given(total=st.integers(1, 2000), every=st.integers(1, 300), share=st.floats(0, 1), step=st.sampled_from([1e-3, 5e-3]))
@settings(max_examples=60)
def test_times_of_a_run_and_of_its_continuation_join_to_those_of_the_whole(
    total: int, every: int, share: float, step: float
) -> None:
    cut = round(share * total)
    whole = Schedule(0, total, every, every, step).times_s(every)
    first = Schedule(0, cut, every, every, step).times_s(every)
    second = Schedule(cut, total, every, every, step).times_s(every) if cut else whole[first.size :]
    np.testing.assert_array_equal(np.concatenate([first, second]), whole)
    assert whole.size == total // every + 1


def test_recorded_length_is_true_and_felt_length_is_noisy(tmp_path: Path) -> None:
    noise_m = 0.002
    controller = ToyController()
    config = toy_config(duration_s=2.0, sensor__noise_m=noise_m, record__signals_interval_s=0.001)
    run = simulate(config, tmp_path, plant=SavedToyPlant(), controller=controller)
    # The controller feels at the beginning of each step what the sample before it recorded.
    error = np.array(controller.felt) - run.data["stretch_length"].values[:-1]
    # 6000 draws: the standard deviation is known to 1 / sqrt(2 x 6000) = 0.9 %, the mean to noise / 77.
    assert error.std() == pytest.approx(noise_m, rel=0.05)
    assert abs(error.mean()) < 5 * noise_m / np.sqrt(error.size)
    between = np.corrcoef(error.reshape(len(error), -1).T)
    assert np.abs(between - np.eye(N)).max() < 0.15


def test_one_seed_gives_one_run_and_another_seed_another(tmp_path: Path) -> None:
    def lengths(seed: int, out: str) -> Array:
        config = toy_config(seed=seed, sensor__noise_m=0.001)
        run = simulate(config, tmp_path / out, plant=ToyPlant(shaking_N=0), controller=ToyController())
        return run.data["stretch_length"].values

    np.testing.assert_array_equal(lengths(7, "a"), lengths(7, "b"))
    assert np.abs(lengths(7, "c") - lengths(8, "d")).max() > 0


def test_plant_and_controller_get_seeds_of_their_own(tmp_path: Path) -> None:
    seeds: list[int] = []
    for seed in (0, 1):
        plant, controller = ToyPlant(), ToyController()
        simulate(toy_config(seed=seed), tmp_path / str(seed), plant=plant, controller=controller)
        seeds += [plant.seed, controller.seed]
    assert len(set(seeds)) == 4


def test_parts_that_record_nothing_still_give_the_sensation(tmp_path: Path) -> None:
    run = simulate(toy_config(), tmp_path, plant=ToyPlant(shaking_N=0), controller=ForgetfulController())
    data = run.data
    assert {"stretch_length", "ring_length", "muscle_force", "contact_force", "activation"} <= set(data)
    np.testing.assert_array_equal(data["muscle_force"][1:], np.ones((40, N)))
    np.testing.assert_allclose(data["ring_length"], 0.5 - (data["stretch_length"][..., 0] - REST_M), atol=1e-15)
    assert data["center_of_mass"].isnull().all()
    assert list(data["axis"].values) == ["x", "y", "z"]


@pytest.mark.parametrize(
    ("fault", "words", "last_s"),
    [
        ({"nan_at": 104}, r"at 0\.104 s .*stretch_m\[2, 1\] became nan", 0.1),
        ({"alarm_at": 150}, r"at 0\.15 s .*kinetic energy is 21 J, above 20 J", 0.145),
    ],
)
def test_numbers_that_run_away_stop_the_run_and_keep_the_file(
    tmp_path: Path, fault: dict[str, int], words: str, last_s: float
) -> None:
    with pytest.raises(SimulationStopped, match=words) as stop:
        simulate(toy_config(), tmp_path, plant=SavedToyPlant(**fault), controller=ToyController())
    run = open_run(tmp_path)
    assert (run.status, run.message) == ("stopped_by_guard", str(stop.value))
    assert run.data["time"][-1] == pytest.approx(last_s)
    assert not run.data["stretch_length"].isnull().any()


def test_an_alarm_of_the_controller_stops_the_run(tmp_path: Path) -> None:
    class Alarmed(ToyController):
        def alarm(self) -> str | None:
            return "potential of relay_1 is 900 mV" if self._steps == 12 else None

    with pytest.raises(SimulationStopped, match=r"at 0\.012 s .*relay_1"):
        simulate(toy_config(), tmp_path, plant=ToyPlant(), controller=Alarmed())


def test_activation_out_of_range_never_reaches_the_plant(tmp_path: Path) -> None:
    plant = SavedToyPlant()
    with pytest.raises(SimulationStopped, match=r"muscle 2 an activation of 1\.5"):
        simulate(toy_config(), tmp_path, plant=plant, controller=ToyController(excess_at=31))
    assert plant.read(False)["control_steps"] == 30


@pytest.mark.parametrize(("bad", "words"), [(np.full(N, np.nan), "nan"), (np.zeros(2), "shape")])
def test_activation_of_no_use_is_named(tmp_path: Path, bad: Array, words: str) -> None:
    class Bad(ForgetfulController):
        def step(self, sensation: Sensation) -> Array:
            return bad

    with pytest.raises(SimulationStopped, match=words):
        simulate(toy_config(), tmp_path, plant=ToyPlant(), controller=Bad())


def test_an_error_of_the_controller_comes_through_and_keeps_the_file(tmp_path: Path) -> None:
    class Broken(ToyController):
        def step(self, sensation: Sensation) -> Array:
            if self._steps == 100:
                raise ZeroDivisionError("no gain")
            return super().step(sensation)

    with pytest.raises(ZeroDivisionError):
        simulate(toy_config(), tmp_path, plant=ToyPlant(), controller=Broken())
    run = open_run(tmp_path)
    assert run.status == "failed"
    assert "ZeroDivisionError: no gain" in run.message
    assert run.data["time"][-1] == pytest.approx(0.1)


def test_progress_is_rare(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = itertools.count(0.0, 0.01)
    monkeypatch.setattr(loop, "perf_counter", lambda: next(clock))
    seen: list[float] = []
    simulate(
        toy_config(duration_s=1.0),
        tmp_path,
        plant=ToyPlant(),
        controller=ForgetfulController(),
        progress=lambda simulated_s, wall_s: seen.append(wall_s),
    )
    # All but the last report are at least 0.2 s of the wall clock apart.
    assert len(seen) > 10
    assert np.diff(seen[:-1]).min() > 0.2 - 1e-9


def test_progress_bar_is_drawn_when_asked_for_and_not_otherwise(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    simulate(toy_config(), tmp_path / "a", plant=ToyPlant(), controller=ToyController())
    assert capsys.readouterr() == ("", "")
    simulate(toy_config(), tmp_path / "b", plant=ToyPlant(), controller=ToyController(), progress=True)
    out, err = capsys.readouterr()
    assert out == ""
    assert "0.20 of 0.2 s" in err
    assert "x real time" in err


def test_a_plain_function_is_a_controller_and_the_file_names_it(tmp_path: Path) -> None:
    def half(sensation: Sensation) -> Array:
        return np.full(len(sensation.ring_length_m), 0.5)

    run = simulate(toy_config(), tmp_path, plant=ToyPlant(), controller=half)
    assert run.data.attrs["controller"] == "half"
    np.testing.assert_array_equal(run.data["activation"][1:], 0.5)
