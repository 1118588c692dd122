"""What a 3D worm's shape and forces cannot be, and what is doubtful: looked at after every movement of the body.

Strands do not stretch and have a thickness. So no axial spring is longer than the straight strands beside it, and no
ring is shorter than the strands of its crossings are wide together; what goes beyond stops the run. Short of that, and
where actuators pull nothing or the integrator takes too much, the run goes on and its file says so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from annelid.body.estimates import COLLAPSED, HARDLY, rhombus_of, touching_ring_m
from annelid.body.worm import WormBody
from annelid.config import Guard
from annelid.morphology import Array
from annelid.plausibility import IDLE_SHARE, NUMERICAL_SHARE
from annelid.protocols import State

ACTIVATED = 0.1
"""Activation above which an actuator is expected to pull."""
LEAST_CONTRACTION_S = 0.2
"""Contractions shorter than this may be over before a cable is taut."""
LONG_CONTRACTION_S = 0.5
"""In a contraction as long as this, the slowest of the robots' cables shortens its ring by more than `HARDLY`."""
LONG = 3.0
"""Length of an axial spring, over that at rest, from which a run is doubtful."""
DEEP = 0.1
"""Depth of a vertex in the ground, over the mesh's radius, from which a run is doubtful: twice what presets reach."""
WIDE_GAP = 0.5
"""Gap between the two strands of a crossing, over the side of a rhombus, from which a run is doubtful."""
LEAST_WORK_J = 0.01
"""Work of the muscles below which the integrator's share of it means nothing."""


@dataclass(frozen=True, slots=True)
class Energies:
    """Energies of a run so far, J.

    Attributes:
        work: Work of the muscles, and what the weight has given.
        numerical: What the integrator has taken of it; negative where it has given.
    """

    work: float
    numerical: float


class _Extreme:
    """The largest value of a quantity so far, when it was reached, and where."""

    def __init__(self) -> None:
        self.value, self.time_s, self.place = -math.inf, 0.0, 0

    def take(self, value: float, time_s: float) -> bool:
        """Tells whether a value is a new extreme, and keeps it then."""
        if not value > self.value:
            return False
        self.value, self.time_s = value, time_s
        return True


