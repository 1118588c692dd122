"""Reading presets, TOML files and overrides into a checked configuration."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from annelid.config.checking import check_config
from annelid.config.models import RunConfig
from annelid.errors import ConfigError, suggest


def preset_names() -> list[str]:
    """Returns the names of the presets that come with annelid."""
    folder = resources.files("annelid") / "presets"
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def preset_text(name: str) -> str:
    """Returns the commented TOML of a preset.

    Raises:
        ConfigError: No preset has that name; the sentence suggests the nearest.
    """
    if name not in preset_names():
        raise ConfigError(f"unknown preset {name!r}: {suggest(name, preset_names())}")
    return (resources.files("annelid") / "presets" / f"{name}.toml").read_text(encoding="utf-8")


def load_config(source: str | Path | Mapping[str, Any], overrides: Mapping[str, Any] | None = None) -> RunConfig:
    """Loads a preset, a TOML file or a mapping, applies overrides, and checks all of it.

    Args:
        source: Name of a preset, path of a TOML file (recognised by its suffix ``.toml``), or nested mapping.
            A file or mapping may name a preset to start from with ``extends``.
        overrides: Values by dotted path, for example ``{"body.mesh.n_segments": 4}``.

    Returns:
        The checked configuration.

    Raises:
        ConfigError: Unknown preset or field, unreadable file, or a value out of its range.
    """
    tree = _read_tree(source)
    for path, value in (overrides or {}).items():
        nested: Any = value
        for key in reversed(path.split(".")):
            nested = {key: nested}
        tree = _merge(tree, nested)
    return check_config(tree)


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
            raise ConfigError(f"{assignment!r} is not of the form field=value, for example arena.friction=0.3")
        parsed[path] = _parse_value(text.strip())
    return parsed


def _parse_value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _read_tree(source: str | Path | Mapping[str, Any]) -> dict[str, Any]:
    if isinstance(source, Mapping):
        own = dict(source)
    elif isinstance(source, Path) or str(source).endswith(".toml"):
        path = Path(source)
        try:
            own = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise ConfigError(f"cannot read the configuration file {path}: {error.strerror}") from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ConfigError(f"{path} is not valid TOML: {error}") from None
        own.setdefault("name", path.stem)
    else:
        own = tomllib.loads(preset_text(str(source)))
    base = own.pop("extends", None)
    return own if base is None else _merge(_read_tree(base), own)


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
