"""What a configuration accepts, what it refuses, and the sentence with which it refuses."""

from __future__ import annotations

import re
import tomllib
import warnings
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.body.worm import WormBody
from annelid.config import (
    RunConfig,
    Vary,
    arena_names,
    field_paths,
    field_value,
    fields_of,
    load_config,
    load_study,
    loading,
    parse_assignments,
    preset_names,
    preset_text,
)
from annelid.errors import ConfigError
from annelid.experiment.search_space import variables_of
from annelid_studies.planar.sections import PlanarWorm


def leaves(tree: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in tree.items():
        found |= leaves(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return found


def own_text(name: str) -> str:
    return loading._files("presets")[name].read_text(encoding="utf-8")


def notes(text: str) -> dict[str, str]:
    """The comment of every field, by its path."""
    found, section = {}, ""
    for line in text.splitlines():
        if line.startswith("["):
            section = line.strip("[]") + "."
        elif line and not line.startswith("#"):
            setting, _, note = line.partition("#")
            found[section + setting.split(" = ")[0]] = note.strip()
    return found


def stated(name: str) -> dict[str, str]:
    """The fields that a preset and those that it extends state, each with its source."""
    own = tomllib.loads(own_text(name))
    above = stated(own["extends"]) if "extends" in own else {}
    return above | notes(own_text(name))


def test_a_preset_or_its_ancestors_state_every_field_that_its_worm_has_with_its_source(
    subtests: pytest.Subtests,
) -> None:
    """No default hides behind a preset."""
    for name in preset_names():
        with subtests.test(f"{name!r:.60}"):
            config, sources = load_config(name), stated(name)
            unsourced = {path for path in leaves(config.model_dump(exclude_none=True)) if not sources.get(path)}
            planar = isinstance(config.body, PlanarWorm)
            assert unsourced - {"name", "summary"} == {path for path in unsourced if planar and "guard." in path}


def test_a_preset_states_nothing_that_it_inherits() -> None:
    """But for a value that has another source: then it is the same by chance."""
    alone = {name for name in preset_names() if "extends" not in tomllib.loads(own_text(name))}
    assert alone == {"riddle2023", "riddle2022-planar"}
    assert {name: again for name in preset_names() if name not in alone and (again := stated_again(name))} == {}


def stated_again(name: str) -> list[str]:
    """Fields of a preset with the value and the source that its base has."""
    own = tomllib.loads(own_text(name))
    base = own.pop("extends")
    inherited, fields = leaves(load_config(base).model_dump(mode="json")), leaves(own)
    renewed = tuple(
        path.removesuffix("kind") for path in fields if path.endswith("kind") and fields[path] != inherited.get(path)
    )
    again = [path for path in fields if fields[path] == inherited.get(path) and not path.startswith(renewed)]
    return [path for path in again if marks(notes(own_text(name))[path]) == marks(stated(base)[path])]


def marks(note: str) -> list[str]:
    return re.findall(r"\[[^]]+\]", note)


def test_the_text_of_a_file_of_the_user_s_has_what_it_extends_behind_it(tmp_path: Path) -> None:
    base, mine, copy = (tmp_path / f"{name}.toml" for name in ("base", "mine", "copy"))
    base.write_text('extends = "riddle2023-rods"\n[arena]\nfriction = 0.3  # measured\n', encoding="utf-8")
    mine.write_text(f'extends = "{base.as_posix()}"\nname = "mine"\n[sensor]\nnoise_m = 0.001', encoding="utf-8")
    text = preset_text(mine)
    assert text.startswith(mine.read_text())
    assert "\n# base.toml, which it extends:\n" in text.replace("'", "")
    assert "\n# friction = 0.3  # measured\n" in text
    assert "\n# riddle2023, which it extends:\n" in text
    copy.write_text(text, encoding="utf-8")
    assert load_config(copy) == load_config(mine)
    mine.write_text("friction = 1", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"did you mean 'arena\.friction'"):
        preset_text(mine)


def test_published_numbers_are_named_not_found_by_a_path() -> None:
    for name in ("../data/riddle2023.json", "riddle2023.toml", "", "riddle2023-rods"):
        with pytest.raises(ConfigError, match=r"published = .*: must be one of riddle2022, riddle2023, wang"):
            load_config("crawler", {"published": name})
    assert load_config("riddle2023", {"published": "none"}).published is None


def test_a_configuration_survives_the_run_file_and_its_printed_preset(tmp_path: Path) -> None:
    file = tmp_path / "copy.toml"
    for name in preset_names():
        config = load_config(name)
        assert RunConfig.model_validate_json(config.model_dump_json()) == config, name
        file.write_text(preset_text(name), encoding="utf-8")
        assert load_config(file) == config, name
    for name in arena_names():
        config = load_config("riddle2025", arena=name)
        assert RunConfig.model_validate_json(config.model_dump_json()) == config, name


def test_every_field_has_a_description() -> None:
    undescribed = [path for path, text in field_paths().items() if not text and not path.endswith(".kind")]
    assert undescribed == []


def test_changing_a_kind_starts_from_that_kind_s_defaults() -> None:
    changed = load_config(
        "riddle2023",
        parse_assignments(["body.formulation.kind=rods", "body.rings.length_range_m=[0.5, 1.0]"]),
    )
    assert isinstance(changed.body, WormBody)
    assert changed.body.formulation.kind == "rods"


def test_a_file_that_names_no_base_starts_from_the_rod_worm(tmp_path: Path) -> None:
    file = tmp_path / "empty.toml"
    file.write_text("", encoding="utf-8")
    expected = load_config("riddle2023-rods").model_copy(update={"name": "empty"})
    assert load_config(file) == expected


def test_files_may_not_extend_themselves(tmp_path: Path) -> None:
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    first.write_text(f'extends = "{second.as_posix()}"', encoding="utf-8")
    second.write_text(f'extends = "{first.as_posix()}"', encoding="utf-8")
    with pytest.raises(ConfigError, match="extends itself"):
        load_config(first)


def test_fields_of_a_configuration_are_those_of_its_kinds() -> None:
    fields = fields_of(load_config("riddle2023-rods"))
    assert "body.n_segments" not in fields
    assert "body.formulation.armature_kg_m2" not in fields
    assert "impratio" in fields["body.formulation.friction_impedance_ratio"]
    with pytest.raises(ConfigError, match=r"did you mean 'body\.mesh\.n_segments'"):
        load_config("riddle2023-rods", {"n_segments": 4})


def test_a_bad_value_is_named_with_what_would_be_valid(subtests: pytest.Subtests) -> None:
    for assignment, sentence in (
        ("body.mesh.n_helices=7", "body.mesh.n_helices = 7: .* even"),
        ("body.mesh.n_helices=4", "body.mesh.n_helices = 4: must be at least 6"),
        ("body.mesh.n_segments=3.5", "must be a whole number"),
        ("arena.friction=-1", "arena.friction = -1: must be at least 0"),
        ("arena.friction=inf", "must be a finite number"),
        ("duration_s=0", "duration_s = 0: must be greater than 0"),
        ("clock.physics_timestep_s=0.0033", "integer multiple"),
        ("record.frames_interval_s=0.0405", "record.frames_interval_s = 0.0405 must be an integer multiple"),
        ("record.signals_interval_s=0.0015", "record.signals_interval_s = 0.0015 must be an integer multiple"),
        ("body.formulation.kind=chian", "'chian': must be one of 'rods', 'chain'; did you mean 'chain'?"),
        ("controller.kind=sns-robst", "did you mean 'sns-robust'"),
        ("body.formulation.joint=ball", "is no field any more: a chain's elements are always joined by three hinges"),
        ("body.mesh.segments=4", "unknown field 'body.mesh.segments': did you mean 'n_segments'"),
        ("friction=1", "did you mean 'arena.friction'"),
        ("body.rings.length_range_m=[1.0, 0.5]", "lower bound below its upper bound"),
        ("body.rings.length_range_m=[[0.5, 1.0], [0.5, 1.0]]", "2 ranges for 3 segments"),
        ("body=3", "is a section"),
        ("body.mesh.n_segments=100000", "must be at most 200"),
        ("duration_s=1e9", "more than 10,000,000 samples"),
        ("body.rings.length_range_m=[]", "one pair"),
        ("body.strands.radius_m=0.5", "must be less than body.mesh.radius_m = 0.16"),
        ("arena.contact_impedance=[1, 2, 3]", "must be less than 1"),
    ):
        with subtests.test(f"{assignment!r:.60}"):
            with pytest.raises(ConfigError, match=sentence) as caught:
                load_config("riddle2023", parse_assignments([assignment]))
            assert "\n" not in str(caught.value)


@given(duration_s=st.floats(1e-3, 100.0), step_s=st.sampled_from([0.001, 0.00035, 0.00079]))
def test_a_duration_becomes_the_nearest_whole_number_of_steps(duration_s: float, step_s: float) -> None:
    clock = {
        "clock.control_timestep_s": step_s,
        "clock.physics_timestep_s": step_s,
        "record.signals_interval_s": step_s,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        config = load_config("riddle2023", {**clock, "record.frames_interval_s": step_s, "duration_s": duration_s})
    assert config.duration_s == pytest.approx(max(round(duration_s / step_s), 1) * step_s, abs=1e-6 * duration_s)


def test_what_a_file_extends_is_seen_from_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "worms").mkdir()
    (tmp_path / "base.toml").write_text("[arena]\nfriction = 0.3\n")
    (tmp_path / "worms" / "mine.toml").write_text('extends = "../base.toml"\nseed = 3\n')
    (tmp_path / "worms" / "study.toml").write_text('preset = "mine.toml"\n[[vary]]\nfield = "seed"\nvalues = [1, 2]\n')
    monkeypatch.chdir(tmp_path)
    config = load_config(load_study("worms/study.toml").preset)
    assert (config.name, config.seed) == ("mine", 3)
    assert config.arena is not None
    assert config.arena.friction == 0.3
    (tmp_path / "worm.urdf").write_text("<robot/>")
    with pytest.raises(ConfigError, match=r"worm.urdf is no configuration: a file ends in \.toml"):
        load_config("worm.urdf")


def test_a_changed_duration_is_said() -> None:
    with pytest.warns(UserWarning, match=r"duration_s = 1\.0005 is taken as 1, a whole number"):
        assert load_config("riddle2023", {"duration_s": 1.0005}).duration_s == 1.0


def test_gone_fields_that_did_nothing_are_left_out_and_others_refused(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    rods = '[body.formulation]\ncurvature = "linear"\nintegrator = "BDF2"\npin_inertance_kg = 0.0094\n'
    mine.write_text(f"{rods}[guard]\nstretch = 1.1\n[arena]\nrail_gap_m = 'none'", encoding="utf-8")
    assert load_config(mine).model_copy(update={"name": "riddle2023-rods", "summary": ""}) == load_config(
        "riddle2023-rods", {"summary": "", "guard.ring_closure": 1.0}
    )
    robust = {"controller": {"kind": "sns-robust", "push_nA": 6.0, "entrainment": 0.02}}
    assert load_config(robust) == load_config({"controller": {"kind": "sns-robust"}})
    for path, value in (
        ("controller.entrainment", 0.0),
        ("guard.stretch", 0.0),
        ("body.formulation.curvature", "constant"),
    ):
        with pytest.raises(ConfigError, match=rf"{path} is no field any more: .*; leave it out"):
            load_config(robust, {path: value})


def test_a_renamed_field_is_read_under_its_new_name(tmp_path: Path) -> None:
    old, new = "controller.let_go_s", "controller.motor_time_constant_s"
    base, mine = tmp_path / "base.toml", tmp_path / "mine.toml"
    base.write_text("[controller]\nkind = 'sns-robust'\nmotor_time_constant_s = 0.1", encoding="utf-8")
    mine.write_text(f"extends = '{base.as_posix()}'\n[controller]\nlet_go_s = 0.3", encoding="utf-8")
    assert field_value(load_config(mine), new) == 0.3
    assert field_value(load_config(mine, {new: 0.5}), new) == 0.5
    with pytest.warns(UserWarning, match=f"{old} is now {new}"):
        assert field_value(load_config(mine, {old: 0.7}), new) == 0.7
    with pytest.warns(UserWarning, match=f"{old} is now {new}"):
        (variable,) = variables_of([Vary.model_validate({"field": old, "values": [0.1]})], load_config(mine))
    assert variable.field == new


@pytest.mark.parametrize("heights", ["body.height_min_m=0.12", "body.height_max_m=0.15"])
def test_planar_heights_must_fit_the_rhombus(heights: str) -> None:
    with pytest.raises(ConfigError, match="height_min_m < height_max_m < 2 side_m"):
        load_config("riddle2022-planar", parse_assignments([heights]))


def test_an_assignment_needs_a_field_and_a_value(subtests: pytest.Subtests) -> None:
    for text in ("friction", "=3", "arena..friction=1"):
        with subtests.test(f"{text!r:.60}"), pytest.raises(ConfigError, match="not of the form field=value"):
            parse_assignments([text])


def test_unreadable_files_are_refused_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        load_config(tmp_path / "absent.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("duration_s = = 3", encoding="utf-8")
    with pytest.raises(ConfigError, match="not valid TOML"):
        load_config(broken)


def test_names_that_are_gone_say_what_to_use() -> None:
    import annelid.nervous

    for name, instead in (("Diagram", "network_figure"), ("SpikingSynapse", "use a Synapse"), ("Factors", "excite")):
        with pytest.raises(ImportError, match=rf"nervous\.{name} has been removed: .*{instead}"):
            getattr(annelid.nervous, name)


def test_names_that_have_moved_are_found_with_a_warning() -> None:
    import annelid.analysis
    import annelid.export
    import annelid.nervous
    import annelid.planar

    for package, name in (
        (annelid.analysis, "detect_slip"),
        (annelid.nervous, "PhaseStepper"),
        (annelid.nervous, "import_network"),
        (annelid.export, "Firmware"),
        (annelid.export, "lems_text"),
        (annelid.planar, "Riddle2022Plant"),
    ):
        with pytest.warns(DeprecationWarning, match=rf"{name} is now annelid_(lab|studies)\."):
            assert getattr(package, name)
        with pytest.raises(AttributeError):
            package.nosuch  # noqa: B018
