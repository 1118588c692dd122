"""Digests of annelid's code and of the engine: what runs, numbers and pictures are made by."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path

import annelid

PHYSICS = ("morphology.py", "clock.py", "arena", "body", "nervous", "control", "planar", "simulation")
"""The rooms whose code a run depends on, beside its configuration."""
READERS = ("analysis", "studies/outcome.py")
"""The code that reads a run's outcome: where it has changed, the outcome is read again, and the run kept."""


@cache
def physics_fingerprint() -> str:
    """Digest of the code that computes runs, and of the versions of the engine and numpy."""
    return f"{code_fingerprint(*PHYSICS)} mujoco {version('mujoco-core')} numpy {version('numpy')}"


@cache
def code_fingerprint(*rooms: str) -> str:
    """Digest of annelid's own code in the given rooms, by default in all."""
    source = Path(annelid.__file__).parent
    digest = hashlib.sha256()
    for room in rooms or (".",):
        place = source / room
        for module in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(module.relative_to(source).as_posix().encode() + b"\0" + module.read_bytes() + b"\0")
    return digest.hexdigest()[:16]
