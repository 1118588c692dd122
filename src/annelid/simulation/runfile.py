"""The run file: its fixed names, and opening one into a `Run`."""

from __future__ import annotations

import errno
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from annelid.config import RunConfig
from annelid.errors import ConfigError, RunFileError
from annelid.simulation.checkpoint import Checkpoint, newest_payload

if TYPE_CHECKING:
    import xarray

FILE_NAME = "run.nc"
MESSAGE_BYTES = 512
SLOTS = ("checkpoint/slot_0", "checkpoint/slot_1")
STATUSES = (
    "running_or_killed",
    "complete",
    "interrupted",
    "stopped_by_guard",
    "disk_failure",
    "failed",
)
"""How a run ended, in the order of the file's ``status_code``; ``failed``: its plant or controller raised."""

_BOOKKEEPING = ("samples_written", "frames_written", "status_code", "status_message")


@dataclass(frozen=True, repr=False)
class Run:
    """A run as its file holds it.

    Attributes:
        path: The run file.
        data: Its variables, loaded, cut to the samples and frames that were written.
        config: The configuration it was made with.
        status: How it ended, one of `STATUSES`.
        message: Why it ended before its time; empty if it did not.
    """

    path: Path
    data: xarray.Dataset
    config: RunConfig
    status: str
    message: str

    def __repr__(self) -> str:
        time = self.data["time"].values
        reached = f"{float(time[-1]):g} s" if time.size else "nothing"
        return f"<Run {str(self.path)!r}: {self.config.name}, {self.status}, {reached}>"

    @property
    def start_s(self) -> float:
        """Simulated time at which this run started, s: 0 unless it continues another."""
        return float(self.data.attrs.get("resumed_at_s", 0.0))

    @property
    def wall_time_s(self) -> float:
        """Wall-clock time from the start of the run to its last sample, s; 0 without samples."""
        wall = self.data["wall_time"].values
        return float(wall[-1]) if wall.size else 0.0

    @property
    def real_time_factor(self) -> float:
        """Simulated time over wall-clock time; NaN for a run that did not get beyond its start."""
        wall_s = self.wall_time_s
        time = self.data["time"].values
        simulated_s = float(time[-1]) - self.start_s if time.size else 0.0
        return simulated_s / wall_s if simulated_s > 0 and wall_s > 0 else float("nan")


def open_run(path: str | Path) -> Run:
    """Opens a run, also one that was killed or is still going on.

    Args:
        path: The run's folder or its file.

    Returns:
        The run with its data in memory, cut to what was written.

    Raises:
        RunFileError: There is no such file, it is no annelid run, or it is truncated or damaged.
    """
    import xarray

    file = _checked_file(path)
    try:
        with xarray.open_dataset(file, engine="h5netcdf") as dataset:
            marks = dataset[list(_BOOKKEEPING)].load()
            n_samples = _count(marks, "samples_written", dataset.sizes["time"])
            n_frames = _count(marks, "frames_written", dataset.sizes["frame"])
            status = STATUSES[_count(marks, "status_code", len(STATUSES) - 1)]
            message = str(marks["status_message"].values)
            data = dataset.drop_vars(list(_BOOKKEEPING)).isel(time=slice(n_samples), frame=slice(n_frames)).load()
    # What a damaged file raises depends on where the damage is.
    except Exception as error:
        raise RunFileError(f"{file} is damaged: {_first_line(error)}") from None
    return Run(file, data, _config(file, data.attrs), status, message)


def read_config(path: str | Path) -> RunConfig:
    """Reads the configuration of a run.

    Raises:
        RunFileError: As `open_run`.
    """
    import h5py

    file = _checked_file(path)
    try:
        with h5py.File(file, "r") as content:
            attrs = dict(content.attrs)
    except Exception as error:
        raise RunFileError(f"{file} is damaged: {_first_line(error)}") from None
    return _config(file, attrs)


