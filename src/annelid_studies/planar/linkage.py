"""Chains of rigid links that are symmetric about the body's axis: geometry, energies and forces.

The upper half of a worm is a chain of rigid links, its lower half the mirror image. Coordinates are
``q = (x_0, h_1 .. h_N, ..)``: the front tip on the axis, the segments' heights, and whatever else a worm needs, all in
m. Link ``k`` of length ``L_k`` rises by ``r = G q`` and runs by ``c = sqrt(L^2 - r^2)`` along the body, at the slope
angle ``phi = arcsin(r / L)``. Point masses ``m`` sit at ``X = x_0 + H c`` and at the height ``R q``. Then

    c' = -r / c,   c'' = -L^2 / c^3,   phi' = 1 / c                                    (by the rise)
    J = dX/dq = [1 | H diag(c') G],    M = J^T m J + R^T m R,    T = p^T M^-1 p / 2,   p = M dq/dt
    dT/dq = G^T [c'' dr/dt (H^T m dX/dt)]
    U = k_s/2 sum (l - l_0)^2 + k_t/2 sum (B phi)^2 + sum over vertices k_w/2 (|y| - R_w)_+^2,   l = E c
    dissipated power = d_h sum (dh/dt)^2 + d_t sum (B dphi/dt)^2

with lengths ``l`` of the segments, a return spring along each, torsional springs over the differences ``B phi``, and
a wall at the radius ``R_w``. A muscle pulls the two vertices of its segment together with the force
``activation F_0 (h - h_s)_+ / (h_0 - h_s)``, which falls from ``F_0`` at the relaxed height to nothing at ``h_s``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from annelid.protocols import Array
from annelid_studies.planar.sections import DynamicPlanarWorm

_NO_MOVE_M = 1e-12


@dataclass(frozen=True)
class Posture:
    """What follows from the coordinates alone: rises, runs and their derivatives, Jacobian and mass matrix."""

    q: Array
    rise: Array
    run: Array
    run_1: Array
    run_2: Array
    jacobian: Array
    mass: Array


@dataclass(frozen=True)
class Linkage:
    """A worm of links, springs, dampers, muscles and walls; see the module for the equations.

    Attributes:
        body: Springs k_s, dampers d_h, muscles (F_0, h_0, h_s) and number of segments N; the first N coordinates behind
            ``x_0`` are their heights.
        rises: G without the column of ``x_0``, shape ``(n_links, n_coordinates)``.
        link_length_m: L.
        lump_runs: H, shape ``(n_lumps, n_links)``.
        lump_heights: R without the column of ``x_0``, shape ``(n_lumps, n_coordinates)``.
        lump_mass_kg: m; a lump off the axis is counted with its mirror image.
        vertices: The lump of every segment's upper and lower vertex.
        outline: The lumps along the upper half, from the front tip to the rear one.
        segment_runs: E, shape ``(n_segments, n_links)``.
        straight: Coordinates, with ``x_0``, per height of the worm with straight sides and equal heights.
        hinges: B, shape ``(n_hinges, n_links)``.
        torsion_stiffness_Nm_per_rad: k_t.
        torsion_damping_Nms_per_rad: d_t.
        wall_radius_m: R_w; infinite without walls.
        wall_stiffness_N_per_m: k_w.
        friction: Coefficient of Coulomb friction between vertices and walls.
    """

    body: DynamicPlanarWorm
    rises: Array
    link_length_m: Array
    lump_runs: Array
    lump_heights: Array
    lump_mass_kg: Array
    vertices: np.ndarray
    outline: np.ndarray
    segment_runs: Array
    straight: Array
    hinges: Array
    torsion_stiffness_Nm_per_rad: float
    torsion_damping_Nms_per_rad: float
    wall_radius_m: float = np.inf
    wall_stiffness_N_per_m: float = 0.0
    friction: float = 0.0

    @property
    def n_segments(self) -> int:
        """Number of segments N."""
        return self.body.n_segments

    @cached_property
    def n_coordinates(self) -> int:
        """Number of coordinates, ``x_0`` included."""
        return self.rises.shape[1] + 1

    @cached_property
    def _vertical_mass(self) -> Array:
        return _with_front(self.lump_heights.T @ (self.lump_mass_kg[:, np.newaxis] * self.lump_heights))

    @cached_property
    def _hinge_stiffness(self) -> Array:
        return self.torsion_stiffness_Nm_per_rad * self.hinges.T @ self.hinges

    @cached_property
    def _hinge_damping(self) -> Array:
        return self.torsion_damping_Nms_per_rad * self.hinges.T @ self.hinges

    @cached_property
    def _segment_stiffness(self) -> Array:
        return self.body.spring_stiffness_N_per_m * self.segment_runs.T @ self.segment_runs

    def muscle_stiffness(self, activation: Array) -> Array:
        """Returns the muscles' force per height above the shortest, N/m, of the activation's shape."""
        body = self.body
        return activation * (body.muscle_force_N / (body.height_relaxed_m - body.height_shortest_m))

    def muscle_force(self, activation: Array, q: Array) -> Array:
        """Returns the contractile forces, N, of the activation's shape."""
        return self.muscle_stiffness(activation) * np.maximum(self.heights(q) - self.body.height_shortest_m, 0.0)

    def heights(self, q: Array) -> Array:
        """Returns the segments' heights, m, a view of shape ``(n_segments,)``."""
        return q[1 : 1 + self.n_segments]

    def posture(self, q: Array) -> Posture:
        """Computes all that depends on the coordinates alone; a link that would have to stretch has the run NaN."""
        rise = self.rises @ q[1:]
        with np.errstate(invalid="ignore", divide="ignore"):
            run = np.sqrt(self.link_length_m**2 - rise * rise)
            run_1 = -rise / run
            run_2 = -(self.link_length_m**2) / run**3
        jacobian = np.ones((len(self.lump_mass_kg), self.n_coordinates))
        jacobian[:, 1:] = (self.lump_runs * run_1) @ self.rises
        mass = jacobian.T @ (self.lump_mass_kg[:, np.newaxis] * jacobian) + self._vertical_mass
        return Posture(q, rise, run, run_1, run_2, jacobian, mass)

    def lengths(self, posture: Posture) -> Array:
        """Returns the segments' lengths, m, shape ``(n_segments,)``."""
        return self.segment_runs @ posture.run

    def places(self, posture: Posture) -> Array:
        """Returns the lumps of the upper half, m, shape ``(n_lumps, 2)``."""
        return np.stack([posture.q[0] + self.lump_runs @ posture.run, self.lump_heights @ posture.q[1:]], axis=1)

    def slopes(self, posture: Posture) -> Array:
        """Returns the links' angles to the axis, rad, shape ``(n_links,)``."""
        return np.arctan2(posture.rise, posture.run)

    def wall_force(self, q: Array) -> Array:
        """Returns the force between each of a segment's two vertices and the wall, N, shape ``(n_segments,)``."""
        return self.wall_stiffness_N_per_m * np.maximum(self.heights(q) / 2.0 - self.wall_radius_m, 0.0)

    def mean_wall_force(self, start: Array, end: Array) -> tuple[Array, Array]:
        """Returns the walls' force averaged such that its work is what they store, and its derivative by the end.

        They are of each vertex, in N and N per m of the height at the end, from coordinates ``start`` to ``end``.
        """
        if not self.wall_stiffness_N_per_m:
            return np.zeros(self.n_segments), np.zeros(self.n_segments)
        before = self.heights(start) / 2.0 - self.wall_radius_m
        after = self.heights(end) / 2.0 - self.wall_radius_m
        moves = np.abs(after - before) > _NO_MOVE_M
        move = np.where(moves, after - before, 1.0)
        squeeze, at_end = np.maximum(before, 0.0), np.maximum(after, 0.0)
        mean = np.where(moves, 0.5 * (at_end**2 - squeeze**2) / move, 0.5 * (at_end + squeeze))
        slope = np.where(moves, (at_end - mean) / move, 0.5 * (after > 0.0))
        return self.wall_stiffness_N_per_m * mean, 0.5 * self.wall_stiffness_N_per_m * slope

    def _stretch(self, posture: Posture) -> Array:
        slack_m = np.sqrt((2.0 * self.body.side_m) ** 2 - self.body.height_relaxed_m**2)
        return self.lengths(posture) - slack_m

    def elastic_energy(self, posture: Posture) -> float:
        """Returns the energy of return springs, torsional springs and walls, J."""
        stretch, body = self._stretch(posture), self.body
        turn = self.hinges @ self.slopes(posture)
        energy = body.spring_stiffness_N_per_m * stretch @ stretch + self.torsion_stiffness_Nm_per_rad * turn @ turn
        if self.wall_stiffness_N_per_m:
            wall = self.wall_force(posture.q)
            energy += 2.0 * wall @ wall / self.wall_stiffness_N_per_m
        return 0.5 * float(energy)

    def kinetic_force(self, posture: Posture, velocity: Array) -> Array:
        """Returns dT/dq at given velocities, N, shape ``(n_coordinates,)``."""
        momentum = self.lump_mass_kg * (posture.jacobian @ velocity)
        by_rise = posture.run_2 * (self.rises @ velocity[1:]) * (self.lump_runs.T @ momentum)
        return _with_front(self.rises.T @ by_rise)

    def spring_force(self, posture: Posture) -> Array:
        """Returns -dU/dq of all springs, without the walls, N, shape ``(n_coordinates,)``."""
        tension, torque = self._link_loads(posture)
        return _with_front(-self.rises.T @ (posture.run_1 * tension + torque / posture.run))

    def spring_stiffness(self, posture: Posture) -> Array:
        """Returns the second derivatives of the springs' energy, N/m, ``(n_coordinates, n_coordinates)``."""
        tension, torque = self._link_loads(posture)
        by_rise = posture.run_1[:, np.newaxis] * self._segment_stiffness * posture.run_1
        by_rise += self._hinge_stiffness / (posture.run[:, np.newaxis] * posture.run)
        by_rise += np.diag(posture.run_2 * tension + posture.rise / posture.run**3 * torque)
        return _with_front(self.rises.T @ by_rise @ self.rises)

    def damping(self, posture: Posture) -> Array:
        """Returns the matrix of viscous resistances, N s/m, shape ``(n_coordinates, n_coordinates)``."""
        by_rise = self._hinge_damping / (posture.run[:, np.newaxis] * posture.run)
        matrix = _with_front(self.rises.T @ by_rise @ self.rises)
        heights = np.arange(1, 1 + self.n_segments)
        matrix[heights, heights] += self.body.height_damping_Ns_per_m
        return matrix

    def _link_loads(self, posture: Posture) -> tuple[Array, Array]:
        """Derivatives of U by the runs (N) and by the slopes (N m) of the links."""
        tension = self.body.spring_stiffness_N_per_m * (self.segment_runs.T @ self._stretch(posture))
        return tension, self._hinge_stiffness @ self.slopes(posture)


def _with_front(part: Array) -> Array:
    """Puts zeros for the coordinate ``x_0`` before a vector or a matrix."""
    whole = np.zeros([n + 1 for n in part.shape])
    whole[(slice(1, None),) * part.ndim] = part
    return whole
