"""What a 3D worm's shape and forces cannot be, and what is doubtful: looked at after every movement of the body.

Strands do not stretch and have a thickness. So no axial spring is longer than the straight strands beside it, and no
ring is shorter than the strands of its crossings are wide together; what goes beyond stops the run. Short of that, and
where actuators pull nothing or the integrator takes too much, the run goes on and its file says so.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from annelid.body.estimates import COLLAPSED, LEAST_SHORTENED, touching_ring_m
from annelid.body.worm import WormBody
from annelid.config import Guard
from annelid.morphology import Array, MeshGeometry
from annelid.protocols import State

ACTIVATED = 0.1
"""Activation above which an actuator is expected to pull."""
LEAST_CONTRACTION_S = 0.2
"""Contractions shorter than this may be over before a cable is taut."""
LONG_CONTRACTION_S = 0.5
"""In a contraction as long as this, the slowest of the robots' cables shortens a ring by over `LEAST_SHORTENED`."""
LONG = 3.0
"""Length of an axial spring, over that at rest, from which a run is doubtful."""
MOST_STRETCH = 1.1
"""Length of an axial spring, over that at which the strands beside it are straight, at which a run is stopped."""
DEEP = 0.1
"""Depth of a vertex in the ground, over the mesh's radius, from which a run is doubtful: twice what presets reach."""
WIDE_GAP = 0.5
"""Gap between the two strands of a crossing, over the side of a rhombus, from which a run is doubtful."""
LEAST_WORK_J = 0.01
"""Work of the muscles below which the integrator's share of it means nothing."""
NUMERICAL_SHARE = 1 / 3
"""Share of the muscles' work lost to the integrator above which a run is doubtful."""
IDLE_SHARE = 1e-3
"""Share of its greatest force that an actuator must reach in a contraction."""


class Energies(NamedTuple):
    """Energies of a run so far, J."""

    work: float  # of the muscles, and what the weight has given
    numerical: float  # what the integrator has taken of it; negative where it has given


