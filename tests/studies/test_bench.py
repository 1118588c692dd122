from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.config import load_config
from annelid.errors import RunKilled
from annelid_studies.bench.benchmark import (
    JSON_NAME,
    Measurements,
    bench,
    errors,
    exponent,
    judge,
)
from annelid_studies.bench.cases import LINES, N_PERTURBED, BenchCase, bench_cases, timed
from annelid_studies.bench.measure import measure
from annelid_studies.bench.report import bench_figure, bench_table
from annelid_studies.bench.timing import (
    ENGINE_PHASES,
    PHASES,
    EngineTimes,
    Stopwatch,
    laps_s,
    shares,
)
from annelid_studies.standard_cases import CHAIN, RODS

positive = st.floats(1e-3, 1e3)


def numbers(elongation: float = 0.08, period: float = 2.6, travel: float = -0.2, work: float = 4.0) -> dict[str, Any]:
    return {
        "elongation_mean_max_m": [elongation, 0.9 * elongation],
        "period_s": period,
        "travel_m": travel,
        "travel_path_m": 0.3,
        "muscle_work_J": [work, 0.5 * work],
    }


def error(measured: dict[str, Any], reference: dict[str, Any]) -> dict[str, float | None]:
    return {name: found for name, (found,) in errors([measured], [reference]).items()}


class TestErrors:
    @given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
    def test_the_larger_of_elongation_and_period_counts(self, a: float, b: float) -> None:
        found = error(numbers(elongation=0.08 * (1 + a), period=2.6 * (1 + b)), numbers())
        assert found["elongation"] == pytest.approx(abs(a), abs=1e-12)
        assert found["period"] == pytest.approx(abs(b), abs=1e-12)
        assert found["largest"] == pytest.approx(max(abs(a), abs(b)), abs=1e-12)

    def test_travel_work_and_slip_are_relative(self) -> None:
        found = error(numbers(travel=-0.3, work=5.0), numbers(travel=-0.2, work=4.0))
        assert (found["travel"], found["work"]) == (pytest.approx(0.5), pytest.approx(0.25))
        assert found["slip"] == pytest.approx(1.0 / 3.0), "path over travel: 1 instead of 1.5"

    def test_what_is_missing_is_unknown_and_not_small(self, subtests: pytest.Subtests) -> None:
        for missing in ("period_s", "elongation_mean_max_m", "travel_m", "travel_path_m", "muscle_work_J"):
            with subtests.test(f"{missing!r:.60}"):
                for found in (
                    error(numbers() | {missing: None}, numbers()),
                    error(numbers(), numbers() | {missing: None}),
                ):
                    assert (found["largest"] is None) == (missing in ("period_s", "elongation_mean_max_m"))
                    n_unknown = 1 if missing in ("travel_path_m", "muscle_work_J") else 2
                    assert list(found.values()).count(None) == n_unknown

    def test_one_unknown_segment_makes_the_elongation_unknown(self) -> None:
        found = error(numbers() | {"elongation_mean_max_m": [0.08, None]}, numbers())
        assert (found["elongation"], found["period"]) == (None, 0.0)


@given(st.floats(0.5, 3.0), positive, st.lists(st.integers(1, 100), min_size=2, unique=True))
def test_exponent_of_a_power_law(power: float, factor: float, sizes: list[int]) -> None:
    assert exponent(sizes, [factor * n**power for n in sizes]) == pytest.approx(power, abs=1e-6)


class TestTiming:
    def test_a_stopwatch_adds_up_and_counts_nested_calls_once(self) -> None:
        times = iter([0.0, 1.0, 5.0, 5.5, 7.0, 9.0])
        thing = SimpleNamespace(double=lambda x: 2 * x, fourfold=lambda x: thing.double(thing.double(x)))
        watch = Stopwatch(thing, "double", "fourfold", "absent", reading=lambda: 7.0, clock=lambda: next(times))
        assert [thing.double(1), thing.fourfold(1), thing.double(3)] == [2, 4, 6]
        assert watch.seconds == 1.0 + 0.5 + 2.0
        assert list(watch.ends) == [1.0, 5.5, 9.0]
        assert list(watch.readings) == [7.0] * 3

    @given(st.lists(st.tuples(st.integers(0, 3), st.floats(0.01, 10.0)), min_size=1, max_size=20))
    def test_laps_go_from_movement_to_movement(self, calls: list[tuple[int, float]]) -> None:
        steps, durations = zip(*calls, strict=True)
        ends, times = np.cumsum(durations), 0.02 * np.cumsum(steps)
        laps = laps_s(list(ends), list(times), 0.02)
        moves = [index for index, n in enumerate(steps) if n]
        assert len(laps) == max(0, len(moves) - 1)
        weighed = laps * [steps[index] for index in moves[1:]]
        assert weighed.sum() == pytest.approx(ends[moves[-1]] - ends[moves[0]] if moves else 0.0)

    @given(st.lists(positive, min_size=5, max_size=5), positive, positive, positive, positive)
    def test_shares_add_up_to_one(
        self, phases: list[float], rest: float, around: float, control: float, loop: float
    ) -> None:
        step = sum(phases) + rest
        engine = EngineTimes(tuple(phases), step, step + around, (), ())
        # The timed run may be longer than the one with the engine's timers.
        plant, total = 3 * (step + around), 3 * (step + around) + control + loop
        found = shares(total, plant, control, engine)
        assert tuple(found) == PHASES
        assert sum(found.values()) == pytest.approx(1.0)
        expected = [*(3 * phase for phase in phases), 3 * rest, 3 * around, control, loop]
        assert list(found.values()) == pytest.approx([part / total for part in expected], abs=1e-9)


