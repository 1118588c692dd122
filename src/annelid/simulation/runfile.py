"""The run file: its fixed names, opening one into a `Run`, and continuing it."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from annelid.config import RunConfig
from annelid.config.checking import gone_fields, present_fields
from annelid.errors import ConfigError, RunFileError, UnreadableText
from annelid.registry import Registry
from annelid.simulation import digest
from annelid.simulation.checkpoint import Checkpoint, newest_payload
from annelid.simulation.lock import LOCK_NAME
from annelid.textfiles import parse_json

if TYPE_CHECKING:
    import h5py
    import xarray

FILE_NAME = "run.nc"
MESSAGE_BYTES = 512
WARNINGS = "warnings"
WARNING_BYTES = 8192
SCHEMA = "schema_version"
SCHEMA_VERSION = 7
"""Of the file's names and their meanings; a change that an older reader would take for something else raises it, and
`migrated` brings older files up to it. Files of annelid 0.1 say none, which counts as 0."""
CHECKED_ON_OPENING_BYTES = 64_000_000
"""Files up to this size are compared with their digests whenever they are opened; larger ones by `verify_run` only."""
ACTED = "gone_fields"
"""Attribute that `migrated` gives files of older versions: the gone fields that acted, by name."""
SLOTS = ("checkpoint/slot_0", "checkpoint/slot_1")
STATUSES = ("running_or_killed", "complete", "interrupted", "stopped_by_guard", "disk_failure", "failed")
"""How a run ended, in the order of the file's ``status_code``; ``failed``: its plant or controller raised."""

CPU_TIME = "cpu_time"
_BOOKKEEPING = ("samples_written", "frames_written", "status_code", "status_message")


@dataclass(frozen=True, repr=False)
class Run:
    """A run as its file has it.

    Attributes:
        path: The run file.
        data: Its variables, loaded, cut to the samples and frames that were written.
        config: The configuration it was made with.
        status: How it ended, one of `STATUSES`.
        message: Why it ended before its time; empty if it did not.
        warnings: What is doubtful about it, a sentence each.
        cpu_time_s: Processor time that its process spent on it, s; 0 for a run that was killed or is still going on.
    """

    path: Path
    data: xarray.Dataset
    config: RunConfig
    status: str
    message: str
    warnings: tuple[str, ...] = ()
    cpu_time_s: float = 0.0

    def __repr__(self) -> str:
        time = self.data["time"].values
        reached = f"{float(time[-1]):g} s" if time.size else "nothing"
        return f"<Run {str(self.path)!r}: {self.config.name}, {self.status}, {reached}>"

    def _repr_html_(self) -> str:
        return VIEWS.find("html")(self)

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


VIEWS: Registry[Callable[[Run], str]] = Registry("view of a run", "annelid.draw.notebook")
"""What shows a run in a notebook; it is loaded on first use, so that a simulation needs no matplotlib."""


def open_run(path: str | Path) -> Run:
    """Opens a run, also one that was killed or is still going on.

    Args:
        path: The run's folder or its file.

    Returns:
        The run with its data in memory, cut to what was written.

    Raises:
        RunFileError: There is no such file, it is no annelid run, or it is truncated or damaged.
    """
    file = examined_file(path)[0]
    with present_data(file) as dataset:
        marks = dataset[[*_BOOKKEEPING, WARNINGS, CPU_TIME]].load()
        n_samples = _count(marks, "samples_written", dataset.sizes["time"])
        n_frames = _count(marks, "frames_written", dataset.sizes["frame"])
        status = STATUSES[_count(marks, "status_code", len(STATUSES) - 1)]
        kept = dataset.drop_vars([*marks.data_vars])
        for name, variable in kept.variables.items():
            # Labels of a dimension may be words.
            if variable.dtype.kind not in "fiu" and variable.dims != (name,):
                raise ValueError(f"{name!r} holds no numbers")
            if variable.dims[:1] not in (("time",), ("frame",), (name,)) and name != "stretch_rest_length":
                raise ValueError(f"{name!r} is along {variable.dims}, not along time or frame")
        data = kept.isel(time=slice(n_samples), frame=slice(n_frames)).load()
        message = str(marks["status_message"].values)
        doubts = tuple(str(marks[WARNINGS].values).splitlines())
        cpu_time_s = float(marks[CPU_TIME])
    return Run(file, data, config_in(file, data.attrs), status, message, doubts, cpu_time_s)


