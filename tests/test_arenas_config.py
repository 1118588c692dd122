"""Arenas by name, what they keep of a preset, and fields that are given without their unit."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from annelid.arena.kinds.floor import Floor
from annelid.arena.kinds.pipe import Pipe
from annelid.config import RunConfig, arena_names, arena_summary, arena_text, load_config
from annelid.config.checking import whole_path
from annelid.config.run import SHARED
from annelid.errors import ConfigError

OPTIONAL = {"rail_gap_m", "posts"}


def test_an_arena_states_every_field_of_its_own(subtests: pytest.Subtests) -> None:
    for name in arena_names():
        with subtests.test(f"{name!r:.60}"):
            stated = set(tomllib.loads(arena_text(name))["arena"])
            arena = load_config("riddle2025", arena=name).arena
            assert arena is not None
            assert set(type(arena).model_fields) - set(SHARED) - OPTIONAL - stated == set()
            assert arena_summary(name)


def test_an_arena_keeps_the_worm_s_friction_and_gravity_unless_it_states_them() -> None:
    moon = {"arena.gravity_m_per_s2": 1.62, "name": "moon"}
    arena = load_config(load_config("riddle2025", moon).model_dump(), arena="pipe.bend").arena
    assert isinstance(arena, Pipe)
    assert (arena.friction, arena.gravity_m_per_s2) == (0.7, 1.62)
    assert arena.contact_time_constant_s == tomllib.loads(arena_text("pipe.bend"))["arena"]["contact_time_constant_s"]
    setae = load_config("riddle2025", arena="setae").arena
    assert setae is not None
    assert (setae.friction, setae.backward_friction, setae.has_setae) == (0.3, 1.0, True)


def test_overrides_lie_over_the_arena_and_need_no_unit() -> None:
    arena = load_config("riddle2025", {"arena.radius": 0.8, "arena.bore_m": 0.2}, arena="pipe.bend").arena
    assert isinstance(arena, Pipe)
    assert (arena.radius_m, arena.bore_m, arena.course) == (0.8, 0.2, "bend")
    assert load_config("riddle2025", {"duration": 3.0, "clock.physics_timestep": 0.005}).duration_s == 3.0


def test_a_unit_may_be_left_out_where_one_field_remains() -> None:
    tree = {"body": {"kind": "worm"}, "arena": {"kind": "pipe"}}
    assert whole_path("arena.turn", tree) == "arena.turn_deg"
    assert whole_path("body.strands.young_modulus", tree) == "body.strands.young_modulus_Pa"
    assert whole_path("arena.friction", tree) == "arena.friction"
    # A field that goes on with words, not with a unit, is another one.
    assert whole_path("arena.profile_start", tree) == "arena.profile_start_m"
    assert whole_path("arena.contact", tree) == "arena.contact"
    assert whole_path("nothing.here", tree) == "nothing.here"


def test_a_missing_unit_that_leaves_two_fields_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    class Twofold(Floor):
        span_m: float = 1.0
        span_deg: float = 1.0

    monkeypatch.setattr("annelid.config.checking.sections_in", lambda annotation: [Twofold])
    with pytest.raises(ConfigError, match=r"arena\.span is ambiguous: name one of arena\.span_m, arena\.span_deg"):
        whole_path("arena.span", {"arena": {"kind": "floor"}})


def test_a_file_may_describe_an_arena(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('[arena]\nkind = "pipe"\nbore_m = 0.3\n', encoding="utf-8")
    arena = load_config("riddle2025", arena=file).arena
    assert isinstance(arena, Pipe)
    assert arena.bore_m == 0.3
    file.write_text("duration_s = 3\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="describes no arena"):
        load_config("riddle2025", arena=file)


def test_a_file_of_before_the_kinds_is_a_floor(tmp_path: Path) -> None:
    file = tmp_path / "old.toml"
    file.write_text('extends = "riddle2025"\n[arena]\nfriction = 0.4\n', encoding="utf-8")
    arena = load_config(file).arena
    assert isinstance(arena, Floor)
    assert arena.friction == 0.4
    assert RunConfig.model_validate({"arena": {"friction": 0.4}}).arena == Floor(friction=0.4)


def test_a_bad_arena_is_named_with_what_would_be_valid(subtests: pytest.Subtests) -> None:
    for arena, field, value, sentence in (
        ("pipe.bent", "seed", 0, "unknown arena 'pipe.bent'.*pipe.bend"),
        ("pipe", "arena.course", "spiral", "arena.course = 'spiral': must be one of"),
        ("pipe.taper", "arena.narrowest_m", 0.2, r"arena\.narrowest_m = 0\.2: must be less than arena\.bore_m = 0\.18"),
        ("pipe.u", "arena.radius", 0.15, r"arena\.radius_m = 0\.15: must be more than 0\.183"),
        ("pipe.helix", "arena.pitch", 0.3, r"arena\.pitch_m = 0\.3: must be more than"),
        ("pipe.bend", "arena.turn", 270.0, r"arena\.turn_deg = 270: a bend must be in"),
        ("steps", "arena.rounding", 0.02, r"arena\.rounding_m = 0\.02: must be at most 0\.01"),
        ("rough", "arena.roughness", 0.05, r"arena\.roughness_m = 0\.05: must be at most a fifth"),
        ("floor", "arena.kind", "ice", r"arena\.kind = 'ice': must be one of"),
        ("floor", "arena.bore_m", 0.2, "another kind"),
    ):
        with subtests.test(f"{arena!r:.60}"), pytest.raises(ConfigError, match=sentence):
            load_config("riddle2025", {field: value}, arena=arena)


def test_a_planar_worm_has_no_arena() -> None:
    with pytest.raises(ConfigError, match="arena has no effect"):
        load_config("riddle2022-planar", arena="pipe")
