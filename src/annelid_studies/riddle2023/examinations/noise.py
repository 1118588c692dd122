"""Sensor tolerance and noise: where the rhythm holds, with the paper's pins and with tight ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.analysis import RhythmScore
from annelid.body.worm import WormBody
from annelid.draw.canvas import canvas, save_both
from annelid.draw.markdown import Table
from annelid.draw.style import panel_title
from annelid.experiment.case import Case
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations.side_by_side import (
    PAPERS,
    SPRUNG,
    TIGHT,
    Worm,
    capitalised,
    in_percent,
    listed,
    rhythm_kind,
    rhythm_words,
    span,
)
from annelid_studies.worms import CHAIN

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MM = 1000.0
EVEN = 0.9
"""Least regularity of a wave that does not limp."""

Cells = Mapping[tuple[float, float], Sequence[RhythmScore]]
"""The runs of each (tolerance, noise), both in m."""
ONE_WAVE: Callable[[RhythmScore], bool] = attrgetter("is_one_wave")


@dataclass(frozen=True)
class NoiseMap:
    """A worm's map.

    Attributes:
        worm: The worm.
        tolerances_m: Tolerances of its sensors, m.
        noises_m: Standard deviations of the noise on every reading, m.
        n_seeds: Runs of each cell with noise.
    """

    worm: Worm
    tolerances_m: Sequence[float]
    noises_m: Sequence[float]
    n_seeds: int

    def cell(self, tolerance_m: float, noise_m: float) -> list[Case]:
        """Returns the runs of one cell: one for each seed, or a single one without noise, which is deterministic."""
        changes = {"sensor.tolerance_m": tolerance_m, "sensor.noise_m": noise_m}
        if not noise_m:
            return [self.worm.case(changes)]
        return [self.worm.case({**changes, "seed": seed}) for seed in range(self.n_seeds)]

    def cells(self) -> dict[tuple[float, float], list[Case]]:
        """Returns the runs of every cell."""
        return {(t, noise): self.cell(t, noise) for noise in self.noises_m for t in self.tolerances_m}


MAPS: Mapping[Effort, Sequence[NoiseMap]] = {
    "quick": (
        NoiseMap(PAPERS, (0.010,), (0.0,), 2),
        NoiseMap(SPRUNG, (0.0085, 0.010), (0.0, 0.001), 2),
        NoiseMap(TIGHT, (0.008, 0.015), (0.0, 0.002), 2),
    ),
    "full": (
        NoiseMap(PAPERS, (0.008, 0.010, 0.012, 0.015), (0.0, 0.001, 0.002), 5),
        NoiseMap(SPRUNG, (0.007, 0.008, 0.0085, 0.009, 0.010, 0.012), (0.0, 0.001, 0.002), 5),
        NoiseMap(TIGHT, (0.005, 0.008, 0.010, 0.012, 0.015, 0.020, 0.030), (0.0, 0.001, 0.002, 0.005), 5),
    ),
}


AT_THE_PAPERS_STEP = {tolerance_m: Case(CHAIN, {"sensor.tolerance_m": tolerance_m}) for tolerance_m in (0.008, 0.012)}
"""The chain at 1 ms, without noise, on both sides of the paper's tolerance."""
NOISY_AT_THE_PAPERS_STEP = [Case(CHAIN, {"sensor.noise_m": 0.002, "seed": seed}) for seed in range(3)]
"""The chain at 1 ms and its own tolerance, under the map's largest noise."""


def cases(effort: Effort) -> list[Case]:
    """Returns the runs of all maps."""
    mapped = [case for chart in MAPS[effort] for cell in chart.cells().values() for case in cell]
    return [*mapped, *AT_THE_PAPERS_STEP.values(), *NOISY_AT_THE_PAPERS_STEP] if effort == "full" else mapped


def read_cells(chart: NoiseMap, results: Results) -> Cells:
    """Returns the rhythms of every cell of a map."""
    return {place: [results[case].rhythm for case in cell] for place, cell in chart.cells().items()}


