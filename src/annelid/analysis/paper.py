"""The numbers that a run of the same worm is laid beside: published ones, and those of the paper's own formulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources

from annelid.analysis.comparison import differing_fields, relative_difference
from annelid.analysis.summary import Summary
from annelid.body.worm import WormBody
from annelid.config import RunConfig, load_config, preset_names
from annelid.control.sns import paper_controller
from annelid.textfiles import parse_json

ROBOT_ELONGATION_M = (0.0615, 0.0382, 0.0478, 0.0598)
"""Largest elongation of the robot's segments 1-4 while it walks straight on flat ground, m: each the mean of the left
and the right stretch sensor. Riddle et al. 2023, section 4, from data of Wang. Its Fig. 9 shows the readings over
time as a graph; numbers are given of these maxima only.
"""
PAPER_ELONGATION_M = (0.0420, 0.0255, 0.0402)
"""Largest elongation of the segments of the paper's worm of three, m. Riddle et al. 2023, section 3."""
PAPER_MIDDLE_DEFICIT, PAPER_END_DIFFERENCE = 0.394, 0.0445
"""How far segment 2 stays below segment 1 by these, and segment 3, as the paper states them."""

PAPER_2023 = "Riddle et al. 2023"
PAPER_2022 = "Riddle et al. 2022"
FORMULATION = "riddle2023"
"""The preset that rebuilds the paper's worm in the paper's own formulation."""

PERIOD_WITHIN, ELONGATION_WITHIN = 0.01, 0.05
"""Relative differences up to which a run agrees with the paper's formulation."""

_IN_ITS_RUN = ("period_s", "elongation_mean_max_m", "middle_deficit_mean", "ring_length_min_m", "pin_gap_max_m")
SPREAD = ("elongation_least_pp_m", "elongation_most_pp_m")
"""The range over a segment's sensors, in which one published sensor may lie."""
# What says how a run is recorded and guarded, and what it is called.
_BESIDE_THE_WORM = ("name", "summary", "record.", "guard.")


@dataclass(frozen=True, slots=True)
class Published:
    """One number to compare with.

    Attributes:
        value: In the unit of the summary's field: one number, one number a segment, or words.
        paper: Where it was published; `FORMULATION` for one of our run of that preset.
        place: Where in it.
    """

    value: float | tuple[float, ...] | str
    paper: str
    place: str


def published(config: RunConfig) -> dict[str, Published]:
    """Returns what has been published of the configured worm, keyed by the fields of `Summary`.

    Only configurations named after a paper and with its kind of controller have such numbers: the three-segment worm of
    ``riddle2023`` and its rods, the four-segment robot ``wang``, and the planar worms of ``riddle2022`` with the gate
    time constants and gains that go together.
    """
    network = paper_controller(config.controller)
    if network is None:
        return {}
    if _is_of_2023(config):
        return dict(_RIDDLE_2023)
    if config.name == "wang" and config.body.n_segments == len(ROBOT_ELONGATION_M):
        return dict(_ROBOT)
    period_s = config.body.published_period_s(config)
    if config.name.startswith("riddle2022") and period_s is not None:
        return {
            "period_s": Published(period_s, PAPER_2022, "the authors' code"),
            "order": Published("1-2-3..", PAPER_2022, "Fig. 4"),
        }
    return {}


@dataclass(frozen=True, slots=True)
class Agreement:
    """How a run compares with the paper's formulation.

    Attributes:
        order: Whether the segments contract in the same order.
        period: Relative difference of the period; None where either has none.
        elongation: Relative difference of the largest mean elongation, segment by segment; None where it is not known.
    """

    order: bool
    period: float | None
    elongation: tuple[float | None, ...]

    @property
    def period_agrees(self) -> bool:
        """Whether the period is within `PERIOD_WITHIN`."""
        return self.period is not None and abs(self.period) <= PERIOD_WITHIN

    @property
    def elongation_agrees(self) -> tuple[bool, ...]:
        """Whether the elongation of each segment is within `ELONGATION_WITHIN`."""
        return tuple(share is not None and abs(share) <= ELONGATION_WITHIN for share in self.elongation)

    def __bool__(self) -> bool:
        """Whether order, period and every elongation agree."""
        return self.order and self.period_agrees and all(self.elongation_agrees)


