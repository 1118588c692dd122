"""Figures of runs, and of what many runs add up to."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from annelid.errors import RunFileError
from annelid.registry import Registry

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run

RUN_FIGURES: Registry[Callable[[Run, Path], Path]] = Registry(
    "figure", "annelid.draw.figures", "annelid.draw.plots", error=RunFileError
)
"""What `annelid draw` draws of one run to a path, by its name."""
