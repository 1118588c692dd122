"""Where a worm crawled, seen from above: its travel, track and outline, how it turned, and the circle through it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from annelid.analysis.numbers import finite, number
from annelid.errors import RunFileError
from annelid.protocols import Array
from annelid.simulation.runfile import Run

FORWARDS = np.array([-1.0, 0.0])
"""Where a worm leads at the start, seen from above."""
# An arc is one where it bulges by more than this many times what the points are off it.
_CLEARLY = 3.0


def forward_position(run: Run) -> Array:
    """Returns the position of the centre of mass along the initial heading, m from the origin, ``(n_times,)``."""
    along: Array = -run.variables["center_of_mass"].values[:, 0]
    return along


@dataclass(frozen=True, kw_only=True)
class Travel:
    """How far a worm came, along its initial heading."""

    travel_m: float | None = number("displacement of the centre of mass, negative backwards", "travel", "mm")
    travel_path_m: float | None = number("length of its path forwards and backwards", "travel to and fro", "mm")


def travel(run: Run) -> Travel:
    """Reads the travel of a run; None for a worm that stays in its place or was not recorded."""
    if "center_of_mass" not in run.variables or not run.variables["time"].values.size:
        return Travel()
    ahead = forward_position(run)
    return Travel(travel_m=finite(ahead[-1] - ahead[0]), travel_path_m=finite(np.abs(np.diff(ahead)).sum()))


@dataclass(frozen=True)
class Track:
    """A worm's track on the floor, at the times of the recorded postures.

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
        return self.ring_centre(0)

    @cached_property
    def heading_rad(self) -> Array:
        """Direction from the last ring to the foremost, unwrapped, ``(n,)``: 0 towards -x, positive to the left."""
        ahead = self.front_m - self.ring_centre(-1)
        return np.unwrap(np.arctan2(-ahead[:, 1], -ahead[:, 0]))

    @cached_property
    def roll_rad(self) -> Array:
        """Roll about the body's length since the start, unwrapped, ``(n,)``: positive where its left side rises."""
        planes = self.crossing_m.reshape(len(self.time_s), -1, self.n_per_plane, 3)
        centre = planes.mean(axis=2)
        ahead = centre[:, self.ring_planes[0]] - centre[:, self.ring_planes[-1]]
        left = np.cross([0.0, 0.0, 1.0], ahead)
        up = np.cross(ahead, left)
        axes = np.stack([each / np.linalg.norm(each, axis=1, keepdims=True) for each in (left, up)], axis=1)
        # Of every crossing about the centre of its plane.
        across = np.einsum("tpkx,tax->tapk", planes - centre[:, :, np.newaxis], axes)
        turned = across[:, 0] + 1j * across[:, 1]
        return np.unwrap(np.angle((turned * turned[0].conj()).sum(axis=(1, 2))))

    def ring_centre(self, segment: int) -> Array:
        """Centre of a segment's ring, seen from above, ``(n, 2)``; segments from 0, negative ones from the rear."""
        return self._planes[:, self.ring_planes[segment]].mean(axis=1)

    @cached_property
    def _planes(self) -> Array:
        """Crossings seen from above, plane by plane, ``(n, n_planes, n_per_plane, 2)``."""
        return self.crossing_m[..., :2].reshape(len(self.time_s), -1, self.n_per_plane, 2)

    def outline_m(self, sample: int) -> Array:
        """Returns the outline seen from above, m, ``(n_corners, 2)``: closed, along the outermost crossings."""
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
        RunFileError: The run is of a body without a mesh, or has fewer than two recorded postures.
    """
    geometry, data = run.config.body.geometry(), run.variables
    if geometry is None:
        raise RunFileError(f"{run.path} has no track: only the 3D worm (body.kind = 'worm') records one")
    if "crossing_position" not in data or data["frame_time"].values.size < 2:
        raise RunFileError(f"{run.path} holds fewer than two recorded postures, and so no track")
    rings = tuple(geometry.ring_planes.tolist())
    return Track(data["frame_time"].values, data["crossing_position"].values, geometry.n_per_plane, rings)


def nearest_frame(run: Run, time_s: float) -> int:
    """Returns the index of the recorded posture nearest to a time.

    Args:
        run: The run.
        time_s: The time, s.

    Raises:
        RunFileError: No postures recorded, or the time lies more than a frame's interval outside of them.
    """
    if "crossing_position" not in run.variables or not run.variables["frame_time"].values.size:
        raise RunFileError(f"{run.path} holds no recorded postures of a 3D worm")
    return nearest_time(run, run.variables["frame_time"].values, time_s)


def nearest_time(run: Run, times_s: Array, time_s: float) -> int:
    """Returns the index of the recorded time nearest to a wanted one, as `nearest_frame` does.

    Args:
        run: The run, which an error names.
        times_s: Recorded times, s.
        time_s: The wanted time, s.

    Raises:
        RunFileError: The run has no such time.
    """
    margin = float(np.diff(times_s).max()) if len(times_s) > 1 else run.config.record.frames_interval_s
    if not times_s[0] - margin <= time_s <= times_s[-1] + margin:
        raise RunFileError(
            f"{run.path} has no picture at {time_s:g} s: it was recorded from {times_s[0]:g} to {times_s[-1]:g} s"
        )
    return int(np.abs(times_s - time_s).argmin())


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle fitted to a track."""

    centre_m: tuple[float, float]
    radius_m: float
    angle_rad: float  # that the track covers seen from the centre, positive to the left (from x to y)
    off_m: float  # root mean square of the points' distances from the circle

    @property
    def signed_radius_m(self) -> float:
        """The radius, positive for a track that turns left, m."""
        return self.radius_m if self.angle_rad > 0 else -self.radius_m

    @property
    def is_clear(self) -> bool:
        """Whether the track bends clearly more than it swings: by how far its arc stands off the chord."""
        bulge_m = self.radius_m * (1.0 - float(np.cos(min(abs(self.angle_rad) / 2, np.pi))))
        return bulge_m > _CLEARLY * self.off_m and bulge_m > 1e-9 * self.radius_m


def fitted_circle(points_m: ArrayLike) -> Circle | None:
    """Fits a circle to points of a track in order, m, ``(n, 2)``; None for fewer than three, or for a line.

    The sum of ``(|p|^2 + b . p + c)^2`` over its mean squared slope is smallest (Taubin 1991), which unlike plain
    least squares does not draw the radius of a short noisy arc in.
    """
    points = np.asarray(points_m, dtype=float)
    if len(points) < 3:
        return None
    middle = points.mean(axis=0)
    x, y = (points - middle).T
    square = x * x + y * y
    mean = square.mean()
    if not mean > 0:
        return None
    columns = np.stack([(square - mean) / (2.0 * np.sqrt(mean)), x, y], axis=-1)
    a, b, c = np.linalg.svd(columns, full_matrices=False)[2][-1]
    curved = a / (2.0 * np.sqrt(mean))
    if abs(curved) * np.sqrt(mean) < 1e-9:
        return None
    centre = -np.array([b, c]) / (2.0 * curved)
    radius = float(np.sqrt(centre @ centre + mean))
    away = np.hypot(x - centre[0], y - centre[1])
    angle = np.unwrap(np.arctan2(y - centre[1], x - centre[0]))
    off = float(np.sqrt(((away - radius) ** 2).mean()))
    place = middle + centre
    return Circle((float(place[0]), float(place[1])), radius, float(angle[-1] - angle[0]), off)
