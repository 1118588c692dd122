"""Guards on a worm's shape, and warnings: nonsense stops, doubt is recorded, also after a resume."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from annelid import load_config, open_run, simulate, summary
from annelid.body.worm import WormBody
from annelid.config import RunConfig
from annelid.errors import ConfigError, SimulationStopped
from annelid.simulation.guards import Energies, Watch

NO_ENERGY = Energies(0.0, 0.0)
HARD = {
    "body.rings.peak_force_N": 425.35435,
    "body.mesh.angular_rate_rad_per_m": 25.241869,
    "body.strands.linear_density_kg_per_m": 0.036985,
    "arena.contact_time_constant_s": 0.022763,
    "duration_s": 1.0,
}


def body_of(config: RunConfig) -> WormBody:
    assert isinstance(config.body, WormBody)
    return config.body


class Looked:
    """A watch of a preset's worm that is shown one quantity at a time, all others as at rest."""

    def __init__(self, preset: str = "riddle2023-rods", changes: dict[str, Any] | None = None) -> None:
        config = load_config(preset, changes)
        self.body = body_of(config)
        self.watch = Watch(self.body, self.body.geometry(), config.guard)
        self.n = config.body.n_segments * (1 if self.body.rings.layout == "whole" else 2)
        self.rest: dict[str, Any] = {
            "ring_length_m": np.full(self.n, 0.96 * config.body.n_segments / self.n),
            "spring_length_m": self.body.geometry().spring_length_m,
            "depth_m": -0.01,
            "gap_m": 0.0,
            "activation": np.zeros(self.n),
            "force_N": np.zeros(self.n),
        }

    def at(self, time_s: float, **shown: Any) -> str | None:
        return self.watch.look(time_s, **(self.rest | shown))

    def warnings(self, time_s: float = 1.0, energies: Energies = NO_ENERGY) -> tuple[str, ...]:
        return self.watch.warnings(time_s, energies)


@pytest.mark.parametrize(
    ("shown", "words"),
    [
        (
            {"ring_length_m": np.array([0.96, 0.023, 0.96])},
            "the ring of segment 2 is 0.023 m long, below the limit",
        ),
        (
            {"spring_length_m": np.append(np.full(41, 0.0748), 0.25)},
            "spring is 0.25 m long, above the limit",
        ),
        ({"depth_m": 0.06}, "0.06 m deep in the ground, above the limit guard.depth_m = 0.05"),
    ],
)
def test_what_strands_cannot_do_stops_a_run(shown: dict[str, Any], words: str) -> None:
    look = Looked()
    assert look.at(0.1) is None
    assert words in str(look.at(0.2, **shown))
    assert [" at 0.2 s" in warning for warning in look.warnings()] == [True]


@pytest.mark.parametrize(
    ("shown", "words"),
    [
        (
            {"ring_length_m": np.array([0.96, 0.96, 0.15])},
            "the ring of segment 3 was 0.15 m long at 0.2 s, 16 % of its length",
        ),
        ({"depth_m": 0.02}, "0.02 m deep in the ground at 0.2 s"),
        ({"gap_m": 0.06}, "strands of a crossing were 0.06 m apart at 0.2 s"),
    ],
)
def test_what_is_doubtful_is_kept(shown: dict[str, Any], words: str) -> None:
    look = Looked()
    look.at(0.1)
    assert look.warnings() == ()
    assert look.at(0.2, **shown) is None
    look.at(0.3)
    (warning,) = look.warnings()
    assert words in warning


def test_an_actuator_without_force_is_told_of_every_contraction() -> None:
    look = Looked("riddle2025")
    on = np.zeros(look.n)
    on[2:4] = 1.0
    for step in range(100):
        contracted = 20 <= step % 50 < 45
        pulling = np.where(np.arange(look.n) == 2, 1.0, 0.0) if contracted else np.zeros(look.n)
        look.at(0.01 * step, activation=on if contracted else 0.0 * on, force_N=pulling)
    (warning,) = look.warnings()
    assert warning.startswith(
        "the actuators of segment 2 pulled with no force in 2 of their contractions, first at 0.2 s:"
    )
    assert look.warnings() == (warning,), "telling changes nothing"


