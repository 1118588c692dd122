"""Reading presets, arenas, TOML files and overrides into a checked configuration."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib import resources
from importlib.resources.abc import Traversable
from os.path import isfile
from pathlib import Path
from textwrap import indent
from typing import Any

from annelid.config.checking import check_config, field_value, present_fields, whole_path
from annelid.config.fidelity import HOME, RESOLUTION, find_level
from annelid.config.kinds import kind_of_file
from annelid.config.run import SHARED, ArenaKind, BodyKind, RunConfig
from annelid.errors import ConfigError, UnreadableText, listed, shown, suggest
from annelid.registry import load_extensions
from annelid.textfiles import MOST_LEVELS, check_depth, parse_toml, read_text, read_toml

DEFAULT_BASE = "riddle2023-rods"
"""What a user's file starts from unless it says otherwise or states its own kind of body."""

_FOREIGN = {
    ".urdf": "; load URDF in MuJoCo and save it as MJCF",
    ".nml": "; write a network of NeuroML as TOML (annelid export-network PRESET --to toml shows the form)",
}
"""What to do with files of other programs, by their ends."""
_packages = ["annelid"]
"""Packages that have presets and arenas."""


def add_presets(package: str) -> None:
    """Adds the presets and arenas of a package, the TOML files of its folders ``presets`` and ``arenas``.

    Args:
        package: Its name. The module of its entry point `annelid.registry.KINDS` calls this.
    """
    _packages.append(package)


def preset_names() -> list[str]:
    """Returns the names of the presets of annelid and of other installed packages."""
    return sorted(_files("presets"))


def preset_text(source: str | Path) -> str:
    """Returns a preset as its file has it, each field with its source, and behind it as comments all that it extends.

    Args:
        source: Name of a preset, or path of a TOML file.

    Returns:
        The text, which loads as the preset does.

    Raises:
        ConfigError: As `load_config`.
    """
    load_config(source)
    (_, text, _), *bases = reversed(_layers(source))
    return "".join([text, *(f"\n# {name}, which it extends:\n\n{indent(base, '# ', bool)}" for name, base, _ in bases)])


def arena_names() -> list[str]:
    """Returns the names of the arenas of annelid and of other installed packages."""
    return sorted(_files("arenas"))


def arena_text(name: str) -> str:
    """Returns the commented TOML of an arena: a line about it, and its table ``[arena]``.

    Raises:
        ConfigError: No arena has that name; the sentence suggests the nearest.
    """
    return _text("arenas", "arena", name)


def arena_summary(name: str) -> str:
    """Returns an arena's line about it.

    Raises:
        ConfigError: No arena has that name; the sentence suggests the nearest.
    """
    return str(parse_toml(arena_text(name), name)["summary"])


def _files(folder: str) -> dict[str, Traversable]:
    """Returns the TOML files in a folder of every package by their names without the suffix; the first of a name."""
    load_extensions()
    folders = [found for package in _packages if (found := resources.files(package) / folder).is_dir()]
    entries = [entry for found in reversed(folders) for entry in found.iterdir()]
    return {entry.name.removesuffix(".toml"): entry for entry in entries if entry.name.endswith(".toml")}


def _text(folder: str, what: str, name: str) -> str:
    files = _files(folder)
    if name not in files and Path(name).suffix and isfile(name):
        remedy = _FOREIGN.get(Path(name).suffix.lower(), "")
        raise ConfigError(
            f"{name} is no configuration: a file ends in .toml, a robot or a scene as MJCF in .xml{remedy}"
        )
    if name not in files:
        raise ConfigError(f"unknown {what} {shown(name)}: {suggest(name, files)}")
    return files[name].read_text(encoding="utf-8")


def load_config(
    source: str | Path | Mapping[str, Any],
    overrides: Mapping[str, Any] | None = None,
    *,
    fidelity: str | None = None,
    arena: str | Path | None = None,
) -> RunConfig:
    """Loads a preset, a TOML file or a mapping, applies overrides, and checks all of it.

    Args:
        source: Name of a preset, path of a TOML file or of a robot as MJCF (``.toml``, ``.xml``), or nested mapping.
            A file or mapping may name a preset or another file to start from with ``extends``; a file that
            neither does so nor states ``body.kind`` starts from ``riddle2023-rods``.
        overrides: Values by dotted path, for example ``{"body.mesh.n_segments": 4}``; whole sections too. The
            unit at the end of a field's name may be left out (``arena.radius``). A section whose ``kind`` changes
            keeps nothing of what it had before.
        fidelity: How finely a 3D worm of rods is resolved: a level of `annelid.config.LEVELS`; lies over what the
            source says and under the overrides. None leaves the source as it is.
        arena: Where the worm is put instead: a name of `arena_names`, a TOML file with a table ``[arena]``, or a scene
            as MJCF (``.xml``); lies under the overrides. Friction, gravity and contacts stay the source's where the
            arena does not state them.

    Returns:
        The checked configuration.

    Raises:
        ConfigError: Unknown preset, arena, level or field, unreadable file, or a value out of its range.
    """
    tree = _read_tree(source)
    if arena is not None:
        tree = {**tree, "arena": _arena_instead(tree.get("arena"), arena)}
    if fidelity is not None:
        level = find_level(fidelity)
        check_config(_overridden(tree, overrides or {})).body.refuse_fidelity(fidelity)
        home = check_config(_read_tree(HOME))
        tree = _overridden(tree, {path: field_value(home, path) for path in RESOLUTION} | dict(level.changes))
    return check_config(_overridden(tree, overrides or {}))


