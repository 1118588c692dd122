"""Keys of results: digests of a configuration, of the code that computes it, and of the versions of engine and numpy.

Code counts by rooms: modules or packages right below their top package. Its comments, layout, docstrings and
descriptions of fields do not.
"""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

from annelid.config import RunConfig
from annelid.config.kinds import kinds_in

_ROOMS = "config morphology clock arena body nervous control simulation"
_BASE = "engine errors output plausibility protocols registry text textfiles"
PHYSICS = tuple(f"annelid.{room}" for room in f"{_ROOMS} {_BASE}".split())
"""The rooms that compute every run."""
READERS = ("annelid.experiment.outcome", "annelid.analysis")
"""What reads a run's outcome: where it has changed, the outcome is read again, and the run kept."""


def run_key(config: RunConfig) -> str:
    """Digest of all that a run depends on: its configuration, the code that computes it, the engine."""
    rooms = {room_of(kind) for kind in kinds_in(config)}
    text = config.model_dump_json(exclude={"summary", "published"}) + physics_fingerprint(*sorted(rooms))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def room_of(kind: type) -> str:
    """Returns the room that a class is of."""
    return ".".join(kind.__module__.split(".")[:2])


@cache
def physics_fingerprint(*further: str) -> str:
    """Digest of the code that computes runs, of further modules, and the versions of the engine and numpy."""
    code = code_fingerprint(*sorted({*PHYSICS, *further}))
    return f"{code} mujoco {version('mujoco-core')} numpy {version('numpy')}"


@cache
def code_fingerprint(*names: str) -> str:
    """Digest of modules, and of packages with all that lies in them."""
    return hashlib.sha256("\0".join(_code_in(path) for name in names for path in _files(name)).encode()).hexdigest()[
        :16
    ]


def _files(name: str) -> list[Path]:
    """The file of a module, or those of a package; none for a notebook."""
    path = Path(import_module(name).__file__ or "")
    return sorted(path.parent.rglob("*.py")) if path.name == "__init__.py" else [path] if path.is_file() else []


@cache
def _code_in(path: Path) -> str:
    tree = ast.parse(path.read_bytes())
    for node in ast.walk(tree):
        for parts in vars(node).values():
            if isinstance(parts, list):
                parts[:] = [part for part in parts if not _is_words(part)]
    return ast.unparse(tree)


def _is_words(part: Any) -> bool:
    match part:
        case ast.Expr(ast.Constant()) | ast.keyword("description"):
            return True
    return False
