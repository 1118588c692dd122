"""The benchmark: tasks that do not change, entrants that cannot cheat, scores, and the ranking made of them."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from annelid.config import ControllerKind, RunConfig, load_config
from annelid.errors import ConfigError, RunFileError
from annelid.experiment import Store
from annelid.protocols import Array, Controller, Plant, Sensation
from annelid.simulation import WormPlant, build_controller
from annelid_lab.robots.body import EXAMPLE
from annelid_studies.baselines import DiscreteGait
from annelid_studies.challenge import report, scores, tasks
from annelid_studies.challenge.ranking import ALL, Speeds, half_step_changes, mean_ranks, pairs, standings
from annelid_studies.challenge.scores import Score, challenge, electric_energy_J, read_scores
from annelid_studies.challenge.tasks import REFERENCE, Entrant, all_tasks, entries, find_entrants
from annelid_studies.challenge.tuning import tune, write_entrants
from annelid_studies.faults import Faults

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

SCORE = Score(REFERENCE, "three", "slope", 3, 1000, 1, "", "setup", "key", "", 0.05, 0.5, 1.0, 10.0, 12.0, True, 0.7)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs are judged from their beginning, so that they may be short."""
    early = all_tasks().model_copy(update={"settling_s": 0.04})
    monkeypatch.setattr(tasks, "all_tasks", lambda: early)
    monkeypatch.setattr(scores, "all_tasks", lambda: early)


def test_draws_of_a_version_stay_what_they_are() -> None:
    """A number that changes here changes the benchmark, and raises its version."""
    found = all_tasks()
    assert found.version == 3
    assert found.drawn("friction", 1000) == {"arena.friction": 0.28}
    assert found.drawn("slope", 1000) == {"arena.slope_deg": 5.694, "arena.friction": 0.6036}


def test_draws_lie_in_their_range_and_differ_by_seed(subtests: pytest.Subtests) -> None:
    for name in all_tasks().tasks:
        with subtests.test(f"{name!r:.60}"):
            task, seeds = all_tasks().tasks[name], range(40)
            draws = [all_tasks().drawn(name, seed) for seed in seeds]
            # A friction that is drawn within 1 % only has few values, as it is rounded.
            assert len({str(each) for each in draws}) > len(seeds) / 4
            for field, among in task.draw.items():
                values = np.array([abs(each[field]) for each in draws])
                spread = 0.01 if field == "arena.friction" else 0.0
                assert np.all(
                    (values >= among.low * (1 - spread) - 1e-9) & (values <= among.high * (1 + spread) + 1e-9)
                )
            if "arena.friction" not in task.draw:
                friction = {**all_tasks().set, **task.set}["arena.friction"]
                assert all(abs(each["arena.friction"] / friction - 1.0) <= 0.0101 for each in draws)


def test_a_task_makes_blind_runs_whose_step_can_be_halved_alike_for_all_entrants(subtests: pytest.Subtests) -> None:
    found = find_entrants([])
    for body in all_tasks().bodies:
        for name in all_tasks().tasks:
            with subtests.test(f"{body} {name}"):
                whole = entries(found, [name], [1000], bodies=[body])
                configs = [entry.case.config for entry in whole]
                own = {"controller": True, "sensor": {"tolerance_m", "hysteresis_m"}}
                assert len({config.model_dump_json(exclude=own) for config in configs}) == 1
                [half] = entries({"sns": found["sns"]}, [name], [1000], bodies=[body], finer=2)
                faults, clock = configs[0].trial, configs[0].clock
                assert isinstance(faults, Faults)
                assert faults.blind
                assert half.case.config.clock.physics_timestep_s == clock.physics_timestep_s / 2
                assert half.case.config.clock.control_timestep_s == clock.control_timestep_s


def test_an_entrant_has_numbers_for_a_body_and_for_a_task() -> None:
    controller = {"kind": "sns-pressure", "network": {"kind": "sns"}}
    fields = {"three": {"controller.network.gate_time_constant_ms": 90.0}, "three/slope": {"sensor.tolerance_m": 0.01}}
    mine = Entrant(controller=controller, on=fields)
    tuned = {"kind": "sns-pressure", "network": {"kind": "sns", "gate_time_constant_ms": 90.0}}
    assert mine.fields("three", "slope") == {"controller": tuned, "sensor.tolerance_m": 0.01}
    assert mine.fields("three", "level") == {"controller": tuned}
    assert mine.fields("six", "slope") == {"controller": controller}


