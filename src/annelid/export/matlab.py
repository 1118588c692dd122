"""A run as one MATLAB file: a variable for every signal, and structs that say what they are."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.export.selection import CLOCKS, signal_names
from annelid.export.tables import about, labels_of
from annelid.output import whole_file

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run

LONGEST_NAME = 63
"""Characters that MATLAB reads of a name."""
STRUCTS = ("units", "long_name", "dimensions", "labels", "config", "run")


def write_matlab(run: Run, path: Path) -> Path:
    """Writes a run.

    Signals keep their dimensions, time first. The structs ``units``, ``long_name`` and ``dimensions`` have a field for
    every signal, ``labels`` one for every dimension that has labels, ``config`` the configuration, and ``run`` how it
    ended and with which versions.

    Args:
        run: The run.
        path: File to write.

    Raises:
        RunFileError: The file cannot be written.
    """
    from scipy.io import savemat

    data, facts = run.data, about(run)
    names = matlab_names([*CLOCKS.values(), *signal_names(data)], taken=STRUCTS)
    meanings = facts["signals"] | {clock: {"units": "s", "dimensions": [dim]} for dim, clock in CLOCKS.items()}
    content: dict[str, Any] = {ours: np.asarray(data[name].values, dtype=float) for name, ours in names.items()}
    for struct in ("units", "long_name", "dimensions"):
        content[struct] = {ours: matlab_value(meanings[name].get(struct, "")) for name, ours in names.items()}
    labelled = [str(dim) for dim in data.sizes if dim not in CLOCKS and dim in data.variables]
    content["labels"] = {matlab_names([dim])[dim]: matlab_value(labels_of(data, dim).tolist()) for dim in labelled}
    content["config"] = matlab_value(facts["configuration"])
    content["run"] = matlab_value({key: facts[key] for key in ("name", "status", "message")} | facts["attributes"])
    with whole_file(path) as draft:
        savemat(draft, content, long_field_names=True, do_compression=True, oned_as="column")
    return path


def matlab_names(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """Returns a legal and distinct MATLAB name for each name, none of those taken: letters, digits and underscores."""
    legal: dict[str, str] = {}
    used = set(taken)
    for name in names:
        stem = re.sub(r"\W", "_", name, flags=re.ASCII)
        stem = (stem if stem[:1].isalpha() else f"x{stem}")[:LONGEST_NAME]
        free, number = stem, 1
        while free in used:
            number += 1
            free = f"{stem[: LONGEST_NAME - 4]}_{number}"
        used.add(free)
        legal[name] = free
    return legal


def matlab_value(value: Any) -> Any:
    """Turns a plain value into what scipy writes as its MATLAB counterpart.

    Tables become structs, lists of numbers rows, other lists cells, and None the empty array.
    """
    if value is None:
        return np.empty((0, 0))
    if isinstance(value, Mapping):
        names = matlab_names(value)
        return {names[key]: matlab_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        if value and all(map(_is_number, value)):
            return np.array([value], dtype=float)
        cells = np.empty((1, len(value)), dtype=object)
        for i, item in enumerate(value):
            cells[0, i] = matlab_value(item)
        return cells
    return float(value) if _is_number(value) else value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
