"""Levels of fidelity: what they change, what they leave, and how near they come to a converged run."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.analysis import Summary, summary
from annelid.config import LEVELS, RunConfig, load_config
from annelid.config.fidelity import RESOLUTION
from annelid.errors import ConfigError
from annelid.simulation import simulate

WORMS = ("riddle2023-rods", "wang")
LEVEL_NAMES = list(LEVELS)
NAMES = {"name", "summary"}


def flat(config: RunConfig) -> dict[str, object]:
    def walk(tree: dict[str, object], above: str) -> dict[str, object]:
        found: dict[str, object] = {}
        for key, value in tree.items():
            path = f"{above}{key}"
            found |= walk(value, f"{path}.") if isinstance(value, dict) else {path: value}
        return found

    return walk(config.model_dump(exclude=NAMES), "")


@pytest.mark.parametrize("worm", WORMS)
@given(
    level=st.sampled_from(LEVEL_NAMES),
    friction=st.floats(0.05, 1.5),
    n_segments=st.integers(3, 12),
    rate=st.floats(5.0, 20.0),
)
def test_a_level_changes_the_resolution_only(
    worm: str, level: str, friction: float, n_segments: int, rate: float
) -> None:
    own = {
        "arena.friction": friction,
        "body.mesh.n_segments": n_segments,
        "body.springs.stiffness_N_per_m": rate,
        "body.rings.length_range_m": [0.55, 1.05],
    }
    plain = flat(load_config(worm, own))
    resolved = flat(load_config(worm, own, fidelity=level))
    changed = {path for path in plain | resolved if plain.get(path) != resolved.get(path)}
    assert changed <= set(RESOLUTION)


def test_levels_go_from_slow_to_fast() -> None:
    steps = [load_config("riddle2023-rods", fidelity=level).clock.physics_timestep_s for level in LEVEL_NAMES]
    assert steps == sorted(steps)


def test_overrides_win_over_the_level_and_the_level_over_the_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[clock]\nphysics_timestep_s = 0.02\n[sensor]\ntolerance_m = 0.017\n", encoding="utf-8")
    assert load_config(file).clock.physics_timestep_s == 0.02
    accurate = load_config(file, fidelity="accurate")
    assert accurate.clock.physics_timestep_s == LEVELS["accurate"].changes["clock.physics_timestep_s"] == 0.005
    assert accurate.sensor.tolerance_m == 0.017
    own = load_config(file, {"clock.physics_timestep_s": 0.002}, fidelity="accurate")
    assert own.clock.physics_timestep_s == 0.002
    assert own.body.mesh.elements_per_side == accurate.body.mesh.elements_per_side  # type: ignore[union-attr]


def test_what_has_no_such_level_is_refused(subtests: pytest.Subtests) -> None:
    for source, overrides, level, words in (
        ("riddle2023-rods", {}, "acurate", "accurate"),
        ("riddle2022-planar", {}, "fast", "body.kind = 'riddle2022'"),
        ("riddle2023-fast", {}, "preview", "rods that share their pins"),
        ("riddle2023-rods", {}, "paper", "the preset riddle2023"),
        ("riddle2023", {}, "paper", "the preset riddle2023"),
        ("riddle2023", {}, "fast", "rods that share their pins"),
        ({"body": {"formulation": {"kind": "chain"}}}, {}, "fast", "rods that share their pins"),
    ):
        with subtests.test(f"{source!r:.60}"), pytest.raises(ConfigError, match=words):
            load_config(source, overrides, fidelity=level)


@pytest.fixture(scope="module")
def converged(tmp_path_factory: pytest.TempPathFactory) -> Summary:
    fine = {"clock.physics_timestep_s": 0.001, "body.mesh.elements_per_side": 6, "duration_s": 8.0}
    run = simulate(load_config("riddle2023-rods", fine), tmp_path_factory.mktemp("converged"), progress=False)
    return summary(run)


@pytest.mark.slow
@pytest.mark.parametrize(("level", "within"), [("accurate", 0.01), ("fast", 0.02), ("preview", 0.03)])
def test_a_level_is_as_near_to_the_converged_run_as_its_page_says(
    level: str, within: float, converged: Summary, tmp_path: Path
) -> None:
    """The table of docs/evidence/speed.md, at friction 1 with three segments."""
    ours = summary(
        simulate(load_config("riddle2023-rods", {"duration_s": 8.0}, fidelity=level), tmp_path, progress=False)
    )
    assert ours.order == converged.order
    assert ours.period_s == pytest.approx(converged.period_s, rel=0.005)
    assert ours.elongation_mean_max_m == pytest.approx(converged.elongation_mean_max_m, rel=within)
