"""Sensor tolerance and noise: where the worm keeps its rhythm, with the paper's crossings and with rigid ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from annelid.analysis import RhythmScore
from annelid.config import field_value
from annelid.draw import canvas, panel_title, save_both
from annelid.experiment import Case, Store
from annelid_studies.riddle2023 import words
from annelid_studies.riddle2023.contents import Findings, Number, examination, findings
from annelid_studies.riddle2023.examinations.design import PAPERS, RIGID, SOFT, Worm
from annelid_studies.riddle2023.words import MM
from annelid_studies.tables import tabulated
from annelid_studies.worms import CHAIN, Effort

EVEN = 0.9
"""Least regularity of a wave that does not limp."""

Cells = Mapping[tuple[float, float], Sequence[RhythmScore]]
"""The runs of each (tolerance, noise), both in m."""
ONE_WAVE: Callable[[RhythmScore], bool] = attrgetter("is_one_wave")


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
AT_THE_PAPERS_STEP = {tolerance_m: Case(CHAIN, {"sensor.tolerance_m": tolerance_m}) for tolerance_m in (0.008, 0.012)}
"""The chain at 1 ms, without noise, on both sides of the paper's tolerance."""
NOISE_AT_THE_PAPERS_STEP_M = 0.002
NOISY_AT_THE_PAPERS_STEP = [
    Case(CHAIN, {"sensor.noise_m": NOISE_AT_THE_PAPERS_STEP_M, "seed": seed}) for seed in range(3)
]
"""The chain at 1 ms and its own tolerance, under the map's largest noise."""


def _cases(effort: Effort) -> list[Case]:
    mapped = [case for chart in MAPS[effort] for cell in chart.cells().values() for case in cell]
    return [*mapped, *AT_THE_PAPERS_STEP.values(), *NOISY_AT_THE_PAPERS_STEP] if effort == "full" else mapped


def is_even(score: RhythmScore) -> bool:
    """Whether a rhythm is the paper's wave and does not limp."""
    return score.is_one_wave and words.number(score.regularity) >= EVEN


def steady_tolerances(cells: Cells, noise_m: float, wanted: Callable[[RhythmScore], bool] = ONE_WAVE) -> list[float]:
    """Returns the tolerances at which every run with this noise has the wanted rhythm, m, rising."""
    return sorted(
        tolerance for (tolerance, noise), scores in cells.items() if noise == noise_m and all(map(wanted, scores))
    )


def handled_noise(cells: Cells, wanted: Callable[[RhythmScore], bool] = ONE_WAVE) -> float | None:
    """Returns the largest noise at which some tolerance has the wanted rhythm in every run, m; None if none has."""
    return max((noise for _, noise in cells if steady_tolerances(cells, noise, wanted)), default=None)


def share(cells: Cells, wanted: Callable[[RhythmScore], bool] = ONE_WAVE) -> float:
    """Returns the share of runs with the wanted rhythm, averaged over the cells."""
    return float(np.mean([np.mean([wanted(score) for score in scores]) for scores in cells.values()]))


def majority(scores: Sequence[RhythmScore]) -> str:
    """Returns the most frequent kind of rhythm; of two as frequent, the less ordered."""
    counts = Counter("limping" if one.is_one_wave and not is_even(one) else words.kind(one) for one in scores)
    return max(counts, key=lambda kind: (counts[kind], list(_FILLS).index(kind)))


# From order to silence and from light to dark, so that the map reads in greyscale.
_FILLS: dict[str, dict[str, Any]] = {
    "1-2-3": {"facecolor": "#d5efe8", "edgecolor": "white", "label": "an even wave 1-2-3"},
    "limping": {"facecolor": "#f6e3a8", "edgecolor": "#c9a227", "hatch": "\\\\", "label": "a limping wave 1-2-3"},
    "other order": {"facecolor": "#d3b45f", "edgecolor": "#6d5716", "hatch": "...", "label": "another ordered wave"},
    "too short": {"facecolor": "#c9ccd1", "edgecolor": "white", "label": "too short to tell"},
    "disordered": {"facecolor": "#d9825b", "edgecolor": "#7a2e0e", "hatch": "////", "label": "disordered"},
    "silent": {"facecolor": "#1b2a6b", "edgecolor": "white", "label": "silent"},
}


