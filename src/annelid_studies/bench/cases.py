"""Which runs the benchmark times: lines through steps, elements and segments, and the converged runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any, Literal

from annelid.body import WormBody
from annelid.config import LEVELS, RunConfig, load_config
from annelid.errors import ConfigError, suggest
from annelid.experiment import Case
from annelid_studies.worms import CHAIN, RODS, TIGHT_CHAIN, Effort, drawn_frictions

LINES = {
    "levels": "the levels of --fidelity, and the paper's own worm beside them",
    "steps": "3 segments, physics steps of 1 to 60 ms, 2 and 3 elements a side",
    "elements": "3 segments, 1 to 6 elements a side, physics steps of 5 and 20 ms",
    "settings": "3 segments as `fast`, with other settings of solver, contact and rods; and as a chain of capsules",
    "segments": "rods as their preset has them, 3 to 30 segments",
    "chain": "the paper's formulation, 3 to 12 segments",
    "duration": "rods as their preset has them, 10 and 60 s, for the memory",
}
"""The lines by name, with what they vary."""

JUDGED_S = 8.0
CONVERGED_STEP_S = 0.001
CONVERGED_IMPEDANCE_RATIO = 1000.0
CONVERGED_ELEMENTS = {"full": (4, 6), "quick": (4,)}
N_PERTURBED = 2
"""Runs that are judged are repeated so often with slightly other friction, against converged runs of that friction."""
CHAIN_S, SEGMENTS_S = 0.05, 2.0
"""Durations of the runs that are timed but not judged, s: fifty steps of the chain, a hundred of rods."""

_STEPS_MS = {"full": (1, 2, 5, 10, 20, 30, 40, 60), "quick": (5, 20)}
_ELEMENTS = {"full": (1, 2, 3, 4, 6), "quick": (1, 2, 3)}
_ELEMENT_STEPS_MS = {"full": (5, 20), "quick": (20,)}
_CREEPING = {"body.formulation.friction_impedance_ratio": 1.0}
_SETTINGS = {
    "impedance ratio 1": _CREEPING,
    "edges in 1 ms": {"body.formulation.edge_time_constant_s": 0.001},
}
_CHAIN: dict[str, Any] = {"body.formulation": TIGHT_CHAIN}
# 31 segments of three elements a side are beyond the limit of the engine (docs/upstream/sparse_ordering.md).
_SEGMENTS = {"full": (3, 6, 12, 24, 30), "quick": (3, 6, 12)}
# Twelve segments of chain take seconds to compile and most of a second a step; both grow about with the cube of N.
_CHAIN_SEGMENTS = {"full": (3, 6, 12), "quick": (3, 6)}
_DURATIONS_S = {"full": (10.0, 60.0), "quick": (10.0,)}
_LEAST_INTERVAL_S = 0.005


@dataclass(frozen=True)
class BenchCase:
    """One run of the benchmark."""

    name: str  # What it is, in a few words; no two cases share it
    # ``"judged"`` is compared with the ``"converged"`` runs, ``"speed"`` only timed
    kind: Literal["judged", "converged", "speed"]
    case: Case  # Its preset and what is changed in it
    lines: tuple[str, ...]  # The lines that it lies on

    @property
    def body(self) -> WormBody:
        """The 3D worm's body."""
        return _worm_body(self.case.config)

    @property
    def perturbed(self) -> list[RunConfig]:
        """The same runs with slightly other friction, where errors count."""
        if self.kind == "speed" or self.case.config.arena is None:
            return []
        return [self.case.but(one).config for one in drawn_frictions(self.case.config.arena.friction, N_PERTURBED)]


def bench_cases(effort: Effort, lines: Sequence[str] | None = None) -> list[BenchCase]:
    """Returns the cases of the lines, each once, the converged runs last.

    Args:
        effort: ``"quick"`` for fewer points on each line and one converged run, ``"full"`` for all.
        lines: Names of `LINES`; None for all.

    Raises:
        ConfigError: There is no such line.
    """
    chosen = check_lines(lines)
    found: dict[str, BenchCase] = {}
    for case in (case for line in LINES if line in chosen for case in _cases_of(line, effort)):
        before = found.setdefault(case.name, case)
        found[case.name] = replace(before, lines=tuple(dict.fromkeys((*before.lines, *case.lines))))
    if any(case.kind == "judged" for case in found.values()):
        found |= {case.name: case for case in map(converged, CONVERGED_ELEMENTS[effort])}
    return list(found.values())


