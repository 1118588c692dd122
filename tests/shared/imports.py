"""What a module imports, read from its text."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path


def executed(node: ast.AST) -> Iterator[ast.AST]:
    """All parts of a module that run some time, so not what stands there for type checkers only."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.If) and isinstance(part.test, ast.Name) and part.test.id == "TYPE_CHECKING":
            continue
        yield part
        yield from executed(part)


def imported(module: Path) -> set[str]:
    """Full names of all that a module imports, wherever the statement stands; what only types need does not count."""
    names: set[str] = set()
    for node in executed(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            base = node.module or ""
            names |= {f"{base}.{alias.name}" if base == "annelid" else base for alias in node.names}
    return names
