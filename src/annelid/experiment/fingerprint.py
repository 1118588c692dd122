"""Digests of annelid's code and of the engine: what runs, numbers and pictures are made by.

Only what computes counts. Comments, docstrings, the layout of the text, descriptions of a configuration's fields, lists
of public names and imports for type checkers do not. Which modules are meant is found by following their imports, so
none is forgotten.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import annelid
from annelid.lazy import offered

SOURCE = Path(annelid.__file__).parent.parent
PACKAGES = ("annelid", "annelid_studies")
"""The packages in `SOURCE` whose code is read."""
PHYSICS = tuple(
    f"annelid.{room}"
    for room in ("config", "morphology", "clock", "arena", "body", "nervous", "control", "planar", "simulation")
)
"""The code that computes runs, with all that it imports."""
READERS = ("annelid.experiment.outcome",)
"""The code that reads a run's outcome: where it has changed, the outcome is read again, and the run kept."""
_NO_RESULT = {*PACKAGES, "annelid.lazy", "annelid.simulation.progress"}
"""Modules that no number depends on: the list of public names, how they are loaded, and the progress bar."""


@cache
def physics_fingerprint() -> str:
    """Digest of the code that computes runs, and of the versions of the engine and numpy."""
    return f"{code_fingerprint(*PHYSICS)} mujoco {version('mujoco-core')} numpy {version('numpy')}"


@cache
def code_fingerprint(*roots: str) -> str:
    """Digest of modules and of all of annelid that they import, wherever the statement stands.

    Args:
        roots: Modules, or packages for all of their modules, as ``annelid.body.rods`` or ``annelid.body``; none for
            all of `PACKAGES`.
    """
    digest = hashlib.sha256()
    for name in sorted(modules_behind(*roots)):
        digest.update(f"{name}\0{_code_of_module(name)}\0".encode())
    return digest.hexdigest()[:16]


@cache
def foreign_code(kind: type) -> str:
    """Returns what the module of another package's kind does, empty for one of annelid's own."""
    if kind.__module__.split(".")[0] in PACKAGES:
        return ""
    return code_of(ast.parse(Path(inspect.getfile(kind)).read_bytes()))


def modules_behind(*roots: str) -> set[str]:
    """Names of the modules that `code_fingerprint` reads."""
    missing = [name for root in roots or PACKAGES for name in _within(root)]
    found = set[str]()
    while missing:
        name = missing.pop()
        if name not in found | _NO_RESULT:
            found.add(name)
            missing += _imported(name)
    return found


def code_of(node: ast.AST) -> str:
    """Writes down what a piece of code does, the same whatever the layout of its text and the version of Python."""
    parts = [type(node).__name__]
    for field in node._fields:
        value = getattr(node, field, None)
        if isinstance(value, ast.expr_context):
            continue
        if isinstance(value, list):
            # Newer versions of Python have further lists, which are empty here.
            if items := [code_of(one) if isinstance(one, ast.AST) else repr(one) for one in _counted(value, node)]:
                parts.append(f"{field}=[{','.join(items)}]")
        elif isinstance(value, ast.AST):
            parts.append(f"{field}={code_of(value)}")
        elif value is not None:
            parts.append(f"{field}={value!r}")
    return f"({' '.join(parts)})"


def _counted(parts: Iterable[Any], of: ast.AST) -> Iterator[Any]:
    """Those parts of some code that something depends on."""
    for part in parts:
        match part, of:
            case (
                (ast.Expr(ast.Constant()), _)
                | (ast.keyword("description"), ast.Call(ast.Name("Field")))
                | (ast.Assign([ast.Name("__all__")]), ast.Module())
            ):
                pass
            case ast.If(ast.Name("TYPE_CHECKING")), _:
                yield from _counted(part.orelse, part)
            case _:
                yield part


@cache
def _code_of_module(name: str) -> str:
    return code_of(_parsed(name))


@cache
def _parsed(name: str) -> ast.Module:
    return ast.parse(_path(name).read_bytes())


def _path(name: str) -> Path:
    place = SOURCE.joinpath(*name.split("."))
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")


def _within(root: str) -> Iterator[str]:
    place = SOURCE.joinpath(*root.split("."))
    for path in place.rglob("*.py") if place.is_dir() else [_path(root)]:
        yield ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix("__init__").removesuffix(".")


@cache
def _imported(name: str) -> frozenset[str]:
    """Names of annelid's modules that a module imports, and of the packages that they lie in."""
    found = set[str]()
    for statement in _statements(_parsed(name)):
        if not isinstance(statement, ast.Import | ast.ImportFrom):
            continue
        for alias in statement.names:
            named = isinstance(statement, ast.Import)
            parts = (alias.name if named else _home(statement.module or "", alias.name)).split(".")
            for end in range(1, len(parts) + 1) if parts[0] in PACKAGES else ():
                if _path(inner := ".".join(parts[:end])).exists():
                    found.add(inner)
    return frozenset(found)


def _home(module: str, name: str) -> str:
    """Full name of what a statement imports, also where a package loads it from another module on first use."""
    if module.split(".")[0] in PACKAGES and SOURCE.joinpath(*module.split(".")).is_dir():
        home = offered(_parsed(module)).get(name)
        if home not in (None, module):
            return _home(home, name)
    return f"{module}.{name}"


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    for field in ("body", "orelse", "handlers", "finalbody", "cases"):
        for statement in _counted(getattr(node, field, ()), node):
            yield statement
            yield from _statements(statement)
