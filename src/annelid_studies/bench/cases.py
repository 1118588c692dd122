"""Which runs the benchmark times: levels of fidelity beside presets, lines through steps and segments, and more."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any, Literal

from annelid.body import WormBody, worm_of
from annelid.config import LEVELS, RunConfig, load_config
from annelid.errors import ConfigError, suggest
from annelid.experiment import Case
from annelid_studies.standard_cases import CHAIN, FAST, RODS, Effort, drawn_frictions

LINES = {
    "levels": "the levels of --fidelity, riddle2025-muscles and riddle2023-fast, beside the paper's formulation",
    "steps": "3 segments of rods, physics steps of 1 to 40 ms",
    "segments": "rods as their preset has them, 3 to 96 segments",
    "chain": "the paper's formulation, 3 to 12 segments",
    "duration": "rods as their preset has them, 10 and 60 s, for the memory",
}
"""The lines by name, with what they vary."""

JUDGED_S = 8.0
CONVERGED_ELEMENTS, CONVERGED_STEP_S, CONVERGED_IMPEDANCE_RATIO = 4, 0.001, 1000.0
N_PERTURBED = 2
"""Runs that are judged are repeated so often with slightly other friction, against converged runs of that friction."""
CHAIN_S, SEGMENTS_S = 0.05, 2.0
"""Durations of the runs on the lines of segments, s: fifty steps of the chain, two hundred of rods."""

_STEPS_MS = {"full": (1, 2, 5, 10, 20, 40), "quick": (5, 20)}
_SEGMENTS = {"full": (3, 6, 12, 24, 48, 96), "quick": (3, 6, 12)}
# Twelve segments of chain take seconds to compile and most of a second a step; both grow about with the cube of N.
_CHAIN_SEGMENTS = {"full": (3, 6, 12), "quick": (3, 6)}
_DURATIONS_S = {"full": (10.0, 60.0), "quick": (10.0,)}
_LEAST_INTERVAL_S = 0.005
_STEP, _IMPEDANCE_RATIO = "clock.physics_timestep_s", "body.formulation.friction_impedance_ratio"


@dataclass(frozen=True)
class BenchCase:
    """One run of the benchmark."""

    name: str  # What it is, in a few words; no two cases share it
    # ``"judged"`` is compared with the ``"converged"`` run, ``"speed"`` only timed
    kind: Literal["judged", "converged", "speed"]
    case: Case  # Its preset and what is changed in it
    lines: tuple[str, ...] = ()  # The lines that it lies on
    level: str | None = None  # The level of fidelity that it is

    @property
    def body(self) -> WormBody:
        """The 3D worm's body."""
        return worm_of(self.case.config)

    @property
    def perturbed(self) -> list[RunConfig]:
        """The same runs with slightly other friction, where errors count."""
        if self.kind == "speed" or self.case.config.arena is None:
            return []
        return [self.case.but(one).config for one in drawn_frictions(self.case.config.arena.friction, N_PERTURBED)]


def bench_cases(effort: Effort, lines: Sequence[str] | None = None) -> list[BenchCase]:
    """Returns the cases of the lines, each once, and the converged run last where any case is judged.

    Args:
        effort: ``"quick"`` for fewer points on each line, ``"full"`` for all.
        lines: Names of `LINES`; None for all.

    Raises:
        ConfigError: There is no such line.
    """
    for line in lines or ():
        if line not in LINES:
            raise ConfigError(f"there are no cases {line!r}: {suggest(line, LINES)}")
    chosen = [line for line in LINES if lines is None or line in lines]
    found: dict[str, BenchCase] = {}
    for case in (case for line in chosen for case in _cases_of(line, effort)):
        before = found.setdefault(case.name, case)
        found[case.name] = replace(before, lines=tuple(dict.fromkeys((*before.lines, *case.lines))))
    finest = [converged()] if any(case.kind == "judged" for case in found.values()) else []
    return [*found.values(), *finest]


def converged() -> BenchCase:
    """The run that the judged ones are compared with: a fine mesh, short steps, and contact that does not creep."""
    changes = {
        "body.mesh.elements_per_side": CONVERGED_ELEMENTS,
        _IMPEDANCE_RATIO: CONVERGED_IMPEDANCE_RATIO,
        **_steps_of(CONVERGED_STEP_S),
    }
    return BenchCase(f"converged, {CONVERGED_ELEMENTS} elements", "converged", Case(RODS, changes))


def judged(changes: Mapping[str, Any], line: str, level: str | None = None) -> BenchCase:
    """Rods of three segments for three cycles, with changes of the mesh, the step or the impedance ratio."""
    step_s = changes.get(_STEP, load_config(RODS).clock.physics_timestep_s)
    case = Case(RODS, {**changes, **_steps_of(step_s)})
    name = f"rods, {worm_of(case.config).mesh.elements_per_side} elements, {1e3 * step_s:g} ms"
    name += f", impedance ratio {changes[_IMPEDANCE_RATIO]:g}" if _IMPEDANCE_RATIO in changes else ""
    return BenchCase(name, "judged", case, (line,), level)


def as_it_is(preset: str) -> BenchCase:
    """A preset without any change, for its processor time beside the paper's formulation."""
    return BenchCase(f"{preset} as it is", "speed", Case(preset, _recorded_as(preset)), ("levels",))


def timed(preset: str, n_segments: int, duration_s: float, line: str) -> BenchCase:
    """A preset with other numbers of segments."""
    changes: dict[str, Any] = {"body.mesh.n_segments": n_segments, "duration_s": duration_s}
    if preset == CHAIN and n_segments != 3:
        # The paper's file gives one range for each of three segments; the rods' preset has their mean.
        changes["body.rings.length_range_m"] = worm_of(load_config(RODS)).rings.length_range_m
    case = Case(preset, {**changes, **_recorded_as(preset)})
    return BenchCase(f"{preset}, {n_segments} segments, {duration_s:g} s", "speed", case, (line,))


def _cases_of(line: str, effort: Effort) -> list[BenchCase]:
    match line:
        case "levels":
            levels = [judged(level.changes, line, name) for name, level in LEVELS.items()]
            return [as_it_is(CHAIN), *levels, as_it_is("riddle2025-muscles"), as_it_is(FAST)]
        case "steps":
            return [judged({_STEP: step_ms / 1e3}, line) for step_ms in _STEPS_MS[effort]]
        case "segments":
            return [timed(RODS, n, SEGMENTS_S, line) for n in _SEGMENTS[effort]]
        case "chain":
            return [timed(CHAIN, n, CHAIN_S, line) for n in _CHAIN_SEGMENTS[effort]]
        case _:
            return [timed(RODS, 3, duration, line) for duration in _DURATIONS_S[effort]]


def _steps_of(step_s: float) -> dict[str, float]:
    """A step of the body, with intervals of the record at which every sample is a new one."""
    signals, frames = (ceil(round(interval / step_s, 6)) * step_s for interval in (_LEAST_INTERVAL_S, 0.04))
    return {
        _STEP: step_s,
        "record.signals_interval_s": round(signals, 9),
        "record.frames_interval_s": round(frames, 9),
        "duration_s": JUDGED_S,
    }


def _recorded_as(preset: str) -> dict[str, Any]:
    """What a preset records; a study's cases record less unless they say otherwise."""
    return {f"record.{name}": value for name, value in load_config(preset).record.model_dump().items()}
