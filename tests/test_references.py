"""What a configuration rests on is cited, and every entry is sound BibTeX."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from bibtexparser.entrypoint import parse_string

import annelid
from annelid.config import ControllerKind, kinds_of, load_config, preset_names
from annelid.config.kinds import every_kind
from annelid.references import ALWAYS, bibtex, entries, references_of
from annelid_studies.planar.sections import PlanarWorm

ROOT = Path(__file__).parent.parent
SOURCES = {
    "riddle2022-planar": {"riddle2022"},
    "daltorio2013": {"daltorio2013"},
    "boxerbaum2012": {"boxerbaum2012"},
    "wang": {"wang", "riddle2025models"},
    "meshworm": {"seok2013", "liang1990"},
    **{name: {"wang", "riddle2022"} for name in preset_names() if name.startswith("riddle2023")},
}
"""What each preset is named after, or its file states as its source; all others come from the robot of 2025."""
CONTROLLERS = {
    "sns": {"riddle2022", "szczecinski2017"},
    "adaptive": {"riddle2022", "szczecinski2017", "nourse"},
    "sns-robust": {"riddle2022", "szczecinski2017"},
    "sns-waiting": {"riddle2022", "szczecinski2017"},
    "sns-pressure": {"riddle2022", "szczecinski2017", "daltorio2013"},
    "shc": {"horchler2015", "shaw2012", "stone1990", "daltorio2013"},
    "phase-chain": {"ijspeert2007"},
    "timed": {"riddle2025models"},
    "network": {"riddle2022"},
    "sine": set(),
    "discrete": {"fang2015"},
    "reflex": set(),
    "policy": set(),
}


def cited(source: str, changes: Mapping[str, Any] | None = None) -> set[str]:
    return set(references_of(load_config(source, changes)))


def test_every_preset_cites_its_source(subtests: pytest.Subtests) -> None:
    for preset in preset_names():
        with subtests.test(f"{preset!r:.60}"):
            expected = SOURCES.get(preset, {"riddle2025", "riddle2025models"})
            assert expected | set(ALWAYS) <= cited(preset)


def test_every_preset_cites_its_controller_and_what_computes_it(subtests: pytest.Subtests) -> None:
    for preset in preset_names():
        with subtests.test(f"{preset!r:.60}"):
            config = load_config(preset)
            keys = set(references_of(config))
            assert CONTROLLERS[config.controller.kind] <= keys
            assert ("todorov2012" in keys) != isinstance(config.body, PlanarWorm)


def test_the_kinds_of_controllers_above_are_all_that_there_are() -> None:
    own = {name for name, kind in kinds_of(ControllerKind).items() if kind.__module__.startswith("annelid")}
    assert {*CONTROLLERS, "program"} == own


@pytest.mark.parametrize(
    ("changes", "key", "reason"),
    [
        ({"arena.kind": "pipe"}, "riddle2025models", "pipes"),
        ({"body.rings.layout": "halves", "turning": {"kind": "touch"}}, "riddle2025models", "contact"),
        ({"body.rings.kind": "servo"}, "riddle2025models", "servos"),
        ({"controller.scheme": "toolbox"}, "nourse2023", "steps"),
    ],
)
def test_what_a_field_brings_in_is_cited_for_it(changes: dict[str, Any], key: str, reason: str) -> None:
    before = references_of(load_config("riddle2023-rods", {"controller.gate_start": "steady"}))
    after = references_of(load_config("riddle2023-rods", {"controller.gate_start": "steady"} | changes))
    assert key not in before
    assert reason in after[key]


def test_a_file_of_the_users_cites_what_it_extends(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text('extends = "riddle2025-muscles"\nduration_s = 1.0\n')
    assert set(references_of(load_config(mine))) == cited("riddle2025-muscles")


def test_every_key_has_an_entry() -> None:
    assert set(ALWAYS) | {key for kind in every_kind() for key, _ in kind.cites} <= set(entries())


def test_the_file_parses_and_every_entry_can_be_cited() -> None:
    text = bibtex(list(entries()))
    library = parse_string(text)
    assert library.failed_blocks == []
    assert [entry.key for entry in library.entries] == list(entries())
    whole = (Path(annelid.__file__).parent / "data" / "references.bib").read_text(encoding="utf-8")
    assert [entry.key for entry in parse_string(whole).entries] == list(entries())
    for entry in library.entries:
        fields = {field.key for field in entry.fields}
        assert "author" in fields
        assert "note" in fields or {"title", "year"} <= fields, entry.key


def test_what_is_printed_parses_with_its_reasons(subtests: pytest.Subtests) -> None:
    for preset in preset_names():
        with subtests.test(f"{preset!r:.60}"):
            references = references_of(load_config(preset))
            library = parse_string(bibtex(references))
            assert library.failed_blocks == []
            assert [entry.key for entry in library.entries] == list(references)
            assert all(references.values())


def test_the_tool_is_cited_as_its_citation_file_says() -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    facts = dict(re.findall(r"^([\w-]+): \"?([^\"\n]+)", text, re.MULTILINE))
    entry = parse_string(entries()["annelid"]).entries[0]
    assert entry["title"].replace("{", "").replace("}", "") == facts["title"]
    assert entry["version"] == facts["version"] == annelid.__version__
    assert entry["year"] == facts["date-released"][:4]
