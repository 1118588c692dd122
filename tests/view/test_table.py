from __future__ import annotations

from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from annelid.analysis.paper import formulation
from annelid.analysis.summary import Summary, summary
from annelid.config import load_config
from annelid.draw.summary_table import closing_sentence, legend, summary_rows, summary_table
from annelid.simulation.runfile import Run

FAST = load_config("riddle2023-fast")
RODS = load_config("riddle2023-rods")


def printed(run: Run, numbers: Summary, width: int) -> list[str]:
    text = StringIO()
    Console(file=text, width=width).print(summary_table(numbers, run.config))
    return text.getvalue().splitlines()


def test_our_numbers_stay_in_a_narrow_terminal(planar_run: Run) -> None:
    numbers = replace(summary(planar_run), period_s=2.125, period_std_s=None, order=[1, 2, 3], onsets_s=[0.0, 0.5, 1.0])
    for width in (40, 60, 100):
        lines = printed(planar_run, numbers, width)
        assert any("this run" in line for line in lines)
        assert any("2.125 s" in line for line in lines)
        assert "3 at 1.00" in " ".join(" ".join(lines).split())
        assert max(len(line) for line in lines) <= width


def test_no_number_is_minus_zero(rods_run: Run) -> None:
    numbers = replace(summary(rods_run), travel_m=-1e-6, travel_path_m=-0.002)
    text = "\n".join(printed(rods_run, numbers, 120))
    assert "-0.0 mm" not in text
    assert "0.0 mm" in text
    assert "-2.0 mm" in text


def test_a_short_run_does_not_contradict_itself() -> None:
    """A wave that was seen to its end stands beside no row that says there were no cycles."""
    for cycles, shown in ((0, False), (3, True)):
        rows = {row.label: row.ours for row in summary_rows(replace(formulation(), cycles=cycles), RODS)}
        assert rows["wave 1-2-..-N"] == "yes, 2 times"
        assert ("complete cycles after the first" in rows) == shown


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
    assert ("reproduces order, period and mean elongation" in sentence) == agrees
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
    assert closing_sentence(formulation(), load_config(mine)).startswith("mine reproduces order")
    changed = closing_sentence(formulation(), load_config(mine, {"arena.friction": 0.3}))
    assert changed.startswith("this run differs from riddle2023-fast in arena.friction:")


def test_what_only_records_or_names_is_no_change() -> None:
    config = load_config("riddle2023-fast", {"record.signals_interval_s": 0.02, "seed": 3, "guard.height_m": 2.0})
    assert closing_sentence(formulation(), config) == closing_sentence(formulation(), FAST)
    noisy = load_config("riddle2023-fast", {"sensor.noise_m": 0.001, "seed": 3})
    assert "seed" in closing_sentence(formulation(), noisy)


def test_a_run_that_was_cut_short_and_other_worms_claim_nothing() -> None:
    assert closing_sentence(replace(formulation(), status="interrupted"), FAST) == ""
    for preset in ("riddle2023", "riddle2023-rods", "riddle2022-planar", "crawler"):
        assert "reproduces" not in closing_sentence(formulation(), load_config(preset))


@given(factor=st.floats(0.5, 2.0))
def test_a_deviation_is_ours_over_the_reference_less_one(factor: float) -> None:
    paper = formulation()
    assert paper.period_s is not None
    _, reference, apart = cells(replace(paper, period_s=factor * paper.period_s), "riddle2023-fast", "period")
    assert reference == f"{paper.period_s:.3f} s"
    assert float(apart.removesuffix(" %")) == pytest.approx(100 * (factor - 1), abs=0.051, rel=0.06)


def test_rigid_crossings_are_explained_in_the_table_that_compares_them() -> None:
    paper = formulation()
    assert paper.elongation_mean_max_m is not None
    twice = replace(paper, elongation_mean_max_m=[2.1 * (one or 0.0) for one in paper.elongation_mean_max_m])
    assert "crossings are rigid, and a segment elongates 2.1 times as far" in legend(twice, RODS)
    assert "rigid" not in legend(twice, FAST)