def is_even(score: RhythmScore) -> bool:
    """Tells whether a rhythm is the paper's wave and does not limp."""
    return score.is_one_wave and score.regularity is not None and score.regularity >= EVEN


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
    counts = Counter(map(_kind, scores))
    return max(counts, key=lambda kind: (counts[kind], list(_FILLS).index(kind)))


def _kind(score: RhythmScore) -> str:
    kind = rhythm_kind(score)
    return "limping" if kind == "1-2-3" and not is_even(score) else kind


# From order to silence and from light to dark, so that the map reads in greyscale.
_FILLS: dict[str, dict[str, Any]] = {
    "1-2-3": {"facecolor": "#d5efe8", "edgecolor": "white"},
    "limping": {"facecolor": "#f6e3a8", "edgecolor": "#c9a227", "hatch": "\\\\"},
    "other order": {"facecolor": "#d3b45f", "edgecolor": "#6d5716", "hatch": "..."},
    "too short": {"facecolor": "#c9ccd1", "edgecolor": "white"},
    "disordered": {"facecolor": "#d9825b", "edgecolor": "#7a2e0e", "hatch": "////"},
    "silent": {"facecolor": "#1b2a6b", "edgecolor": "white"},
}
_LEGEND = {
    "1-2-3": "an even wave 1-2-3",
    "limping": "a limping wave 1-2-3",
    "other order": "another ordered wave",
    "too short": "too short to tell",
    "disordered": "disordered",
    "silent": "silent",
}


def examine(results: Results, effort: Effort, stem: Path) -> Findings:
    """Draws the maps and says how much of the loop's fragility is the pins'."""
    read = [(chart, read_cells(chart, results)) for chart in MAPS[effort]]
    _draw(read, stem)
    by_worm = {chart.worm.name: cells for chart, cells in read}
    common = _in_common(list(by_worm.values()))
    compared = {name: {place: cells[place] for place in common} if common else cells for name, cells in by_worm.items()}
    windows = {name: steady_tolerances(cells, 0.0) for name, cells in by_worm.items()}
    handled = {name: handled_noise(cells) for name, cells in by_worm.items()}
    numbers: dict[str, float | str | None] = {"noise_common_cells": float(len(common))}
    for chart, cells in read:
        name = chart.worm.name
        numbers[f"noise_handled_{name}"] = handled[name]
        numbers[f"noise_tested_{name}"] = max(chart.noises_m)
        numbers[f"window_{name}"] = _in_mm(windows[name])
        numbers[f"window_low_{name}"] = min(windows[name], default=None)
        numbers[f"window_high_{name}"] = max(windows[name], default=None)
        even = steady_tolerances(cells, 0.0, is_even)
        numbers[f"even_window_{name}"] = _in_mm(even)
        numbers[f"even_window_low_{name}"] = min(even, default=None)
        numbers[f"even_window_high_{name}"] = max(even, default=None)
        numbers[f"noise_handled_evenly_{name}"] = handled_noise(cells, is_even)
        numbers[f"walking_share_{name}"] = share(compared[name])
        numbers[f"even_share_{name}"] = share(compared[name], is_even)
        numbers[f"runs_{name}"] = float(sum(map(len, cells.values())))
    if effort == "full":
        walking = [results[case].rhythm.is_one_wave for case in NOISY_AT_THE_PAPERS_STEP]
        numbers["walking_share_noisy_papers_step"] = sum(walking) / len(walking)
    return Findings(
        answer=" ".join(
            [
                _windows_in_words(read, windows),
                _fragility_in_words(read, compared, bool(common)),
                _noise_in_words(read, handled),
            ]
        ),
        caption=_caption(read),
        table=_table(read),
        remarks=[
            _breadth_in_words(read),
            _handling_in_words(read),
            _sensor_in_words(read),
            _step_in_words(results)
            if effort == "full"
            else f"The quick effort runs {PAPERS.label} at its own tolerance only.",
        ],
        numbers=numbers,
    )


