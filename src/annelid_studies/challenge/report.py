"""What is made of the ranking: CSV files, tables for the terminal and the figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple
from math import isfinite, isnan, nan
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table as TerminalTable

from annelid.draw import canvas, panel_title, save_both, segment_colors
from annelid.markdown import Table
from annelid.output import write_csv
from annelid_studies.challenge.ranking import ALL, Array, Pair, Speeds, Standing, mean_ranks, standings
from annelid_studies.challenge.scores import Score
from annelid_studies.challenge.tasks import REFERENCE
from annelid_studies.tables import grouped, tabulated, terminal_table

CM = 100.0


def write_rows(kind: type[Any], rows: Sequence[Any], path: Path) -> Path:
    """Writes scores, standings or pairs as CSV, a column for every field; NaN stays empty."""
    return write_csv(path, kind.__slots__, ([_cell(value) for value in astuple(row)] for row in rows))


def _cell(value: object) -> object:
    return None if isinstance(value, float) and not isfinite(value) else value


def _with_interval(number: float, low: float, high: float) -> str:
    if not isfinite(number):
        return "-"
    return f"{number:.2f}" + (f" ({low:.2f} .. {high:.2f})" if isfinite(low) else "")


def _percent(share: float, low: float = nan, high: float = nan) -> str:
    if not isfinite(share):
        return "-"
    return f"{100 * share:.0f}" + (f" ({100 * low:.0f} .. {100 * high:.0f})" if isfinite(low) else "")


def _median(changes: Array | None) -> str:
    return "-" if changes is None else f"{np.median(np.abs(changes)):.1%}"


def ranking_table(found: Sequence[Standing], changes: Mapping[str, Array]) -> TerminalTable:
    """Lays out the ranking over all bodies and tasks."""
    columns: Mapping[str, Callable[[Standing], str]] = {
        "entrant": lambda one: one.entrant,
        "speed over the reference's": lambda one: _with_interval(one.ratio, one.ratio_low, one.ratio_high),
        "in order": lambda one: f"{one.robust:.0%}",
        "refused": lambda one: f"{one.refused:.0%}",
        "slip (J/m)": lambda one: f"{one.slip_J_per_m:.3g}",
        "work (J/m)": lambda one: f"{one.work_J_per_m:.3g}",
        "half the step": lambda one: _median(changes.get(one.entrant)),
    }
    overall = [one for one in found if one.task == one.body == ALL]
    caption = (
        "with 95 % intervals over tasks and draws; in order: share of runs in which one wave travels; half the step: "
        "median change of speed there"
    )
    return terminal_table(tabulated(overall, columns), "All bodies and tasks", caption=caption)


def speed_tables(found: Sequence[Standing]) -> list[TerminalTable]:
    """Lays out mean speeds, a table for each body with a row for an entrant and a column for a task."""
    tables = []
    for body, own in grouped((one for one in found if ALL not in (one.body, one.task)), lambda one: one.body).items():
        tasks = list(dict.fromkeys(one.task for one in own))
        rows = [
            [entrant, *(f"{CM * one.speed_m_per_s:.2f}" for one in each)]
            for entrant, each in grouped(own, lambda one: one.entrant).items()
        ]
        tables.append(terminal_table(Table(["entrant", *tasks], rows), f"Mean speed of body {body} (cm/s)"))
    return tables


def own_bodies_table(scores: Sequence[Score]) -> TerminalTable:
    """Lays out mean speeds of the entrants that brought their body."""
    rows = []
    for key, own in grouped(scores, lambda one: (one.entrant, one.body, one.task)).items():
        speed = np.array([one.speed_m_per_s for one in own])
        lengths = (
            float(np.nanmean(speed / [one.length_m for one in own])) if any(not one.refused for one in own) else nan
        )
        refused = f"{sum(bool(one.refused) for one in own)} of {len(own)}"
        rows.append([*key, f"{CM * speed.mean():.2f}", "-" if isnan(lengths) else f"{lengths:.3f}", refused])
    heads = ["entrant", "body", "task", "speed (cm/s)", "body lengths/s", "refused"]
    return terminal_table(Table(heads, rows), "With a body of their own", n_words=3)


def refused_table(scores: Sequence[Score]) -> TerminalTable:
    """Lays out the runs that were refused and count as speed 0, by entrant and reason."""
    lost = grouped((one for one in scores if one.refused), lambda one: (one.entrant, one.body, one.task))
    rows = [[*key, str(len(own)), own[0].refused] for key, own in lost.items()]
    return terminal_table(Table(["entrant", "body", "task", "runs", "reason"], rows), "Refused runs", n_words=5)


def ranking_figure(scores: Sequence[Score], stem: Path) -> Path:
    """Draws speeds with their intervals over each body, and mean ranks with the critical difference."""
    found, speeds = standings(scores), Speeds([one for one in scores if one.finer == 1])
    names = [one.entrant for one in found if one.task == one.body == ALL]
    of = {(one.entrant, one.body): one for one in found if one.task == ALL}
    bodies = list(dict.fromkeys(body for body, _ in speeds.cells))
    ranks, critical = mean_ranks(speeds)
    heights = np.arange(len(names))[::-1]
    with canvas(0.9 + 0.28 * len(names)) as figure:
        ratio, rank = figure.subplots(1, 2, sharey=True)
        for i, (body, color) in enumerate(zip(bodies, segment_colors(len(bodies)), strict=True)):
            own = [of[name, body] for name in names]
            values = np.array([one.ratio for one in own])
            spans = np.array([[one.ratio - one.ratio_low, one.ratio_high - one.ratio] for one in own]).T
            y = heights + 0.2 * (len(bodies) - 1 - 2 * i) / max(len(bodies), 1)
            errors = np.maximum(spans, 0.0) if np.isfinite(spans).all() else None
            ratio.errorbar(values, y, xerr=errors, fmt="o", color=color, markersize=3.5, linewidth=1.0, label=body)
        ratio.axvline(1.0, color="0.7", linewidth=0.8)
        ratio.set(xlabel="speed over the reference's", yticks=heights, yticklabels=names)
        ratio.legend(frameon=False)
        panel_title(ratio, "Mean over tasks, 95 % intervals")
        rank.plot([ranks[name] for name in names], heights, "o", color="0.2", markersize=3.5)
        if isfinite(critical):
            best = min(ranks.values())
            rank.axvspan(best, best + critical, color="0.9", zorder=0)
        rank.set(xlabel="mean rank over tasks, 1 the fastest")
        panel_title(rank, "Grey: not told apart from the first")
        return save_both(figure, stem)


def pairs_table(found: Sequence[Pair]) -> TerminalTable:
    """Lays out every entrant beside the reference, which is first of all, and what half the step makes of it."""
    columns: Mapping[str, Callable[[Pair], str]] = {
        "entrant": lambda one: one.second,
        "body": lambda one: one.body,
        "slower by (%)": lambda one: _percent(one.difference, one.difference_low, one.difference_high),
        "slower in (%)": lambda one: _percent(one.faster),
        "one draw (%)": lambda one: _percent(one.at_step),
        "half step (%)": lambda one: _percent(one.at_half_step),
        "slip": lambda one: f"{1 / one.slip:.2f}" if isfinite(one.slip) else "-",
        "work": lambda one: f"{1 / one.work:.2f}" if isfinite(one.work) else "-",
    }
    caption = (
        "slower by: of the reference's speed, with a 95 % interval; slower in: share of tasks and draws; half step: "
        "the one draw at half the step; slip, work: for a metre, over the reference's"
    )
    rows = [one for one in found if one.task == ALL and one.first == REFERENCE]
    return terminal_table(tabulated(rows, columns), f"Beside {REFERENCE}", n_words=2, caption=caption)