def as_config(source: RunConfig | str | Path | Mapping[str, Any]) -> RunConfig:
    """Returns a configuration as it is, and loads anything else by `load_config`.

    Raises:
        ConfigError: It is none of these, or as `load_config`.
    """
    if isinstance(source, RunConfig):
        return source
    if not isinstance(source, str | Path | Mapping):
        raise ConfigError(
            f"{shown(source)} is no configuration: give a RunConfig, the name of a preset, a TOML file or a mapping"
        )
    return load_config(source)


def parse_assignments(assignments: Iterable[str]) -> dict[str, Any]:
    """Parses ``field=value`` strings; values are read as TOML, and as plain text where they are none.

    Raises:
        ConfigError: A string has no ``=`` or no field before it.
    """
    parsed: dict[str, Any] = {}
    for assignment in assignments:
        path, equals, text = assignment.partition("=")
        path = path.strip()
        if not equals or not path or not all(path.split(".")):
            raise ConfigError(f"{shown(assignment)} is not of the form field=value, for example arena.friction=0.3")
        parsed[path] = _parse_value(text.strip())
    return parsed


def _arena_instead(present: Any, name: str | Path) -> dict[str, Any]:
    """Returns the table of another arena, with the fields of every arena from the present one where it has none."""
    reader = kind_of_file(ArenaKind, name)
    if reader is not None:
        stated = reader.from_file(Path(name)).get("arena")
    elif str(name).endswith(".toml"):
        stated = read_toml(Path(name)).get("arena")
    else:
        stated = parse_toml(arena_text(str(name)), str(name)).get("arena")
    if not isinstance(stated, Mapping):
        raise ConfigError(f"{name} describes no arena: it must have a table [arena]")
    shared = present if isinstance(present, Mapping) else {}
    return {field: shared[field] for field in SHARED if field in shared} | dict(stated)


def _overridden(tree: dict[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Lays values given by dotted path over a tree."""
    for path, value in sorted(overrides.items(), key=_kinds_first):
        nested: Any = value
        path = whole_path(path, tree)
        for key in reversed(path.split(".")):
            nested = {key: nested}
        tree = _merge(tree, nested)
    return tree


def _parse_value(text: str) -> Any:
    try:
        tree = parse_toml(f"value = {text}", "the value")
    except UnreadableText:
        return text
    # A text of several lines may state more than the value.
    return tree["value"] if len(tree) == 1 else text


def _read_tree(source: str | Path | Mapping[str, Any]) -> dict[str, Any]:
    """Merges what a source states over what it extends, renamed fields under their present names."""
    tree: dict[str, Any] = {}
    for *_, own in _layers(source):
        tree, _ = present_fields(_merge(tree, own))
    return tree


def _layers(
    source: str | Path | Mapping[str, Any], above: tuple[Path, ...] = ()
) -> list[tuple[str, str, Mapping[str, Any]]]:
    """Returns name, text and fields of a source and of each that it extends, the outermost first."""
    default, folder = None, None
    if isinstance(source, Mapping):
        check_depth(source, "the configuration")
        name, text, own = "", "", dict(source)
    elif (reader := kind_of_file(BodyKind, source)) is not None:
        path = Path(source)
        return [(path.name, "", {"name": path.stem, **reader.from_file(path)})]
    elif isinstance(source, Path) or str(source).endswith(".toml"):
        path = Path(source)
        folder = path.parent
        # Without line breaks, so that it stands in a comment.
        name, text = shown(path.name), read_text(path, "the configuration file")
        own = parse_toml(text, str(path))
        own.setdefault("name", path.stem)
        if path.resolve() in above:
            raise ConfigError(f"{path} extends itself: {listed(each.name for each in (*above, path))}")
        if len(above) >= MOST_LEVELS:
            raise ConfigError(
                f"{path} is extended through {len(above)} files: at most {MOST_LEVELS} may extend another"
            )
        above = (*above, path.resolve())
        body = own.get("body")
        stands_alone = isinstance(body, Mapping) and "kind" in body
        default = None if stands_alone else DEFAULT_BASE
    else:
        name, text = str(source), _text("presets", "preset", str(source))
        own = parse_toml(text, name)
    base = own.pop("extends", default)
    if base is None:
        return [(name, text, own)]
    if not isinstance(base, str):
        raise ConfigError(f"extends = {shown(base)}: must be the name of a preset or of a TOML or MJCF file")
    return [*_layers(base if folder is None else seen_from(folder, base), above), (name, text, own)]


def seen_from(folder: Path, source: str) -> str:
    """Returns a preset's name as it is, and the path of a file as it is seen from a folder."""
    is_file = source.endswith(".toml") or kind_of_file(BodyKind, source) is not None
    return str(folder / source) if is_file else source


def _kinds_first(override: tuple[str, Any]) -> float:
    """Orders overrides: those of a kind, outer ones first, would drop others of their section if they came later."""
    path, _ = override
    return path.count(".") if path.split(".")[-1] == "kind" else float("inf")


def _merge(base: dict[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """Lays ``change`` over ``base``; a table whose ``kind`` changes starts from that kind's own defaults."""
    if "kind" in change and change["kind"] != base.get("kind"):
        base = {}
    merged = dict(base)
    for key, value in change.items():
        if isinstance(value, Mapping):
            below = merged.get(key)
            merged[key] = _merge(dict(below) if isinstance(below, Mapping) else {}, value)
        else:
            merged[key] = value
    return merged