def _in_common(maps: Sequence[Cells]) -> list[tuple[float, float]]:
    return sorted(set.intersection(*(set(cells) for cells in maps)))


def _in_mm(lengths_m: Sequence[float], of_m: Sequence[float] = ()) -> str:
    """Lists lengths, or gives their range where they are neighbours among the tested ones."""
    if not lengths_m:
        return "none"
    first = sorted(of_m).index(lengths_m[0]) if of_m else 0
    if len(lengths_m) > 1 and tuple(sorted(of_m)[first : first + len(lengths_m)]) == tuple(lengths_m):
        return f"{MM * lengths_m[0]:g} to {MM * lengths_m[-1]:g} mm"
    return f"{listed([f'{MM * length:g}' for length in lengths_m])} mm"


def _windows_in_words(read: Sequence[tuple[NoiseMap, Cells]], windows: Mapping[str, Sequence[float]]) -> str:
    parts = [
        f"{_in_mm(windows[chart.worm.name], chart.tolerances_m)} ({chart.worm.label}; evenly at "
        f"{_in_mm(steady_tolerances(cells, 0.0, is_even), chart.tolerances_m)})"
        for chart, cells in read
    ]
    return f"Without noise the worm walks in one wave 1-2-3 at tolerances of {listed(parts)}."


def _fragility_in_words(read: Sequence[tuple[NoiseMap, Cells]], compared: Mapping[str, Cells], in_common: bool) -> str:
    walking = {name: share(cells) for name, cells in compared.items()}
    evenly = {name: share(cells, is_even) for name, cells in compared.items()}
    widths = {chart.worm.name: _relative_width(steady_tolerances(cells, 0.0, is_even)) for chart, cells in read}
    n_cells = len(next(iter(compared.values())))
    where = f"the {n_cells} cells that the three maps share" if in_common else "each map's own cells"
    parts = [
        f"{in_percent(walking[chart.worm.name])} % ({chart.worm.label}; {in_percent(evenly[chart.worm.name])} % evenly)"
        for chart, _ in read
    ]
    fact = f"Of the runs in {where}, {listed(parts)} walk."
    if not in_common:
        return fact
    soft = (PAPERS.name, SPRUNG.name)
    measures = (walking, evenly, widths)
    wider = sum(measure[TIGHT.name] > 1.05 * max(measure[name] for name in soft) for measure in measures)
    if wider == len(measures):
        return f"{fact} So a good part of the loop's fragility is the soft pins'."
    if wider:
        return f"{fact} So the soft pins are a part of the loop's fragility, though not by every measure."
    return f"{fact} So the loop's fragility is not that of the soft pins."


def _relative_width(window_m: Sequence[float]) -> float:
    """How many times its lower end the upper end of a window is; 0 where there is none."""
    return max(window_m) / min(window_m) if window_m else 0.0


def _breadth_in_words(read: Sequence[tuple[NoiseMap, Cells]]) -> str:
    parts = []
    for chart, cells in read:
        even = steady_tolerances(cells, 0.0, is_even)
        if even:
            parts.append(f"{_relative_width(even):.1f} ({chart.worm.label})")
    if not parts:
        return "No tested tolerance gives an even wave."
    return (
        f"The largest tested tolerance with an even wave is so many times the smallest: {listed(parts)}. The true "
        "windows are wider, by up to the next tested tolerances."
    )


