"""The formats that a run can be exported to: what each is called, takes and needs, and how it is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from annelid.draw.render import Progress, render_video
from annelid.errors import MissingDependency, RunFileError
from annelid.export.matlab import write_matlab
from annelid.export.mjcf import write_mjcf
from annelid.export.page import write_page
from annelid.export.tables import Table, about, tables_of, write_parquet, write_table
from annelid.output import with_suffix, write_json
from annelid.registry import Registry

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run

WINDOW = frozenset({"--from-time", "--to-time"})
SELECTION = WINDOW | {"--signals", "--every"}
GIF_FPS = 12.5
ABOUT = "about.json"


@dataclass(frozen=True, slots=True)
class Format:
    """One format.

    Attributes:
        name: What it is called on the command line.
        default: What it writes in the run's folder unless told otherwise; without a suffix, a folder of files.
        suffix: How the name of its files ends.
        options: Options of the selection that it takes.
        write: Writes a run to a path, calling back with steps done and in all; returns the files.
        package: What it needs that not everybody has installed, or None.
    """

    name: str
    default: str
    suffix: str
    options: frozenset[str]
    write: Callable[[Run, Path, Progress], list[Path]]
    package: str | None = None

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


FORMATS: Registry[Format] = Registry("format", "annelid.export", error=RunFileError)
"""Every format by its name; a module in this package, or one of another package, adds its own."""


def find_format(name: str) -> Format:
    """Returns the format of a name.

    Raises:
        RunFileError: There is none; the sentence suggests the nearest.
    """
    return FORMATS.find(name)


def _csv(run: Run, path: Path, progress: Progress) -> list[Path]:
    written = _tables(run, path, ".csv", write_table, progress)
    return written if path in written else [*written, write_json(path / ABOUT, about(run))]


def _parquet(run: Run, path: Path, progress: Progress) -> list[Path]:
    facts = about(run)

    def write(table: Table, file: Path, wrote: Callable[[int], None]) -> Path:
        write_parquet(table, file, facts)
        wrote(len(table[0].values))
        return file

    return _tables(run, path, ".parquet", write, progress)


def _tables(
    run: Run,
    path: Path,
    suffix: str,
    write: Callable[[Table, Path, Callable[[int], None]], Path],
    progress: Progress,
) -> list[Path]:
    """Writes every table of a run into a folder, or its only one to a file.

    Raises:
        RunFileError: The path is one file, but there are several tables; or a file cannot be written.
    """
    tables = tables_of(run)
    alone = path.suffix.lower() == suffix
    if alone and len(tables) != 1:
        raise RunFileError(
            f"{path} is one file, but these signals make {len(tables)} tables ({', '.join(tables)}): name a folder, "
            "or choose signals of the same dimensions with --signals"
        )
    total, done = sum(len(table[0].values) for table in tables.values()), 0

    def wrote(rows: int) -> None:
        nonlocal done
        done += rows
        progress(done, total)

    (path.parent if alone else path).mkdir(parents=True, exist_ok=True)
    return [write(table, path if alone else path / f"{name}{suffix}", wrote) for name, table in tables.items()]


for _format in (
    Format("csv", "csv", ".csv", SELECTION, _csv),
    Format("mat", "run.mat", ".mat", SELECTION, lambda run, path, _: [write_matlab(run, path)]),
    Format("parquet", "parquet", ".parquet", SELECTION, _parquet, "pyarrow"),
    Format("mp4", "video.mp4", ".mp4", WINDOW, lambda run, path, told: [render_video(run, path, progress=told)]),
    Format(
        "gif",
        "video.gif",
        ".gif",
        WINDOW,
        lambda run, path, told: [render_video(run, path, fps=GIF_FPS, progress=told)],
    ),
    Format("html", "report.html", ".html", WINDOW, lambda run, path, told: [write_page(run, path, told)]),
    Format("mjcf", "worm.xml", ".xml", frozenset(), lambda run, path, _: [write_mjcf(run, path)]),
):
    FORMATS.add(_format.name, _format)
