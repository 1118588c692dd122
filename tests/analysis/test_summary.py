from __future__ import annotations

import json
import math
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from annelid.analysis import NUMBERS, Summary, summary
from annelid.analysis.paper import published
from annelid.config import check_config, field_paths, load_config, preset_names
from annelid.config.run import published_worms
from annelid.draw.summary_table import summary_rows
from annelid.simulation.runfile import Run
from synthetic import FIRST_HELIX_EXCESS, HOLDING_FORCE_N, PEAKS_M, wave_data


def run_of(data: xr.Dataset, **tree: Any) -> Run:
    config = check_config({"name": "riddle2023", "published": "riddle2023"} | tree)
    return Run(Path("run.nc"), {}, {}, config, "complete", "").with_data(data)


def holds_nan(value: object) -> bool:
    if isinstance(value, list):
        return any(holds_nan(item) for item in value)
    return isinstance(value, float) and not math.isfinite(value)


def test_numbers_of_a_written_down_run() -> None:
    # 6 s of a wave of 2.4 s: onsets every 0.8 s from 0 to 5.6 s.
    numbers = summary(run_of(wave_data()))
    assert numbers.order == [1, 2, 3, 1, 2, 3, 1, 2]
    assert numbers.onsets_s == pytest.approx([0.8 * k for k in range(8)])
    assert numbers.period_s == pytest.approx(2.4)
    assert numbers.wave is True
    assert numbers.full_cycles == 2
    assert numbers.duration_s == pytest.approx(6.0)
    assert numbers.real_time_factor == pytest.approx(0.5)
    assert numbers.elongation_mean_max_m == pytest.approx(PEAKS_M)
    assert numbers.elongation_first_helix_pp_m == pytest.approx([FIRST_HELIX_EXCESS * p for p in PEAKS_M])
    others = (6 - FIRST_HELIX_EXCESS) / 5
    assert numbers.elongation_most_pp_m == numbers.elongation_first_helix_pp_m
    assert numbers.elongation_least_pp_m == pytest.approx([others * p for p in PEAKS_M])
    assert numbers.middle_deficit == pytest.approx(0.5)
    assert numbers.middle_deficit_mean == pytest.approx(0.5)
    assert numbers.end_difference == pytest.approx(0.25)
    assert numbers.contraction_force_median_N == HOLDING_FORCE_N
    assert numbers.segment_force_median_N == [HOLDING_FORCE_N] * 3
    assert numbers.segment_force_peak_N == [HOLDING_FORCE_N] * 3
    assert numbers.travel_m == pytest.approx(0.06), "it leads towards -x, so forwards is positive"
    assert numbers.travel_path_m == pytest.approx(0.06)
    assert numbers.ring_length_min_m == pytest.approx(0.36)
    assert numbers.edge_strain_max == pytest.approx(0.001)
    assert numbers.pin_gap_max_m == pytest.approx(0.002)


def test_json_has_every_number_and_reads_back_the_same() -> None:
    numbers = summary(run_of(wave_data()))
    read = json.loads(numbers.to_json())
    assert list(read) == list(NUMBERS)
    assert Summary(**read) == numbers


def test_every_number_is_declared_with_its_meaning_and_the_page_of_gaits_names_those_that_there_are() -> None:
    assert {field.name for field in fields(Summary)} == set(NUMBERS)
    assert [name for name, number in NUMBERS.items() if not number.meaning] == []
    table = (
        (Path(__file__).parents[2] / "docs" / "evidence" / "gait.md")
        .read_text(encoding="utf-8")
        .partition("\n## The energy")[0]
    )
    rows = [line.split("|") for line in table.splitlines() if line.startswith("| `")]
    for _, names, _, units, _ in rows:
        told = [name.strip(" `") for name in names.split(",")]
        assert [NUMBERS[name].unit for name in told] == [unit.strip() for unit in units.split(",")]


def test_what_cannot_be_told_is_null_and_never_nan() -> None:
    data = wave_data(duration_s=0.1).drop_vars(["muscle_force", "edge_strain", "pin_gap"])
    data["center_of_mass"] = data["center_of_mass"] * np.nan
    data["activation"] = data["activation"] * 0
    data["stretch_length"] = data["stretch_length"] * 0 + 0.075
    data["wall_time"] = data["wall_time"] * 0
    numbers = summary(run_of(data))
    read = json.loads(numbers.to_json(), parse_constant=lambda name: pytest.fail(f"{name} in the JSON"))
    for key in ("period_s", "wave", "middle_deficit", "contraction_force_median_N", "travel_m", "edge_strain_max"):
        assert read[key] is None, key
    assert read["real_time_factor"] is None
    assert not any(holds_nan(getattr(numbers, field.name)) for field in fields(numbers))


