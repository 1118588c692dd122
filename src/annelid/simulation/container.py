"""A netCDF-4 file of fixed size, laid out whole before a run and then overwritten in place.

HDF5 keeps its metadata in memory while a file is open for writing, so a process killed in the middle can leave
a file that no longer opens. Here HDF5 only lays the file out, every variable contiguous, allocated and filled at once.
Then the run writes raw numbers at the variables' offsets. The file is valid at every instant, other processes may read
it during the run, and its room on the disk is taken from the start. Behind it lies room for a digest of the whole.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from annelid.errors import RunFileError
from annelid.output import whole_file
from annelid.simulation import digest

Extent = tuple[int, int]
"""Where a variable lies in the file: its offset and its length, bytes."""
WITHOUT_LABELS = "This is a netCDF dimension but not a netCDF variable."
"""How netCDF-4 calls a dimension without labels, before its size."""
_METADATA_BYTES = 262_144


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable of the file."""

    name: str  # ``group/name`` puts it into a group
    dims: tuple[str, ...]  # a variable in a group may use the root's
    units: str  # in CF's form
    long_name: str  # what it is, in words
    dtype: str = "<f8"  # little-endian numpy dtype; "str" for labels
    data: Any = None  # None for one that is filled (floats with NaN) and overwritten during the run
    attrs: Mapping[str, Any] = field(default_factory=dict)  # further ones


def needed_bytes(sizes: Mapping[str, int], variables: Sequence[Variable]) -> int:
    """Returns the size of the file, rounded up by a generous share for its metadata."""
    itemsizes = (64 if variable.dtype == "str" else np.dtype(variable.dtype).itemsize for variable in variables)
    counts = (prod(sizes[dim] for dim in variable.dims) for variable in variables)
    numbers = sum(itemsize * count for itemsize, count in zip(itemsizes, counts, strict=True))
    return _METADATA_BYTES + numbers + 2048 * len(variables)


def create(
    path: Path, sizes: Mapping[str, int], variables: Sequence[Variable], attrs: Mapping[str, Any]
) -> dict[str, Extent]:
    """Lays out the file, making its folder if needed; it appears under its name only when it is complete.

    One that exists is replaced. Returns where each variable lies in the file.

    Raises:
        RunFileError: The folder cannot be made or written, or the disk has no room. Nothing is left behind.
    """
    needed, made = needed_bytes(sizes, variables), not path.parent.exists()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        free = shutil.disk_usage(path.parent).free
        if free < needed:
            raise RunFileError(
                f"no room for the run file {path}: it needs {needed / 1e6:.1f} MB and {free / 1e6:.1f} MB are free; "
                "free some, shorten duration_s or record less often"
            )
        with whole_file(path) as draft:
            _try_room(draft, needed)
            extents = _lay_out(draft, sizes, variables, attrs)
            with open(draft, "r+b") as handle:
                handle.write(digest.room(handle.seek(0, os.SEEK_END)))
                handle.flush()
                os.fsync(handle.fileno())
    except BaseException as error:
        if made:
            with suppress(OSError):
                path.parent.rmdir()
        # HDF5 reports a failed write as an OSError or, while it closes the file, as a RuntimeError.
        if isinstance(error, OSError | RuntimeError):
            raise RunFileError(f"cannot write the run file {path}: {_reason(error)}") from None
        raise
    return extents


def _try_room(draft: Path, needed: int) -> None:
    """Writes as many bytes as the file needs, since a quota or a limit shows only then.

    HDF5 cannot be left to find out: after a failed write it may crash the process.
    """
    chunk = bytes(1 << 20)
    with open(draft, "wb", buffering=0) as handle:
        while needed > 0:
            needed -= handle.write(chunk[: min(needed, len(chunk))])


def _reason(error: BaseException) -> str:
    return getattr(error, "strerror", None) or str(error).splitlines()[0]


def _lay_out(
    path: Path, sizes: Mapping[str, int], variables: Sequence[Variable], attrs: Mapping[str, Any]
) -> dict[str, Extent]:
    import h5py

    allocated_at_once = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    allocated_at_once.set_layout(h5py.h5d.CONTIGUOUS)
    allocated_at_once.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    allocated_at_once.set_fill_time(h5py.h5d.FILL_TIME_ALLOC)
    # Offsets at multiples of 8 keep every number within one memory page, hence whole after a kill.
    alignment: dict[str, Any] = {"alignment_threshold": 0, "alignment_interval": 8}
    with h5py.File(path, "w", libver="earliest", **alignment) as file:
        file.attrs.update(attrs)
        made: dict[str, Any] = {}
        for variable in variables:
            attributes = {"units": variable.units, "long_name": variable.long_name, **variable.attrs}
            options: dict[str, Any] = {"dtype": variable.dtype}
            if variable.dtype == "str":
                options = {"dtype": h5py.string_dtype(), "data": np.array(variable.data, dtype=object)}
            elif variable.data is not None:
                options["data"] = np.asarray(variable.data, dtype=variable.dtype)
            elif not variable.dims:
                # h5py passes no creation properties for a scalar; writing it allocates it.
                options["data"] = np.zeros((), dtype=variable.dtype)
            else:
                options["dcpl"] = allocated_at_once.copy()
                if np.dtype(variable.dtype).kind == "f":
                    options["fillvalue"] = attributes["_FillValue"] = np.nan
            shape = [sizes[dim] for dim in variable.dims]
            made[variable.name] = file.create_dataset(variable.name, shape, **options)
            made[variable.name].attrs.update(attributes)
        for dim, size in sizes.items():
            if dim in made:
                made[dim].make_scale(dim)
            else:
                made[dim] = file.create_dataset(dim, (size,), ">f4")
                made[dim].make_scale(f"{WITHOUT_LABELS} {size:10d}")
        for variable in variables:
            for axis, dim in enumerate(variable.dims if variable.name not in sizes else ()):
                made[variable.name].dims[axis].attach_scale(made[dim])
    with h5py.File(path, "r") as file:
        stored = {variable.name: file[variable.name].id for variable in variables}
        return {name: (dataset.get_offset(), dataset.get_storage_size()) for name, dataset in stored.items()}


class RawWriter:
    """Overwrites numbers of a file that `create` laid out.

    Raises:
        RunFileError: From every method, where the operating system refuses (a full disk, for example).
    """

    def __init__(self, path: Path, extents: Mapping[str, Extent]) -> None:
        self._path = path
        self._extents = extents
        with self._named():
            # Unbuffered, so that what was written is the operating system's even if this process dies.
            self._file = open(path, "r+b", buffering=0)  # noqa: SIM115

    @contextmanager
    def _named(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            words = f"cannot write the run file {self._path}: {_reason(error)}; what was written before is kept"
            raise RunFileError(words) from None

    @property
    def closed(self) -> bool:
        """Whether nothing more can be written."""
        return self._file.closed

    def write(self, name: str, content: NDArray[np.generic] | bytes, skip_bytes: int = 0) -> None:
        """Overwrites a variable's bytes, from ``skip_bytes`` after its start on."""
        with self._named():
            self._file.seek(self._extents[name][0] + skip_bytes)
            digest.write_whole(self._file, content if isinstance(content, bytes) else content.tobytes())

    def finish(self) -> None:
        """Writes the digest of the file, which is not to change any more, and hands everything to the disk."""
        with self._named():
            digest.write(self._file)
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Closes the file."""
        self._file.close()
