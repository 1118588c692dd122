"""The stepper of the dynamic planar worms: the variational midpoint rule with Coulomb friction.

One step of length ``dt`` from coordinates and momenta ``(q_0, p_0)``: with the mean velocity ``u`` as the unknown and
``q_m = q_0 + dt/2 u``,

    M(q_m) u - dt/2 [dT/dq + Q](q_m, u) - dt/2 J^T f = p_0,     q_1 = q_0 + dt u,     p_1 = 2 M(q_m) u - p_0

where ``Q`` holds springs, walls, dampers and muscles, ``J u`` is the slip of the vertices along the wall and ``f``
their friction, ``|f| <= 2 mu N`` for the two vertices of a segment. The force ``N`` of a wall, which has a kink, is its
mean over the way from ``q_0`` to ``q_1``, so that its work is what the wall stores (a discrete gradient, Gonzalez
1996). Without walls, dampers, friction and muscles the rule is symplectic and of second order (Marsden and West 2001),
so that the energy's error stays bounded, and the momentum along the body is kept. ``u`` is found by Newton's method
with the friction's complementarity problem solved in each iteration.

Vertices that stick do not move at all during the step. An impulse at its end takes away the velocity that they had
kept at its beginning; what that costs is work lost to friction, and so is ``-f J u dt`` of the sliding ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from annelid.planar.friction import coulomb
from annelid.planar.linkage import Linkage
from annelid.protocols import Array

_ITERATIONS = 50
_TOLERANCE_M_PER_S = 1e-9


@dataclass(frozen=True, slots=True)
class Step:
    """The outcome of one step.

    Attributes:
        q: Coordinates at its end, m.
        p: Momenta at its end, kg m/s.
        muscle_force_N: Contractile force, shape ``(n_segments,)``, in the middle of the step.
        wall_force_N: Force of the wall on each of a segment's two vertices, likewise.
        friction_N: Friction on both vertices of a segment together along x, likewise.
        muscle_work_J: Work done by every muscle.
        damping_loss_J: Energy lost to the dampers.
        slip_loss_J: Energy lost to friction by every segment.
        converged: Whether Newton's method did.
    """

    q: Array
    p: Array
    muscle_force_N: Array
    wall_force_N: Array
    friction_N: Array
    muscle_work_J: Array
    damping_loss_J: float
    slip_loss_J: Array
    converged: bool


def midpoint_step(worm: Linkage, q: Array, p: Array, activation: Array, timestep_s: float) -> Step:
    """Advances a worm by one step.

    Args:
        worm: The worm.
        q: Coordinates, m, shape ``(n_coordinates,)``.
        p: Momenta, kg m/s, same shape.
        activation: Activation of the muscles in [0, 1], shape ``(n_segments,)``.
        timestep_s: Length of the step, s.

    Returns:
        The outcome; it holds NaN where a link would have had to stretch.
    """
    half = 0.5 * timestep_s
    heights = np.arange(1, 1 + worm.n_segments)
    pull_stiffness = worm.muscle_stiffness(activation)
    velocity: Array = np.linalg.solve(worm.posture(q).mass, p).astype(np.float64, copy=False)
    friction = limit = np.zeros(worm.n_segments)
    converged = False
    for _ in range(_ITERATIONS):
        middle = worm.posture(q + half * velocity)
        if not np.isfinite(middle.mass).all():
            break
        damping = worm.damping(middle)
        pull = worm.muscle_force(activation, middle.q)
        normal, wall_stiffness = worm.mean_wall_force(q, q + timestep_s * velocity)
        force = worm.kinetic_force(middle, velocity) + worm.spring_force(middle) - damping @ velocity
        force[heights] -= pull + normal
        residual = p + half * force - middle.mass @ velocity
        stiffness = worm.spring_stiffness(middle)
        stiffness[heights, heights] += np.where(pull > 0.0, pull_stiffness, 0.0) + 2.0 * wall_stiffness
        system = middle.mass + half * (damping + half * stiffness)
        limit = 2.0 * worm.friction * normal
        if limit.any():
            slip_of = middle.jacobian[worm.vertices]
            answers = np.linalg.solve(system, np.column_stack([residual, half * slip_of.T]))
            friction = coulomb(slip_of @ answers[:, 1:], slip_of @ (velocity + answers[:, 0]), limit)
            change = answers[:, 0] + answers[:, 1:] @ friction
        else:
            friction = np.zeros(worm.n_segments)
            change = np.linalg.solve(system, residual)
        velocity = velocity + change
        if np.abs(change).max() <= _TOLERANCE_M_PER_S:
            converged = True
            break
    middle = worm.posture(q + half * velocity)
    pull = worm.muscle_force(activation, middle.q)
    end = q + timestep_s * velocity
    normal, _ = worm.mean_wall_force(q, end)
    momentum = 2.0 * middle.mass @ velocity - p
    sticks = np.abs(friction) < limit
    momentum, lost_in_stopping = _stop(worm, end, momentum, sticks)
    slip = middle.jacobian[worm.vertices] @ velocity
    return Step(
        q=end,
        p=momentum,
        muscle_force_N=pull,
        wall_force_N=normal,
        friction_N=friction,
        muscle_work_J=-timestep_s * pull * worm.heights(velocity),
        damping_loss_J=timestep_s * float(velocity @ worm.damping(middle) @ velocity),
        slip_loss_J=lost_in_stopping - timestep_s * friction * np.where(sticks, 0.0, slip),
        converged=converged,
    )


def _stop(worm: Linkage, q: Array, p: Array, sticks: np.ndarray) -> tuple[Array, Array]:
    """Takes the velocity along the wall from the vertices that stick; returns the momenta and each one's loss, J."""
    loss = np.zeros(worm.n_segments)
    if not sticks.any():
        return p, loss
    posture = worm.posture(q)
    slip_of = posture.jacobian[worm.vertices[sticks]]
    answers = np.linalg.solve(posture.mass, np.column_stack([p, slip_of.T]))
    slip = slip_of @ answers[:, 0]
    impulse = np.linalg.solve(slip_of @ answers[:, 1:], -slip)
    loss[sticks] = -0.5 * impulse * slip
    return p + slip_of.T @ impulse, loss