def test_an_entrant_that_was_tuned_on_tests_or_changes_the_task_is_refused(
    subtests: pytest.Subtests, tmp_path: Path
) -> None:
    for text, says in (
        ("[mine]\ncontroller.kind = 'sine'\ntuned_on = [0, 1000, 1003]", "mine: .*1000, 1003"),
        ("[mine]\ncontroller.kind = 'sine'\non.three = {'sensor.noise_m' = 0.0}", "cannot set sensor.noise_m"),
        ("[mine]\ncontroller.kind = 'sine'\nvary = {'arena.friction' = {low = 0.1, high = 2.0}}", "set arena.friction"),
        ("[mine]\ncontroller.kind = 'sine'\narena.friction = 5.0", "arena"),
        ("[mine]\ncontroller.kind = 'sine'\nguard.depth_m = 1.0", "guard"),
        ("[timed]\ncontroller.kind = 'sine'", "another entrant 'timed'"),
        ("mine = 3", "mine is no table"),
    ):
        with subtests.test(f"{text!r:.60}"):
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            (folder / "mine.toml").write_text(text)
            with pytest.raises(ConfigError, match=says):
                find_entrants([str(folder / "mine.toml")])


def test_a_file_enters_beside_the_reference(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("[mine]\ncontroller.kind = 'sine'\ntuned_on = [1]")
    assert list(find_entrants([str(tmp_path / "mine.toml")])) == [REFERENCE, "mine"]


class SeedReader:
    """Contracts by what it finds out about the run: its seed, its ground and its noise."""

    def __init__(self, told: float, n_muscles: int) -> None:
        self._told, self._n_muscles = told, n_muscles

    def reset(self, seed: int) -> None:
        self._level = (seed + self._told) % 1.0

    def step(self, sensation: Sensation) -> Array:
        return np.full(self._n_muscles, self._level)


@pytest.mark.usefixtures("short", "forgotten_controllers")
def test_an_entrant_that_reads_the_seed_reads_nothing(tmp_path: Path) -> None:
    """It contracts alike in every draw, though its runs have other seeds, friction and noise."""

    class SeedReading(ControllerKind):
        """A kind that looks at the whole configuration and at the body that it is built for."""

        kind: Literal["seed-reading"] = "seed-reading"

        def build(self, config: RunConfig, plant: Plant) -> Controller:
            model = getattr(plant, "model", None)
            ground = 0.0 if model is None else float(model.geom_friction[0, 0])
            arena = 0.0 if config.arena is None else config.arena.friction
            return SeedReader(0.1 * config.seed + arena + 100 * config.sensor.noise_m + ground, plant.n_muscles)

    mine, store = Entrant(controller={"kind": "seed-reading"}), Store(tmp_path)
    wanted = entries({"mine": mine}, ["sensors"], [1000, 1001], bodies=["three"], duration_s=0.06)
    assert not any(one.refused for one in challenge(store, wanted))
    levels = {float(level) for each in wanted for level in store.run(each.case).data["activation"].values[1:].ravel()}
    assert len(levels) == 1
    sighted = [each.case.but({"trial.blind": False}) for each in wanted]
    store.compute(sighted)
    assert len({float(store.run(case).data["activation"].values[-1, 0]) for case in sighted}) == len(sighted)


def test_motors_take_the_power_of_a_direct_current_motor() -> None:
    time_s, ones = np.linspace(0.0, 1.0, 11), np.ones((11, 1))
    stalled = electric_energy_J(time_s, 13.0 * ones, 0.9 * ones)
    assert stalled == pytest.approx(13.0 * 0.064)
    shortening = 0.9 - 0.064 * time_s[:, np.newaxis]
    assert electric_energy_J(time_s, 5.0 * ones, shortening) == pytest.approx(5.0 * 0.064 + 25.0 / 13.0 * 0.064)
    assert electric_energy_J(time_s, 5.0 * ones, 2.0 - shortening) == 0.0, "nothing is given back"


NUMBERS = ("speed_m_per_s", "distance_m", "slip_J", "work_J", "electric_J", "in_order")


def ranked(*rows: Score) -> dict[tuple[str, str], Any]:
    return {(one.entrant, one.task): one for one in standings(rows)}


def test_the_ranking_is_the_mean_of_ratios_over_tasks() -> None:
    rows = []
    for seed, speed in enumerate((0.04, 0.06)):
        rows.append(replace(SCORE, seed=seed, speed_m_per_s=speed))
        rows.append(replace(SCORE, seed=seed, speed_m_per_s=0.2 * speed, task="level"))
        rows.append(replace(SCORE, entrant="mine", seed=seed, speed_m_per_s=speed + 0.05))
        rows.append(replace(SCORE, entrant="mine", seed=seed, speed_m_per_s=0.0, task="level", in_order=False))
    found = ranked(*rows)
    assert found[REFERENCE, ALL].ratio == pytest.approx(1.0)
    assert found["mine", ALL].ratio == pytest.approx((2.0 + 0.0) / 2)
    mine = found["mine", "slope"]
    assert mine.speed_low < mine.speed_m_per_s < mine.speed_high
    assert found["mine", ALL].robust == 0.5
    assert 0.0 < found["mine", ALL].robust_low < 0.5 < found["mine", ALL].robust_high < 1.0
    overall = next(one for one in pairs(rows) if one.body == ALL)
    assert (overall.first, overall.second) == (REFERENCE, "mine")
    assert (overall.difference, overall.faster) == pytest.approx((1.0 - 1.0, 0.5))
    by_task = {one.task: one.difference for one in pairs(rows) if one.body != ALL}
    assert by_task == pytest.approx({ALL: 0.0, "slope": -1.0, "level": 1.0})
    assert mean_ranks(Speeds(rows))[0] == {REFERENCE: 1.5, "mine": 1.5}


def test_an_interval_holds_the_mean_of_tasks_and_draws_as_often_as_it_says() -> None:
    rng, held = np.random.default_rng(1), 0
    for _ in range(200):
        tasks_mean = rng.normal(1.0, 0.2, 20)
        speeds = tasks_mean[:, np.newaxis] + rng.normal(0.0, 0.1, (20, 8))
        rows = [
            replace(SCORE, entrant=name, task=str(task), seed=seed, speed_m_per_s=speed)
            for (task, seed), own in np.ndenumerate(speeds)
            for name, speed in ((REFERENCE, 1.0), ("mine", float(own)))
        ]
        overall = next(one for one in pairs(rows) if one.body == ALL)
        held += overall.difference_low <= 0.0 <= overall.difference_high
    assert 175 <= held <= 199, "95 % of 200, less what a percentile bootstrap of 20 tasks lacks"


def test_energies_of_a_pair_are_compared_on_the_runs_that_both_finish() -> None:
    rng = np.random.default_rng(2)
    rows = [
        replace(SCORE, task=task, seed=seed, slip_J=float(rng.uniform(1.0, 2.0)))
        for task in ("slope", "level")
        for seed in range(4)
    ]
    rows += [replace(one, entrant="mine", slip_J=1.5 * one.slip_J, work_J=0.5 * one.work_J) for one in rows]
    rows[-1] = replace(rows[-1], refused="wild", slip_J=nan, work_J=nan, distance_m=0.0)
    rows[-2] = replace(rows[-2], slip_J=1e6, distance_m=-0.1)
    overall = next(one for one in pairs(rows) if one.body == ALL)
    assert (overall.slip_low, overall.slip, overall.slip_high) == pytest.approx((1 / 1.5,) * 3, rel=1e-3)
    assert overall.work == pytest.approx(2.0)


def test_a_pair_whose_order_turns_at_half_the_step_says_so() -> None:
    rows = [replace(SCORE, seed=seed, finer=finer) for seed in (0, 1, 2) for finer in (1, 2) if finer == 1 or seed == 0]
    fast = {1: 0.06, 2: 0.04}
    rows += [replace(one, entrant="mine", speed_m_per_s=fast[one.finer]) for one in rows]
    overall = next(one for one in pairs(rows) if one.body == ALL)
    assert (overall.at_step, overall.at_half_step) == pytest.approx((-0.2, 0.2))
    changes = half_step_changes(rows)
    assert changes[REFERENCE] == pytest.approx([0.0])
    assert changes["mine"] == pytest.approx([-1 / 3])


def test_a_refused_run_stands_still_and_spends_nothing(tmp_path: Path) -> None:
    lost = {"speed_m_per_s": 0.0, "distance_m": 0.0, "slip_J": nan, "work_J": nan, "electric_J": nan}
    rows = [replace(SCORE, seed=seed) for seed in (0, 1)]
    rows += [replace(SCORE, entrant="mine", seed=0)]
    rows += [replace(SCORE, entrant="mine", seed=1, refused="wild", in_order=False, **lost)]
    mine = ranked(*rows)["mine", ALL]
    assert (mine.ratio, mine.refused, mine.robust) == (0.5, 0.5, 0.5)
    assert (mine.slip_J_per_m, mine.electric_J_per_m) == (2.0, 24.0)
    assert read_scores(report.write_rows(Score, rows, tmp_path / "runs.csv"))[3].refused == "wild"


def test_a_worm_that_gets_nowhere_has_no_energy_per_metre(tmp_path: Path) -> None:
    rows = [replace(SCORE, seed=seed) for seed in (0, 1)]
    rows += [replace(SCORE, entrant="mine", seed=seed, speed_m_per_s=-0.01, distance_m=-0.1) for seed in (0, 1)]
    found = standings(rows)
    path = report.write_rows(type(found[0]), found, tmp_path / "scores.csv")
    line = next(line for line in path.read_text().splitlines() if line.startswith("mine,all"))
    assert line.endswith(",,,")
    assert report.ranking_figure(rows, tmp_path / "figure").exists()


def test_a_strangers_scores_are_numbers_or_refused(subtests: pytest.Subtests, tmp_path: Path) -> None:
    for before, after, says in (
        ("entrant,", "name,", r"row 0, entrant: "),
        ("0.05", "fast", r"row 0, speed_m_per_s: "),
        ("0.05", "nan", r"row 0, speed_m_per_s: .*finite"),
        ("slope,3,", "slope,7,", r"version 7 of the tasks; here it is 3"),
        ("slope", "slope,more", r"no runs\.csv"),
    ):
        with subtests.test(f"{before!r:.60}"):
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            path = report.write_rows(Score, [SCORE], folder / "runs.csv")
            path.write_text(path.read_text().replace(before, after, 1))
            with pytest.raises(RunFileError, match=says):
                read_scores(path)


@pytest.mark.usefixtures("short")
def test_runs_of_another_call_are_taken_where_they_are_of_the_same_setup(tmp_path: Path) -> None:
    entrants = find_entrants([REFERENCE])
    wanted = entries(entrants, ["load"], [1000, 1001], bodies=["three"], duration_s=0.06)
    known = [replace(one, speed_m_per_s=0.123) for one in challenge(Store(tmp_path / "there"), wanted[:1])]
    both = challenge(Store(tmp_path / "here"), wanted, known)
    assert [one.seed for one in both] == [1000, 1001]
    assert both[0].speed_m_per_s == 0.123
    assert len(list(tmp_path.glob("here/*/run.nc"))) == 1
    own: dict[str, Any] = {"bodies": ["three"]}
    others = (
        entries(entrants, ["load"], [1000], duration_s=0.07, **own),
        entries(entrants, ["load"], [1000], finer=2, **own),
    )
    assert len({entry.setup for entry in (wanted[0], *others[0], *others[1])}) == 3, "another setup is another run"


@pytest.mark.usefixtures("short")
def test_a_run_of_which_the_integrator_takes_too_much_is_taken_at_half_the_step(tmp_path: Path) -> None:
    wanted = entries(find_entrants([REFERENCE]), ["level"], [1000], bodies=["three"], duration_s=0.2)
    [one] = challenge(Store(tmp_path / "once"), wanted)
    spoiled = replace(one, refused="the integrator took 9% of the muscles' work", speed_m_per_s=0.0)
    store = Store(tmp_path / "again")
    [again] = challenge(store, wanted, [spoiled])
    assert again == replace(one, key=again.key, halved=True, **{name: getattr(again, name) for name in NUMBERS})
    assert (again.refused, again.key != one.key, again.work_J > 0) == ("", True, True)
    half = wanted[0].halved().case
    assert store.run(half).config.clock.physics_timestep_s == 0.002
    assert challenge(store, wanted, [again]) == [again], "it is not halved again"


@pytest.mark.usefixtures("short")
def test_runs_are_scored_kept_and_refused_ones_told(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("[mine]\ncontroller = {kind = 'timed', hold_s = 9.0}")
    entrants = find_entrants([str(tmp_path / "mine.toml")])
    wanted = entries(entrants, ["load"], [1000], bodies=["three"], duration_s=0.2)
    store = Store(tmp_path / "runs")
    timed, mine = found = challenge(store, wanted)
    assert not timed.refused
    assert len(timed.key) == 16
    assert timed.work_J > 0
    assert timed.electric_J > 0
    assert "the cycle of 3 segments" in mine.refused
    assert (mine.speed_m_per_s, mine.key, mine.in_order) == (0.0, "", False)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("runs/*/run.nc")}
    # NaN is not equal to itself.
    assert repr(challenge(store, wanted)) == repr(found)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.glob("runs/*/run.nc")} == before


