"""The examples about going places do what their first lines say, on runs as short as will tell."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

import annelid

EXAMPLES = Path(__file__).parent.parent / "examples"
MOST_LINES = 60


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_an_example_is_short_and_says_what_it_is(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.startswith('"""')
    assert len(text.splitlines()) <= MOST_LINES


def test_setae_make_travel_of_breathing(tmp_path: Path) -> None:
    breathing = example("breathing_on_setae")
    even = breathing.travel_m(0.6, None, 2.0, tmp_path / "even")
    setae = breathing.travel_m(0.2, 1.0, 2.0, tmp_path / "setae")
    assert setae > 0.1
    assert setae > 3.0 * abs(even)


def test_a_wave_that_feels_the_ground_goes_round(tmp_path: Path) -> None:
    config = annelid.load_config("riddle2025-muscles", {"duration_s": 6.0})
    run = annelid.simulate(config, tmp_path, controller=example("felt_ground").Wave())
    numbers = annelid.summary(run)
    assert numbers.full_cycles >= 1
    assert numbers.travel_m is not None
    assert numbers.travel_m < -0.1


def test_the_course_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example("round_a_post").main(tmp_path, 1.0)
    assert (tmp_path / "track.png").stat().st_size > 10_000
    assert "after 1 s" in capsys.readouterr().out


def test_the_way_through_a_taper_is_laid_side_by_side(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example("through_a_taper").main(tmp_path, 1.0)
    table = capsys.readouterr().out
    assert "adaptive" in table
    assert "0.183" in table, "the bore and the clearance where the worm starts"


def test_a_worm_learns_to_do_better_than_at_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = {"body.mesh.n_segments": 3, "body.mesh.n_helices": 6, "body.rings.peak_force_N": 16.0}
    cheap = {"changes": body | {"clock.physics_timestep_s": 0.04}, "episode_s": 2.4}
    start, learned = example("learn_to_crawl").main(tmp_path, generations=4, **cheap)
    assert learned > start
    assert "return of the start" in capsys.readouterr().out
    assert (tmp_path / "learning_curve.png").stat().st_size > 5_000


def test_the_best_gate_of_every_friction_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    module = example("sweep_friction_and_gate")
    vary = [
        {"field": "arena.friction", "values": [0.3]},
        {"field": "controller.gate_time_constant_ms", "values": [150.0]},
    ]
    module.main(tmp_path, {**module.STUDY, "set": {"duration_s": 0.1}, "vary": vary}, "processes")
    assert capsys.readouterr().out == "friction 0.3: none walks\n"
    assert (tmp_path / "sweep.nc").exists()
