"""The runs that lie below a folder, and what each is."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from annelid.errors import ConfigError, RunFileError
from annelid.experiment.outcome import OUTCOME_NAME
from annelid.simulation.runfile import FILE_NAME, STATUSES, open_checked, read_config


@dataclass(frozen=True, slots=True)
class Kept:
    """What lies in one folder."""

    folder: Path
    preset: str | None
    """Name of the configuration; None where there is no run file, or it cannot be read."""
    duration_s: float | None
    """Simulated time that was reached."""
    size_bytes: int
    """Size of the files in the folder."""
    changed: str
    """When the newest of them was written, UTC."""
    status: str
    """How the run ended; ``outcome only`` where a study kept the numbers, ``unreadable`` for a damaged file."""


def runs_below(root: Path) -> Iterator[Kept]:
    """Yields the runs and kept outcomes in a folder and below it, in the order of their paths; follows no links."""
    if not root.is_dir():
        raise ConfigError(f"there is no folder {root}")
    for name, below, files in os.walk(root):
        # Hidden folders are attempts of studies that still go on or were killed.
        below[:] = sorted(entry for entry in below if not entry.startswith("."))
        if FILE_NAME in files or OUTCOME_NAME in files:
            yield _kept(Path(name), files)


def _kept(folder: Path, files: list[str]) -> Kept:
    preset = duration_s = None
    status = "outcome only"
    if FILE_NAME in files:
        try:
            preset = read_config(folder).name
            # Not `open_run`, which would load all of a large file.
            with open_checked(folder / FILE_NAME) as data:
                n_samples = int(data["samples_written"][()])
                duration_s = float(data["time"][n_samples - 1]) if n_samples else 0.0
                status = STATUSES[int(data["status_code"][()])]
        except RunFileError:
            status = "unreadable"
    states = [(folder / file).lstat() for file in files]
    changed = datetime.fromtimestamp(max(state.st_mtime for state in states), UTC).isoformat(timespec="seconds")
    return Kept(folder, preset, duration_s, sum(state.st_size for state in states), changed, status)