@pytest.mark.usefixtures("short")
def test_an_entrant_brings_its_body_to_the_tasks_of_walking(tmp_path: Path) -> None:
    (tmp_path / "balls.xml").write_text(EXAMPLE)
    text = "[balls]\npreset = 'balls.xml'\ncontroller.kind = 'sine'\n"
    (tmp_path / "mine.toml").write_text(text + "[other]\npreset = 'crawler'\ncontroller.kind = 'sine'\n")
    entrants = find_entrants([str(tmp_path / "mine.toml")])
    wanted = [one for one in entries(entrants, [], [1000], duration_s=0.1) if one.entrant != REFERENCE]
    assert [(one.body, one.task) for one in wanted] == [
        ("balls", "level"),
        *(("crawler", task) for task in ("level", "friction", "slope", "rough")),
    ]
    [balls] = challenge(Store(tmp_path / "runs"), wanted[:1])
    assert not balls.refused
    assert balls.length_m == pytest.approx(0.3, rel=0.3)
    assert report.own_bodies_table([balls]).row_count == 1
    (tmp_path / "mine.toml").write_text(text.replace("balls.xml", "bolls.xml"))
    with pytest.raises(ConfigError, match=r"entrant balls.*bolls\.xml"):
        find_entrants([str(tmp_path / "mine.toml")])


