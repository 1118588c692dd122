"""The numbers that a run of the same worm is laid beside: published ones, and those of the paper's own formulation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, reduce
from importlib import resources
from typing import Any

from annelid.analysis.comparison import differing_fields
from annelid.analysis.summary import NUMBERS, Summary
from annelid.config import RunConfig, load_config, preset_names
from annelid.config.run import published_worms
from annelid.control.sns import NAME, paper_controller
from annelid.textfiles import parse_json

_ROBOT, _WORM = (published_worms()[name][0]["numbers"] for name in ("wang", "riddle2023"))
ROBOT_ELONGATION_M: tuple[float, ...] = tuple(_ROBOT["elongation_mean_max_m"][0])
"""Largest elongation of the robot's segments 1-4 while it walks straight on flat ground, m."""
PAPER_ELONGATION_M: tuple[float, ...] = tuple(_WORM["elongation_first_helix_pp_m"][0])
"""Largest elongation of the segments of the paper's worm of three, m."""
PAPER_MIDDLE_DEFICIT: float = _WORM["middle_deficit"][0]
PAPER_END_DIFFERENCE: float = _WORM["end_difference"][0]
"""How far segment 2 stays below segment 1 by these, and segment 3, as the paper states them."""
FORMULATION = "riddle2023"
"""The preset that rebuilds the paper's worm in the paper's own formulation, and the name of what it publishes."""

PERIOD_WITHIN, ELONGATION_WITHIN = 0.01, 0.05
"""Relative differences up to which a run agrees with the paper's formulation."""

_IN_ITS_RUN = ("period_s", "elongation_mean_max_m", "middle_deficit_mean", "ring_length_min_m", "pin_gap_max_m")
SPREAD = ("elongation_least_pp_m", "elongation_most_pp_m")
"""The range over a segment's sensors, in which one published sensor may lie."""
# What says how a run is recorded and guarded.
_BESIDE_THE_WORM = ("record.", "guard.")


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


def published(config: RunConfig, controller: str | None = None) -> dict[str, Published]:
    """Returns what has been published of the configured worm, keyed by the fields of `Summary`.

    These are the numbers that its field ``published`` names, in ``data/published.toml``, where the fields that the
    numbers are given for have those values, and the controller is the paper's unless they are of a robot.

    Args:
        config: The configuration.
        controller: What the run file calls the controller, since one from Python may replace the configured one.
    """
    if config.published is None:
        return {}
    of_papers = paper_controller(config.controller) is not None and controller in (None, NAME)
    for worm in published_worms()[config.published]:
        given = all(_value(config, path) == value for path, value in worm["given"].items())
        if given and (of_papers or worm.get("any_controller")):
            return {field: Published(_tuple(value), *source) for field, (value, *source) in worm["numbers"].items()}
    return {}


@cache
def formulation() -> Summary:
    """Returns the numbers of the paper's own formulation, from our run of the preset `FORMULATION`."""
    text = (resources.files("annelid") / "data" / f"{FORMULATION}.json").read_text(encoding="utf-8")
    numbers = parse_json(text, f"{FORMULATION}.json")
    return Summary(**{field: value for field, value in numbers.items() if field in NUMBERS})


def references(config: RunConfig, controller: str | None = None) -> dict[str, Published]:
    """Returns what the numbers of a run are compared with, keyed by the fields of `Summary`.

    These are the published numbers; for worms of rods that stand for the paper's, also those of the paper's own
    formulation. A published elongation of a single sensor is compared with the range over all sensors as well. The
    controller is that of the run file, as for `published`.
    """
    beside = published(config, controller)
    single = beside.get("elongation_first_helix_pp_m")
    if single is not None:
        beside |= dict.fromkeys(SPREAD, single)
    if stands_for_the_papers(config, controller):
        for field in _IN_ITS_RUN:
            beside[field] = Published(_tuple(getattr(formulation(), field)), FORMULATION, f"annelid run {FORMULATION}")
    return beside


def stands_for_the_papers(config: RunConfig, controller: str | None = None) -> bool:
    """Tells whether a worm is of rods and of the paper's kind, to be compared with the paper's own formulation."""
    theirs = config.published == FORMULATION and bool(published(config, controller))
    return theirs and not config.body.is_papers


def changed_fields(config: RunConfig) -> tuple[str, list[str]]:
    """Returns the preset that a run is of, and the fields in which it differs from that.

    It is the preset that the run is named after, or else the nearest of those with the same published numbers. What is
    recorded and when the guard stops the run do not count, nor does the seed where nothing is drawn. A section of
    another kind counts as its kind.
    """
    named = config.name in preset_names()
    presets = {name: load_config(name) for name in ([config.name] if named else preset_names())}
    changed = {
        name: _changes(preset, config)
        for name, preset in presets.items()
        if named or preset.published == config.published
    }
    return min(changed.items(), key=lambda each: len(each[1]))


def _changes(preset: RunConfig, config: RunConfig) -> list[str]:
    fields = differing_fields([preset, config])
    uncounted = (*_BESIDE_THE_WORM, *(() if config.sensor.noise_m else ("seed",)))
    changed = [field for field in fields if not field.startswith(uncounted)]
    others = tuple(field.removesuffix("kind") for field in changed if field.endswith(".kind"))
    return [field for field in changed if field.endswith(".kind") or not field.startswith(others)]


def _value(config: RunConfig, path: str) -> Any:
    """Returns the value at a dotted path; None where this worm has no such field."""
    return reduce(lambda section, name: getattr(section, name, None), path.split("."), config)


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