def _noise_in_words(read: Sequence[tuple[NoiseMap, Cells]], handled: Mapping[str, float | None]) -> str:
    parts = []
    for chart, _ in read:
        most, reached = max(chart.noises_m), handled[chart.worm.name]
        if most == 0:
            continue
        if reached is None:
            parts.append(f"none ({chart.worm.label})")
        elif reached == 0:
            least = min(noise for noise in chart.noises_m if noise > 0)
            parts.append(f"less than {MM * least:g} mm ({chart.worm.label})")
        else:
            tested = "the most tested" if reached == most else f"up to {MM * most:g} mm tested"
            parts.append(f"{MM * reached:g} mm ({chart.worm.label}; {tested})")
    return f"The largest noise under which some tolerance keeps every run in this wave is {listed(parts)}."


def _handling_in_words(read: Sequence[tuple[NoiseMap, Cells]]) -> str:
    sentences = []
    for chart, cells in read:
        own = chart.worm.case(None).config.sensor.tolerance_m
        parts = []
        for noise in chart.noises_m:
            if not noise:
                continue
            steady = steady_tolerances(cells, noise)
            words = f"{_in_mm(steady, chart.tolerances_m)} under noise of {MM * noise:g} mm"
            if steady and (own, noise) in cells and own not in steady:
                words += f", where {MM * own:g} mm no longer serves"
            parts.append(words)
        if parts:
            sentences.append(f"{capitalised(chart.worm.label)} (tolerance {MM * own:g} mm): {'; '.join(parts)}.")
    return (
        "The paper supposes that noise is handled by changing the sensor's threshold. The tolerances that keep every "
        "run in order, by noise. " + " ".join(sentences)
    )


def _sensor_in_words(read: Sequence[tuple[NoiseMap, Cells]]) -> str:
    most = max(noise for chart, _ in read for noise in chart.noises_m)
    config = TIGHT.case(None).config
    assert isinstance(config.body, WormBody)
    n_springs = config.body.mesh.n_helices // 2
    return (
        f"Noise is normal, and drawn anew for every spring and every {MM * config.clock.control_timestep_s:g} ms. The "
        f"sensor compares the mean of a segment's {n_springs} springs with the tolerance, so {MM * most:g} mm on each "
        f"spring are {MM * most / sqrt(n_springs):.1f} mm on what it compares. In cells where some runs walk and some "
        "do not, chance decides."
    )


def _step_in_words(results: Results) -> str:
    said = [
        f"at {MM * tolerance:g} mm {rhythm_words(results[case].rhythm)}"
        for tolerance, case in AT_THE_PAPERS_STEP.items()
    ]
    noisy = [results[case].rhythm for case in NOISY_AT_THE_PAPERS_STEP]
    walking = sum(map(ONE_WAVE, noisy))
    noise_m = NOISY_AT_THE_PAPERS_STEP[0].config.sensor.noise_m
    return (
        "The chain's map is of steps of 2 ms. At the paper's step of 1 ms and without noise its rhythm is "
        f"{listed(said)}; with noise of {MM * noise_m:g} mm and the paper's tolerance, {walking} of {len(noisy)} runs "
        "walk 1-2-3."
    )


def _caption(read: Sequence[tuple[NoiseMap, Cells]]) -> str:
    n_seeds = listed(sorted({str(chart.n_seeds) for chart, _ in read}))
    duration = listed(sorted({f"{chart.worm.case(None).config.duration_s:g}" for chart, _ in read}))
    return (
        "Rhythm in closed loop over the tolerance of the stretch sensors and the standard deviation of their noise. A "
        "cell's shade is the most frequent rhythm of its runs; the text says how many of them walk in a single wave "
        f"1-2-3, and below it their mean regularity: 1 for a perfectly even wave; with less than {EVEN:g} it limps. "
        f"With noise a cell is {n_seeds} runs of {duration} s, each with its own seed; without noise it is one "
        "run, which is deterministic. Blank cells were not run."
    )


