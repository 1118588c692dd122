"""Packages whose public names are loaded on first use, so that importing one loads nothing heavy.

Such a package names what it offers once, as imports for type checkers, and in ``__all__``::

    if TYPE_CHECKING:
        from annelid.body.worm import WormBody

    __all__ = ["WormBody"]
    __getattr__, __dir__ = lazy(__name__)
"""

from __future__ import annotations

import sys
from functools import cache
from importlib import import_module

# typing takes longer to load than all else here.
TYPE_CHECKING = False
if TYPE_CHECKING:
    import ast
    from collections.abc import Callable, Mapping
    from typing import Any


def lazy(
    package: str, gone: Mapping[str, str] | None = None, now: tuple[str, ...] = ()
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Returns the ``__getattr__`` and ``__dir__`` of a package, which load its public names on first use.

    Args:
        package: The package's ``__name__``.
        gone: Names that it had, and what to do instead.
        now: Names of the packages that have what it had, as `moved` takes them.
    """

    @cache
    def homes() -> dict[str, str]:
        import ast
        from pathlib import Path

        file = sys.modules[package].__file__
        assert file is not None
        return offered(ast.parse(Path(file).read_bytes()))

    def get(name: str) -> Any:
        if gone and name in gone:
            # ``from package import name`` would replace the words of an AttributeError.
            raise ImportError(f"{package}.{name} has been removed: {gone[name]}")
        if name not in sys.modules[package].__all__:
            return moved(package, *now)(name)
        return getattr(import_module(homes()[name]), name)

    return get, lambda: sorted(sys.modules[package].__all__)


def moved(package: str, *now: str) -> Callable[[str], Any]:
    """Returns the ``__getattr__`` of a package for names that lie elsewhere now: found with a warning, for one release.

    Args:
        package: The package's ``__name__``.
        now: Names of the packages that have them.
    """

    def get(name: str) -> Any:
        import warnings
        from importlib.util import find_spec

        # Python asks here, too, before it imports a module of the package itself; a module has none.
        is_package = not name.startswith("_") and hasattr(sys.modules[package], "__path__")
        is_own = name.startswith("_") or (is_package and find_spec(f"{package}.{name}") is not None)
        for home in () if is_own else now:
            if (found := getattr(import_module(home), name, None)) is not None:
                warnings.warn(f"{package}.{name} is now {home}.{name}", DeprecationWarning, stacklevel=2)
                return found
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return get


def offered(package: ast.Module) -> dict[str, str]:
    """Returns the module of every name that a package's file imports, also where only type checkers read it."""
    import ast

    return {
        alias.name: node.module
        for node in ast.walk(package)
        if isinstance(node, ast.ImportFrom) and node.module is not None
        for alias in node.names
    }
