"""Checking a configuration, and saying in one sentence what is wrong with it."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import cache, reduce
from importlib import resources
from typing import Any, TypeVar, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from annelid.config.kinds import Kind, kinds_of
from annelid.config.run import RunConfig
from annelid.config.sections import Section
from annelid.errors import MOST_SHOWN, ConfigError, listed, nearest, shown
from annelid.textfiles import parse_toml

Checked = TypeVar("Checked", bound=Section)


def check_config(tree: Mapping[str, Any]) -> RunConfig:
    """Turns a nested mapping into a checked `RunConfig`, or raises `ConfigError` naming the field.

    Gone fields that did nothing, which files of older versions have, are left out.
    """
    return check_section(RunConfig, present_fields(tree)[0])


def check_section(section: type[Checked], tree: Mapping[str, Any]) -> Checked:
    """Turns a nested mapping into a checked section of any kind.

    Args:
        section: Class of the section.
        tree: Its fields, nested.

    Raises:
        ConfigError: A field is unknown or out of its range; the sentence names it.
    """
    try:
        return section.model_validate(tree)
    except ValidationError as error:
        raise ConfigError(_explain_all(error, section, tree)) from None


def field_paths(model: type[BaseModel] = RunConfig) -> dict[str, str]:
    """Returns the dotted path and the description of every field, for help texts and suggestions."""
    return dict(_fields_below(model))


def fields_of(config: RunConfig) -> dict[str, str]:
    """Returns the dotted path and the description of every field that this configuration's kinds have."""
    return dict(_fields_below(config))


def field_value(config: RunConfig, path: str) -> Any:
    """Returns the value of a field.

    Args:
        config: The configuration.
        path: Dotted path, one of `fields_of`.
    """
    value: Any = config
    for name in path.split("."):
        value = getattr(value, name)
    return value