def _table(read: Sequence[tuple[NoiseMap, Cells]]) -> Table:
    rows = []
    for chart, cells in read:
        for noise in chart.noises_m:
            scores = [score for (_, level), of_cell in cells.items() if level == noise for score in of_cell]
            if not scores:
                continue
            kinds = Counter(map(rhythm_kind, scores))
            walks = [score for score in scores if score.is_one_wave]
            regularities = [score.regularity for score in walks if score.regularity is not None]
            periods = [score.period_s for score in walks if score.period_s is not None]
            rows.append(
                [
                    chart.worm.label,
                    f"{MM * noise:g}",
                    _in_mm(steady_tolerances(cells, noise), chart.tolerances_m).removesuffix(" mm"),
                    f"{len(walks)} of {len(scores)}",
                    str(sum(map(is_even, walks))),
                    *(str(kinds[kind]) for kind in ("other order", "disordered", "silent")),
                    span(regularities, digits=2),
                    span(periods, digits=2),
                ]
            )
    return Table(
        (
            "worm",
            "noise (mm)",
            "all walk at (mm)",
            "walk 1-2-3",
            "evenly",
            "other order",
            "disordered",
            "silent",
            "regularity of walks",
            "their period (s)",
        ),
        rows,
    )


def _draw(read: Sequence[tuple[NoiseMap, Cells]], stem: Path) -> None:
    from matplotlib.patches import Patch

    tolerances = sorted({tolerance for chart, _ in read for tolerance in chart.tolerances_m})
    noises = sorted({noise for chart, _ in read for noise in chart.noises_m})
    with canvas(1.35 + 0.38 * len(noises)) as figure:
        panels = figure.subplots(1, len(read), sharey=True, squeeze=False)[0]
        for axes, (chart, cells) in zip(panels, read, strict=True):
            _draw_map(axes, cells, tolerances, noises)
            panel_title(axes, capitalised(chart.worm.label))
        panels[0].set_ylabel("sensor noise (mm)")
        panels[len(read) // 2].set_xlabel("tolerance of the stretch sensors (mm)")
        seen = {majority(scores) for _, cells in read for scores in cells.values()}
        handles = [Patch(**look, label=_LEGEND[kind]) for kind, look in _FILLS.items() if kind in seen]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
        save_both(figure, stem)


def _draw_map(axes: Axes, cells: Cells, tolerances: Sequence[float], noises: Sequence[float]) -> None:
    from matplotlib.patches import Rectangle

    for (tolerance, noise), scores in cells.items():
        x, y = tolerances.index(tolerance), noises.index(noise)
        kind = majority(scores)
        axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1.0, 1.0, linewidth=0.8, **_FILLS[kind]))
        plate = {"facecolor": _FILLS[kind]["facecolor"], "edgecolor": "none", "pad": 0.2}
        axes.text(
            x,
            y,
            _cell_text(scores),
            ha="center",
            va="center",
            fontsize=6.5,
            linespacing=1.1,
            color="white" if kind == "silent" else "black",
            bbox=plate if "hatch" in _FILLS[kind] else None,
        )
    axes.set_xlim(-0.5, len(tolerances) - 0.5)
    axes.set_ylim(-0.5, len(noises) - 0.5)
    axes.set_xticks(range(len(tolerances)), [f"{MM * tolerance:g}" for tolerance in tolerances])
    axes.set_yticks(range(len(noises)), [f"{MM * noise:g}" for noise in noises])
    axes.tick_params(length=0)
    axes.grid(visible=False)


def _cell_text(scores: Sequence[RhythmScore]) -> str:
    walks = [score for score in scores if score.is_one_wave]
    text = f"{len(walks)}/{len(scores)}"
    regularities = [score.regularity for score in walks if score.regularity is not None]
    return f"{text}\n{np.mean(regularities):.2f}".replace("\n0.", "\n.") if regularities else text


NOISE = Examination(
    name="noise",
    title="Sensor tolerance and noise",
    question=(
        "Within which tolerances of the stretch sensors, and up to which noise, does the worm keep its rhythm? How "
        "much of the loop's fragility is the pins', and can noise be handled by changing the threshold, as the paper "
        "supposes?"
    ),
    cases=cases,
    examine=examine,
)