def migrated(data: xarray.Dataset) -> xarray.Dataset:
    """Returns all variables and attributes of a run file of any schema up to the present one in the present one.

    Files of schema 0, those of annelid 0.1, have neither warnings nor processor time. Their configuration is valid as
    it is: fields that are newer default to what 0.1 did, guards excepted. Signals that 0.1 did not record stay absent.
    Those up to schema 1 name no published numbers. Where a field acted that is gone
    (`annelid.config.checking.gone_fields`), the run says so among its warnings, and is not continued.
    """
    if data.attrs.get(SCHEMA, 0) < 1:
        added = {WARNINGS: ((), ""), CPU_TIME: ((), 0.0)}
        data = data.assign({name: value for name, value in added.items() if name not in data})
    return _without_gone_fields(data).assign_attrs({SCHEMA: SCHEMA_VERSION})


def _without_gone_fields(data: xarray.Dataset) -> xarray.Dataset:
    try:
        tree, acted = present_fields(parse_json(data.attrs["config"], "the configuration"))
        for path in acted:
            *above, leaf = path.split(".")
            del reduce(getitem, above, tree)[leaf]
        if tree["body"].get("strands", {}).get("damping_time_s", 0.0) is None:
            del tree["body"]["strands"]["damping_time_s"]
    except (UnreadableText, KeyError, TypeError, ValueError, AttributeError):
        return data  # What is wrong with it, its reader says.
    if acted:
        told = (
            f"{path} was {value}, a field that is gone ({gone_fields()[path]['now']}): its command does not repeat it"
            for path, value in sorted(acted.items())
        )
        data = data.assign({WARNINGS: ((), "\n".join(filter(None, (str(data[WARNINGS].values), *told))))})
        data = data.assign_attrs({ACTED: ", ".join(sorted(acted))})
    return data.assign_attrs(config=json.dumps(tree))


@contextmanager
def _reading(file: Path) -> Iterator[None]:
    """Makes one error of all that reading a file may raise, which depends on where its damage is."""
    try:
        yield
    except RunFileError:
        raise
    except Exception as error:
        reason = (str(error) or type(error).__name__).splitlines()[0]
        if isinstance(error, FileNotFoundError | NotADirectoryError):
            within = sorted(
                found.parent for depth in ("*", "*/*") for found in file.parent.glob(f"{depth}/{FILE_NAME}")
            )
            held = (
                f"{len(within)} run{'s' * (len(within) > 1)}: name one of them, as {within[0]}"
                if within
                else f"no {FILE_NAME}"
            )
            hint = f": {file.parent} holds {held}" if file.parent.is_dir() else ""
            sentence = f"there is no run file {file}{hint}"
        elif not isinstance(error, OSError):
            sentence = f"{file} is damaged: {reason}"
        elif "truncated" in reason:
            sentence = f"{file} is truncated: only {file.stat().st_size} bytes of it are left"
        elif error.strerror:
            sentence = f"cannot open {file}: {error.strerror}"
        else:
            sentence = f"{file} is truncated or damaged: {reason}"
        raise RunFileError(sentence) from None


@contextmanager
def present_data(file: Path) -> Iterator[xarray.Dataset]:
    """Opens a checked run file in the present schema."""
    import xarray

    with _reading(file), xarray.open_dataset(file, engine="h5netcdf") as dataset:
        yield migrated(dataset)


def read_config(path: str | Path) -> RunConfig:
    """Reads the configuration of a run, from its folder or its file; raises as `open_run`."""
    file = examined_file(path)[0]
    with present_data(file) as dataset:
        return config_in(file, dataset.attrs)


def read_checkpoint(path: str | Path) -> Checkpoint:
    """Reads the last checkpoint of a run; raises as `open_run`, or where the run has no checkpoint."""
    import h5py

    file = examined_file(path)[0]
    with _reading(file):
        with h5py.File(file, "r") as content:
            slots = [content[name][()].tobytes() for name in SLOTS if name in content]  # type: ignore[index]
        payload = newest_payload(slots)
        if payload is not None:
            return Checkpoint.from_bytes(payload)
    reason = "it was killed before the first" if slots else "its plant or controller cannot be saved"
    raise RunFileError(f"{file} holds no checkpoint to continue from: {reason}")