def check_lines(lines: Sequence[str] | None) -> list[str]:
    """Returns the lines asked for, all for None.

    Raises:
        ConfigError: There is no such line.
    """
    chosen = list(LINES if lines is None else lines)
    for line in chosen:
        if line not in LINES:
            raise ConfigError(f"there are no cases {line!r}: {suggest(line, LINES)}")
    return chosen


def converged(elements: int) -> BenchCase:
    """A run that the judged ones are compared with, of one mesh: short steps, and contact that does not creep."""
    changes = {
        **_resolution(elements, CONVERGED_STEP_S),
        "body.formulation.friction_impedance_ratio": CONVERGED_IMPEDANCE_RATIO,
        "duration_s": JUDGED_S,
    }
    return BenchCase(f"converged, {elements} elements", "converged", Case(RODS, changes), ())


def judged(elements: int, step_ms: float, line: str, what: str = "", **settings: Any) -> BenchCase:
    """Three segments, long enough for three cycles, with other settings if they are given and named."""
    changes = {**_resolution(elements, step_ms / 1e3), "duration_s": JUDGED_S, **settings}
    name = f"{'chain' if settings == _CHAIN else 'rods'}, {elements} elements, {step_ms:g} ms{what and f', {what}'}"
    return BenchCase(name, "judged", Case(RODS, changes), (line,))


def timed(preset: str, n_segments: int, duration_s: float, line: str) -> BenchCase:
    """A preset as it is, with other numbers of segments."""
    changes: dict[str, Any] = {"body.mesh.n_segments": n_segments, "duration_s": duration_s}
    # A study's cases are recorded sparsely unless they say otherwise.
    changes |= {f"record.{name}": value for name, value in load_config(preset).record.model_dump().items()}
    if preset == CHAIN and n_segments != 3:
        # The paper's file gives one range for each of three segments; the rods' preset has their mean.
        changes["body.rings.length_range_m"] = _worm_body(load_config(RODS)).rings.length_range_m
    name = f"{preset}, {n_segments} segments, {duration_s:g} s"
    return BenchCase(name, "speed", Case(preset, changes), (line,))


def level_of(config: RunConfig) -> str | None:
    """Name of the level of fidelity that a configuration of three segments resolves like, or None."""
    same = (
        name
        for name, level in LEVELS.items()
        if load_config(RODS, {**level.changes, "duration_s": config.duration_s}) == config
    )
    return next(same, None)


def _cases_of(line: str, effort: Effort) -> list[BenchCase]:
    match line:
        case "levels":
            found = [timed(CHAIN, 3, CHAIN_S, line)]
            for level in LEVELS.values():
                config = load_config(RODS, level.changes)
                settings = (
                    {"what": "impedance ratio 1", **_CREEPING} if _CREEPING.items() <= level.changes.items() else {}
                )
                step_ms = 1e3 * config.clock.physics_timestep_s
                found.append(judged(_worm_body(config).mesh.elements_per_side, step_ms, line, **settings))
            return found
        case "steps":
            return [judged(elements, step, line) for elements in (2, 3) for step in _STEPS_MS[effort]]
        case "elements":
            steps = _ELEMENT_STEPS_MS[effort]
            return [judged(elements, step, line) for step in steps for elements in _ELEMENTS[effort]]
        case "settings":
            others = [judged(2, step, line, "impedance ratio 1", **_CREEPING) for step in (10, 30, 40, 60, 80)]
            others += [judged(2, 20, line, what, **settings) for what, settings in _SETTINGS.items()]
            return [*others, judged(3, 2, line, **_CHAIN)] if effort == "full" else others[-1:]
        case "segments":
            return [timed(RODS, n, SEGMENTS_S, line) for n in _SEGMENTS[effort]]
        case "chain":
            return [timed(CHAIN, n, CHAIN_S, line) for n in _CHAIN_SEGMENTS[effort]]
        case "duration":
            return [timed(RODS, 3, duration, line) for duration in _DURATIONS_S[effort]]
        case _:
            return []


def _worm_body(config: RunConfig) -> WormBody:
    assert isinstance(config.body, WormBody)
    return config.body


def _resolution(elements: int, step_s: float) -> dict[str, float | int]:
    """A mesh and a step; every recorded sample is a new one."""
    signals, frames = (ceil(round(interval / step_s, 6)) * step_s for interval in (_LEAST_INTERVAL_S, 0.04))
    return {
        "body.mesh.elements_per_side": elements,
        "clock.physics_timestep_s": step_s,
        "record.signals_interval_s": round(signals, 9),
        "record.frames_interval_s": round(frames, 9),
    }
