"""What annelid writes as TOML is read back the same, to the last bit and letter."""

from __future__ import annotations

import math
import tomllib
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.config import load_config, parse_assignments, preset_names
from annelid.errors import UnreadableText
from annelid.textfiles import MOST_LEVELS, nested, parse_json, parse_toml, toml_text, toml_value

# All that UTF-8 can hold: signs, blanks, quotes, worms, controls.
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
FLOATS = st.floats(allow_nan=False)
SCALARS = st.one_of(TEXTS, FLOATS, st.integers(-(2**63), 2**63 - 1), st.booleans())
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3))


def same(one: Any, other: Any) -> bool:
    """Equal, and of the same type all the way down, with the sign of zero."""
    if isinstance(one, dict):
        return isinstance(other, dict) and one.keys() == other.keys() and all(same(one[k], other[k]) for k in one)
    if isinstance(one, list):
        return isinstance(other, list) and len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float):
        return isinstance(other, float) and one == other and math.copysign(1, one) == math.copysign(1, other)
    return type(one) is type(other) and one == other


@settings(max_examples=150)
@given(st.dictionaries(TEXTS, VALUES, max_size=4), TEXTS)
def test_a_document_is_read_as_it_was_written(tree: dict[str, Any], heading: str) -> None:
    assert same(parse_toml(toml_text(tree), "it"), tree)
    # The heading may be what a user typed; none of it becomes a field.
    assert same(parse_toml(toml_text(tree, heading), "it"), tree)


@settings(max_examples=150)
@given(VALUES)
def test_a_value_is_set_as_it_was_written(value: Any) -> None:
    text = toml_value(value)
    assert "\n" not in text
    assert same(tomllib.loads(f"it = {text}")["it"], value)
    assert same(parse_assignments([f"it={text}"])["it"], value)


def test_not_a_number_is_written_too() -> None:
    assert math.isnan(parse_toml(toml_text({"x": math.nan}), "it")["x"])


def test_a_configuration_is_loaded_as_it_was_written(subtests: pytest.Subtests) -> None:
    for name in preset_names():
        with subtests.test(f"{name!r:.60}"):
            config = load_config(name, {"name": "🪱 of mine", "summary": 'a "b" \\'})
            assert load_config(parse_toml(toml_text(config.model_dump()), "it")) == config
            fields = {"body": config.body, "controller": config.controller, "duration_s": config.duration_s}
            words = [f"{path}={toml_value(value)}" for path, value in fields.items()]
            assert load_config(name, parse_assignments(words)) == load_config(name)


def test_fields_by_dotted_path_become_tables() -> None:
    section = {"kind": "servo"}
    assert nested({"a.b": section, "a.b.c": 1, "d": (1, 2)}) == {"a": {"b": {"kind": "servo", "c": 1}}, "d": [1, 2]}
    assert section == {"kind": "servo"}


def test_levels_up_to_the_bound_are_read() -> None:
    for read, before in ((parse_toml, "x = "), (parse_json, "")):
        read(before + "[" * MOST_LEVELS + "]" * MOST_LEVELS, "it")
        with pytest.raises(UnreadableText, match="nested too deeply"):
            read(before + "[" * (MOST_LEVELS + 2) + "]" * (MOST_LEVELS + 2), "it")
    parse_toml(f"{'.'.join(['a'] * MOST_LEVELS)} = 1\nnumbers = [{'1.5, ' * 500}]", "it")
    with pytest.raises(UnreadableText, match="nested too deeply"):
        parse_toml(f"{'.'.join(['a'] * (MOST_LEVELS + 1))} = 1", "it")
