"""The weak middle: pulls of single segments, what is read of them, and how the sweeps are put together."""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from dataclasses import replace
from math import isnan, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid import simulate
from annelid.analysis import ROBOT_ELONGATION_M, RhythmScore, Summary
from annelid.body import ServoRings, WormBody
from annelid.errors import ConfigError
from annelid.experiment.outcome import Hold, Outcome, outcome
from annelid.simulation.worm import WormPlant
from annelid_studies.riddle2023.figures.muscle_surface import engine_flv, scaled_length
from annelid_studies.weak_middle import pulls, sweeps
from annelid_studies.weak_middle.pulls import (
    ACTUATORS,
    END_M,
    Actuator,
    Pulled,
    Setting,
    force_limited,
    length_limited,
    muscle,
    muscle_activation,
    next_force,
    next_length,
    papers_muscle,
    pull,
    read_pull,
    rest_ring_m,
    servo,
)
from annelid_studies.weak_middle.results import (
    asymmetry_table,
    sweep_table,
    weak_middle_figure,
    write_readings,
)
from annelid_studies.weak_middle.sweeps import (
    QUANTITIES,
    Answer,
    Asymmetry,
    Point,
    Reading,
    check_points,
    deficits,
    stiffness_changes,
    sweep_points,
    value_at,
    weight_changes,
)

SMALL: dict[str, Any] = {"body.mesh.n_segments": 3, "body.mesh.elements_per_side": 1}
"""Coarse and short; the properties below are those of any mesh."""
FORCE_N = 10.0
SETTING = Setting(length_m=0.68, ring_length_m=0.681, force_N=13.25, activation=0.18)


class Bench:
    """Pulls segments of small worms, each once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._done: dict[str, Pulled] = {}

    def __call__(self, segment: int, actuator: Actuator, **changes: Any) -> Pulled:
        case = pull(segment, actuator, {**SMALL, **changes})
        if case.command not in self._done:
            run = simulate(case.config, self._folder / str(len(self._done)), progress=False)
            self._done[case.command] = read_pull(segment, outcome(run))
        return self._done[case.command]

    def deficit(self, actuator: Actuator, **changes: Any) -> float:
        ends, middle = (self(segment, actuator, **changes) for segment in (1, 2))
        assert ends.problem == middle.problem == ""
        return 1 - middle.elongation_m / ends.elongation_m


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return Bench(tmp_path_factory.mktemp("bench"))


def test_mirror_segments_elongate_alike(bench: Bench) -> None:
    """The rear half is read as the mirror image of the front half."""
    first, last = (bench(segment, force_limited(FORCE_N)) for segment in (1, 3))
    assert first.elongation_m > 0.02
    assert last.elongation_m == pytest.approx(first.elongation_m, rel=0.02)
    assert last.ring_length_m == pytest.approx(first.ring_length_m, rel=0.01)


def test_limits_of_length_hide_the_weak_middle(bench: Bench) -> None:
    assert bench.deficit(length_limited(0.80)) < 0.5 * bench.deficit(force_limited(FORCE_N))
    end, middle = (bench(segment, length_limited(0.80)) for segment in (1, 2))
    assert middle.force_N > 1.05 * end.force_N, "the middle must be held back all the same"


def test_a_muscle_pulls_with_the_force_of_its_length(bench: Bench) -> None:
    pulled = bench(1, muscle(0.12))
    rings = papers_muscle()
    length = scaled_length(pulled.ring_length_m, rings.length_ranges(1)[0])
    assert pulled.force_N == pytest.approx(rings.forces(1)[0] * float(engine_flv(length, 0.0, rings, 0.12)), rel=0.01)
    assert muscle_activation(pulled.force_N, pulled.ring_length_m) == pytest.approx(0.12, rel=0.01)


def test_a_servo_ends_at_its_cable_where_rods_are_soft(bench: Bench) -> None:
    servos = pulls.base_body().rings
    assert isinstance(servos, ServoRings)
    shortest = servos.length_ranges(1)[0][0]
    soft = bench(1, servo(), **stiffness_changes(0.5))
    assert soft.force_N < 0.9 * servos.forces(1)[0]
    assert soft.ring_length_m == pytest.approx(shortest + 2 * soft.force_N / servos.stiffness_N_per_m, abs=2e-3)


def test_too_great_a_force_collapses_a_ring_and_gives_no_point(bench: Bench) -> None:
    pulled = bench(1, force_limited(30.0))
    assert pulled.problem
    reading = Reading(Point("segments", 3, 3, force_limited(30.0)), (pulled, bench(2, force_limited(FORCE_N))))
    assert isnan(reading.deficit)
    assert reading.problem.startswith("segment 1 ")


def test_a_worm_of_a_mass_weighs_it(subtests: pytest.Subtests) -> None:
    for mass_kg in (0.77, 1.87, 3.0):
        with subtests.test(f"{mass_kg!r:.60}"):
            config = pull(
                1, force_limited(FORCE_N), {"body.mesh.elements_per_side": 3, **weight_changes(mass_kg)}
            ).config
            assert WormPlant(config).total_mass_kg == pytest.approx(mass_kg, rel=1e-4)


def test_a_worm_lighter_than_its_strands_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"mass_kg = 0\.1 must be above 0\.3"):
        weight_changes(0.1)


def test_the_sweeps_meet_at_the_base_worm() -> None:
    """All sweeps share the base worm's runs, and at its value a quantity's fields are the preset's own."""
    settings = defaultdict(lambda: SETTING)
    base = [
        [point for point in sweep_points(quantity, "quick", settings) if point.value == sweeps.BASE[quantity.name]]
        for quantity in QUANTITIES
    ]
    commands = [[case.command for point in points for case in point.cases.values()] for points in base]
    assert [point.actuator.kind for point in base[0]] == list(ACTUATORS)
    assert all(of_one == commands[0] for of_one in commands)
    for quantity in QUANTITIES:
        changed = pull(1, servo(), quantity.changes(sweeps.BASE[quantity.name])).config
        assert changed.arena == pull(1, servo()).config.arena
        assert isinstance(changed.body, WormBody)
        strands = pulls.base_body().strands
        assert changed.body.mesh == pulls.base_body().mesh
        assert changed.body.strands.young_modulus_Pa == strands.young_modulus_Pa
        assert changed.body.strands.shear_modulus_Pa == pytest.approx(strands.shear_modulus_Pa)
        assert changed.body.pins.mass_kg == pytest.approx(pulls.base_body().pins.mass_kg, rel=0.005)