@pytest.mark.usefixtures("short")
def test_a_search_takes_the_fastest_of_its_trials_and_goes_on_where_it_was(tmp_path: Path) -> None:
    text = "[mine]\ncontroller.kind = 'discrete'\n[mine.vary]\n"
    text += "'controller.unit_s' = {low = 0.05, high = 0.9, log = true}\n"
    (tmp_path / "mine.toml").write_text(text + "'controller.contracted' = {low = 1, high = 199, whole = true}\n")
    entrants = {"mine": find_entrants([str(tmp_path / "mine.toml")])["mine"]}
    store = Store(tmp_path / "runs")
    found, trials = tune(entrants, 3, store, bodies=["three"], duration_s=0.3)
    # Both patterns at three paces, and the pace and pattern that it has.
    assert len(trials) == 1 + 6 + 3
    assert trials[0].speed_m_per_s == max(one.speed_m_per_s for one in trials)
    assert set(found["mine"].on["three"]) == {"controller.unit_s", "controller.contracted"}
    assert found["mine"].on["three"]["controller.contracted"] in (1, 2)
    assert found["mine"].tuned_on == (0, 1)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("runs/*/run.nc")}
    assert tune(entrants, 3, store, bodies=["three"], duration_s=0.3) == (found, trials)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.glob("runs/*/run.nc")} == before
    written = write_entrants(found, tmp_path / "entrants.toml")
    assert tasks.read_entrants(written) == found