def test_published_numbers_stand_beside_the_papers_worm_only() -> None:
    paper = published(check_config({"published": "riddle2023"}))
    assert paper["elongation_first_helix_pp_m"].value == (0.0420, 0.0255, 0.0402)
    assert not published(check_config({"published": "riddle2023", "body": {"mesh": {"n_segments": 4}}}))
    assert not published(check_config({"published": "riddle2022"}))
    assert not published(check_config({"name": "riddle2023"}))


def test_published_numbers_go_with_a_preset_whatever_a_worm_is_called(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text('extends = "riddle2023-rods"\n', encoding="utf-8")
    assert published(load_config(mine)) == published(load_config("riddle2023"))
    assert {name for name in preset_names() if published(load_config(name))} == {
        "riddle2022-planar", "riddle2023", "riddle2023-fast", "riddle2023-rods", "wang", "wang-network",
    }  # fmt: skip


def test_what_is_published_is_of_fields_that_exist(subtests: pytest.Subtests) -> None:
    for name in sorted(published_worms()):
        with subtests.test(f"{name!r:.60}"):
            for worm in published_worms()[name]:
                assert set(worm) - {"any_controller"} == {"given", "numbers"}
                assert set(worm["numbers"]) <= set(NUMBERS)
                assert set(worm["given"]) <= {*field_paths(), "body.n_segments"}
                assert all(len(entry) == 3 for entry in worm["numbers"].values())


def test_planar_periods(subtests: pytest.Subtests) -> None:
    for n_segments, tau_ms, gain, period_s in (
        (3, 300.0, 1.3, 2.625),
        (6, 300.0, 1.3, 5.25),
        (6, 100.0, 3.6, 2.248),
        (4, 300.0, 1.3, None),
        (3, 200.0, 1.3, None),
    ):
        with subtests.test(f"{n_segments!r:.60}"):
            config = check_config(
                {
                    "published": "riddle2022",
                    "body": {"kind": "riddle2022", "n_segments": n_segments, "gain": gain},
                    "controller": {"gate_time_constant_ms": tau_ms},
                }
            )
            entry = published(config).get("period_s")
            assert (entry.value if entry else None) == period_s


def test_loads_are_told_segment_by_segment() -> None:
    """Two muscles a segment; force and length on a circle, whose area is the work of a cycle."""
    data = wave_data()
    phase = 2.0 * np.pi * data["time"].values / 6.0
    size = np.array([1.0, 2.0, 3.0]).repeat(2)
    shape = ("time", "muscle")
    data = data.drop_dims("muscle").assign(
        muscle_force=(shape, 5.0 + size * np.sin(phase)[:, None]),
        ring_length=(shape, 0.4 + 0.1 * np.cos(phase)[:, None] * np.ones(6)),
        activation=(shape, np.ones((phase.size, 6))),
    )
    numbers = summary(run_of(data))
    assert numbers.muscle_work_J == pytest.approx([2 * np.pi * 0.1 * k for k in (1, 2, 3)], rel=1e-5)
    assert numbers.segment_force_peak_N == pytest.approx([6.0, 7.0, 8.0], rel=1e-6)
    assert numbers.segment_force_median_N == pytest.approx([5.0, 5.0, 5.0], abs=1e-6)
    assert numbers.contraction_force_peak_N == pytest.approx(8.0)


def test_forces_are_those_of_every_sample_in_which_the_muscle_itself_is_contracted() -> None:
    data = wave_data().isel(time=slice(3))
    shape = ("time", "muscle")
    data["muscle_force"] = (shape, [[9.0, 1.0, 0.0], [2.0, 1.0, 0.0], [2.0, 7.0, 0.0]])
    data["activation"] = (shape, [[0.9, 0.0, 0.0], [0.9, 0.5, 0.0], [0.2, 0.6, 0.0]])
    numbers = summary(run_of(data))
    assert numbers.segment_force_median_N == [5.5, 7.0, None]
    assert (numbers.contraction_force_median_N, numbers.contraction_force_peak_N) == (7.0, 9.0)


def test_travel_is_net_and_its_path_goes_forwards_and_backwards() -> None:
    data = wave_data().isel(time=slice(4))
    data["center_of_mass"][:, 0] = [-0.1, -0.3, -0.2, 0.0]
    numbers = summary(run_of(data))
    assert numbers.travel_m == pytest.approx(-0.1)
    assert numbers.travel_path_m == pytest.approx(0.5)


def test_a_rhythm_that_stops_is_a_warning_and_no_reason_to_run_longer() -> None:
    data = wave_data(duration_s=8.0)
    data["activation"][data["time"].values > 1.0] = 0.0
    numbers = summary(run_of(data))
    assert numbers.rhythm_verdict == "silent"
    assert [doubt.partition(" (")[0] for doubt in numbers.warnings] == ["the rhythm stops"]
    rows = {row.label: row.ours for row in summary_rows(numbers, load_config("riddle2023-rods"))}
    assert rows["warnings"] == "1, below"
    assert rows["order"].endswith(", then none")
    assert rows["speed (cm/s)"] == "none: the rhythm stops"
    assert not summary(run_of(wave_data())).warnings
