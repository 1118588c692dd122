"""Maps: what the columns of a measured log are, and in which unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from annelid.config import Line, Positive, Section, Share, check_section
from annelid.errors import ConfigError, listed, shown
from annelid.textfiles import read_toml

UNITS = {
    "s": ("s", 1.0), "ms": ("s", 1e-3), "us": ("s", 1e-6), "min": ("s", 60.0),
    "m": ("m", 1.0), "cm": ("m", 1e-2), "mm": ("m", 1e-3), "um": ("m", 1e-6), "in": ("m", 0.0254),
    "m/s": ("m/s", 1.0), "cm/s": ("m/s", 1e-2), "mm/s": ("m/s", 1e-3), "J": ("J", 1.0), "px": ("px", 1.0),
    "N": ("N", 1.0), "mN": ("N", 1e-3), "gf": ("N", 9.80665e-3), "kgf": ("N", 9.80665), "lbf": ("N", 4.4482216),
    "rad": ("rad", 1.0), "deg": ("rad", np.pi / 180.0), "1": ("1", 1.0), "%": ("1", 1e-2),
}  # fmt: skip
"""Units of columns: what each measures, by its SI unit, and how many of these it is."""
Drift = Annotated[float, Field(ge=-0.2, le=0.2)]
UNIT_AT_END = re.compile(r"[_ (\[]+([A-Za-zµμ/%]+|1(?=[)\]]))[)\]]?$")
"""Finds the unit of a column, the first group, at the end of its name; a 1 outside brackets is a number."""


class Column(Section):
    """What a column of a log is, as its entry under ``[map]``."""

    signal: Line = Field(description="the signal of the run, as stretch_length[1, left]")
    unit: Line | None = Field(
        default=None, description="unit of the column; none: the end of its name, as in length_mm, or a row of units"
    )
    scale: float | None = Field(default=None, description="SI units of the signal in one of the column's, as m per rad")
    offset: float | Literal["free"] = Field(
        default=0.0,
        description="added to the column, in the signal's SI unit; free, also of travel: means are made equal",
    )
    distance_to: Line | None = Field(default=None, description="another tracked point: the column is their distance")

    @model_validator(mode="before")
    @classmethod
    def _from_any_place(cls, given: object) -> object:
        """Frees the offset of travel, since a log may count places from anywhere."""
        if not isinstance(given, Mapping) or given.get("signal") != "travel":
            return given
        return {"offset": "free", **given}


class LogMap(Section):
    """What the columns of a log are; the whole of a map."""

    time: Line | None = Field(default=None, description="column of the time; its unit is the end of its name")
    time_unit: Line | None = Field(default=None, description="unit of the time where its name has none")
    rate_Hz: Positive | None = Field(default=None, description="rows a second, in place of a column of the time")
    m_per_px: Positive | None = Field(default=None, description="metres in a pixel, for tracked points")
    individual: Line | None = Field(default=None, description="which animal or track, where a tracker followed several")
    least_likelihood: Share = Field(default=0.6, description="tracked points that are less likely are gaps")
    lag_s: float | Literal["free"] = Field(
        default="free", description="time of the run less time of the log, s; free: where both agree best"
    )
    clock_drift: Drift | Literal["free"] = Field(
        default=0.0, description="how much faster than true the log's clock runs; free: fitted"
    )
    map: Mapping[str, Column] = Field(description="what each column is")

    @model_validator(mode="before")
    @classmethod
    def _spelt_out(cls, given: object) -> object:
        """Takes a text for a column that only names its signal."""
        if not isinstance(given, Mapping) or not isinstance(named := given.get("map"), Mapping):
            return given
        return {**given, "map": {c: {"signal": own} if isinstance(own, str) else own for c, own in named.items()}}


def read_map(path: str | Path) -> LogMap:
    """Reads a map.

    Raises:
        ConfigError: It cannot be read, has an unknown field, or maps nothing.
    """
    read = check_section(LogMap, read_toml(Path(path), "the map"))
    if not read.map:
        raise ConfigError(f'{path} maps no column: write one under [map], as s1_left_mm = "stretch_length[1, left]"')
    if (read.time is None) == (read.rate_Hz is None):
        raise ConfigError(f"{path} needs either time, the column of the time, or rate_Hz, rows a second")
    return read


def unit_of(name: str, given: str | None, what: str, example: str = "mm") -> tuple[str, float]:
    """Returns what a column measures, by its SI unit, and how many of these its unit is.

    Args:
        name: The column's name, which may end in the unit.
        given: The unit, where it is stated.
        what: What states it, for the error.
        example: A unit that would fit, for the error.

    Raises:
        ConfigError: The unit is unknown, or there is none.
    """
    found = UNIT_AT_END.search(name)
    unit = given or (found[1] if found else "")
    if (known := plain_unit(unit)) in UNITS:
        return UNITS[known]
    if given:
        raise ConfigError(f"{what} = {shown(given)} is no known unit: it is one of {listed(list(UNITS))}")
    raise ConfigError(
        f"the unit of column {shown(name)} is not known: end its name in one, as _{example}, or write "
        f'{what} = "{example}" in the map'
    )


def plain_unit(text: str) -> str:
    """Returns a unit without brackets and with u for micro."""
    return text.strip(" ()[]").replace("µ", "u").replace("μ", "u")