def test_a_discrete_gait_moves_back_by_whole_segments() -> None:
    assert DiscreteGait(contracted=2, unit_s=0.5).activation([0.0, 0.5, 2.5, 3.0], 6).tolist() == [
        [1, 1, 0, 0, 0, 0],
        [0, 1, 1, 0, 0, 0],
        [1, 0, 0, 0, 0, 1],
        [1, 1, 0, 0, 0, 0],
    ]


def test_a_reflex_waits_for_length_and_load_but_not_for_ever() -> None:
    reflex = {"kind": "reflex", "enough_m": 0.02, "landed_N": 0.5, "least_s": 0.1, "patience_s": 1.0}
    config = load_config("riddle2023-rods", {"controller": reflex})
    plant = WormPlant(config)
    felt, controller = plant.reset(0), build_controller(config, plant)

    def active(time_s: float, longer_m: float, load_N: float) -> int:
        sensed = replace(
            felt, time_s=time_s, stretch_m=felt.rest_stretch_m + longer_m, touch_N=load_N + 0.0 * felt.touch_N
        )
        return int(np.argmax(controller.step(sensed)))

    controller.reset(0)
    assert active(0.05, 0.03, 1.0) == 0, "too early"
    assert active(0.2, 0.01, 1.0) == 0, "too short"
    assert active(0.3, 0.03, 0.1) == 0, "the last one has not landed"
    assert active(0.4, 0.03, 1.0) == 1
    assert active(1.3, 0.0, 0.0) == 1
    assert active(1.4, 0.0, 0.0) == 2, "it waits no longer"


