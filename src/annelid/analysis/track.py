"""Where a worm crawled, seen from above: its track, its outline, and how it turned."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from annelid.config import WormBody
from annelid.errors import RunFileError

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Track:
    """A worm's way over the floor, at the times of the recorded postures.

    Attributes:
        time_s: Shape ``(n,)``.
        crossing_m: Positions of the crossings, m, ``(n, n_crossings, 3)``.
        n_per_plane: Crossings on each plane of crossings, which are numbered plane by plane.
        ring_planes: Plane of each segment's ring, ``(n_segments,)``.
    """

    time_s: Array
    crossing_m: Array
    n_per_plane: int
    ring_planes: tuple[int, ...]

    @cached_property
    def middle_m(self) -> Array:
        """Middle of the body, the mean of all crossings, ``(n, 2)``."""
        return self.crossing_m[..., :2].mean(axis=1)

    @cached_property
    def front_m(self) -> Array:
        """Centre of the foremost ring, ``(n, 2)``."""
        return self._ring_centre(0)

    @cached_property
    def heading_rad(self) -> Array:
        """Direction from the last ring to the foremost, unwrapped, ``(n,)``: 0 towards -x, positive to the left."""
        ahead = self.front_m - self._ring_centre(-1)
        return np.unwrap(np.arctan2(-ahead[:, 1], -ahead[:, 0]))

    def _ring_centre(self, segment: int) -> Array:
        return self._planes[:, self.ring_planes[segment]].mean(axis=1)

    @cached_property
    def _planes(self) -> Array:
        """Crossings seen from above, plane by plane, ``(n, n_planes, n_per_plane, 2)``."""
        return self.crossing_m[..., :2].reshape(len(self.time_s), -1, self.n_per_plane, 2)

    def outline_m(self, sample: int) -> Array:
        """Returns the body's outline seen from above at a sample: a closed polygon, m, ``(n_corners, 2)``.

        On either side it runs along the outermost crossing of every plane.
        """
        planes = self._planes[sample]
        centre = planes.mean(axis=1)
        along = np.gradient(centre, axis=0)
        across = np.stack([-along[:, 1], along[:, 0]], axis=-1)[:, np.newaxis]
        place = ((planes - centre[:, np.newaxis]) * across).sum(axis=-1)
        rows = np.arange(len(planes))
        one, other = planes[rows, place.argmax(axis=1)], planes[rows, place.argmin(axis=1)]
        return np.concatenate([one, other[::-1], one[:1]])


def track_of(run: Run) -> Track:
    """Reads the track of a 3D worm from its run.

    Raises:
        RunFileError: A planar worm, or fewer than two recorded postures.
    """
    body, data = run.config.body, run.data
    if not isinstance(body, WormBody):
        raise RunFileError(f"{run.path} holds a planar worm, which crawls along a line and has no track")
    if data.sizes.get("frame", 0) < 2 or "crossing_position" not in data:
        raise RunFileError(f"{run.path} holds fewer than two recorded postures, and so no track")
    mesh = body.mesh
    rings = (mesh.free_planes_at_ends + mesh.planes_between_rings * segment for segment in range(mesh.n_segments))
    return Track(data["frame_time"].values, data["crossing_position"].values, mesh.n_helices // 2, tuple(rings))


@dataclass(frozen=True, slots=True)
class Turn:
    """How a worm turned over whole cycles.

    Attributes:
        cycles: Whole cycles between the two ends.
        angle_rad: Change of the heading, positive to the left.
        path_m: Length of the way of the middle of the body, from cycle to cycle.
        curvature_per_m: Angle over path; positive to the left.
    """

    cycles: int
    angle_rad: float
    path_m: float
    curvature_per_m: float

    @property
    def radius_m(self) -> float:
        """Radius of the circle, m; infinite for a straight way, NaN for one of no length."""
        return np.inf if self.curvature_per_m == 0 else abs(1.0 / self.curvature_per_m)


def turn_of(track: Track, period_s: float, after_s: float = 0.0) -> Turn:
    """Measures the turn over as many whole cycles as there are.

    Samples a cycle apart are compared, so that the swings within a cycle do not count; angle and path are means over
    every phase of the cycle.

    Args:
        track: The track.
        period_s: Time of a cycle.
        after_s: Time from which on it is measured, so that the start is left out.

    Raises:
        RunFileError: Less than one whole cycle behind ``after_s``.
    """
    first, last = max(after_s, float(track.time_s[0])), float(track.time_s[-1])
    cycles = int((last - first) / period_s + 1e-9) if period_s > 0 else 0
    # The last whole cycle serves to average over its phases.
    hops = cycles - 1
    if hops < 1:
        raise RunFileError(
            f"a turn takes at least two cycles of {period_s:g} s, not the {last - first:.4g} s from {first:.4g} s on"
        )
    phases = np.linspace(0.0, period_s, 64, endpoint=False)
    times = first + phases[:, np.newaxis] + period_s * np.arange(hops + 1)
    x, y, heading = (np.interp(times, track.time_s, values) for values in (*track.middle_m.T, track.heading_rad))
    path = float(np.hypot(np.diff(x, axis=1), np.diff(y, axis=1)).sum(axis=1).mean())
    angle = float((heading[:, -1] - heading[:, 0]).mean())
    return Turn(hops, angle, path, angle / path if path > 0 else float("nan"))
