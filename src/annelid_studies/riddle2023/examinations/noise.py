"""Sensor tolerance and noise: where the worm keeps its rhythm, with the paper's crossings and with rigid ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from annelid.analysis import RhythmScore
from annelid.experiment import Case, Store
from annelid_studies.papers import words
from annelid_studies.papers.report_parts import Findings, Number
from annelid_studies.papers.words import MM
from annelid_studies.riddle2023.examinations.design import PAPERS, RIGID, SOFT, Worm, examination, findings
from annelid_studies.standard_cases import CHAIN, Effort
from annelid_studies.tables import tabulated

Cells = Mapping[tuple[float, float], Sequence[RhythmScore]]
"""The runs of each (tolerance, noise), both in m."""


@dataclass(frozen=True)
class NoiseMap:
    """A worm's map."""

    worm: Worm
    tolerances_m: Sequence[float]  # Tolerances of its sensors, m
    noises_m: Sequence[float]  # Standard deviations of the noise on every reading, m
    n_seeds: int  # Runs of each cell with noise

    def cell(self, tolerance_m: float, noise_m: float) -> list[Case]:
        """Returns the runs of one cell: one for each seed, or a single one without noise, which is deterministic."""
        changes = {"sensor.tolerance_m": tolerance_m, "sensor.noise_m": noise_m}
        seeds = [{"seed": seed} for seed in range(self.n_seeds)] if noise_m else [{}]
        return [self.worm.case({**changes, **seed}) for seed in seeds]

    def cells(self) -> dict[tuple[float, float], list[Case]]:
        """Returns the runs of every cell."""
        return {(t, noise): self.cell(t, noise) for noise in self.noises_m for t in self.tolerances_m}


MAPS: Mapping[Effort, Sequence[NoiseMap]] = {
    "quick": (
        NoiseMap(PAPERS, (0.010,), (0.0,), 2),
        NoiseMap(SOFT, (0.0075, 0.010), (0.0, 0.001), 2),
        NoiseMap(RIGID, (0.008, 0.015), (0.0, 0.002), 2),
    ),
    "full": (
        NoiseMap(PAPERS, (0.008, 0.010, 0.012, 0.015), (0.0, 0.001, 0.002), 5),
        NoiseMap(SOFT, (0.006, 0.0075, 0.008, 0.009, 0.010, 0.012), (0.0, 0.001, 0.002), 5),
        NoiseMap(RIGID, (0.005, 0.008, 0.010, 0.012, 0.015, 0.020, 0.030), (0.0, 0.001, 0.002, 0.005), 5),
    ),
}
NOISE_AT_THE_PAPERS_STEP_M = 0.002
NOISY_AT_THE_PAPERS_STEP = [
    Case(CHAIN, {"sensor.noise_m": NOISE_AT_THE_PAPERS_STEP_M, "seed": seed}) for seed in range(3)
]
"""The chain at 1 ms and its own tolerance, under the map's largest noise."""


def _cases(effort: Effort) -> list[Case]:
    mapped = [case for chart in MAPS[effort] for cell in chart.cells().values() for case in cell]
    return [*mapped, *NOISY_AT_THE_PAPERS_STEP] if effort == "full" else mapped


def steady_tolerances(cells: Cells, noise_m: float) -> list[float]:
    """Returns the tolerances at which every run with this noise is one wave, m, rising."""
    return sorted(
        t for (t, noise), scores in cells.items() if noise == noise_m and all(one.is_one_wave for one in scores)
    )


def handled_noise(cells: Cells) -> float | None:
    """Returns the largest noise at which every run of some tolerance is one wave, m; None if there is none."""
    return max((noise for _, noise in cells if steady_tolerances(cells, noise)), default=None)


class _Read(NamedTuple):
    """A map with its runs, and the tolerances that need no luck, m."""

    chart: NoiseMap
    cells: Cells
    window: Sequence[float]

    @property
    def worm(self) -> Worm:
        return self.chart.worm


def _examine(store: Store, effort: Effort) -> Findings:
    mapped = {
        chart: {place: [store[case].rhythm for case in cell] for place, cell in chart.cells().items()}
        for chart in MAPS[effort]
    }
    maps = [_Read(chart, cells, steady_tolerances(cells, 0.0)) for chart, cells in mapped.items()]
    noisy_maps = [one for one in maps if max(one.chart.noises_m) > 0]
    numbers: dict[str, Number] = {}
    for one in maps:
        numbers[f"noise_handled_{one.worm.name}"] = handled_noise(one.cells)
        numbers[f"noise_tested_{one.worm.name}"] = max(one.chart.noises_m)
        numbers[f"window_{one.worm.name}"] = _in_mm(one.window)
    found: dict[str, Any] = {
        "windows": words.by_worm(maps, lambda one: _in_mm(one.window)),
        "papers": PAPERS.label,
    }
    if effort == "full":
        noisy = [store[case].rhythm.is_one_wave for case in NOISY_AT_THE_PAPERS_STEP]
        numbers["walking_share_noisy_papers_step"] = sum(noisy) / len(noisy)
        found |= {
            "noise_mm": MM * NOISE_AT_THE_PAPERS_STEP_M,
            "n_noisy": sum(noisy),
            "of_noisy": len(noisy),
        }
    found["handled"] = words.by_worm(
        noisy_maps,
        lambda one: f"{words.in_unit(handled_noise(one.cells), MM, 0)} of {MM * max(one.chart.noises_m):g} mm",
    )
    rows = [
        (one, noise, [score for (_, level), cell in one.cells.items() if level == noise for score in cell])
        for one in maps
        for noise in one.chart.noises_m
    ]
    return findings("noise", found, tabulated(rows, _COLUMNS), [effort], numbers)


_Row = tuple[_Read, float, Sequence[RhythmScore]]


def _of_kind(kind: str) -> Callable[[_Row], str]:
    return lambda row: str(sum(words.kind(score) == kind for score in row[2]))


def _of_walks(name: str) -> Callable[[_Row], str]:
    return lambda row: words.span(words.number(getattr(score, name)) for score in row[2] if score.is_one_wave)


_COLUMNS: Mapping[str, Callable[[_Row], str]] = {
    "worm": lambda row: row[0].worm.label,
    "noise (mm)": lambda row: f"{MM * row[1]:g}",
    "all walk at (mm)": lambda row: _in_mm(steady_tolerances(row[0].cells, row[1])).removesuffix(" mm"),
    "walk 1-2-3": lambda row: f"{sum(score.is_one_wave for score in row[2])} of {len(row[2])}",
    "other order": _of_kind("other order"),
    "disordered": _of_kind("disordered"),
    "silent": _of_kind("silent"),
    "regularity of walks": _of_walks("regularity"),
    "their period (s)": _of_walks("period_s"),
}


def _in_mm(lengths_m: Sequence[float]) -> str:
    return f"{words.listed(f'{MM * length:g}' for length in lengths_m)}{' mm' if lengths_m else ''}"


NOISE = examination("noise", _cases, _examine)
