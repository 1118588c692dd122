"""What a run file may hold: only what `container.create` lays out, so that opening one touches nothing else.

HDF5 can keep a variable's numbers in other files, point to other files, unpack numbers with code that it loads, and
declare terabytes that no disk holds. None of that is in a run file, so a file with any of it is refused before a number
is read.
"""

from __future__ import annotations

from math import prod
from typing import Any

import h5py
import numpy as np

_MOST_OBJECTS = 4096
_MOST_ATTRIBUTES = 256
_MOST_DIMENSIONS = 8
_PLAIN = (h5py.h5t.INTEGER, h5py.h5t.FLOAT, h5py.h5t.STRING)
_LAYOUTS = (h5py.h5d.CONTIGUOUS, h5py.h5d.COMPACT)
# How netCDF-4 ties variables to dimensions.
_SCALES = {"DIMENSION_LIST": h5py.h5t.VLEN, "REFERENCE_LIST": h5py.h5t.COMPOUND}
# A dimension without a variable is one that declares up to 4 bytes an element and stores none.
_UNSTORED_SHARE = 8


def check_content(file: h5py.File, size: int) -> None:
    """Refuses an open file of a size, bytes, that holds anything but plain numbers and texts within itself.

    Raises:
        ValueError: The sentence says which part is what it should not be.
    """
    stored = unstored = 0
    texts = _Texts(size)
    parts: list[tuple[str, h5py.Group | h5py.Dataset]] = [("", file)]
    for path, part in parts:
        _check_attributes(path or "/", part, texts)
        if isinstance(part, h5py.Dataset):
            n_stored, n_unstored = _check_variable(path, part, size, texts)
            stored, unstored = stored + n_stored, unstored + n_unstored
            continue
        if len(part) > _MOST_OBJECTS:
            raise ValueError(f"{path or 'it'} holds {len(part)} parts, more than the {_MOST_OBJECTS} allowed")
        for key in part:
            name = f"{path}/{key}"
            # Asked of the link itself, since to open a part is to follow its link.
            if type(part.get(key, getlink=True)) is not h5py.HardLink:
                raise ValueError(f"{name!r} is a link to elsewhere, which a run file does not have")
            inner = part[key]
            if not isinstance(inner, h5py.Dataset) and (path or not isinstance(inner, h5py.Group)):
                raise ValueError(f"{name!r} is no variable, and a run file has no other parts there")
            parts.append((name, inner))
    if stored > size or unstored > _UNSTORED_SHARE * size:
        raise ValueError(f"its variables declare {stored + unstored} bytes, and the file has {size}")


class _Texts:
    """Counts texts and attributes of a whole file, since many of them may be the same bytes of it."""

    def __init__(self, most: int) -> None:
        self._left = most

    def add(self, length: int) -> None:
        self._left -= length
        if self._left < 0:
            raise ValueError("its texts and attributes are longer than the file")


def _check_variable(name: str, dataset: h5py.Dataset, size: int, texts: _Texts) -> tuple[int, int]:
    """Returns the bytes that a variable has in the file, and those that it only declares."""
    variable, made = dataset.id, dataset.id.get_create_plist()
    if made.get_layout() not in _LAYOUTS or made.get_external_count() or made.get_nfilters():
        raise ValueError(
            f"{name!r} is virtual, external, chunked or compressed, and a run file stores plain numbers within itself"
        )
    kind = variable.get_type()
    if kind.get_class() not in _PLAIN:
        raise ValueError(f"{name!r} holds neither numbers nor texts")
    if dataset.ndim > _MOST_DIMENSIONS:
        raise ValueError(f"{name!r} has {dataset.ndim} dimensions, more than the {_MOST_DIMENSIONS} allowed")
    count = prod(map(int, variable.shape)) if variable.shape is not None else 0
    length, offset = count * kind.get_size(), variable.get_offset()
    if made.get_layout() == h5py.h5d.CONTIGUOUS and offset is None:
        return 0, length
    if length > (variable.get_storage_size() if offset is None else size - offset):
        raise ValueError(f"{name!r} declares {length} bytes, more than the file has for it")
    if isinstance(kind, h5py.h5t.TypeStringID) and kind.is_variable_str():
        longest = 0
        # One by one, and each as long as the longest, which is how numpy keeps them.
        for number, index in enumerate(np.ndindex(dataset.shape)):
            more = max(0, len(dataset[index]) - longest)
            texts.add(longest + (number + 1) * more)
            longest += more
    return length, 0


def _check_attributes(name: str, part: h5py.Group | h5py.Dataset, texts: _Texts) -> None:
    count = h5py.h5a.get_num_attrs(part.id)
    if count > _MOST_ATTRIBUTES:
        raise ValueError(f"{name!r} has {count} attributes, more than the {_MOST_ATTRIBUTES} allowed")
    for index in range(count):
        attribute = h5py.h5a.open(part.id, index=index)
        kind = attribute.get_type()
        key = attribute.name.decode(errors="replace")
        n_elements = attribute.get_space().get_simple_extent_npoints()
        texts.add(attribute.get_storage_size())
        if isinstance(part, h5py.Dataset) and kind.get_class() == _SCALES.get(key):
            if kind.get_class() == h5py.h5t.VLEN:
                _check_dimensions(name, part, kind, n_elements)
        elif kind.get_class() not in _PLAIN:
            raise ValueError(f"the attribute {key!r} of {name!r} is neither a number nor a text")
        elif name == "/" and n_elements != 1:
            raise ValueError(f"the attribute {key!r} is not one number or text")
        elif isinstance(kind, h5py.h5t.TypeStringID) and kind.is_variable_str() and n_elements:
            # To read an attribute is to read all of it, and many texts may be one that is long.
            if n_elements > 1:
                raise ValueError(f"the attribute {key!r} of {name!r} is not one text")
            texts.add(len(str(part.attrs[key])))


def _check_dimensions(name: str, dataset: h5py.Dataset, kind: Any, n_elements: int) -> None:
    """Checks, without reading them, that a variable has one reference to each of its dimensions."""
    references = kind.get_super().get_class() == h5py.h5t.REFERENCE
    # Counted by HDF5 itself, since h5py would make an object of every reference.
    if (
        not references
        or n_elements != dataset.ndim
        or any(h5py.h5ds.get_num_scales(dataset.id, axis) != 1 for axis in range(dataset.ndim))
    ):
        raise ValueError(f"{name!r} has other references than one to each dimension")