def pumping(segments: tuple[int, ...], period_s: float) -> dict[str, Any]:
    """A controller under which some segments contract for half of each period, all at once."""
    starts = [round(period_s * i, 6) for i in range(round(12.0 / period_s))]
    turns = [
        {"segment": segment, "start_s": start, "stop_s": round(start + period_s / 2, 6)}
        for start in starts
        for segment in segments
    ]
    return {"kind": "program", "contractions": turns}


CHEATS: dict[str, tuple[str, dict[str, Any]]] = {
    "its front drags the rest along": ("level", pumping((1,), 0.5)),
    "its ends drag the rest along": ("level", pumping((1, 3), 0.4)),
    "it shivers, too fast for the steps": ("level", {"kind": "sine", "period_s": 0.03}),
    "it slips, all at once": ("level", {"kind": "sine", "period_s": 0.6, "waves": 0.0}),
    "it rams the wall": ("narrow", {"kind": "timed", "rise_s": 0.0, "hold_s": 0.1, "fall_s": 0.0, "interval_s": 0.05}),
}


@pytest.mark.slow
@pytest.mark.parametrize("cheat", CHEATS)
def test_a_cheat_loses_to_the_baseline_or_is_refused(cheat: str, tmp_path: Path) -> None:
    task, controller = CHEATS[cheat]
    entrants = {**find_entrants([REFERENCE]), "cheat": Entrant(controller=controller)}
    store, wanted = Store(tmp_path), entries(entrants, [task], [1000], bodies=["three"])
    baseline, found = challenge(store, wanted)
    print(f"{cheat}: {found.speed_m_per_s:.4f} m/s {found.refused}; baseline {baseline.speed_m_per_s:.4f} m/s")
    assert not baseline.refused
    assert baseline.speed_m_per_s > 0.005
    assert found.refused or found.speed_m_per_s < baseline.speed_m_per_s
    arena = wanted[1].case.config.arena
    if arena is not None and (line := arena.centre_line()) is not None and (bore := arena.bore()) is not None:
        for entry in wanted:
            skin = store.run(entry.case).data["crossing_position"].values
            near = line.nearest(skin)
            beyond = np.linalg.norm(skin - near.point_m, axis=-1) - bore.at(near.arc_m)[0]
            assert np.nanmax(beyond) < 0.005, "nobody goes through a wall"