def _fields_below(section: BaseModel | type[BaseModel], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yields path and description of every field: of a section those that it has, of a class those of every kind."""
    is_class = isinstance(section, type)
    for name, info in (section if is_class else type(section)).model_fields.items():
        if not _is_branch(info.annotation):
            yield f"{prefix}{name}", info.description or ""
            continue
        for inner in sections_in(info.annotation) if is_class else filter(None, [getattr(section, name)]):
            yield from _fields_below(inner, f"{prefix}{name}.")


def _is_branch(annotation: Any) -> bool:
    """Tells a section from a field; a list of sections is one field, set as a whole."""
    return get_origin(annotation) is not tuple and bool(sections_in(annotation))


def sections_in(annotation: Any) -> list[type[Section]]:
    """Returns the sections that an annotation admits: every kind of a family, and those of a list of sections too."""
    if isinstance(annotation, type) and issubclass(annotation, Kind):
        return list(kinds_of(annotation).values())
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return [annotation]
    found: list[type[Section]] = []
    for argument in getattr(annotation, "__args__", ()):
        found.extend(sections_in(argument))
    return found


UNITS = frozenset(
    {"m", "s", "ms", "m2", "s2", "kg", "N", "Nm", "Nms", "Ns", "J", "W", "Pa", "Hz", "deg", "rad", "mV", "nA", "nF"}
    | {"uS", "per"}
)
"""Parts of the units that end the names of fields."""
_SYMBOLS = {"Nms": "N m s", "Nm": "N m", "Ns": "N s", "m2": "m²", "s2": "s²", "uS": "µS"}


RENAMED = {"controller.let_go_s": "controller.motor_time_constant_s"}
"""Fields that go on under another name, by dotted path."""


@cache
def gone_fields() -> Mapping[str, dict[str, Any]]:
    """Returns what ``data/gone_fields.toml`` has of each field that is gone, by dotted path.

    ``now`` is what replaced it, ``idle`` the values with which it did nothing, beside None.
    """
    file = resources.files("annelid") / "data" / "gone_fields.toml"
    return parse_toml(file.read_text(encoding="utf-8"), file.name)


def present_fields(tree: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Takes from a configuration of any version the names that are gone and mean nothing more.

    Args:
        tree: The configuration; need not be checked.

    Returns:
        It with renamed fields under their present names and without gone ones that did nothing; the gone ones that
        acted, which it still has, with their values, by dotted path.
    """
    present, acted = dict(tree), dict[str, Any]()
    for path in (*RENAMED, *gone_fields()):
        *above, leaf = path.split(".")
        section = reduce(lambda part, name: part.get(name) if isinstance(part, Mapping) else None, above, tree)
        if not isinstance(section, Mapping) or leaf not in section or has_field(path, tree):
            continue
        value = section[leaf]
        if path not in RENAMED and not _did_nothing(path, value, tree):
            acted[path] = value
            continue
        section = present
        for name in above:
            section[name] = section = dict(section[name])
        del section[leaf]
        if path in RENAMED:
            section[RENAMED[path].rpartition(".")[2]] = value
    return present, acted


def _did_nothing(path: str, value: Any, tree: Mapping[str, Any]) -> bool:
    """Whether a field that is gone had a value that its worm has without it."""
    idle = gone_fields()[path]["idle"]
    body = tree.get("body")
    formulation = body.get("formulation") if isinstance(body, Mapping) else None
    formulation = formulation if isinstance(formulation, Mapping) else {}
    if path == "body.formulation.pin_inertance_kg" and formulation.get("pins") != "separate":
        return True
    if path == "arena.friction_cone":
        idle = ["pyramidal" if formulation.get("kind") == "chain" else "elliptic"]
    return value in (*idle, None, "none")


def has_field(path: str, tree: Mapping[str, Any]) -> bool:
    """Returns whether a configuration's kinds of sections have a field.

    Args:
        path: Dotted path of the field.
        tree: The configuration; need not be checked.
    """
    return path.rsplit(".", 1)[-1] in _names_beside(path, tree)


def _names_beside(path: str, tree: Mapping[str, Any]) -> dict[str, None]:
    """Names of all fields of the section of a dotted path, whose kind is the one in a configuration."""
    members: Sequence[type[BaseModel]] = [RunConfig]
    level: Any = tree
    for name in path.split(".")[:-1]:
        fields = [member.model_fields[name] for member in members if name in member.model_fields]
        level = level.get(name) if isinstance(level, Mapping) else None
        kind = level.get("kind") if isinstance(level, Mapping) else None
        members = _of_kind([section for field in fields for section in sections_in(field.annotation)], kind)
    return dict.fromkeys(name for member in members for name in member.model_fields)


def whole_path(path: str, tree: Mapping[str, Any]) -> str:
    """Completes a dotted path whose field is given without its unit.

    Args:
        path: For example ``arena.radius`` for ``arena.radius_m``.
        tree: The configuration that it belongs to, whose kinds of sections decide; need not be checked.

    Returns:
        The path of the one field that differs by a unit only, or the present one of a field that was renamed, or else
        the path as it is.

    Raises:
        ConfigError: Several fields differ by a unit only.
    """
    *sections, leaf = path.split(".")
    names = _names_beside(path, tree)
    if leaf in names:
        return path
    if path in RENAMED:
        warnings.warn(f"{path} is now {RENAMED[path]}", stacklevel=2)
        return RENAMED[path]
    start = f"{leaf}_"
    whole = [n for n in names if n.startswith(start) and UNITS.issuperset(n.removeprefix(start).split("_"))]
    if len(whole) > 1:
        raise ConfigError(f"{path} is ambiguous: name one of {', '.join('.'.join((*sections, w)) for w in whole)}")
    return ".".join((*sections, *(whole or [leaf])))


def unit_of(path: str) -> str:
    """Returns the unit that ends a field's name, as "m/s" for ``.._m_per_s``; empty where there is none."""
    words = path.rsplit(".", 1)[-1].split("_")
    start = next((i for i in range(1, len(words)) if UNITS.issuperset(words[i:])), len(words))
    above, _, below = " ".join(_SYMBOLS.get(word, word) for word in words[start:]).partition("per ")
    return f"{above.strip() or 1}/{below}" if below else above


def _kind_of(section: type[Section]) -> Any:
    return section.model_fields["kind"].default if "kind" in section.model_fields else None


def _of_kind(sections: list[type[Section]], kind: Any) -> list[type[Section]]:
    """Returns the sections of a kind, all where none is."""
    return [section for section in sections if kind is not None and _kind_of(section) == kind] or sections


_WORDS = {
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
    "literal_error": "must be one of {expected}",
    "union_tag_invalid": "must be one of {expected_tags}",
    "union_tag_not_found": "must be the name of a kind",
    "int_from_float": "must be a whole number",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "finite_number": "must be a finite number",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "tuple_type": "must be a list",
    "too_long": "has {actual_length:d} entries: must have at most {max_length:d}",
    "too_short": "must have at least {min_length:d} entries",
    "string_type": "must be a text in quotes",
    "model_type": "is a section; set one of its fields instead",
    "model_attributes_type": "is a section; set one of its fields instead",
}


VALID_VALUE = re.compile("'([^']*)'")
"""A value in the sentence that lists those that are valid."""
MOST_SENTENCE = 450
"""Characters of what is wrong with a configuration; the first thing is told in any case."""


def _explain_all(error: ValidationError, root: type[Section], tree: Any) -> str:
    """Joins what is wrong, as much of it as a sentence can hold."""
    sentences: dict[str, None] = {}
    for count, detail in enumerate(error.errors()):
        sentence = _explain(detail, root, tree)
        if sentences and sum(map(len, [*sentences, sentence])) > MOST_SENTENCE:
            return f"{'; '.join(sentences)}; and {error.error_count() - count:,} more"
        sentences[sentence] = None
    return "; ".join(sentences)


def _explain(detail: ErrorDetails, root: type[Section], tree: Any) -> str:
    parts, section = _place(detail["loc"], root, tree)
    kind, given = detail["type"], detail["input"]
    if kind == "extra_forbidden":
        unknown = str(detail["loc"][-1])
        path = ".".join([*parts, unknown])
        # What is gone from one kind may be a field of another.
        elsewhere = path.startswith("controller.") and path in field_paths()
        if path in gone_fields() and root is RunConfig and not elsewhere:
            return f"{path} is no field any more: {gone_fields()[path]['now']}; leave it out"
        return f"unknown field {shown(path)}: {_nearest_fields(unknown, parts, section, root)}"
    path = ".".join(parts)
    if kind == "missing":
        return f"{path} must be given"
    if kind == "value_error":
        message = str(detail.get("ctx", {}).get("error", detail["msg"]))
        return message if isinstance(given, dict | BaseModel) else f"{path} = {shown(given)}: {message}"
    words = _WORDS.get(kind, "").format(**detail.get("ctx", {})) or detail["msg"]
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        path = f"{path}.kind" if path else "kind"
        given = given.get("kind") if isinstance(given, Mapping) else given
    if kind in ("literal_error", "union_tag_invalid") and isinstance(given, str):
        near = nearest(given, VALID_VALUE.findall(words))
        words += f"; did you mean {near!r}?" if near is not None else ""
    return f"{path or 'the configuration'} = {shown(given)}: {words}"


def _place(loc: tuple[int | str, ...], root: type[Section], tree: Any) -> tuple[list[str], type[BaseModel]]:
    """Follows an error's location, which may name types too, through the sections.

    Returns:
        The parts of the dotted path, without a last part that is no field; the section that it leads to.
    """
    section: type[BaseModel] = root
    members: list[type[Section]] = []
    parts: list[str] = []
    for place, part in enumerate(loc):
        names = {info.alias or name: name for name, info in section.model_fields.items()}
        if part in names and not members:
            field = section.model_fields[names[str(part)]]
            tree = tree.get(part) if isinstance(tree, Mapping) else getattr(tree, str(part), None)
            members = sections_in(field.annotation)
            kind = tree.get("kind", _kind_of(members[0])) if isinstance(tree, Mapping) and members else None
            members = _of_kind(members, kind)
        elif members and part in {_kind_of(member) for member in members}:
            continue
        elif isinstance(part, int):
            tree = tree[part] if isinstance(tree, Sequence) and part < len(tree) else None
            members = _of_kind(members, tree.get("kind") if isinstance(tree, Mapping) else None)
        elif isinstance(tree, Mapping) and part in tree and place < len(loc) - 1:
            # A key of a mapping of sections.
            tree = tree[part]
        else:
            continue
        parts.append(str(part))
        if len(members) == 1:
            section, members = members[0], []
    return parts, section


def _nearest_fields(leaf: str, parts: Sequence[str], section: type[BaseModel], root: type[Section]) -> str:
    """Suggests a field for the last part of a location that names none."""
    siblings = sorted(info.alias or name for name, info in section.model_fields.items())
    by_leaf: dict[str, str] = {}
    for path in field_paths(root):
        by_leaf.setdefault(path.rsplit(".", 1)[-1], path)
    near = get_close_matches(leaf[:MOST_SHOWN], siblings, n=1, cutoff=0.6)
    near_elsewhere = get_close_matches(leaf[:MOST_SHOWN], by_leaf, n=1, cutoff=0.6)
    if leaf in by_leaf and by_leaf[leaf].split(".")[:-1] == list(parts):
        hint = "it belongs to another kind. "
    elif leaf in by_leaf or (near_elsewhere and not near):
        hint = f"did you mean {by_leaf[near_elsewhere[0]]!r}? "
    else:
        hint = f"did you mean {near[0]!r}? " if near else ""
    return f"{hint}Valid here: {listed(siblings)}"