class Watch:
    """Looks at one worm, and keeps what is worth a warning."""

    def __init__(self, body: WormBody, geometry: MeshGeometry, guard: Guard) -> None:
        """Derives the limits from the mesh at rest."""
        rings, n = body.rings, body.mesh.n_segments
        self._guard = guard
        self._per_segment = 2 if rings.layout == "halves" else 1
        self._ring_rest_m, self._ring_least_m = geometry.ring_length_m, touching_ring_m(body)
        self._spring_most_m = geometry.spring_longest_m
        self._deep_m = DEEP * min(body.mesh.radii_m)
        self._gap_m = WIDE_GAP * float(self._spring_most_m.min()) / 2
        self._idle_N = IDLE_SHARE * np.repeat(rings.forces(n), self._per_segment)
        self._force_field = rings.force_field
        # The largest values so far, when they were reached, s, and where.
        names = "closing", "depth", "gap", "spring"
        self._extremes: dict[str, tuple[float, float, int]] = dict.fromkeys(names, (-math.inf, 0.0, 0))
        # What they are compared by: the length at rest of the place where each was, rings counted from 1.
        rings_m, springs_m = self._ring_rest_m.tolist(), geometry.spring_length_m.tolist()
        self._rest_m = {"closing": [1.0, *rings_m], "depth": [1.0], "gap": [1.0], "spring": springs_m}
        # Of every muscle: whether it is active; since when, s; its longest contraction, s; its largest force since it
        # is active, N; in how many contractions it has pulled nothing; and when the first of these began, s.
        self._muscles = np.zeros((6, len(self._idle_N)))
        self._active_bytes = self._active.tobytes()

    @property
    def _active(self) -> NDArray[np.bool_]:
        return self._muscles[0] > 0.0

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
        """Takes note of one movement; returns why the run cannot go on, in a sentence, or None.

        Rings, activation and force are ``(n_muscles,)``, springs ``(n_springs,)``; the depth is that of the deepest
        vertex in the ground, negative above it, the gap the largest between two pinned strands.
        """
        active = activation > ACTIVATED
        if active.tobytes() != self._active_bytes:
            self._switch(time_s, active)
        most_N = self._muscles[3]
        np.maximum(most_N, force_N, out=most_N)
        rings = ring_length_m.reshape(-1, 2).sum(axis=1) if self._per_segment == 2 else ring_length_m
        ring, spring = int((rings / self._ring_rest_m).argmin()), int((spring_length_m / self._spring_most_m).argmax())
        spring_m, spring_most_m = float(spring_length_m[spring]), float(self._spring_most_m[spring])
        for name, value, place in (
            ("closing", -float(rings[ring]), ring + 1),
            ("depth", depth_m, 0),
            ("gap", gap_m, 0),
            ("spring", spring_m, spring),
        ):
            (most, _, where), rest_m = self._extremes[name], self._rest_m[name]
            if value / rest_m[place] > most / rest_m[where]:
                self._extremes[name] = value, time_s, place
        guard, ring_m = self._guard, float(np.minimum.reduce(rings))
        if ring_m < self._ring_least_m:
            return (
                f"the ring of segment {int(rings.argmin()) + 1} is {ring_m:.3g} m long, below the limit of "
                f"{self._ring_least_m:.3g} m at which its crossings touch"
            )
        if spring_m > MOST_STRETCH * spring_most_m:
            return (
                f"an axial spring is {spring_m:.3g} m long, above the limit of {MOST_STRETCH:g} times the "
                f"{spring_most_m:.3g} m at which the strands beside it are straight"
            )
        if depth_m > guard.depth_m:
            return (
                f"a point of the mesh is {depth_m:.3g} m deep in the ground, above the limit "
                f"guard.depth_m = {guard.depth_m:g} m"
            )
        return None

    def _switch(self, time_s: float, active: NDArray[np.bool_]) -> None:
        """Takes note of contractions that begin or end."""
        before = self._active
        self._muscles[2:] = self._judged(before & ~active, time_s)
        began = active & ~before
        self._muscles[1, began], self._muscles[3, began] = time_s, 0.0
        self._muscles[0], self._active_bytes = active, active.tobytes()

    def _judged(self, ended: NDArray[np.bool_], time_s: float) -> Array:
        """Returns what is kept of the muscles from their longest contraction on, were some of them to end now."""
        _, since_s, longest_s, most_N, idle, first_idle_s = self._muscles
        lasted_s = time_s - since_s
        pulled_nothing = ended & (most_N < self._idle_N) & (lasted_s >= LEAST_CONTRACTION_S)
        longest_s = np.where(ended, np.maximum(longest_s, lasted_s), longest_s)
        first_idle_s = np.where(pulled_nothing & (idle == 0), since_s, first_idle_s)
        return np.stack([longest_s, most_N, idle + pulled_nothing, first_idle_s])

    def warnings(self, time_s: float, energies: Energies) -> tuple[str, ...]:
        """Returns a sentence for everything doubtful up to a time, s."""
        found: list[str] = []
        (closing_m, closed_s, ring), depth, gap, spring = self._extremes.values()
        ring_m, rest_m = -closing_m, self._rest_m["closing"][ring]
        if ring_m < COLLAPSED * rest_m:
            found.append(
                f"the ring of segment {ring} was {ring_m:.3g} m long at {closed_s:.4g} s, "
                f"{100 * ring_m / rest_m:.0f} % of its length at rest: the mesh has collapsed; use less force "
                f"(body.rings.{self._force_field}) or stiffer strands"
            )
        spring_rest_m = self._rest_m["spring"][spring[2]]
        if spring[0] > LONG * spring_rest_m:
            found.append(
                f"an axial spring was {spring[0]:.3g} m long at {spring[1]:.4g} s, "
                f"{spring[0] / spring_rest_m:.1f} times its length in the mesh at rest"
            )
        if depth[0] > self._deep_m:
            found.append(
                f"a point of the mesh was {depth[0]:.3g} m deep in the ground at {depth[1]:.4g} s: contacts are too "
                "soft for the load; shorten arena.contact_time_constant_s"
            )
        if gap[0] > self._gap_m:
            found.append(
                f"the strands of a crossing were {gap[0]:.3g} m apart at {gap[1]:.4g} s, over half the distance to the "
                "next crossing: the pins are too soft for the load"
            )
        longest_s, _, idle, first_idle_s = self._judged(self._active, time_s)
        if idle.any():
            segments = sorted({int(muscle) // self._per_segment + 1 for muscle in np.flatnonzero(idle)})
            found.append(
                f"the actuators of segment{'s' * (len(segments) > 1)} {', '.join(map(str, segments))} pulled with no "
                f"force in {idle.sum():.0f} of their contractions, first at {first_idle_s[idle > 0].min():.4g} s: "
                f"change body.rings.length_range_m; a ring is {self._ring_rest_m[segments[0] - 1]:.3g} m long at rest"
            )
        elif ring_m > (1.0 - LEAST_SHORTENED) * rest_m and longest_s.max() >= LONG_CONTRACTION_S:
            found.append(
                f"no ring was shortened by more than {100 * max(0.0, 1 - ring_m / rest_m):.2g} %, although muscles "
                f"were active for up to {longest_s.max():.2g} s: use more force (body.rings.{self._force_field}) or a "
                "softer mesh"
            )
        share = energies.numerical / energies.work if energies.work > LEAST_WORK_J else 0.0
        if abs(share) > NUMERICAL_SHARE:
            found.append(
                f"the integrator {'took' if share > 0 else 'added'} {100 * abs(share):.0f} % of the work of muscles "
                f"and weight, {energies.work:.3g} J, more than {100 * NUMERICAL_SHARE:.0f} %: the motion "
                "depends on clock.physics_timestep_s; repeat the run with a shorter one"
            )
        return tuple(found)

    def get_state(self) -> State:
        """Returns what has been kept so far."""
        return {"watch_extremes": np.array(list(self._extremes.values())), "watch_contractions": self._muscles.copy()}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        extremes = np.asarray(state["watch_extremes"], dtype=float).tolist()
        values = ((value, time_s, int(place)) for value, time_s, place in extremes)
        self._extremes = dict(zip(self._extremes, values, strict=True))
        self._muscles[:] = state["watch_contractions"]
        self._active_bytes = self._active.tobytes()
