"""The run file: its fixed names, opening one into a `Run`, and continuing it."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import getitem
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from annelid.config import RunConfig
from annelid.config.checking import gone_fields, present_fields
from annelid.errors import ConfigError, RunFileError, UnreadableText
from annelid.registry import Registry
from annelid.simulation import digest
from annelid.simulation.checkpoint import Checkpoint, newest_payload
from annelid.simulation.container import WITHOUT_LABELS
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
_OF_THE_FORMAT = {"CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "_FillValue", "coordinates"}
"""Attributes by which netCDF-4 and CF tie variables together; so do those whose names begin with ``_N``."""


class Recorded(NamedTuple):
    """One variable of a run, as xarray takes them: the names of its dimensions, its values and its attributes."""

    dims: tuple[str, ...]
    values: NDArray[Any]
    attrs: Mapping[str, Any]


@dataclass(frozen=True, repr=False)
class Run:
    """A run as its file has it.

    Attributes:
        path: The run file.
        variables: All that was recorded, by name, cut to the samples and frames that were written.
        attrs: The file's global attributes.
        config: The configuration it was made with.
        status: How it ended, one of `STATUSES`.
        message: Why it ended before its time; empty if it did not.
        warnings: What is doubtful about it, a sentence each.
        cpu_time_s: Processor time that its process spent on it, s; 0 for a run that was killed or is still going on.
    """

    path: Path
    variables: Mapping[str, Recorded]
    attrs: Mapping[str, Any]
    config: RunConfig
    status: str
    message: str
    warnings: tuple[str, ...] = ()
    cpu_time_s: float = 0.0

    @cached_property
    def data(self) -> xarray.Dataset:
        """All that was recorded, as xarray has it; it shares its memory with `variables`."""
        import xarray

        return xarray.Dataset(self.variables, attrs=self.attrs).set_coords({"frame_time"} & {*self.variables})

    def with_data(self, data: xarray.Dataset) -> Run:
        """Returns the run with other data, such as some samples of its own."""
        parts: Any = data.variables
        variables = {name: Recorded(one.dims, one.values, one.attrs) for name, one in parts.items()}
        return replace(self, variables=variables, attrs=data.attrs)

    def __repr__(self) -> str:
        time = self.variables["time"].values
        reached = f"{float(time[-1]):g} s" if time.size else "nothing"
        return f"<Run {str(self.path)!r}: {self.config.name}, {self.status}, {reached}>"

    def _repr_html_(self) -> str:
        return VIEWS.find("html")(self)

    @property
    def start_s(self) -> float:
        """Simulated time at which this run started, s: 0 unless it continues another."""
        return float(self.attrs.get("resumed_at_s", 0.0))

    @property
    def wall_time_s(self) -> float:
        """Wall-clock time from the start of the run to its last sample, s; 0 without samples."""
        wall = self.variables["wall_time"].values
        return float(wall[-1]) if wall.size else 0.0

    @property
    def real_time_factor(self) -> float:
        """Simulated time over wall-clock time; NaN for a run that did not get beyond its start."""
        wall_s = self.wall_time_s
        time = self.variables["time"].values
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
    with open_checked(file) as content:
        attrs, doubts = migrated(_attributes(content), _text(content, WARNINGS).splitlines())
        n_samples = _count(content, "samples_written", content["time"].size)
        n_frames = _count(content, "frames_written", content["frame_time"].size)
        status = STATUSES[_count(content, "status_code", len(STATUSES) - 1)]
        variables = _variables(content, {"time": n_samples, "frame": n_frames})
        cpu_time_s = float(content[CPU_TIME][()]) if CPU_TIME in content else 0.0
        message = _text(content, "status_message")
    return Run(file, variables, attrs, config_in(file, attrs), status, message, tuple(doubts), cpu_time_s)


def _variables(content: Any, written: dict[str, int]) -> dict[str, Recorded]:
    """Reads what was recorded, cut to what was written along a dimension."""
    import h5py

    variables, sizes = dict[str, Recorded](), dict(written)
    for name, variable in content.items():
        # A dimension without labels has no variable.
        only_size = variable.attrs.get("NAME", b"").startswith(WITHOUT_LABELS.encode())
        if only_size or name in (*_BOOKKEEPING, WARNINGS, CPU_TIME, "checkpoint"):
            continue
        dims = (name,) if variable.is_scale else tuple(dim[0].name.lstrip("/") for dim in variable.dims)
        # Labels of a dimension may be words.
        if variable.dtype.kind not in "fiu" and dims != (name,):
            raise ValueError(f"{name!r} holds no numbers")
        if dims[:1] not in (("time",), ("frame",), (name,)) and name != "stretch_rest_length":
            raise ValueError(f"{name!r} is along {dims}, not along time or frame")
        words = h5py.check_string_dtype(variable.dtype)
        values = variable.asstr()[:].astype(str) if words else variable[: written.get(dims[0])]
        if any(sizes.setdefault(dim, size) != size for dim, size in zip(dims, values.shape, strict=True)):
            raise ValueError(f"{name!r} has shape {values.shape}, others have {sizes}")
        variables[name] = Recorded(dims, values, _attributes(variable))
    return variables


def _attributes(part: Any) -> dict[str, Any]:
    """The attributes of an open file or of one of its variables; what netCDF-4 keeps as a list of one is that one."""
    kept = {name: part.attrs[name] for name in part.attrs if name not in _OF_THE_FORMAT and name[:2] != "_N"}
    return {name: value[0] if np.shape(value) == (1,) else value for name, value in kept.items()}


def _text(content: Any, name: str) -> str:
    """The text of a variable of single characters; none in files that are older than it."""
    return content[name][()].tobytes().rstrip(b"\0").decode() if name in content else ""


def migrated(attrs: Mapping[str, Any], doubts: list[str]) -> tuple[dict[str, Any], list[str]]:
    """Returns the attributes and warnings of a run file of any schema up to the present one in the present one.

    The configuration of files of schema 0, those of annelid 0.1, is valid as it is: fields that are newer default to
    what 0.1 did, guards excepted. Those up to schema 1 name no published numbers. Where a field acted that is gone
    (`annelid.config.checking.gone_fields`), the run says so among its warnings, and is not continued.
    """
    attrs = {**attrs, SCHEMA: SCHEMA_VERSION}
    try:
        tree, acted = present_fields(parse_json(attrs["config"], "the configuration"))
        for path in acted:
            *above, leaf = path.split(".")
            del reduce(getitem, above, tree)[leaf]
        if tree["body"].get("strands", {}).get("damping_time_s", 0.0) is None:
            del tree["body"]["strands"]["damping_time_s"]
    except (UnreadableText, KeyError, TypeError, ValueError, AttributeError):
        return attrs, doubts  # What is wrong with it, its reader says.
    if acted:
        doubts = doubts + [
            f"{path} was {value}, a field that is gone ({gone_fields()[path]['now']}): its command does not repeat it"
            for path, value in sorted(acted.items())
        ]
        attrs[ACTED] = ", ".join(sorted(acted))
    return {**attrs, "config": json.dumps(tree)}, doubts


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
def open_checked(file: Path) -> Iterator[Any]:
    """Opens an examined file."""
    import h5py

    with _reading(file), h5py.File(file) as content:
        yield content


def read_attributes(path: str | Path) -> tuple[Path, dict[str, Any]]:
    """Returns a run's file and its global attributes in the present schema; raises as `open_run`."""
    file = examined_file(path)[0]
    with open_checked(file) as content:
        return file, migrated(_attributes(content), [])[0]


def read_config(path: str | Path) -> RunConfig:
    """Reads the configuration of a run, from its folder or its file; raises as `open_run`."""
    return config_in(*read_attributes(path))


def read_checkpoint(path: str | Path) -> Checkpoint:
    """Reads the last checkpoint of a run; raises as `open_run`, or where the run has no checkpoint."""
    file = examined_file(path)[0]
    with open_checked(file) as content:
        slots = [content[name][()].tobytes() for name in SLOTS if name in content]
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
            raise ConfigError(
                f"the output folder {out} is not empty: name another, or replace its run with --force (overwrite=True)"
            )
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
            made = f": annelid run {file} makes a run of a configuration, with --network of a network"
            hint = made if file.suffix == ".toml" else ""
            raise RunFileError(f"{file} is not an annelid run: it is not a netCDF-4 file{hint}")
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


def _count(content: Any, name: str, most: int) -> int:
    value = int(content[name][()])
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