class _Read(NamedTuple):
    """A map with its runs, those of them in cells that all maps share, and the tolerances that need no luck, m."""

    chart: NoiseMap
    cells: Cells
    compared: Cells
    window: Sequence[float]
    even_window: Sequence[float]

    @property
    def worm(self) -> Worm:
        return self.chart.worm

    @property
    def breadth(self) -> float:
        """How many times its lower end the upper end of the even window is; 0 where there is none."""
        return max(self.even_window) / min(self.even_window) if self.even_window else 0.0


def _examine(store: Store, effort: Effort, stem: Path) -> Findings:
    mapped = {
        chart: {place: [store[case].rhythm for case in cell] for place, cell in chart.cells().items()}
        for chart in MAPS[effort]
    }
    common = sorted(set.intersection(*map(set, mapped.values())))
    maps = [
        _Read(
            chart,
            cells,
            {place: cells[place] for place in common} or cells,
            steady_tolerances(cells, 0.0),
            steady_tolerances(cells, 0.0, is_even),
        )
        for chart, cells in mapped.items()
    ]
    noisy_maps = [one for one in maps if max(one.chart.noises_m) > 0]
    _draw(maps, stem)
    numbers: dict[str, Number] = {}
    for one in maps:
        numbers[f"noise_handled_{one.worm.name}"] = handled_noise(one.cells)
        numbers[f"noise_tested_{one.worm.name}"] = max(one.chart.noises_m)
        numbers[f"window_{one.worm.name}"] = _in_mm(one.window)
    found: dict[str, Any] = {
        "windows": words.by_worm(maps, lambda one: _in_mm(one.window)),
        "even_windows": words.by_worm(maps, lambda one: _in_mm(one.even_window)),
        "fragility": _fragility_in_words(maps, bool(common)),
        "even": EVEN,
        "seeds": maps[0].chart.n_seeds,
        "duration_s": PAPERS.case(None).config.duration_s,
        "breadths": words.by_worm((one for one in maps if one.even_window), lambda one: f"{one.breadth:.1f}"),
        "by_noise": "; ".join(map(_by_noise, noisy_maps)),
        **_of_sensor(max(noise for one in maps for noise in one.chart.noises_m)),
        "papers": PAPERS.label,
    }
    if effort == "full":
        noisy = [store[case].rhythm.is_one_wave for case in NOISY_AT_THE_PAPERS_STEP]
        numbers["walking_share_noisy_papers_step"] = sum(noisy) / len(noisy)
        found |= {
            "quiet": words.listed(
                f"at {MM * tolerance:g} mm {words.rhythm(store[case].rhythm)}"
                for tolerance, case in AT_THE_PAPERS_STEP.items()
            ),
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
    remarks = ["breadths", "thresholds", "sensor", effort]
    return findings("noise", found, tabulated(rows, _COLUMNS), remarks, numbers)


_Row = tuple[_Read, float, Sequence[RhythmScore]]


def _of_kind(kind: str) -> Callable[[_Row], str]:
    return lambda row: str(sum(words.kind(score) == kind for score in row[2]))


def _of_walks(name: str) -> Callable[[_Row], str]:
    return lambda row: words.span(words.number(getattr(score, name)) for score in row[2] if score.is_one_wave)


_COLUMNS: Mapping[str, Callable[[_Row], str]] = {
    "worm": lambda row: row[0].worm.label,
    "noise (mm)": lambda row: f"{MM * row[1]:g}",
    "all walk at (mm)": lambda row: _in_mm(steady_tolerances(row[0].cells, row[1])).removesuffix(" mm"),
    "walk 1-2-3": lambda row: f"{sum(map(ONE_WAVE, row[2]))} of {len(row[2])}",
    "evenly": lambda row: str(sum(map(is_even, row[2]))),
    "other order": _of_kind("other order"),
    "disordered": _of_kind("disordered"),
    "silent": _of_kind("silent"),
    "regularity of walks": _of_walks("regularity"),
    "their period (s)": _of_walks("period_s"),
}


def _in_mm(lengths_m: Sequence[float]) -> str:
    return f"{words.listed(f'{MM * length:g}' for length in lengths_m)}{' mm' if lengths_m else ''}"


def _fragility_in_words(maps: Sequence[_Read], in_common: bool) -> str:
    where = f"the {len(maps[0].compared)} cells that the three maps share" if in_common else "each map's own cells"
    walking = {one.worm: share(one.compared) for one in maps}
    evenly = {one.worm: share(one.compared, is_even) for one in maps}
    parts, even_parts = (
        words.listed(f"{words.in_percent(value)} % ({worm.label})" for worm, value in of.items())
        for of in (walking, evenly)
    )
    fact = f"Of the runs in {where}, {parts} walk, {even_parts} evenly."
    if not in_common:
        return fact
    measures = (walking, evenly, {one.worm: one.breadth for one in maps})
    wider = sum(measure[RIGID] > 1.05 * max(measure[PAPERS], measure[SOFT]) for measure in measures)
    verdict = {
        len(measures): "a good part of the loop's fragility is the soft crossings'",
        0: "the loop's fragility is not that of the soft crossings",
    }.get(wider, "the soft crossings are a part of the loop's fragility, though not by every measure")
    return f"{fact} So {verdict}."


def _by_noise(one: _Read) -> str:
    parts = [
        f"{_in_mm(steady_tolerances(one.cells, noise))} under noise of {MM * noise:g} mm"
        for noise in one.chart.noises_m[1:]
    ]
    return f"{one.worm.label} (own tolerance {MM * one.worm.tolerance_m:g} mm), {', '.join(parts)}"


def _of_sensor(most_m: float) -> dict[str, Any]:
    """What noise of a size on every spring is on what the sensor compares."""
    config = RIGID.case(None).config
    n_springs = field_value(config, "body.mesh.n_helices") // 2
    return {
        "step_ms": MM * config.clock.control_timestep_s,
        "n_springs": n_springs,
        "most_mm": MM * most_m,
        "mean_mm": MM * most_m / sqrt(n_springs),
    }


def _draw(maps: Sequence[_Read], stem: Path) -> None:
    tolerances = sorted({tolerance for one in maps for tolerance in one.chart.tolerances_m})
    noises = sorted({noise for one in maps for noise in one.chart.noises_m})
    with canvas(1.35 + 0.38 * len(noises)) as figure:
        panels = figure.subplots(1, len(maps), sharey=True, squeeze=False)[0]
        for axes, one in zip(panels, maps, strict=True):
            for (tolerance, noise), scores in one.cells.items():
                _draw_cell(axes, tolerances.index(tolerance), noises.index(noise), scores)
            axes.set_xlim(-0.5, len(tolerances) - 0.5)
            axes.set_ylim(-0.5, len(noises) - 0.5)
            axes.set_xticks(range(len(tolerances)), [f"{MM * tolerance:g}" for tolerance in tolerances])
            axes.set_yticks(range(len(noises)), [f"{MM * noise:g}" for noise in noises])
            axes.tick_params(length=0)
            axes.grid(visible=False)
            panel_title(axes, words.capitalised(one.worm.label))
        panels[0].set_ylabel("sensor noise (mm)")
        panels[len(maps) // 2].set_xlabel("tolerance of the stretch sensors (mm)")
        seen = {majority(scores) for one in maps for scores in one.cells.values()}
        handles = [Patch(**look) for kind, look in _FILLS.items() if kind in seen]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
        save_both(figure, stem)


def _draw_cell(axes: Axes, x: int, y: int, scores: Sequence[RhythmScore]) -> None:
    """Shades a cell by its rhythm and writes into it how many runs walk, and how regularly."""
    kind = majority(scores)
    fill = _FILLS[kind]
    axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1.0, 1.0, linewidth=0.8, **fill))
    walks = [score for score in scores if score.is_one_wave]
    text = f"{len(walks)}/{len(scores)}"
    if regularities := [score.regularity for score in walks if score.regularity is not None]:
        text += f"\n{np.mean(regularities):.2f}".replace("\n0.", "\n.")
    plate = {"facecolor": fill["facecolor"], "edgecolor": "none", "pad": 0.2} if "hatch" in fill else None
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 6.5, "linespacing": 1.1, "bbox": plate}
    axes.text(x, y, text, color="white" if kind == "silent" else "black", **look)


NOISE = examination("noise", _cases, _examine)