def test_the_rear_half_is_the_mirror_image(subtests: pytest.Subtests) -> None:
    for n_segments, pulled in ((3, (1, 2)), (4, (1, 2)), (5, (1, 2, 3)), (8, (1, 2, 3, 4))):
        with subtests.test(f"{n_segments!r:.60}"):
            point = Point("segments", n_segments, n_segments, force_limited(FORCE_N))
            assert tuple(point.cases) == pulled
            reading = Reading(point, tuple(read(segment, 0.06 - 0.01 * segment) for segment in pulled))
            lengths = reading.elongation_m
            assert len(lengths) == n_segments
            assert lengths == lengths[::-1]
            interior = [0.06 - 0.01 * min(i, n_segments + 1 - i) for i in range(2, n_segments)]
            assert reading.deficit == pytest.approx(1 - np.mean(interior) / 0.05)


def read(segment: int, elongation_m: float, problem: str = "") -> Pulled:
    return Pulled(segment, elongation_m, 0.7, 13.0, 1e-5, problem)


def held(segment: int, elongation_m: float, ring_m: float = 0.7) -> Hold:
    lengths = tuple(elongation_m if i == segment else -1.0 for i in (1, 2, 3))
    return Hold(segment, lengths, lengths, ring_m, None, 13.0)


def outcome_of(*holds: Hold, message: str = "") -> Outcome:
    blank: Any = None
    summary: Summary = blank
    rhythm: RhythmScore = blank
    return Outcome(Path("run"), summary, rhythm, holds, message)


def test_what_is_read_of_a_pull() -> None:
    good = read_pull(2, outcome_of(held(2, 0.0400), held(2, 0.0401)))
    assert (good.elongation_m, good.force_N, good.problem) == (0.0401, 13.0, "")
    assert good.drift_m == pytest.approx(1e-4)
    assert "still moves, 1.0 mm" in read_pull(2, outcome_of(held(2, 0.040), held(2, 0.041))).problem
    crushed = read_pull(2, outcome_of(held(2, 0.1), held(2, 0.1, ring_m=0.49 * rest_ring_m())))
    assert "collapsed to 0.47 m" in crushed.problem
    stopped = read_pull(2, outcome_of(message="edge strain"))
    assert isnan(stopped.elongation_m)
    assert stopped.problem == "edge strain"
    with pytest.raises(ConfigError, match="not that of one pulled segment"):
        read_pull(2, outcome_of(held(2, 0.04)))


@given(st.floats(-50, -5), st.floats(0.5, 0.75))
def test_the_search_for_a_length_is_exact_for_a_straight_line(slope: float, root: float) -> None:
    readings = {length: read(1, END_M + slope * (length - root)) for length in (root + 0.013, root - 0.021)}
    assert next_length(readings) == pytest.approx(root, abs=0.6e-4)


