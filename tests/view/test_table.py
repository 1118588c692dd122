from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.analysis.numbers import three_digits
from annelid.analysis.paper import formulation
from annelid.analysis.summary import Summary
from annelid.config import load_config
from annelid.draw.summary_table import closing_sentence, explained, summary_rows, summary_table

FAST = load_config("riddle2023-fast")
RODS = load_config("riddle2023-rods")


def test_a_table_keeps_to_80_columns_and_says_how_long_to_run_for_a_speed() -> None:
    """Of the paper's worms, and of one with more segments than a cell lists."""

    def moved(name: str) -> str:
        return "0.43 % !" if name.endswith(("_m", "_s", "_N")) else ""

    many = replace(formulation(), n_segments=24, elongation_mean_max_m=[0.001 * i for i in range(24)], wave=True)
    long = replace(formulation(), speed_m_per_s=0.0123456, speed_body_lengths_per_s=0.02, cost_of_transport=24.3)
    for numbers, config in ((formulation(), FAST), (long, RODS), (many, load_config("crawler"))):
        for everything in (False, True):
            lines = summary_table(numbers, config, everything=everything, moved=moved).splitlines()
            assert max(map(len, lines)) <= 80
            assert everything or len(lines) <= 15
            rows = {line.split("  ")[0]: line for line in lines}
            assert len(rows) == len(lines), "each row is one line"
    assert "0 to 2.30, mean 1.15" in rows["elongation (cm)"]
    assert rows["order"].split()[1] == "1-2-..-24,"
    assert "1.23" in "".join(row.ours for row in summary_rows(long, RODS) if row.label == "speed (cm/s)")
    short = next(row.ours for row in summary_rows(formulation(), FAST) if row.label == "speed (cm/s)")
    assert short == "needs two cycles, better four: --duration 12"
    for other in (replace(formulation(), duration_s=60.0), replace(formulation(), status="interrupted")):
        assert next(row.ours for row in summary_rows(other, FAST) if row.label == "speed (cm/s)") == "needs two cycles"


@given(value=st.floats(1e-12, 1e12), sign=st.sampled_from([-1, 1]))
def test_three_digits_are_within_half_of_the_third(value: float, sign: int) -> None:
    text = three_digits(sign * value)
    assert float(text) == pytest.approx(sign * value, rel=0.00501)
    assert len(text) < 10


def test_a_row_is_explained_by_its_name_in_tables_and_in_python() -> None:
    assert explained("Speed (cm/s)") == explained("speed_m_per_s")
    assert len(explained("speed")) == 2
    for row in summary_rows(formulation(), FAST, everything=True):
        assert explained(row.label)[0][2]


def cells(numbers: Summary, preset: str, label: str) -> tuple[str, ...]:
    return next(row for row in summary_rows(numbers, load_config(preset)) if row[0].startswith(label))[1:]


@given(
    factors=st.lists(st.floats(0.9, 1.1), min_size=3, max_size=3), period=st.floats(0.98, 1.02), swapped=st.booleans()
)
def test_a_reproduction_is_claimed_if_and_only_if_order_period_and_each_elongation_agree(
    factors: list[float], period: float, swapped: bool
) -> None:
    paper = formulation()
    assert paper.elongation_mean_max_m is not None
    assert paper.period_s is not None
    numbers = replace(
        paper,
        order=paper.order[::-1] if swapped else paper.order,
        period_s=period * paper.period_s,
        elongation_mean_max_m=[
            factor * (one or 0.0) for factor, one in zip(factors, paper.elongation_mean_max_m, strict=True)
        ],
    )
    apart = [abs(factor - 1.0) for factor in factors]
    if any(abs(one - 0.05) < 1e-9 for one in apart) or abs(abs(period - 1.0) - 0.01) < 1e-9:
        return
    agrees = not swapped and abs(period - 1.0) < 0.01 and max(apart) < 0.05
    sentence = closing_sentence(numbers, FAST)
    assert ("does not reproduce" not in sentence) == agrees
    assert ("reproduces order, period and elongation" in sentence) == agrees
    assert ("order 3-2-1" in sentence) == swapped
    for segment, one in enumerate(apart, start=1):
        assert (f"elongation of segment {segment} " in sentence) == (one > 0.05)


def test_a_changed_worm_reproduces_nothing() -> None:
    for changes in ({"arena.friction": 0.3}, {"controller.gate_time_constant_ms": 200.0}, {"duration_s": 6.0}):
        sentence = closing_sentence(formulation(), load_config("riddle2023-fast", changes))
        assert "reproduce" not in sentence
        assert next(iter(changes)) in sentence


def test_a_worm_of_another_name_is_compared_with_the_nearest_preset(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text('extends = "riddle2023-fast"\nseed = 3\n', encoding="utf-8")
    assert closing_sentence(formulation(), load_config(mine)).startswith("reproduces order")
    changed = closing_sentence(formulation(), load_config(mine, {"arena.friction": 0.3}))
    assert changed.startswith("differs from riddle2023-fast in arena.friction;")


def test_what_only_records_or_names_is_no_change() -> None:
    config = load_config("riddle2023-fast", {"record.signals_interval_s": 0.02, "seed": 3, "guard.height_m": 2.0})
    assert closing_sentence(formulation(), config) == closing_sentence(formulation(), FAST)
    noisy = load_config("riddle2023-fast", {"sensor.noise_m": 0.001, "seed": 3})
    assert "seed" in closing_sentence(formulation(), noisy)


def test_a_run_that_was_cut_short_and_other_worms_claim_nothing() -> None:
    assert "reproduces" not in closing_sentence(replace(formulation(), status="interrupted"), FAST)
    other = replace(formulation(), controller="a function from Python")
    assert "reproduces" not in closing_sentence(other, FAST)
    assert not any(row.reference for row in summary_rows(other, FAST))
    stopped = replace(formulation(), status="stopped_by_guard")
    assert closing_sentence(stopped, FAST) == "stopped by guard after 5 s"
    assert [row.ours for row in summary_rows(stopped, FAST) if row.label == "warnings"] == ["stopped by guard"]
    for preset in ("riddle2023", "riddle2023-rods", "riddle2022-planar", "crawler"):
        assert "reproduces" not in closing_sentence(formulation(), load_config(preset))


@given(factor=st.floats(0.5, 2.0))
def test_a_deviation_is_ours_over_the_reference_less_one(factor: float) -> None:
    paper = formulation()
    assert paper.period_s is not None
    _, reference, apart = cells(replace(paper, period_s=factor * paper.period_s), "riddle2023-fast", "period")
    assert reference == f"{paper.period_s:.2f}*"
    assert float(apart.removesuffix(" %")) == pytest.approx(100 * (factor - 1), abs=0.051, rel=0.06)


def test_rigid_crossings_are_explained_beside_the_table_that_compares_them() -> None:
    paper = formulation()
    assert paper.elongation_mean_max_m is not None
    twice = replace(paper, elongation_mean_max_m=[2.1 * (one or 0.0) for one in paper.elongation_mean_max_m])
    assert "rigid: segments elongate 2.1 times as far as those of riddle2023" in closing_sentence(twice, RODS)
    assert "rigid" not in closing_sentence(twice, FAST)
