"""The reference of the configuration, made from its models: units, defaults, bounds and meanings of all fields."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MinLen
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from annelid.config import LEVELS, RunConfig, Section, toml_value, unit_of
from annelid.config.checking import sections_in

LARGEST = 1e15
"""Bound of numbers that have none by their nature; not worth telling."""


def page() -> str:
    """Returns the page below its introduction: a table a section, with unit, default, bounds and meaning of fields."""
    lines: list[str] = []
    for path, section in sections_of(RunConfig, ""):
        kind = section.model_fields.get("kind")
        heading = path or "The run itself"
        lines += ["", f"{'##' if path.count('.') == 0 else '###'} {heading}{f': {kind.default}' if kind else ''}", ""]
        lines += [_prose(section), "", "| field | unit | default | allowed | meaning |", "|---|---|---|---|---|"]
        lines += [_row(name, field) for name, field in section.model_fields.items() if _is_field(field.annotation)]
    levels = (f"| `{name}` | {level.summary} |" for name, level in LEVELS.items())
    lines += ["", "## Levels of fidelity", "", "`--fidelity LEVEL`, or `load_config(preset, fidelity=LEVEL)`.", ""]
    lines += ["| level | what it is |", "|---|---|", *levels]
    return "\n".join(lines) + "\n"


def sections_of(model: type[Section], path: str) -> Iterator[tuple[str, type[Section]]]:
    """Walks the tree of sections: the dotted path of each, with one entry for every kind.

    Args:
        model: The section to begin with.
        path: Its path, empty for the whole configuration.
    """
    yield path, model
    for name, field in model.model_fields.items():
        below = f"{path}.{name}" if path else name
        for section in sections_in(field.annotation):
            yield from sections_of(section, below)


def _is_field(annotation: Any) -> bool:
    """Tells a field from a section; a list of sections is a field, set as a whole."""
    return get_origin(annotation) is tuple or not sections_in(annotation)


def allowed(annotation: Any, bounds: tuple[Any, ...] = ()) -> str:
    """Says in words what a field takes.

    Args:
        annotation: Its type.
        bounds: Marks of its bounds, as pydantic keeps them beside the type.
    """
    if get_origin(annotation) is Annotated:
        inner, *marks = get_args(annotation)
        return allowed(inner, (*bounds, *_marks(marks)))
    if get_origin(annotation) in (Union, UnionType):
        members = [member for member in get_args(annotation) if member is not NoneType]
        return " or ".join(dict.fromkeys(allowed(member, bounds) for member in members))
    if get_origin(annotation) is Literal:
        return ", ".join(f"`{value}`" for value in get_args(annotation))
    if get_origin(annotation) is tuple:
        members = get_args(annotation)
        if members[-1] is Ellipsis:
            return f"list, each {allowed(members[0])}"
        words = list(dict.fromkeys(allowed(member) for member in members))
        return (
            f"list of {len(members)}: {', '.join(words)}"
            if len(words) > 1
            else f"list of {len(members)}, each {words[0]}"
        )
    name = {float: "number", int: "whole number", bool: "true or false", str: "text"}.get(annotation, "table")
    limits = " and ".join(filter(None, map(_limit, bounds)))
    return f"{name} {limits}".strip() if annotation in (float, int) else name


def _marks(marks: Any) -> Iterator[Any]:
    for mark in marks:
        if isinstance(mark, FieldInfo):
            yield from mark.metadata
        else:
            yield mark


def _limit(mark: Any) -> str:
    for kind, words, name in ((Gt, ">", "gt"), (Ge, "≥", "ge"), (Lt, "<", "lt"), (Le, "≤", "le")):
        if isinstance(mark, kind):
            value = getattr(mark, name)
            # Neither a sign nor an exponent stands on a line of its own.
            return "" if value == LARGEST else f"{words}\u00a0{value:g}".replace("-", "\u2011")
    assert not isinstance(mark, MinLen) or mark.min_length
    return ""


def _row(name: str, field: FieldInfo) -> str:
    takes = allowed(field.annotation, tuple(_marks(field.metadata)))
    default = field.get_default(call_default_factory=True)
    if default is PydanticUndefined:
        shown = "must be given"
    else:
        shown = "not set" if default is None else f"`{toml_value(default)}`"
    meaning = "which of this section's kinds" if name == "kind" else field.description or ""
    cells = (f"`{name}`", unit_of(name), shown, takes, meaning)
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _prose(section: type[Section]) -> str:
    """A section's docstring, whose double backticks Markdown would show as they are."""
    return re.sub(r"``(.+?)``", r"`\1`", inspect.getdoc(section) or "")
