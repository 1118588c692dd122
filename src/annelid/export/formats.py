"""The formats that a run can be exported to: what each is called, takes and needs, and how it is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from annelid.body.assemble import mjcf_text
from annelid.config import RunConfig
from annelid.draw.render import Progress
from annelid.errors import MissingDependency, RunFileError
from annelid.export.page import write_page
from annelid.export.tables import write_csv_tables, write_matlab, write_parquet_tables
from annelid.output import with_suffix, write_text
from annelid.registry import FORMATS as GROUP
from annelid.registry import Registry
from annelid.simulation.runfile import Run, read_checkpoint
from annelid.simulation.worm import WormPlant

WINDOW = frozenset({"--from-time", "--to-time"})
SELECTION = WINDOW | {"--signals", "--every"}


@dataclass(frozen=True, slots=True)
class Format:
    """One format.

    Attributes:
        name: What it is called on the command line.
        default: What it writes in the run's folder unless a path is given; without a suffix, a folder of files.
        suffix: How the name of its files ends.
        options: Options of the selection that it takes.
        write: Writes a run to a path, calling back with steps done and in all; returns the files.
        package: What it needs that not everybody has installed, or None.
        worm: Gives the text of a worm that was not run, or None where only runs can be written.
    """

    name: str
    default: str
    suffix: str
    options: frozenset[str]
    write: Callable[[Run, Path, Progress], list[Path]]
    package: str | None = None
    worm: Callable[[RunConfig], str] | None = None

    @property
    def many(self) -> bool:
        """Whether it writes a folder of files."""
        return not Path(self.default).suffix

    def require(self) -> None:
        """Raises `MissingDependency` where what it needs is not installed."""
        if self.package is not None and find_spec(self.package) is None:
            raise MissingDependency(
                f"exporting to {self.name} needs {self.package}: install it with  pip install 'annelid[export]'"
            )

    def target(self, run: Run, output: Path | None) -> Path:
        """Returns what is written: the path that was named, or the default in the run's folder.

        Args:
            run: The run that is exported.
            output: The path, if one was named.

        Raises:
            RunFileError: The path has another suffix, or is a folder where a file is written or the reverse.
        """
        if output is None:
            return run.path.parent / self.default
        if self.many and output.suffix.lower() != self.suffix:
            if output.is_file():
                raise RunFileError(f"{output} is a file: name a folder, or one file that ends in {self.suffix}")
            return output
        return with_suffix(output, (self.suffix,), self.name, default=self.suffix)


FORMATS: Registry[Format] = Registry("format", "annelid.export", error=RunFileError, group=GROUP)
"""Every format by its name; a module in this package, or one of another package, adds its own."""


def write_mjcf(run: Run, path: Path) -> Path:
    """Writes a run's 3D worm and arena for plain MuJoCo, with the last state as a keyframe.

    The keyframe ``final`` is the last checkpoint, whole but for the frames of rods, which the engine keeps outside its
    keyframes. A run that cannot be continued has the keyframe ``last_posture`` instead: its last frame, at rest.

    Raises:
        ConfigError: The worm is planar or started with a heading, or its friction depends on the direction.
        RunFileError: The file cannot be written.
    """
    keyframes: list[dict[str, Any]] = []
    if not run.config.body.is_planar and run.config.body.own_model is None:
        plant = WormPlant(run.config)
        try:
            plant.set_state(read_checkpoint(run.path).plant)
            parts = {name: plant.anatomy.written(getattr(plant.data, name)) for name in ("qpos", "qvel")}
            parts |= {name: np.array(getattr(plant.data, name)) for name in ("act", "ctrl")}
            keyframes.append({"name": "final", "time": float(plant.data.time), **parts})
        except RunFileError:
            if run.data.sizes.get("frame"):
                posture, time_s = run.data["qpos"].values[-1], float(run.data["frame_time"].values[-1])
                keyframes.append(
                    {"name": "last_posture", "time": time_s, "qpos": posture, "act": plant.anatomy.first_act}
                )
    return write_text(path, mjcf_text(run.config, keyframes))


for _format in (
    Format("csv", "csv", ".csv", SELECTION, write_csv_tables),
    Format("mat", "run.mat", ".mat", SELECTION, lambda run, path, _: [write_matlab(run, path)]),
    Format("parquet", "parquet", ".parquet", SELECTION, write_parquet_tables, "pyarrow"),
    Format("html", "report.html", ".html", WINDOW, lambda run, path, progress: [write_page(run, path, progress)]),
    Format("mjcf", "worm.xml", ".xml", frozenset(), lambda run, path, _: [write_mjcf(run, path)], worm=mjcf_text),
):
    FORMATS.add(_format.name, _format)
