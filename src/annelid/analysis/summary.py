"""The numbers of one run, in one record: every number has one name and one unit, whatever prints or keeps it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from annelid.analysis.elongation import Elongation, elongation
from annelid.analysis.energy import Energy, energy_balance
from annelid.analysis.gait import Gait, gait
from annelid.analysis.muscles import Muscles, muscles
from annelid.analysis.numbers import Number, finite, number, numbers_of
from annelid.analysis.rhythm import Rhythm, scored_rhythm
from annelid.analysis.track import Travel, travel
from annelid.simulation.runfile import Recorded, Run


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """The extremes of what the body is made of."""

    ring_length_min_m: float | None = number(
        "shortest ring during the run; of a planar worm the height of a rhombus", "shortest ring", "cm"
    )
    edge_strain_max: float | None = number("largest strain of any edge of a rod", "largest edge strain", "%")
    pin_gap_max_m: float | None = number("largest distance between two pinned strands", "largest pin gap", "mm")


@dataclass(frozen=True, kw_only=True)
class Summary(Rhythm, Elongation, Muscles, Travel, Mesh, Gait, Energy):
    """What a run amounts to: its sections are the classes that it joins, and `NUMBERS` says what each number means.

    A number that is not known is None (null in JSON), never NaN.
    """

    name: str = number("name of the configuration", in_sweeps=False, default="")
    status: str = number("how the run ended", in_sweeps=False, default="")
    n_segments: int = number("number of actuated segments", default=0)
    duration_s: float | None = number("simulated time in the file", "simulated time", "s")
    real_time_factor: float | None = number("simulated time over wall-clock time", "times real time")
    warnings: tuple[str, ...] = number("what is doubtful about the run, a sentence each", in_sweeps=False, default=())
    controller: str | None = number(
        "name of the controller in the run file: one from Python may replace the configured one", in_sweeps=False
    )

    def __post_init__(self) -> None:
        """Takes the warnings as JSON has them, too."""
        object.__setattr__(self, "warnings", tuple(self.warnings or ()))

    def to_dict(self) -> dict[str, Any]:
        """Returns plain lists, numbers, strings and None, ready for JSON."""
        return {name: getattr(self, name) for name in NUMBERS}

    def to_json(self) -> str:
        """Returns the record as JSON with the numbers' names as keys."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)


SECTIONS = (Summary, *Summary.__bases__)
NUMBERS: Mapping[str, Number] = {name: one for section in SECTIONS for name, one in numbers_of(section).items()}
"""All that a summary has, by name."""


def summary(run: Run) -> Summary:
    """Reads the numbers of a run, opened with `annelid.open_run`.

    Quantities whose variables the file lacks (a planar run has no edges) are None.
    """
    data, n_segments = run.variables, run.config.body.n_segments
    beat = scored_rhythm(run)
    sections = (
        beat,
        elongation(data),
        muscles(data, n_segments),
        travel(run),
        _mesh(data, n_segments),
        gait(run),
        energy_balance(data),
    )
    return Summary(
        name=run.config.name,
        status=run.status,
        n_segments=n_segments,
        duration_s=finite(np.ptp(data["time"].values)) if data["time"].values.size else None,
        real_time_factor=finite(run.real_time_factor),
        warnings=(*run.warnings, *_doubts(beat)),
        controller=run.attrs.get("controller"),
        **{name: value for section in sections for name, value in vars(section).items()},
    )


def _doubts(beat: Rhythm) -> tuple[str, ...]:
    if beat.rhythm_verdict != "silent":
        return ()
    return (f"the rhythm stops ({beat.rhythm_reason}): a longer run shows no more",)


def _mesh(data: Mapping[str, Recorded], n_segments: int) -> Mesh:
    shortest = None
    if "ring_length" in data and data["time"].values.size:
        # A ring of two halves is as long as both.
        shortest = data["ring_length"].values.reshape(data["time"].values.size, n_segments, -1).sum(axis=2).min()
    return Mesh(
        ring_length_min_m=finite(shortest),
        edge_strain_max=_largest(data, "edge_strain"),
        pin_gap_max_m=_largest(data, "pin_gap"),
    )


def _largest(data: Mapping[str, Recorded], name: str) -> float | None:
    return finite(data[name].values.max()) if name in data and data[name].values.size else None