def test_a_contraction_that_goes_on_counts_too() -> None:
    look = Looked()
    for step in range(50):
        look.at(0.01 * step, activation=np.array([0.0, 0.0, 1.0]))
    assert "segment 3 pulled with no force in 1 of" in look.warnings(0.5)[0]
    pulled = {"force_N": np.array([0.0, 0.0, 2.0]), "ring_length_m": np.array([0.96, 0.96, 0.9])}
    look.at(0.51, activation=np.array([0.0, 0.0, 1.0]), **pulled)
    assert look.warnings(0.52) == ()


def test_the_integrators_share_is_told() -> None:
    look = Looked()
    assert look.warnings(energies=Energies(work=2.0, numerical=0.6)) == ()
    assert "took 40 % of the work of muscles and weight, 2 J" in look.warnings(energies=Energies(2.0, 0.8))[0]
    assert "added 50 %" in look.warnings(energies=Energies(2.0, -1.0))[0]
    assert look.warnings(energies=Energies(0.001, 0.001)) == ()


def test_what_was_kept_is_restored() -> None:
    first, second = Looked(), Looked()
    first.at(0.1, depth_m=0.02, activation=np.array([0.0, 1.0, 0.0]))
    second.watch.set_state(first.watch.get_state())
    for look in (first, second):
        look.at(0.4, activation=np.zeros(3))
    assert first.warnings() == second.warnings() != ()
    states = first.watch.get_state(), second.watch.get_state()
    assert all(np.array_equal(states[0][name], states[1][name]) for name in states[0])


def test_a_ring_that_collapses_stops_the_run(tmp_path: Path) -> None:
    changes = {
        "arena.gravity_m_per_s2": 20.141072,
        "body.mesh.n_helices": 8,
        "body.rings.peak_force_N": 615.445477,
        "body.strands.damping_time_s": 0.995,
        "duration_s": 0.4,
    }
    with pytest.raises(SimulationStopped, match=r"below the limit of .* m at which its crossings touch"):
        simulate(load_config("riddle2023", changes), tmp_path, progress=False)
    run = open_run(tmp_path)
    assert run.status == "stopped_by_guard"
    assert any(warning.startswith("the ring of segment 1 was 0.0") for warning in run.warnings)


def test_a_setup_that_can_mean_nothing_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    thin = load_config("wang", {"body.mesh.radius_m": 0.05})
    with pytest.raises(ConfigError, match=r"even the shortest cable of 0\.45 m pulls 0 N; set \[0\.195, 0\.3\]"):
        simulate(thin, tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


def test_a_doubtful_run_says_so_everywhere(tmp_path: Path) -> None:
    run = simulate(load_config("riddle2023-rods", HARD), tmp_path / "run", progress=False)
    said = ("body.mesh.angular_rate_rad_per_m = ", "body.rings.peak_force_N = ", "an axial spring was ")
    assert all(any(warning.startswith(words) for warning in run.warnings) for words in said)
    assert summary(run).warnings == run.warnings
    assert json.loads(summary(run).to_json())["warnings"] == list(run.warnings)
    with xarray.open_dataset(run.path, engine="h5netcdf") as plain:
        assert str(plain["warnings"].values).splitlines() == list(run.warnings)
    assert "warnings" not in run.data


def test_rings_that_hardly_close_are_told_once_muscles_were_active_for_long() -> None:
    looked = Looked()
    on, weak = np.ones(looked.n), {"force_N": np.full(looked.n, 0.3), "ring_length_m": np.full(looked.n, 0.95)}
    looked.at(0.0, activation=on, **weak)
    looked.at(0.4, activation=on, **weak)
    assert looked.warnings(0.4) == ()
    looked.at(0.6, activation=on, **weak)
    assert [each.startswith("no ring was shortened by more than 1 %") for each in looked.warnings(0.6)] == [True]
    looked.at(0.8, activation=on, **(weak | {"ring_length_m": np.full(looked.n, 0.9)}))
    assert looked.warnings(0.8) == ()
