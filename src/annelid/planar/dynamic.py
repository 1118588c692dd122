"""The face that the dynamic planar worms show as plants: sensation, recording, saving, and the alarm."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from annelid.clock import StepRatio
from annelid.config import Clock
from annelid.errors import SimulationStopped
from annelid.planar.linkage import Linkage
from annelid.planar.midpoint import midpoint_step
from annelid.protocols import Array, Recordable, Sensation, Signal, State

_STEEPEST = 0.9999
_HALVINGS = 80


class DynamicPlanarPlant:
    """A `Linkage` as a plant; the worms of the literature derive from it.

    Segment 1 is at the front, which points to -x. A segment's one stretch sensor is its length, at rest when the worm
    lies unactuated. ``contact_force`` is the force of the walls along x on both vertices, and along z that of the lower
    wall; the upper one presses with the same force the other way. The centre of mass stays on the axis.

    All energies are booked: kinetic + elastic = muscle work - damping loss - slip loss + the start's energy, up to the
    error of the integrator (`annelid.planar.midpoint`).
    """

    def __init__(self, worm: Linkage, clock: Clock, description: str) -> None:
        """Lays the worm down at rest.

        Args:
            worm: Its mechanics.
            clock: Section of the time steps.
            description: What it is, for the run file.
        """
        self.worm = worm
        self._ratio = StepRatio(clock.control_timestep_s, clock.physics_timestep_s)
        self._description = description
        self._rest = resting_posture(worm)
        self._rest_length_m = worm.lengths(worm.posture(self._rest))[:, np.newaxis]
        self.reset(0)

    @property
    def n_segments(self) -> int:
        """Number of actuated segments."""
        return self.worm.n_segments

    @property
    def n_muscles(self) -> int:
        """Number of actuators, one a segment."""
        return self.worm.n_segments

    def reset(self, seed: int) -> Sensation:
        """Returns to rest at time zero, the front tip at x = 0; nothing here is random."""
        n = self.n_segments
        self._q, self._p = self._rest.copy(), np.zeros_like(self._rest)
        self._muscle_force_N, self._friction_N = np.zeros(n), np.zeros(n)
        self._muscle_work_J, self._positive_work_J, self._slip_loss_J = np.zeros(n), np.zeros(n), np.zeros(n)
        self._damping_loss_J = 0.0
        self._converged = True
        self._n_control_steps = 0
        self._posture = self.worm.posture(self._q)
        return self._sense()

    def step(self, activation: Array) -> Sensation:
        """Advances by one control step.

        Args:
            activation: Shape ``(n_segments,)``, in [0, 1].

        Returns:
            The sensation at its end.

        Raises:
            SimulationStopped: The step has no unique solution.
        """
        activation = np.asarray(activation, dtype=np.float64)
        self._n_control_steps += 1
        for _ in range(self._ratio.physics_steps_due(self._n_control_steps)):
            try:
                step = midpoint_step(self.worm, self._q, self._p, activation, self._ratio.physics_timestep_s)
            except np.linalg.LinAlgError:
                raise SimulationStopped(
                    "the planar worm's equations of motion have no unique solution: its masses, stiffnesses or "
                    "dampings differ by too much"
                ) from None
            self._q, self._p = step.q, step.p
            self._muscle_force_N, self._friction_N = step.muscle_force_N, step.friction_N
            self._muscle_work_J = self._muscle_work_J + step.muscle_work_J
            self._positive_work_J = self._positive_work_J + np.maximum(step.muscle_work_J, 0.0)
            self._slip_loss_J = self._slip_loss_J + step.slip_loss_J
            self._damping_loss_J += step.damping_loss_J
            self._converged &= step.converged
        self._posture = self.worm.posture(self._q)
        return self._sense()

    def kinetic_energy_J(self) -> float:
        """Returns the present kinetic energy, J."""
        return 0.5 * float(self._p @ np.linalg.solve(self._posture.mass, self._p))

    def elastic_energy_J(self) -> float:
        """Returns the present energy of springs and walls, J."""
        return self.worm.elastic_energy(self._posture)

    def recordable(self) -> Recordable:
        """Names lengths, forces, the energies and the outline; contact and slip only where there are walls."""
        n, corners = self.n_segments, len(self.worm.outline)
        walls = "force of the walls along x on a segment, and of the lower wall along z"
        slip = "work of a segment lost to friction so far"
        contact = (
            Signal("contact_force", ("segment", "axis"), (n, 3), "N", walls),
            Signal("slip_loss", ("segment",), (n,), "J", slip),
        )
        return Recordable(
            signals=(
                *(contact if self.worm.wall_stiffness_N_per_m else ()),
                Signal("stretch_length", ("segment", "sensor"), (n, 1), "m", "length of a segment"),
                Signal("ring_length", ("muscle",), (n,), "m", "height of a rhombus"),
                Signal("muscle_force", ("muscle",), (n,), "N", "contractile force of an actuator"),
                Signal("center_of_mass", ("axis",), (3,), "m", "centre of mass; the front points to -x"),
                Signal("outline", ("corner", "plane_axis"), (corners, 2), "m", "upper half, front tip first: x and z"),
                Signal("kinetic_energy", (), (), "J", "kinetic energy"),
                Signal("elastic_energy", (), (), "J", "energy of springs and walls"),
                Signal("muscle_work", ("muscle",), (n,), "J", "net work done by an actuator so far"),
                Signal("positive_work", ("muscle",), (n,), "J", "positive work of an actuator so far, none regained"),
                Signal("damping_loss", (), (), "J", "energy lost to dampers so far"),
            ),
            coords={"segment": list(range(1, n + 1)), "axis": ["x", "y", "z"]},
            attrs={"plant": self._description, "total_mass_kg": float(self.worm.lump_mass_kg.sum())},
        )

    def read(self, frame: bool) -> Mapping[str, NDArray[np.generic] | float]:
        """Reads the signals that `recordable` names; there are none at frame rate."""
        if frame:
            return {}
        felt = self._sense()
        contact = {"contact_force": felt.contact_force_N, "slip_loss": self._slip_loss_J.copy()}
        return {
            **(contact if self.worm.wall_stiffness_N_per_m else {}),
            "stretch_length": felt.stretch_m,
            "ring_length": felt.ring_length_m,
            "muscle_force": felt.muscle_force_N,
            "center_of_mass": felt.center_of_mass_m,
            "outline": self.worm.places(self._posture)[self.worm.outline],
            "kinetic_energy": self.kinetic_energy_J(),
            "elastic_energy": self.elastic_energy_J(),
            "muscle_work": self._muscle_work_J.copy(),
            "positive_work": self._positive_work_J.copy(),
            "damping_loss": self._damping_loss_J,
        }

    def get_state(self) -> State:
        """Returns copies of coordinates (m), momenta (kg m/s), last forces (N), booked energies (J) and the steps."""
        return {
            "q": self._q.copy(),
            "p": self._p.copy(),
            "muscle_force": self._muscle_force_N.copy(),
            "friction": self._friction_N.copy(),
            "muscle_work": self._muscle_work_J.copy(),
            "positive_work": self._positive_work_J.copy(),
            "slip_loss": self._slip_loss_J.copy(),
            "damping_loss": np.array(self._damping_loss_J),
            "n_control_steps": np.array(self._n_control_steps),
        }

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        self._q, self._p = (np.array(state[name], dtype=np.float64) for name in ("q", "p"))
        self._muscle_force_N = np.array(state["muscle_force"], dtype=np.float64)
        self._friction_N = np.array(state["friction"], dtype=np.float64)
        self._muscle_work_J = np.array(state["muscle_work"], dtype=np.float64)
        self._positive_work_J = np.array(state["positive_work"], dtype=np.float64)
        self._slip_loss_J = np.array(state["slip_loss"], dtype=np.float64)
        self._damping_loss_J = float(state["damping_loss"])
        self._n_control_steps = int(state["n_control_steps"])
        self._posture = self.worm.posture(self._q)

    def alarm(self) -> str | None:
        """Returns a sentence if a side stands upright, a segment is squeezed flat, or a step had no solution."""
        slope = np.abs(self._posture.rise) / self.worm.link_length_m
        # Written so that NaN fails it.
        if not slope.max() <= _STEEPEST:
            return f"a side rises by {slope.max():.4g} of its length, more than {_STEEPEST:g}: the worm has folded up"
        height = self.worm.heights(self._q)
        if not height.min() > 0.0:
            return f"the height of segment {int(np.argmin(height)) + 1} is {height.min():.4g} m, not above 0"
        if not self._converged:
            return (
                f"a step of the body had no solution: clock.physics_timestep_s = "
                f"{self._ratio.physics_timestep_s:g} is too long"
            )
        return None

    def _sense(self) -> Sensation:
        worm, posture = self.worm, self._posture
        contact = np.zeros((self.n_segments, 3))
        contact[:, 0] = self._friction_N
        contact[:, 2] = worm.wall_force(self._q)
        places_x = posture.q[0] + worm.lump_runs @ posture.run
        center = np.array([worm.lump_mass_kg @ places_x / worm.lump_mass_kg.sum(), 0.0, 0.0])
        return Sensation(
            time_s=self._n_control_steps * self._ratio.control_timestep_s,
            stretch_m=worm.lengths(posture)[:, np.newaxis],
            rest_stretch_m=self._rest_length_m.copy(),
            ring_length_m=worm.heights(self._q).copy(),
            muscle_force_N=self._muscle_force_N.copy(),
            contact_force_N=contact,
            center_of_mass_m=center,
        )


def resting_posture(worm: Linkage) -> Array:
    """Returns the coordinates of the straight worm in equilibrium without activation, m.

    All segments are equally high and all sides straight, so that hinges carry no load; the height is where return
    springs and walls balance, found by bisection.
    """
    high = worm.muscles.relaxed_height_m
    low = min(high, 2.0 * worm.wall_radius_m)
    for _ in range(_HALVINGS):
        height = 0.5 * (low + high)
        q = height * worm.straight
        outward = worm.heights(worm.spring_force(worm.posture(q))) - worm.wall_force(q)
        low, high = (height, high) if outward.sum() > 0.0 else (low, height)
    return high * worm.straight
