"""An export format: the last length of every ring, one a line."""

from __future__ import annotations

from pathlib import Path

from annelid import Run
from annelid.export import FORMATS, Format, Progress


def text(run: Run, path: Path, progress: Progress) -> list[Path]:
    """Writes the lengths, m."""
    path.write_text("\n".join(f"{length:.6f}" for length in run.data["ring_length"].values[-1]) + "\n")
    return [path]


FORMATS.add("txt", Format("txt", "rings.txt", ".txt", frozenset(), text))