def verify_run(path: str | Path) -> str:
    """Compares a whole run file, of any size, with the digest that was written when the run ended.

    Returns a sentence: that it is intact, or that and why it carries no digest. Raises as `open_run`.
    """
    file, state = examined_file(path, whole=True)
    if state == "intact":
        return f"{file} is intact: every byte is as it was when the run ended"
    reason = "an older version of annelid wrote it"
    if state == "unfinished":
        reason = "it has not ended, was killed, or its digest could not be written"
    return f"{file} carries no digest, so damage would not show: {reason}"


def refuse_used_folder(out: Path, overwrite: bool) -> None:
    """Raises `ConfigError` where a folder, which is to be locked first, is not empty and must not be overwritten."""
    try:
        # A draft is left where a process was killed while it laid out its file.
        ours = LOCK_NAME, ".run.*.part.nc"
        if out.is_dir() and not overwrite and not all(any(map(entry.match, ours)) for entry in out.iterdir()):
            raise ConfigError(f"the output folder {out} is not empty: name another, or allow overwriting")
    except OSError as error:
        raise RunFileError(f"cannot use the output folder {out}: {error.strerror}") from None


def examined_file(path: str | Path, *, whole: bool = False) -> tuple[Path, digest.State]:
    """Returns the run file behind a path and what its digest says, once it is clear that it is safe to read.

    The whole of a large file is compared with its digest only if asked for.
    """
    import h5py

    from annelid.simulation.content_check import check_content

    file = Path(path) / FILE_NAME if Path(path).is_dir() else Path(path)
    with _reading(file):
        size = os.stat(file).st_size
        # To open a pipe would be to wait for its writer.
        if not file.is_file():
            raise RunFileError(f"{file} is not an annelid run: it is not a file")
        if size == 0:
            raise RunFileError(f"{file} is empty")
        state = digest.examine(file, compared=whole or size <= CHECKED_ON_OPENING_BYTES)
        if state == "damaged":
            raise RunFileError(f"{file} is damaged: it is not as it was when the run ended")
        if not h5py.is_hdf5(file):
            raise RunFileError(f"{file} is not an annelid run: it is not a netCDF-4 file")
        with h5py.File(file, "r") as content:
            # First, since a newer file may hold what the present schema does not.
            schema = _schema_of(content)
            if schema > SCHEMA_VERSION:
                raise RunFileError(
                    f"{file} has schema version {schema}, and this version of annelid reads none above "
                    f"{SCHEMA_VERSION}: a newer annelid wrote it"
                )
            check_content(content, size)
            if schema > 0 and state == "absent":
                raise RunFileError(f"{file} is truncated or damaged: the digest at its end is missing")
            ours = "config" in content.attrs and "annelid_version" in content.attrs
            if not ours or any(name not in content for name in _BOOKKEEPING):
                raise RunFileError(f"{file} is not an annelid run: another program wrote it")
    return file, state


def _schema_of(content: h5py.File) -> int:
    """Returns the schema version of an open file whose content is not checked yet."""
    if SCHEMA not in content.attrs:
        return 0
    attribute = content.attrs.get_id(SCHEMA)
    if attribute.dtype.kind not in "iu" or attribute.shape not in ((), (1,)):
        raise ValueError(f"its {SCHEMA} is not one whole number")
    return int(np.asarray(content.attrs[SCHEMA]).item())


def _count(marks: xarray.Dataset, name: str, most: int) -> int:
    value = int(marks[name])
    if not 0 <= value <= most:
        raise ValueError(f"{name} is {value}, not in 0 .. {most}")
    return value


def config_in(file: Path, attrs: dict[Any, Any]) -> RunConfig:
    """Returns the configuration among the attributes of a run file in the present schema; errors name the file."""
    try:
        return RunConfig.model_validate_json(attrs["config"])
    except ValidationError as error:
        if error.errors()[0]["type"] == "json_invalid":
            raise RunFileError(f"{file} is damaged: its configuration is not readable") from None
        raise RunFileError(
            f"{file} was written by annelid {attrs['annelid_version']}, whose configuration this version "
            "does not understand"
        ) from None
