"""The worms that the studies lay side by side, and their open-loop protocol."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import nan
from typing import Any, Literal, TypeVar

import numpy as np

from annelid.analysis import mean_and_interval
from annelid.experiment import Case, Store, finer_steps

Effort = Literal["quick", "full"]
"""Coarse and within minutes, or the whole."""
CHAIN, RODS, FAST = "riddle2023", "riddle2023-rods", "riddle2023-fast"
"""The three worms that the examinations lay side by side: the paper's, rigid crossings, soft crossings in seconds."""
PLANAR = "riddle2022-planar"
PAPERS_RODS: dict[str, Any] = {"body.mesh.elements_per_side": 3}
"""The paper's mesh."""

TIGHT_CHAIN: dict[str, Any] = {
    "kind": "chain",
    "pin_time_constant_s": 0.01,
    "pin_impedance": [0.999, 0.9999, 0.001],
}
"""The paper's formulation with crossings that hardly part, to lay beside the rods."""

RODS_STEP_S = 0.01
"""Step of the rods with rigid crossings in the examinations, s."""

FRICTION_SPREAD = 0.01
"""Largest relative change of the friction in a perturbed run."""
DRAWS = 8
"""Perturbed runs from which an interval is computed."""
NOT_DRAWN = nan, nan, nan, nan
"""In place of what `over_frictions` finds, for a case that it did not run."""
K = TypeVar("K")

HOLD_S, REST_S = 0.8, 0.4
"""In the open-loop protocol each segment is held contracted this long, then all rest this long, s."""


def chain(changes: Mapping[str, Any] | None = None) -> Case:
    """The paper's worm at steps of 2 ms, at half the cost of the paper's 1 ms and with the same rhythm."""
    return Case(CHAIN, {"clock.physics_timestep_s": 0.002, **(changes or {})})


def rods(changes: Mapping[str, Any] | None = None) -> Case:
    """The worm of rods with rigid crossings with the paper's three elements a side, at steps of `RODS_STEP_S`."""
    return Case(RODS, {**PAPERS_RODS, "clock.physics_timestep_s": RODS_STEP_S, **(changes or {})})


def fast(changes: Mapping[str, Any] | None = None) -> Case:
    """The worm of rods whose pins give as the paper's do."""
    return Case(FAST, changes or {})


def one_after_the_other(n_segments: int = 3, hold_s: float = HOLD_S, rest_s: float = REST_S) -> dict[str, Any]:
    """Returns the changes that make a run open-loop: each segment contracted in turn, then all at rest for a while."""
    starts = [round(i * (hold_s + rest_s), 9) for i in range(n_segments)]
    contractions = [
        {"segment": i, "start_s": start, "stop_s": round(start + hold_s, 9)} for i, start in enumerate(starts, start=1)
    ]
    return {"controller": {"kind": "program", "contractions": contractions}, "duration_s": contractions[-1]["stop_s"]}


def over_frictions(
    store: Store, cases: Mapping[K, Case], value: Callable[[K, Case], float]
) -> dict[K, tuple[float, float, float, float]]:
    """Runs cases with `DRAWS` frictions within `FRICTION_SPREAD` of their own, and the first of these at half the step.

    Returns:
        For each key the mean of a value over the frictions, the ends of its 95 % interval, and what half the step
        changes of it.
    """
    drawn = {}
    for key, case in cases.items():
        arena = case.config.arena
        assert arena is not None
        drawn[key] = [case.but(changes) for changes in drawn_frictions(arena.friction, DRAWS)]
    halved = {key: own[0].but(finer_steps(own[0].config)[0]) for key, own in drawn.items()}
    store.compute([*halved.values(), *(case for own in drawn.values() for case in own)], "other frictions")
    found = {}
    for key, own in drawn.items():
        values = [value(key, case) for case in own]
        found[key] = (*mean_and_interval(values), value(key, halved[key]) - values[0])
    return found


def drawn_frictions(friction: float, n: int) -> list[dict[str, Any]]:
    """Returns the changes of n perturbed runs, each with its seed and a friction within `FRICTION_SPREAD` of one."""
    drawn = np.random.default_rng(0).uniform(-FRICTION_SPREAD, FRICTION_SPREAD, n).tolist()
    return [
        {"arena.friction": round(friction * (1.0 + change), 6), "seed": seed}
        for seed, change in enumerate(drawn, start=1)
    ]
