"""How a worm passes a pipe: where its rings are along the centre line, how fast, and how narrow it is there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from annelid.analysis.track import Track, track_of
from annelid.config.run import ArenaKind
from annelid.errors import RunFileError
from annelid.protocols import Array
from annelid.simulation.runfile import Run


@dataclass(frozen=True)
class Passage:
    """A worm's passage through a pipe, at the times of the recorded postures.

    Attributes:
        time_s: Shape ``(n,)``.
        ring_arc_m: Arc length along the centre line at which every ring's centre is, from the place of the worm's front
            at the start, m, ``(n, n_segments)``.
        bore_m: Radius of the bore there, m, ``(n, n_segments)``.
        reach_m: Arc lengths between which the pipe bends or changes its bore, m; both 0 for a plain straight one.
    """

    time_s: Array
    ring_arc_m: Array
    bore_m: Array
    reach_m: tuple[float, float]

    @cached_property
    def front_m(self) -> Array:
        """Arc length of the foremost ring, m, ``(n,)``."""
        return self.ring_arc_m[:, 0]

    @cached_property
    def middle_m(self) -> Array:
        """Mean arc length of the rings, m, ``(n,)``."""
        return self.ring_arc_m.mean(axis=1)

    @property
    def passed(self) -> bool:
        """Whether the middle of the worm has come past all that bends or narrows."""
        return bool(self.middle_m.max() >= self.reach_m[1])

    def speed_m_per_s(self) -> float:
        """Mean speed of the foremost ring along the centre line through all that bends or narrows, m/s.

        From the first posture there to the first past it, or to the end for a worm that does not get so far, so that
        worms are compared over the same distance; NaN if it never came.
        """
        inside = np.flatnonzero(self.front_m >= self.reach_m[0])
        past = np.flatnonzero(self.front_m >= self.reach_m[1])
        last = past[0] if past.size and self.reach_m[1] > self.reach_m[0] else len(self.time_s) - 1
        first = inside[0] if inside.size else last
        if last <= first:
            return float("nan")
        return float((self.front_m[last] - self.front_m[first]) / (self.time_s[last] - self.time_s[first]))

    def speed_over_m_per_s(self, window_s: float) -> Array:
        """Speed of the middle at every posture, m/s, ``(n,)``: the slope of a line through the postures of a window, s.

        A window of a cycle or more leaves the swings within one out.
        """
        slope = np.empty(len(self.time_s))
        for k, now in enumerate(self.time_s):
            near = np.abs(self.time_s - now) <= window_s / 2 + 1e-9
            time = self.time_s[near] - self.time_s[near].mean()
            slope[k] = (time * self.middle_m[near]).sum() / (time * time).sum() if near.sum() > 1 else np.nan
        return slope


def passage_of(run: Run) -> Passage:
    """Reads a worm's passage through a pipe from its run.

    Raises:
        RunFileError: The worm was not in a pipe, or `annelid.analysis.track.track_of` refuses the run.
    """
    arena = run.config.arena
    if arena is None or arena.centre_line() is None:
        where = "a planar worm" if arena is None else f"a worm on a {arena.kind}"
        raise RunFileError(f"{run.path} holds {where}, and so no passage of a pipe")
    return passage_through(arena, track_of(run))


def passage_through(pipe: ArenaKind, track: Track) -> Passage:
    """Reads a worm's passage through a pipe from its track."""
    centre_line, bore, reach_m = pipe.centre_line(), pipe.bore(), pipe.reach_m()
    assert centre_line is not None
    assert bore is not None
    assert reach_m is not None
    planes = track.crossing_m.reshape(len(track.time_s), -1, track.n_per_plane, 3)
    centres = planes[:, list(track.ring_planes)].mean(axis=2)
    arc = centre_line.nearest(centres).arc_m
    return Passage(track.time_s, arc, bore.at(arc)[0], reach_m)
