"""What modules register by being imported, by name: annelid's own, and what other installed packages add."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pkgutil import iter_modules
from typing import Any, Generic, TypeVar

from annelid.errors import AnnelidError, ConfigError, shown, suggest

__all__ = ["COMMANDS", "FORMATS", "KINDS", "Registry", "load_extensions", "load_home"]

KINDS, COMMANDS, FORMATS = "annelid.kinds", "annelid.commands", "annelid.formats"
"""Groups of entry points: each entry names a module of another package that registers something when it is imported."""

Item = TypeVar("Item")


@cache
def load_home(home: str) -> None:
    """Imports a module or, of a package, every module in it."""
    package = import_module(home)
    for module in iter_modules(getattr(package, "__path__", ()), f"{home}."):
        import_module(module.name)


@cache
def load_extensions(group: str = KINDS) -> None:
    """Imports what installed packages name in a group; one that fails is left out with a warning."""
    for entry in entry_points(group=group):
        try:
            entry.load()
        except Exception as error:
            package = entry.dist.name if entry.dist is not None else "an installed package"
            warnings.warn(f"what {package} adds ({entry.value}) cannot be loaded: {error}", stacklevel=2)


class Registry(Generic[Item]):
    """Things of one sort by their names."""

    def __init__(self, what: str, *homes: str, error: type[AnnelidError] = ConfigError, group: str = KINDS) -> None:
        """Makes an empty registry of what is called so in messages.

        Its homes and the entry points of its group register some; they are imported on first use.
        """
        self._what, self._homes, self._error, self._group = what, homes, error, group
        self._known: dict[str, Item] = {}

    def add(self, name: str, item: Item) -> Item:
        """Registers a thing, and returns it; the same one of a module that is loaded anew takes its own place."""
        other = self._known.setdefault(name, item)
        if _origin(other) != _origin(item):
            raise ConfigError(f"{_origin(item)}: {self._what} {shown(name)} is taken by {_origin(other)}")
        self._known[name] = item
        return item

    def has(self, name: str) -> bool:
        """Returns whether a thing is registered so far, and imports nothing for it."""
        return name in self._known

    def all(self) -> dict[str, Item]:
        """Returns everything that is registered, in the order of the names."""
        for home in self._homes:
            load_home(home)
        load_extensions(self._group)
        return dict(sorted(self._known.items()))

    def find(self, name: str) -> Item:
        """Returns the thing of a name; the error where there is none suggests the nearest."""
        known = self.all()
        if name not in known:
            raise self._error(f"unknown {self._what} {shown(name)}: {suggest(name, known)}")
        return known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.all())


def _origin(item: Any) -> Any:
    """Where a class or a function was written; anything else as it is."""
    return f"{item.__module__}.{item.__qualname__}" if hasattr(item, "__qualname__") else item