class TestCases:
    @pytest.mark.parametrize("effort", ["quick", "full"])
    def test_each_is_a_valid_configuration_and_there_once(self, effort: Any) -> None:
        cases = bench_cases(effort)
        assert len({case.name for case in cases}) == len({case.case.config.model_dump_json() for case in cases})
        assert {line for case in cases for line in case.lines} == set(LINES)

    def test_the_full_benchmark_takes_over_what_the_quick_one_measured(self) -> None:
        full = {case.name: case.case.config for case in bench_cases("full")}
        for case in bench_cases("quick"):
            assert full[case.name] == case.case.config


SPEED = {
    "status": "complete",
    "real_time_factor": 2.0,
    "wall_s": 2.0,
    "cpu_s": 1.0,
    "simulated_s": 4.0,
    "step_median_ms": 4.0,
    "step_mean_ms": 4.0,
    "shares": dict.fromkeys(PHASES, 1.0 / len(PHASES)),
    "peak_memory_MB": 150.0,
    "rhythm": {"verdict": "ordered", "reason": "in order"},
    "summary": numbers(),
    "perturbed": [numbers()] * N_PERTURBED,
}


def as_measured(cases: list[BenchCase], **special: Any) -> dict[str, Any]:
    return {case.name: {**SPEED, "step_median_ms": 1.5 * case.body.n_segments} | special for case in cases}


class TestJudging:
    def test_errors_are_against_the_converged_run_also_of_a_disordered_one(self) -> None:
        cases = bench_cases("quick", ["steps"])
        measured = as_measured(cases)
        fastest = measured["rods, 2 elements, 20 ms"]
        fastest |= {"rhythm": {"verdict": "disordered", "reason": "out of order"}, "summary": numbers(elongation=0.081)}
        measured["converged, 4 elements"]["summary"] = numbers(period=2.5)
        five, twenty, finest = judge(cases, measured)["cases"]
        assert five["errors"]["period"] == twenty["errors"]["period"] == [pytest.approx(0.1 / 2.5), 0.0, 0.0]
        assert five["errors"]["elongation"] == [0.0, 0.0, 0.0]
        assert twenty["errors"]["elongation"] == [pytest.approx(0.001 / 0.08), 0.0, 0.0]
        assert twenty["rhythm"]["reason"] == "out of order"
        assert "errors" not in finest

    def test_processor_times_are_laid_beside_the_papers_for_a_simulated_second(self) -> None:
        cases = bench_cases("quick")
        measured = as_measured(cases)
        measured["riddle2023 as it is"] |= {"cpu_s": 45.0, "simulated_s": 5.0, "wall_s": 60.0}
        measured["riddle2023-fast as it is"] |= {"cpu_s": 1.0, "simulated_s": 4.0}
        measured["riddle2025-muscles as it is"] |= {"cpu_s": 0.0, "simulated_s": 0.0}
        times_less = {
            entry["name"]: entry["times_less_cpu"]
            for entry in judge(cases, measured)["cases"]
            if "times_less_cpu" in entry
        }
        assert set(times_less) == {case.name for case in cases if "levels" in case.lines}
        assert times_less["riddle2023 as it is"] == 1.0
        assert times_less["riddle2023-fast as it is"] == pytest.approx(9.0 / 0.25)
        assert times_less["riddle2025-muscles as it is"] is None
        measured["riddle2023 as it is"] = {"failed": "not enough memory"}
        entries = judge(cases, measured)["cases"]
        assert all(entry["times_less_cpu"] is None for entry in entries if "levels" in entry["lines"])

    def test_exponents_over_both_ranges(self) -> None:
        cases = bench_cases("full", ["segments"])
        found = judge(cases, as_measured(cases))["cost_exponents"]
        assert found[RODS] == pytest.approx({"3-96": 1.0, "12-96": 1.0})
        assert found[CHAIN] == {}

    def test_a_failed_case_is_named_with_its_reason(self) -> None:
        cases = bench_cases("quick", ["steps"])
        measured = as_measured(cases)
        measured["rods, 2 elements, 5 ms"] = {"failed": "not enough memory"}
        measured["converged, 4 elements"] = {"failed": "not enough memory"}
        report = judge(cases, measured)
        assert [entry["failed"] for entry in report["cases"] if "failed" in entry] == ["not enough memory"] * 2
        assert not any("errors" in entry for entry in report["cases"])