@cache
def formulation() -> Summary:
    """Returns the numbers of the paper's own formulation, from our run of the preset `FORMULATION`."""
    text = (resources.files("annelid") / "data" / f"{FORMULATION}.json").read_text(encoding="utf-8")
    numbers = parse_json(text, f"{FORMULATION}.json")
    return Summary(**{field: value for field, value in numbers.items() if field in Summary.__slots__})


def references(config: RunConfig) -> dict[str, Published]:
    """Returns what the numbers of a run are compared with, keyed by the fields of `Summary`.

    These are the published numbers; for worms of rods that stand for the paper's, also those of the paper's own
    formulation. A published elongation of a single sensor is compared with the range over all sensors as well.
    """
    beside = published(config)
    single = beside.get("elongation_first_helix_pp_m")
    if single is not None:
        beside |= dict.fromkeys(SPREAD, single)
    if stands_for_the_papers(config):
        for field in _IN_ITS_RUN:
            value = getattr(formulation(), field)
            value = tuple(value) if isinstance(value, list) else value
            beside[field] = Published(value, FORMULATION, f"annelid run {FORMULATION}")
    return beside


def stands_for_the_papers(config: RunConfig) -> bool:
    """Tells whether a worm is of rods and of the paper's kind, to be compared with the paper's own formulation."""
    return _is_of_2023(config) and isinstance(config.body, WormBody) and not config.body.formulation.is_papers


def has_rigid_crossings(config: RunConfig) -> bool:
    """Tells whether a worm's strands share a vertex at each crossing."""
    return isinstance(config.body, WormBody) and config.body.formulation.has_rigid_crossings


def changed_fields(config: RunConfig) -> list[str]:
    """Returns the fields in which a run differs from the preset that it is named after; none where there is none.

    What is recorded and when the guard stops the run do not count, nor does the seed where nothing is drawn. A section
    of another kind counts as its kind.
    """
    if config.name not in preset_names():
        return []
    fields, _ = differing_fields([load_config(config.name), config])
    uncounted = (*_BESIDE_THE_WORM, *(() if config.sensor.noise_m else ("seed",)))
    changed = [field for field in fields if not field.startswith(uncounted)]
    others = tuple(field.removesuffix("kind") for field in changed if field.endswith(".kind"))
    return [field for field in changed if field.endswith(".kind") or not field.startswith(others)]


def agreement(numbers: Summary) -> Agreement:
    """Compares the numbers of a run of three segments with the paper's own formulation."""
    theirs = formulation()
    elongation = relative_difference(theirs.elongation_mean_max_m, numbers.elongation_mean_max_m)
    period = relative_difference(theirs.period_s, numbers.period_s)
    assert not isinstance(period, Sequence)
    of_each = tuple(elongation) if isinstance(elongation, Sequence) else (None,) * theirs.n_segments
    return Agreement(numbers.order == theirs.order, period, of_each)


def _is_of_2023(config: RunConfig) -> bool:
    named = config.name.startswith(FORMULATION) and config.body.n_segments == 3
    return named and paper_controller(config.controller) is not None


_RIDDLE_2023 = {
    "order": Published("1-2-3", PAPER_2023, "Fig. 7"),
    "elongation_first_helix_pp_m": Published(PAPER_ELONGATION_M, PAPER_2023, "section 3"),
    # Segment 2 below segment 1, and segment 1 versus 3.
    "middle_deficit": Published(PAPER_MIDDLE_DEFICIT, PAPER_2023, "section 3"),
    "end_difference": Published(PAPER_END_DIFFERENCE, PAPER_2023, "section 3"),
    "contraction_force_median_N": Published("up to 2.5 N", PAPER_2023, "section 2.2"),
    "travel_m": Published("negligible", PAPER_2023, "section 5"),
    # 5000 steps of 1 ms in 3.5 min.
    "real_time_factor": Published(5.0 / 210.0, PAPER_2023, "section 3"),
}

_ROBOT = {
    "order": Published("1-2-3-4", PAPER_2023, "Fig. 9"),
    "elongation_mean_max_m": Published(ROBOT_ELONGATION_M, PAPER_2023, "section 4"),
}
