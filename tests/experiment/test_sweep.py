"""Sweeps: which runs a study has, how samples grow, and what the dataset tells."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import annelid
from annelid.config import Study, load_study
from annelid.errors import ConfigError
from annelid.experiment.search_space import spread_evenly
from annelid.experiment.sweep import (
    Plan,
    Sweep,
    flattened,
    plan_of,
    results_table,
    shown_numbers,
    swept,
    write_results,
)
from annelid.simulation.runfile import FILE_NAME

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

GATE, TOLERANCE, SEGMENTS = "controller.gate_time_constant_ms", "sensor.tolerance_m", "body.n_segments"
RANGES = [{"field": GATE, "from": 100.0, "to": 600.0, "log": True}, {"field": TOLERANCE, "from": 0.001, "to": 0.02}]
LISTED = [{"field": SEGMENTS, "values": [3, 4]}, {"field": "controller.scheme", "choices": ["euler", "heun"]}]


def study(vary: Any = LISTED, **fields: Any) -> Study:
    return load_study({"preset": "riddle2022-planar", "set": {"duration_s": 0.2}, "vary": vary, **fields})


@st.composite
def grids(draw: st.DrawFn) -> list[dict[str, Any]]:
    """A few fields of the planar worm, each listed or over a range."""
    ranges = {GATE: (50.0, 900.0), TOLERANCE: (0.001, 0.05), "body.gain": (0.5, 2.0)}
    fields = draw(st.lists(st.sampled_from(sorted(ranges)), min_size=1, max_size=3, unique=True))
    vary: list[dict[str, Any]] = []
    for field in fields:
        low, high = ranges[field]
        if draw(st.booleans()):
            vary.append({"field": field, "from": low, "to": high, "number": draw(st.integers(2, 5)), "log": True})
        else:
            values = draw(st.lists(st.floats(low, high), min_size=1, max_size=4, unique=True))
            vary.append({"field": field, "values": values})
    return vary


@settings(max_examples=25)
@given(vary=grids(), repeats=st.integers(1, 3))
def test_a_grid_has_every_combination_once_at_its_own_place(vary: list[dict[str, Any]], repeats: int) -> None:
    plan = plan_of(study(vary, repeats=repeats))
    keys = list(plan.levels)
    for place, (values, case) in zip(np.ndindex(plan.shape), plan.points, strict=True):
        for field, value in values.items():
            assert plan.levels[field][place[keys.index(field)]] == value
            assert case.changes[field] == value
        if repeats > 1:
            assert case.changes["seed"] == plan.levels["repeat"][place[-1]]
    assert len({json.dumps(dict(case.changes)) for _, case in plan.points}) == len(plan.points)


@settings(max_examples=25)
@given(
    design=st.sampled_from(["random", "sobol"]),
    few=st.integers(1, 40),
    more=st.integers(0, 60),
    seed=st.integers(0, 99),
)
def test_more_samples_leave_the_earlier_ones_as_they_are(design: str, few: int, more: int, seed: int) -> None:
    def drawn(n: int, of_seed: int) -> Plan:
        return plan_of(study(RANGES, design=design, samples=n, seed=of_seed))

    first = drawn(few, seed)
    assert drawn(few + more, seed).samples[:few] == first.samples
    assert drawn(few, seed + 1).samples != first.samples


@settings(max_examples=25)
@given(design=st.sampled_from(["random", "lhs", "sobol"]), n=st.integers(1, 64), seed=st.integers(0, 99))
def test_samples_keep_to_their_ranges_and_choices(design: str, n: int, seed: int) -> None:
    vary = [*RANGES, {"field": SEGMENTS, "from": 3, "to": 6}, LISTED[1]]
    for gate, tolerance, n_segments, scheme in plan_of(study(vary, design=design, samples=n, seed=seed)).samples:
        assert 100.0 <= gate <= 600.0
        assert 0.001 <= tolerance <= 0.02
        assert n_segments in (3, 4, 5, 6)
        assert isinstance(n_segments, int)
        assert scheme in ("euler", "heun")


def test_fields_may_be_nested_and_lack_their_units() -> None:
    nested = load_study(
        {
            "preset": "riddle2023-rods",
            "set": {"arena": {"friction": 0.4}, "controller.kind": "sns-robust", "duration": 0.5},
            "vary": [{"field": "sensor.tolerance", "values": [0.001]}],
        }
    )
    ((values, case),) = plan_of(nested).points
    config = case.config
    assert config.arena is not None
    assert (config.arena.friction, config.controller.kind, config.duration_s) == (0.4, "sns-robust", 0.5)
    assert list(values) == [TOLERANCE]
    assert config.sensor.tolerance_m == 0.001
    assert flattened({"a": {"b": {"c": 1}, "d": [2]}}) == {"a.b.c": 1, "a.d": [2]}


ONE = [{"field": GATE, "values": [100.0]}]


def test_what_is_no_study_is_refused_in_a_sentence(subtests: pytest.Subtests, tmp_path: Path) -> None:
    for fields, words in (
        ({"preset": "riddle2022"}, "unknown preset 'riddle2022'"),
        ({"vary": []}, "vary = .*must have at least 1"),
        ({"vary": [{"field": GATE}]}, f"vary '{GATE}' says nothing to take"),
        ({"vary": [{"field": GATE, "values": [1.0], "from": 1.0}]}, "says two things"),
        ({"vary": [{"field": GATE, "from": 1.0, "number": 3}]}, r"from = 1.0 must be given, and be below to"),
        ({"vary": [{"field": GATE, "from": 2.0, "to": 1.0, "number": 3}]}, "be below to = 1.0"),
        ({"vary": [{"field": GATE, "from": 0.0, "to": 1.0, "number": 3, "log": True}]}, "above 0 where log"),
        ({"vary": [{"field": GATE, "from": 1.0, "to": 2.0}]}, "number must be given in a grid"),
        ({"vary": [{"field": GATE, "values": [1.0, 1.0]}]}, "none twice"),
        ({"vary": [{"field": GATE, "values": ["a"]}]}, "vary.0.values.0 = 'a': must be a number"),
        ({"vary": [{"field": GATE, "values": [1.0], "number": 2}]}, "log and number are of a range"),
        ({"vary": [{"field": GATE, "form": 1.0}]}, r"unknown field 'vary.0.form': did you mean 'from'\?"),
        ({"vary": [{"field": "controller.gate_ms", "values": [1.0]}]}, "vary: unknown field .* did you mean"),
        ({"vary": [*ONE, *ONE]}, "stands twice"),
        ({"vary": [{"field": "controller.scheme", "from": 1.0, "to": 2.0, "number": 2}]}, "no number with a range"),
        ({"vary": [{"field": SEGMENTS, "from": 3, "to": 5, "number": 4}]}, "only 3 distinct values"),
        ({"vary": [{"field": SEGMENTS, "from": 3.5, "to": 5, "number": 2}]}, "must be whole numbers"),
        ({"vary": [{"field": "seed", "values": [1, 2]}], "repeats": 2}, "both set the seed"),
        ({"set": {"body": {"gian": 1.0}}}, "unknown field 'body.gian'"),
        ({"design": "halton"}, "design = 'halton': must be one of 'grid'"),
        ({"design": "sobol"}, "samples must be given for design = 'sobol'"),
        ({"samples": 4}, "has no effect on design = 'grid'"),
        ({"design": "lhs", "samples": 4, "vary": [RANGES[0] | {"number": 3}]}, "number = 3 has no effect on design"),
        ({"repeats": 0}, "repeats = 0: must be at least 1"),
        ({"repeats": 100_000, "vary": LISTED}, "400,000 runs, about .* core: it must have at most 100,000"),
        ({"outputs": ["speed"]}, "outputs: unknown number 'speed': did you mean"),
        ({"outputs": ["period_s"], "rank": "travel_m"}, "rank = 'travel_m': must be one of the outputs"),
        ({"rank": "contact_duty"}, "rank = 'contact_duty'"),
        ({"keep": "all"}, "keep = 'all': must be one of"),
        ({"cluster": {"kind": "slurm"}}, "unknown field 'cluster'"),
        ({"vary": [{"field": "body.gain", "values": [-1.0, -2.0]}]}, "body.gain = -1.0"),
    ):
        with subtests.test(f"{fields!r:.60}"):
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            with pytest.raises(ConfigError, match=words):
                swept(load_study({"preset": "riddle2022-planar", "vary": ONE, **fields}), folder / "out")
            assert not list(folder.iterdir())


REFUSED = [{"field": "body.gain", "values": [1.31, 1e4, -1.0]}, LISTED[0]]


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory, runs_in_this_process: None) -> Sweep:
    """Six runs twice, of which some are refused by the plant, others by the configuration."""
    return swept(study(REFUSED, repeats=2, rank="ring_length_min_m"), tmp_path_factory.mktemp("sweep"))


def test_the_dataset_is_labelled_and_every_run_in_it_once(done: Sweep) -> None:
    data = done.data
    assert dict(data.sizes) == {"body.gain": 3, SEGMENTS: 2, "repeat": 2, "segment": 4}
    assert data["body.gain"].values.tolist() == [1.31, 1e4, -1.0]
    for name, variable in data.variables.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name
    good = data.sel({"body.gain": 1.31})
    assert set(good.status.values.ravel()) == {"complete"}
    assert len(set(good.run.values.ravel())) == good.run.size
    for place, run in zip(np.ndindex(done.plan.shape), done.runs, strict=True):
        if run.outcome is not None:
            here = data.isel(dict(zip(done.plan.levels, place, strict=True)))
            assert here.ring_length_min_m == run.outcome.summary.ring_length_min_m
            told = here.elongation_mean_max_m.values
            assert told[~np.isnan(told)].tolist() == run.outcome.summary.elongation_mean_max_m
            assert annelid.open_run(done.folder / "runs" / str(here.run.values)).config.seed == here["repeat"]
    assert data.elongation_mean_max_m.sel({SEGMENTS: 3, "segment": 4}).isnull().all()
    assert data.attrs["n_failed"] == 8


def test_results_are_written_and_read_back_alike(done: Sweep) -> None:
    data = done.data
    paths = write_results(done)
    assert [path.name for path in paths] == ["sweep.nc", "sweep.csv", "sweep.png"]
    read = xr.load_dataset(paths[0], engine="h5netcdf")
    assert read.sel({"body.gain": 1.31}).ring_length_min_m.equals(data.sel({"body.gain": 1.31}).ring_length_min_m)
    assert read.status.values.tolist() == data.status.values.tolist()
    assert load_study(json.loads(read.attrs["study"])) == done.plan.study
    assert len(paths[1].read_text().splitlines()) == 13
    assert shown_numbers(done)[0] == "ring_length_min_m"
    assert results_table(done).row_count == 4


def test_a_rank_without_values_is_said(tmp_path: Path) -> None:
    with pytest.warns(
        UserWarning, match="rank = 'period_s': no run has a value of it, so the table and the figure begin"
    ):
        swept(study(ONE, rank="period_s"), tmp_path)


def test_a_modulus_is_varied_with_the_other_that_follows() -> None:
    vary = {"field": "body.strands.young_modulus_Pa", "values": [3e8, 1e9]}
    with pytest.warns(UserWarning, match="leaves body.strands.shear_modulus_Pa = 200000000.0"):
        plan_of(study([vary], preset="riddle2023-rods"))
    plan = plan_of(study([vary | {"follow": {"body.strands.shear_modulus": 0.667}}], preset="riddle2023-rods"))
    assert [case.config.body.strands.shear_modulus_Pa for _, case in plan.points] == [2.001e8, 6.67e8]  # type: ignore[attr-defined]


def test_numbers_alone_may_be_kept_and_chosen(tmp_path: Path) -> None:
    data = annelid.sweep(
        study(ONE, keep="outcomes", outputs=["duration_s", "muscle_work_J"]).model_dump(by_alias=True), tmp_path
    )
    assert {"duration_s", "muscle_work_J"} == set(data) - {"status", "reason", "run", "rhythm", "warnings", "check"}
    assert not list(tmp_path.glob(f"runs/*/{FILE_NAME}"))
    assert data.duration_s.values == pytest.approx(0.2)


@given(n=st.integers(0, 40), numbers=st.lists(st.integers(), unique=True, max_size=30).map(sorted))
def test_items_are_picked_evenly_from_the_first_to_the_last(n: int, numbers: list[int]) -> None:
    chosen = spread_evenly(n, numbers)
    assert len(set(chosen)) == len(chosen) == min(n, len(numbers))
    places = [numbers.index(one) for one in chosen]
    assert places == sorted(places)
    if len(chosen) > 1:
        assert (places[0], places[-1]) == (0, len(numbers) - 1)
        assert np.ptp(np.diff(places)) <= 1


def test_an_interrupted_check_keeps_the_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("annelid.experiment.sweep.check_runs", interrupted)
    with pytest.raises(KeyboardInterrupt):
        annelid.sweep(study(ONE), tmp_path, check=1)
    data = xr.load_dataset(tmp_path / "sweep.nc", engine="h5netcdf")
    assert (data.status.item(), data.check.item()) == ("complete", "")