def read_checkpoint(path: str | Path) -> Checkpoint:
    """Reads the last checkpoint of a run.

    Raises:
        RunFileError: As `open_run`, or the run has no checkpoint.
    """
    import h5py

    file = _checked_file(path)
    try:
        with h5py.File(file, "r") as content:
            slots = [content[name][()].tobytes() for name in SLOTS if name in content]  # type: ignore[index]
        payload = newest_payload(slots)
        checkpoint = None if payload is None else Checkpoint.from_bytes(payload)
    except Exception as error:
        raise RunFileError(f"{file} is damaged: {_first_line(error)}") from None
    if checkpoint is None:
        reason = "it was killed before the first" if slots else "its plant or controller cannot be saved"
        raise RunFileError(f"{file} holds no checkpoint to continue from: {reason}")
    return checkpoint


def refuse_used_folder(out: Path, overwrite: bool) -> None:
    """Checks that a run may go into a folder.

    Raises:
        ConfigError: It is a file, or it holds something and ``overwrite`` is false.
        RunFileError: It cannot be read.
    """
    try:
        if out.exists() and not out.is_dir():
            raise ConfigError(f"the output folder {out} is a file: name a folder")
        # A draft is left where a process was killed while it laid out its file.
        if out.is_dir() and not overwrite and any(entry.name != f".{FILE_NAME}.part" for entry in out.iterdir()):
            raise ConfigError(f"the output folder {out} is not empty: name another, or allow overwriting")
    except OSError as error:
        raise RunFileError(f"cannot use the output folder {out}: {error.strerror}") from None


def _checked_file(path: str | Path) -> Path:
    """Returns the run file behind a path, once it is clear that it is one and whole."""
    import h5py

    path = Path(path)
    file = path / FILE_NAME if path.is_dir() else path
    size = 0
    try:
        with open(file, "rb") as handle:
            size = os.fstat(handle.fileno()).st_size
        if size == 0:
            raise RunFileError(f"{file} is empty")
        if not h5py.is_hdf5(file):
            raise RunFileError(f"{file} is not an annelid run: it is not a netCDF-4 file")
        with h5py.File(file, "r") as content:
            ours = "config" in content.attrs and "annelid_version" in content.attrs
            missing = [name for name in _BOOKKEEPING if name not in content]
    except OSError as error:
        if isinstance(error, FileNotFoundError) or error.errno in (errno.ENOENT, errno.ENOTDIR):
            hint = f": {path} holds no {FILE_NAME}" if path.is_dir() else ""
            raise RunFileError(f"there is no run file {file}{hint}") from None
        if "truncated" in str(error):
            raise RunFileError(f"{file} is truncated: only {size} bytes of it are left") from None
        if error.strerror:
            raise RunFileError(f"cannot open {file}: {error.strerror}") from None
        raise RunFileError(f"{file} is truncated or damaged: {_first_line(error)}") from None
    except RunFileError:
        raise
    except Exception as error:
        raise RunFileError(f"{file} is damaged: {_first_line(error)}") from None
    if not ours or missing:
        raise RunFileError(f"{file} is not an annelid run: another program wrote it")
    return file


def _count(marks: xarray.Dataset, name: str, most: int) -> int:
    value = int(marks[name])
    if not 0 <= value <= most:
        raise ValueError(f"{name} is {value}, not in 0 .. {most}")
    return value


def _config(file: Path, attrs: dict[Any, Any]) -> RunConfig:
    try:
        return RunConfig.model_validate_json(attrs["config"])
    except ValidationError as error:
        if error.errors()[0]["type"] == "json_invalid":
            raise RunFileError(f"{file} is damaged: its configuration is not readable") from None
        raise RunFileError(
            f"{file} was written by annelid {attrs['annelid_version']}, whose configuration this version "
            "does not understand"
        ) from None


def _first_line(error: Exception) -> str:
    return (str(error) or type(error).__name__).splitlines()[0]
