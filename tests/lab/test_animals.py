"""Runs beside animals: their numbers in closed form, the published ones, and the command."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.analysis import ROBOT_ELONGATION_M
from annelid.config import check_config
from annelid.references import entries
from annelid.simulation.runfile import Run
from annelid_lab.animals import QUANTITIES, delay_of, published, subject_of
from outcome import Command
from synthetic import PEAKS_M, REST_M, wave_data

PAGE = Path(__file__).parents[2] / "docs" / "evidence" / "worm_robots.md"


@settings(max_examples=20)
@given(n=st.integers(3, 12), fronts=st.data(), period_s=st.floats(0.1, 20.0), forwards=st.booleans())
def test_the_delay_of_a_wave_is_its_fronts_over_its_segments(
    n: int, fronts: st.DataObject, period_s: float, forwards: bool
) -> None:
    share = fronts.draw(st.integers(1, n - 1)) / n
    onsets = sorted(
        ((cycle + share * (k if forwards else -k) % 1.0) * period_s, k + 1) for k in range(n) for cycle in range(3)
    )
    found = delay_of([segment for _, segment in onsets], [time for time, _ in onsets], period_s)
    assert found == pytest.approx(min(share, 1.0 - share), abs=1e-6)


def test_the_numbers_of_a_run_in_closed_form() -> None:
    """One of three segments is long at a time; one slides at 0.4, one at 0.6 of the worm's speed, one is in the air."""
    data = wave_data(duration_s=12.0).assign_attrs(total_mass_kg=2.0, body_length_m=0.5)
    n_times = data.sizes["time"]
    force = np.zeros((n_times, 3, 3))
    force[:, :2, 2] = 1.0
    data["contact_force"] = ("time", "segment", "axis"), force
    data["slip_speed"] = ("time", "segment"), np.tile([0.004, -0.006, 0.0], (n_times, 1))
    data["slip_distance"] = ("time", "segment"), np.zeros((n_times, 3))
    run = Run(Path("run.nc"), {}, {}, check_config({"name": "riddle2023"}), "complete", "").with_data(data)
    numbers = {name: low for name, (low, _) in subject_of(run, "walk").numbers.items()}
    assert set(numbers) == set(QUANTITIES)
    expected = {"speed": 0.02, "frequency": 1 / 2.4, "stride": 0.048, "touching": 2 / 3, "anchored": 1 / 3}
    expected |= {"delay": 1 / 3, "stretch": 1.0 + np.mean(PEAKS_M) / REST_M}
    assert {name: numbers[name] for name in expected} == pytest.approx(expected, rel=1e-6)
    assert numbers["short"] == pytest.approx(2 / 3, abs=0.01)


def test_published_numbers_fit_each_other_and_have_their_sources() -> None:
    earthworm, larva, robot = (one.numbers for one in published())
    # Speed is stride times frequency; their powers of the mass cancel.
    assert earthworm["stride"][0] * earthworm["frequency"][1] == pytest.approx(earthworm["speed"][0], rel=0.02)
    for numbers in (larva, robot):
        product = np.mean(numbers["stride"]) * np.mean(numbers["frequency"])
        assert product == pytest.approx(np.mean(numbers["speed"]), rel=0.03)
    ends = min(ROBOT_ELONGATION_M), max(ROBOT_ELONGATION_M)
    assert robot["stretch"] == pytest.approx([1.0 + end / 0.0748 for end in ends], abs=0.005)
    said = " ".join(one.source for one in published()) + PAGE.read_text(encoding="utf-8")
    keys = set(re.findall(r"[\[(, ]([a-z]+(?:19|20)\d\d[a-z]*|wang|luo)(?=[\], )])", said))
    assert {"quillin1999", "sun2022code", "riddle2025models", "seok2013"} <= keys <= set(entries())


def test_a_run_and_a_preset_beside_animals(annelid: Command, tmp_path: Path) -> None:
    short = tmp_path / "short.toml"
    short.write_text('extends = "riddle2022-planar"\nduration_s = 1.0\n')
    done = annelid("compare", short, "earthworm", "-o", tmp_path / "out")
    assert done.exit_code == 0, done.err
    assert "run in runs/" in done.err
    assert "--duration" in done.err
    assert next(line.split()[-1] for line in done.out.splitlines() if "frequency" in line) == "0.17"
    assert max(map(len, done.out.splitlines()[:8])) <= 80
    assert {path.name for path in (tmp_path / "out").glob("earthworm.*")} == {
        f"earthworm.{e}" for e in ("json", "png", "svg")
    }
    (folder,) = Path("runs").iterdir()
    assert "--force" in annelid("compare", folder, "earthworm", "-o", tmp_path / "out").sentence()
