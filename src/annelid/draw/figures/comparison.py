"""Runs overlaid: lengths of rings and segments, and where they went."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from annelid.analysis.track import forward_position
from annelid.draw.canvas import MOST_ROWS, canvas, evenly, line_entries, line_looks, panel_title, save
from annelid.errors import RunFileError
from annelid.protocols import Array
from annelid.simulation.runfile import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CM = 100.0

Values = Array | None  # one column per segment, ``(n_times, n_segments)``; None if they were not recorded


def lengths_figure(runs: Sequence[Run], labels: Sequence[str], path: Path) -> Path:
    """Draws how much each segment is longer than at rest, and its ring in shares of its longest.

    Args:
        runs: The runs.
        labels: A short name of each.
        path: File to write; its suffix chooses the format.

    Raises:
        RunFileError: None of the runs recorded lengths.
    """
    panels = {"Segment, longer than at rest (cm)": _elongation, "Ring (% of its longest)": _rings}
    curves = [[of(run) for of in panels.values()] for run in runs]
    drawn = [any(values is not None for values in of_run) for of_run in curves]
    if not any(drawn):
        raise RunFileError("none of these runs recorded lengths of segments or rings")
    n_segments = max(run.config.body.n_segments for run, shown in zip(runs, drawn, strict=True) if shown)
    segments = evenly(n_segments, MOST_ROWS)
    with canvas(0.8 + 1.15 * len(segments)) as figure:
        grid = figure.subplots(len(segments), len(panels), sharex=True, sharey="col", squeeze=False)
        for i, (title, column) in enumerate(zip(panels, grid.T, strict=True)):
            panel_title(column[0], title)
            column[-1].set_xlabel("time (s)")
            for run, of_run, look in zip(runs, curves, line_looks(len(runs)), strict=True):
                for axes, segment in zip(column, segments, strict=True):
                    if (values := of_run[i]) is not None and segment < values.shape[1]:
                        axes.plot(run.data["time"].values, values[:, segment], **look)
        for axes, segment in zip(grid[:, 0], segments, strict=True):
            axes.set_ylabel(f"segment {segment + 1}")
        _legend(figure, labels, drawn)
        return save(figure, path)


def travel_figure(runs: Sequence[Run], labels: Sequence[str], path: Path) -> Path:
    """Draws the travel of the centre of mass along the initial heading, and its track seen from above.

    Args:
        runs: The runs.
        labels: A short name of each.
        path: File to write; its suffix chooses the format.

    Raises:
        RunFileError: None of the runs recorded where the worm went.
    """
    tracks = [_centre(run) for run in runs]
    drawn = [track is not None for track in tracks]
    if not any(drawn):
        raise RunFileError("none of these runs recorded where the worm went")
    seen = [not run.config.body.is_planar for run in runs]
    with canvas(3.4) as figure:
        panels = figure.subplots(1, 2 if any(seen) else 1, squeeze=False)[0]
        panel_title(panels[0], "Travel towards the front (cm)")
        panels[0].set_xlabel("time (s)")
        for run, track, above, look in zip(runs, tracks, seen, line_looks(len(runs)), strict=True):
            if track is None:
                continue
            ahead = forward_position(run)
            panels[0].plot(run.data["time"].values, _CM * (ahead - ahead[0]), **look)
            if above:
                panels[1].plot(track[:, 0], track[:, 1], **look)
                panels[1].plot(*track[-1, :2], marker="o", markersize=4, color=look["color"])
        if any(seen):
            panel_title(panels[1], "Track of the middle from above (cm)")
            panels[1].set(xlabel="x, front towards the left (heading 0)", ylabel="y")
            panels[1].set_aspect("equal", adjustable="datalim")
        _legend(figure, labels, drawn)
        return save(figure, path)


def _elongation(run: Run) -> Values:
    """Mean lengthening of each segment's sensors, cm."""
    if "stretch_length" not in run.data:
        return None
    stretch, rest = run.data["stretch_length"].values, run.data["stretch_rest_length"].values
    return _CM * (stretch - rest).mean(axis=2)


def _rings(run: Run) -> Values:
    """Length of each segment's ring in percent of its longest in the run; a ring of two halves is as long as both."""
    if "ring_length" not in run.data:
        return None
    lengths = run.data["ring_length"].values
    whole = lengths.reshape(len(lengths), run.config.body.n_segments, -1).sum(axis=2)
    return 100.0 * whole / whole.max(axis=0)


def _centre(run: Run) -> Values:
    """Displacement of the centre of mass from its first place, cm, ``(n_times, 3)``; None for worms that go nowhere."""
    if "center_of_mass" not in run.data:
        return None
    places = run.data["center_of_mass"].values
    return _CM * (places - places[0]) if np.isfinite(places[:, 0]).all() else None


def _legend(figure: Figure, labels: Sequence[str], drawn: Sequence[bool]) -> None:
    """Names the runs that were drawn, above all panels."""
    runs = zip(line_looks(len(labels)), labels, drawn, strict=True)
    handles = line_entries((*look.values(), 2.0, label) for look, label, shown in runs if shown)
    figure.legend(handles=handles, loc="outside upper left", ncols=min(len(handles), 3), handlelength=2.8)