class Watch:
    """Looks at one worm, and keeps what is worth a warning."""

    def __init__(self, body: WormBody, guard: Guard) -> None:
        """Derives the limits from the mesh at rest."""
        shape, rings, n = rhombus_of(body), body.rings, body.mesh.n_segments
        self._guard = guard
        self._n_segments, self._halves = n, rings.layout == "halves"
        self._ring_rest_m = shape.ring_length_m
        self._ring_least_m = touching_ring_m(body)
        self._spring_most_m = shape.longest_m
        self._deep_m = DEEP * body.mesh.radius_m
        self._gap_m = WIDE_GAP * shape.side_m
        forces = rings.forces(n)
        self._idle_N = IDLE_SHARE * np.repeat(forces, 2 if self._halves else 1)
        self._force_field = rings.force_field
        self._spring_rest_m = shape.along_m
        self._closing, self._depth, self._gap, self._spring = _Extreme(), _Extreme(), _Extreme(), _Extreme()
        muscles = len(self._idle_N)
        self._active: NDArray[np.bool_] = np.zeros(muscles, dtype=bool)
        self._active_bytes = self._active.tobytes()
        self._since_s = np.zeros(muscles)
        self._longest_s = np.zeros(muscles)
        self._most_N = np.zeros(muscles)
        self._idle: NDArray[np.int64] = np.zeros(muscles, dtype=np.int64)
        self._first_idle_s = np.zeros(muscles)

    def look(
        self,
        time_s: float,
        ring_length_m: Array,
        spring_length_m: Array,
        depth_m: float,
        gap_m: float,
        activation: Array,
        force_N: Array,
    ) -> str | None:
        """Takes note of one movement.

        Args:
            time_s: Simulated time, s.
            ring_length_m: Lengths of the ring actuators, m, ``(n_muscles,)``.
            spring_length_m: Lengths of the axial springs, m, ``(n_springs,)``.
            depth_m: Depth of the deepest vertex in the ground, m; negative above it.
            gap_m: Largest gap between two pinned strands, m.
            activation: Of the movement, ``(n_muscles,)``.
            force_N: Of the actuators in its last physics step, N, ``(n_muscles,)``.

        Returns:
            Why the run cannot go on, in a sentence, or None.
        """
        active = activation > ACTIVATED
        if active.tobytes() != self._active_bytes:
            self._switch(time_s, active)
        np.maximum(self._most_N, force_N, out=self._most_N)
        rings = ring_length_m.reshape(-1, 2).sum(axis=1) if self._halves else ring_length_m
        ring_m, spring_m = float(np.minimum.reduce(rings)), float(np.maximum.reduce(spring_length_m))
        if self._closing.take(-ring_m, time_s):
            self._closing.place = int(rings.argmin()) + 1
        self._depth.take(depth_m, time_s)
        self._gap.take(gap_m, time_s)
        self._spring.take(spring_m, time_s)
        guard = self._guard
        if ring_m < guard.ring_closure * self._ring_least_m:
            return (
                f"ring {self._closing.place} is {ring_m:.3g} m long, below the limit guard.ring_closure = "
                f"{guard.ring_closure:g} times the {self._ring_least_m:.3g} m at which its crossings touch"
            )
        if spring_m > guard.stretch * self._spring_most_m:
            return (
                f"an axial spring is {spring_m:.3g} m long, above the limit guard.stretch = {guard.stretch:g} times "
                f"the {self._spring_most_m:.3g} m at which the strands beside it are straight"
            )
        if depth_m > guard.depth_m:
            return (
                f"a vertex is {depth_m:.3g} m deep in the ground, above the limit guard.depth_m = {guard.depth_m:g} m"
            )
        return None

    def _switch(self, time_s: float, active: NDArray[np.bool_]) -> None:
        """Takes note of contractions that begin or end."""
        ended = self._active & ~active
        self._judge(ended, time_s)
        self._longest_s = np.where(ended, np.maximum(self._longest_s, time_s - self._since_s), self._longest_s)
        began = active & ~self._active
        self._since_s[began], self._most_N[began] = time_s, 0.0
        self._active, self._active_bytes = active, active.tobytes()

    def _judge(self, muscles: NDArray[np.bool_], time_s: float) -> None:
        """Counts the contractions of some muscles, up to now, in which they have pulled nothing."""
        idle = muscles & (self._most_N < self._idle_N) & (time_s - self._since_s >= LEAST_CONTRACTION_S)
        self._first_idle_s = np.where(idle & (self._idle == 0), self._since_s, self._first_idle_s)
        self._idle = self._idle + idle

    def warnings(self, time_s: float, energies: Energies) -> tuple[str, ...]:
        """Returns a sentence for everything doubtful up to a time, s."""
        found: list[str] = []
        ring_m = -self._closing.value
        if ring_m < COLLAPSED * self._ring_rest_m:
            found.append(
                f"ring {self._closing.place} was {ring_m:.3g} m long at {self._closing.time_s:.4g} s, "
                f"{100 * ring_m / self._ring_rest_m:.0f} % of its length at rest: the mesh has collapsed under "
                f"body.rings.{self._force_field}, or by itself"
            )
        if self._spring.value > LONG * self._spring_rest_m:
            found.append(
                f"an axial spring was {self._spring.value:.3g} m long at {self._spring.time_s:.4g} s, "
                f"{self._spring.value / self._spring_rest_m:.1f} times its length in the mesh at rest"
            )
        if self._depth.value > self._deep_m:
            found.append(
                f"a vertex was {self._depth.value:.3g} m deep in the ground at {self._depth.time_s:.4g} s: the "
                "contacts are too soft for what presses on them, see arena.contact_time_constant_s"
            )
        if self._gap.value > self._gap_m:
            found.append(
                f"the strands of a crossing were {self._gap.value:.3g} m apart at {self._gap.time_s:.4g} s, over half "
                "the side of a rhombus: the pins are too soft for what pulls at them"
            )
        idle = self._idle_muscles(time_s)
        longest_s = np.where(self._active, np.maximum(self._longest_s, time_s - self._since_s), self._longest_s)
        if not idle and ring_m > (1.0 - HARDLY) * self._ring_rest_m and longest_s.max() >= LONG_CONTRACTION_S:
            found.append(
                f"no ring was shortened by more than {100 * max(0.0, 1 - ring_m / self._ring_rest_m):.2g} %, although "
                f"muscles were active for up to {longest_s.max():.2g} s: see body.rings.{self._force_field} and the "
                "mesh's stiffness"
            )
        found += idle
        share = energies.numerical / energies.work if energies.work > LEAST_WORK_J else 0.0
        if abs(share) > NUMERICAL_SHARE:
            found.append(
                f"the integrator {'took' if share > 0 else 'added'} {100 * abs(share):.0f} % of the work of muscles "
                f"and weight, {energies.work:.3g} J, more than {100 * NUMERICAL_SHARE:.0f} %: motion depends on "
                "clock.physics_timestep_s, compare with a shorter one"
            )
        return tuple(found)

    def _idle_muscles(self, time_s: float) -> list[str]:
        before = self._idle, self._first_idle_s
        self._judge(self._active, time_s)
        idle, first_s = self._idle, self._first_idle_s
        self._idle, self._first_idle_s = before
        if not idle.any():
            return []
        per_segment = 2 if self._halves else 1
        segments = sorted({int(muscle) // per_segment + 1 for muscle in np.flatnonzero(idle)})
        named = "segment " + str(segments[0]) if len(segments) == 1 else "segments " + ", ".join(map(str, segments))
        return [
            f"the actuators of {named} pulled nothing in {idle.sum()} of their contractions, first from "
            f"{first_s[idle > 0].min():.4g} s on: see body.rings.length_range_m, with rings of "
            f"{self._ring_rest_m:.3g} m at rest"
        ]

    @property
    def _extremes(self) -> tuple[_Extreme, ...]:
        return self._closing, self._depth, self._gap, self._spring

    def get_state(self) -> State:
        """Returns what has been kept so far."""
        extremes = [(each.value, each.time_s, each.place) for each in self._extremes]
        contractions = (self._active, self._since_s, self._longest_s, self._most_N, self._idle, self._first_idle_s)
        return {"watch_extremes": np.array(extremes), "watch_contractions": np.array(contractions, dtype=np.float64)}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        for each, (value, time_s, place) in zip(
            self._extremes, np.asarray(state["watch_extremes"], dtype=float), strict=True
        ):
            each.value, each.time_s, each.place = float(value), float(time_s), int(place)
        contractions = np.array(state["watch_contractions"], dtype=float)
        active, self._since_s, self._longest_s, self._most_N, idle, self._first_idle_s = contractions
        self._active, self._idle = active.astype(bool), idle.astype(np.int64)
        self._active_bytes = self._active.tobytes()