class TestStore:
    def test_what_is_measured_is_kept_and_an_interruption_loses_the_case_in_progress_only(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked: list[str] = []

        def measured(_: Measurements, case: BenchCase) -> dict[str, Any]:
            asked.append(case.name)
            if len(asked) == 3:
                raise KeyboardInterrupt
            return SPEED

        monkeypatch.setattr(Measurements, "measure", measured)
        with pytest.raises(KeyboardInterrupt):
            bench(tmp_path, "quick", lines=["steps"])
        assert not (tmp_path / JSON_NAME).exists()
        cases = bench_cases("quick", ["steps"])
        monkeypatch.setattr(Measurements, "find", lambda _, case: SPEED if case.name in asked[:2] else None)
        told: list[tuple[int, int, float]] = []
        path = bench(tmp_path, "quick", lines=["steps"], progress=lambda _, *state: told.append(state))
        assert asked[2:] == [case.name for case in cases[2:]] * 2
        assert told == [(2, len(cases), 0.0)]
        assert len(json.loads(path.read_text())["cases"]) == len(cases)

    def test_a_case_that_fails_is_reported_and_not_kept(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def fails(*_: object) -> dict[str, Any]:
            raise RunKilled("its worker died")

        monkeypatch.setattr(Measurements, "measure", fails)
        report = json.loads(bench(tmp_path, "quick", lines=["duration"]).read_text())
        assert [entry["failed"] for entry in report["cases"]] == ["its worker died"]
        assert "failed: its worker died" in list(bench_table(report).columns[1].cells)
        assert not (tmp_path / "cases").exists()

    def test_a_case_is_measured_in_a_process_of_its_own(self, tmp_path: Path) -> None:
        ballast = np.ones(40_000_000)
        case = timed(RODS, 3, 0.2, "duration")
        store = Measurements(tmp_path)
        found = store.measure(case)
        assert store.find(case) == found
        assert found["status"] == "complete"
        assert sum(found["shares"].values()) == pytest.approx(1.0)
        assert all(share > -0.02 for share in found["shares"].values())
        assert all(found["shares"][phase] > 0.0 for phase in ENGINE_PHASES)
        assert found["compile_s"] > 0.0
        body = case.body
        assert found["velocities"] > 3 * body.mesh.n_helices * body.mesh.elements_per_side
        if Path("/proc/self/status").is_file():
            assert 1e6 * found["peak_memory_MB"] < ballast.nbytes
        assert 0.0 < found["cpu_s"] <= 1.05 * found["wall_s"]
        assert found["real_time_factor"] * found["wall_s"] == pytest.approx(found["simulated_s"], rel=1e-6)
        # Laps run from the end of the first step to the end of the last.
        n_steps = round(found["simulated_s"] / case.case.config.clock.physics_timestep_s)
        assert found["step_mean_ms"] * (n_steps - 1) <= 1e3 * found["wall_s"]


def test_finer_physics_than_control_counts_single_steps() -> None:
    config = load_config(RODS, {"duration_s": 0.02, "clock.physics_timestep_s": 0.0005})
    found = measure(config)
    # Two physics steps a call, and 19 laps between 20 calls.
    assert 0.0 < found["step_mean_ms"] * 38 <= 1e3 * found["wall_s"]


class TestPicture:
    def report(self, lines: list[str] | None = None) -> dict[str, Any]:
        """All measured alike, but that no judged run is exact and steps of 40 ms lose the order."""
        cases = bench_cases("full", lines)
        measured = as_measured(cases)
        for case in cases:
            if case.kind == "judged":
                measured[case.name]["summary"] = numbers(period=2.62)
        if "rods, 2 elements, 40 ms" in measured:
            measured["rods, 2 elements, 40 ms"]["rhythm"] = {"verdict": "disordered", "reason": "out of order"}
        return {"machine": "2 cores", **judge(cases, measured)}

    @pytest.mark.parametrize("lines", [None, ["chain"], ["steps"]])
    def test_has_a_panel_for_all_that_was_measured(self, tmp_path: Path, lines: list[str] | None) -> None:
        path = bench_figure(self.report(lines), tmp_path / "bench")
        assert path.read_bytes().startswith(b"\x89PNG")
        text = path.with_suffix(".svg").read_text()
        assert ("Cost of a step" in text) == (lines != ["steps"])
        assert ("Against the converged" in text) == ("not ordered" in text) == (lines != ["chain"])

    def test_the_table_has_errors_and_processor_times(self) -> None:
        columns = {" ".join(str(one.header).split()): list(one.cells) for one in bench_table(self.report()).columns}
        rows = dict(zip(columns["case"], zip(*columns.values(), strict=True), strict=True))
        assert rows["rods, 2 elements, 10 ms (fast)"][1:] == ("4", "2", "1", "150", "0.00 to 0.77")
        assert rows["rods, 2 elements, 40 ms: out of order"][3:] == ("", "150", "0.00 to 0.77")
        assert rows["riddle2023, 6 segments, 0.05 s"][3:] == ("", "150", "")
