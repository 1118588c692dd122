"""Whatever a field is given that it cannot have, the error names a field that exists, and the value."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import suppress
from itertools import product
from typing import Any, Literal, get_args, get_origin

import pytest

from annelid.config import RunConfig, Section, load_config
from annelid.config.checking import field_paths, sections_in
from annelid.errors import ConfigError

EXISTING = set(field_paths()) | {"body", "arena", "controller", "turning", "sensor", "clock", "record", "guard"}
HUGE = 10**5000
NUMBERS = [float("nan"), float("inf"), -float("inf"), 1e300, HUGE, -HUGE, "word", "x" * 100_000, [], {}, {"a": 1}, [[]]]
WORDS = [0, 1.5, HUGE, [], {}, {"a": 1}, ["word"] * 10_000]
CHOICES = ["nothing", "x" * 100_000, *WORDS]


def kinds_of(annotation: Any) -> list[type[Section]]:
    """The sections that a field may hold; none where it is no section."""
    return [] if get_origin(annotation) is tuple else sections_in(annotation)


def literals(annotation: Any) -> bool:
    return get_origin(annotation) is Literal or any(map(literals, get_args(annotation)))


def fields(
    section: type[Section], above: tuple[str, ...], kinds: dict[str, str]
) -> Iterator[tuple[str, dict[str, str], Any]]:
    """Every field of every kind: its path, the kinds that make it exist, and its annotation."""
    for name, info in section.model_fields.items():
        inner = kinds_of(info.annotation)
        for each in inner:
            path = (*above, name)
            tag = each.model_fields["kind"].default if "kind" in each.model_fields else None
            chosen = {**kinds, f"{'.'.join(path)}.kind": tag} if tag is not None else kinds
            yield from fields(each, path, chosen)
        if not inner and name != "kind":
            yield ".".join((*above, name)), kinds, info.annotation


CASES = list(fields(RunConfig, (), {}))


def wrong(annotation: Any) -> list[Any]:
    if literals(annotation):
        return CHOICES
    told = str(annotation)
    return WORDS if "str" in told and "float" not in told else NUMBERS


def test_an_error_names_the_field_and_the_value(subtests: pytest.Subtests) -> None:
    tried = {path for path, _, _ in CASES}
    assert {"controller.turn_ms", "controller.descending.lift", "controller.network.range_mV"} <= tried
    for path, kinds, annotation in CASES:
        with subtests.test(path=path, kinds=kinds):
            whole = {k: v for k, v in kinds.items() if k != "body.kind" or v != "worm"}
            sentences = [refusal({**whole, path: value}, path, value) for value in wrong(annotation)]
            # A field may take anything of its type; no field takes everything.
            assert any(sentences)


def refusal(changes: dict[str, Any], path: str, value: Any) -> str:
    """Returns the sentence in which a value is refused, checked; an empty one where it is taken."""
    try:
        load_config("riddle2023-rods", changes)
    except ConfigError as error:
        sentence = str(error)
    else:
        return ""
    assert len(sentence) < 500, sentence
    assert "\n" not in sentence
    named = sentence.split(" = ")[0].split(" must be given")[0].removeprefix("unknown field ").strip("'")
    while named not in EXISTING and named.rsplit(".", 1)[-1].isdigit():
        named = named.rsplit(".", 1)[0]
    assert named in EXISTING or named == f"{path}.a", sentence
    if named == path and isinstance(value, str | float):
        assert str(value)[:20] in sentence
    return sentence


def test_a_kind_that_is_none_is_refused() -> None:
    sections = ("body", "body.rings", "body.formulation", "arena", "controller", "turning")
    kinds = ([1], {}, None, 3, float("inf"), "x" * 100_000, "nope", True)
    for section, kind in product(sections, kinds):
        with pytest.raises(ConfigError, match=rf"^{section.replace('.', '[.]')}\.kind = ") as error:
            load_config("riddle2023-rods", {f"{section}.kind": kind})
        assert len(str(error.value)) < 500


def test_the_engine_refuses_nothing_that_the_configuration_takes() -> None:
    """What the engine says of a body is told by fields, and nothing else escapes from building it."""
    from annelid.body.assemble import mjcf_text

    coarse = {"body.mesh.elements_per_side": 1}
    body = load_config("riddle2023-rods", coarse).body
    for path, kinds, annotation in CASES:
        there = all(getattr(body, k.split(".")[1], None) is not None for k in kinds if k.count(".") > 1)
        if there and path.startswith("body.") and "float" in str(annotation) and "tuple" not in str(annotation):
            with warnings.catch_warnings(), suppress(ConfigError):
                warnings.simplefilter("ignore")
                mjcf_text(load_config("riddle2023-rods", {**coarse, path: 1e-9}))