@given(st.floats(0.002, 0.02), st.floats(8.0, 14.0))
def test_the_search_for_a_force_ends_on_a_straight_line(slope: float, wanted: float) -> None:
    """Elongation rises by ``slope`` a newton and is right at ``wanted``; a ring collapses three percent above."""
    readings: dict[float, Pulled] = {}
    force = round(1.05 * wanted, 2)
    for _ in range(8):
        problem = "collapsed" if force > 1.03 * wanted else ""
        readings[force] = read(1, END_M + slope * (force - wanted), problem)
        force = next_force(readings)
        assert force < min((one for one, reading in readings.items() if reading.problem), default=math.inf)
    assert force == pytest.approx(wanted, abs=0.011)


@given(st.lists(st.floats(0.01, 1.0), min_size=2, max_size=6), st.booleans(), st.floats(0, 1))
def test_the_value_of_an_elongation_is_found_on_a_steady_curve(steps: list[float], falls: bool, share: float) -> None:
    elongations = np.cumsum(steps)
    values = np.arange(len(steps), dtype=float)[:: -1 if falls else 1]
    wanted = elongations[0] + share * (elongations[-1] - elongations[0])
    found = value_at(values, elongations, wanted)
    order = np.argsort(values)
    assert np.interp(found, values[order], elongations[order]) == pytest.approx(wanted, rel=1e-6)


def test_no_value_is_found_outside_the_readings_or_on_a_curve_that_turns() -> None:
    assert isnan(value_at([1, 2, 3], [1, 2, 3], 3.5))
    assert isnan(value_at([1, 2, 3], [1, 3, 2], 1.5))
    assert value_at([1, 2, 3], [1, nan, 3], 1.5) == pytest.approx(1.5)


@pytest.fixture
def readings() -> list[Reading]:
    """Made-up readings of the quick sweeps, with two checks and one problem."""
    settings = defaultdict(lambda: SETTING)
    points = [point for quantity in QUANTITIES for point in sweep_points(quantity, "quick", settings)]
    points += check_points(settings)[:2]
    made = [Reading(point, tuple(read(i, 0.06 / i) for i in point.cases)) for point in points]
    made[1] = replace(made[1], pulled=(read(1, 0.06), read(2, nan, "collapsed")))
    return made


def test_the_csv_has_a_row_for_every_pull(readings: list[Reading], tmp_path: Path) -> None:
    write_readings(readings, tmp_path / "table.csv")
    with (tmp_path / "table.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert " ".join(rows[0]) == (
        "quantity value n_segments actuator setting resolution segment elongation_cm ring_length_m force_N drift_mm "
        "deficit_percent problem"
    )
    assert len(rows) == sum(len(one.pulled) for one in readings)
    assert float(rows[0]["deficit_percent"]) == pytest.approx(50.0)
    collapsed = [row for row in rows if row["problem"]]
    assert [(row["elongation_cm"], row["deficit_percent"]) for row in collapsed] == [("", "")]


def test_the_figure_draws_a_line_for_every_kind_in_every_panel(readings: list[Reading], tmp_path: Path) -> None:
    for quantity in QUANTITIES:
        lines = [deficits(readings, quantity, kind) for kind in ACTUATORS]
        assert all(len(x) == len(y) == 2 for x, y in lines)
        assert sweeps.BASE[quantity.name] in lines[0][0]
    assert isnan(deficits(readings, QUANTITIES[0], ACTUATORS[1])[1][0])
    path = weak_middle_figure(readings, tmp_path / "figure")
    assert path.stat().st_size > 10_000
    text = path.with_suffix(".svg").read_text(encoding="utf-8")
    for words in (*ACTUATORS, *(quantity.label for quantity in QUANTITIES), "base worm", "robot"):
        assert f"<!-- {words}" in text, words


def test_the_tables_say_what_was_found(readings: list[Reading], capsys: pytest.CaptureFixture[str]) -> None:
    from rich.console import Console

    answer = Answer("force limit of its servo (N)", 12.0, 15.0, (0.03, 0.05))
    confirmed = Reading(
        Point("robot", 0, 4, force_limited(FORCE_N), only=(1, 2, 3, 4)),
        tuple(read(i, one) for i, one in enumerate(ROBOT_ELONGATION_M, start=1)),
    )
    found = Asymmetry((answer, replace(answer, weak=nan)), (13.0, 12.0, 15.0, 13.0), confirmed, (confirmed,))
    console = Console(width=180)
    for table in (sweep_table(readings, QUANTITIES[0]), asymmetry_table(found)):
        console.print(table)
    shown = capsys.readouterr().out
    for words in (
        "50.0 (6.00 / 3.00)",
        "segment 2 collapsed",
        "25 %",
        "6.15 / 3.82 / 4.78 / 5.98",
    ):
        assert words in shown
