"""The stepper of the dynamic planar worms: the variational midpoint rule with Coulomb friction.

One step of length ``dt`` from coordinates and momenta ``(q_0, p_0)``: with the mean velocity ``u`` as the unknown and
``q_m = q_0 + dt/2 u``,

    M(q_m) u - dt/2 [dT/dq + Q](q_m, u) - dt/2 J^T f = p_0,     q_1 = q_0 + dt u,     p_1 = 2 M(q_m) u - p_0

where ``Q`` has springs, walls, dampers and muscles, ``J u`` is the slip of the vertices along the wall and ``f``
their friction, ``|f| <= 2 mu N`` for the two vertices of a segment. The force ``N`` of a wall, which has a kink, is its
mean from ``q_0`` to ``q_1``, so that its work is what the wall stores (a discrete gradient, Gonzalez 1996). Without
walls, dampers, friction and muscles the rule is symplectic and of second order (Marsden and West 2001), so that the
energy's error stays bounded, and the momentum along the body is kept. ``u`` is found by Newton's method with the
friction's complementarity problem solved in each iteration.

Vertices that stick do not move during the step. An impulse at its end takes away the velocity that they had at its
beginning; what that costs is work lost to friction, and so is ``-f J u dt`` of the sliding ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from annelid.protocols import Array
from annelid_studies.planar.linkage import Linkage

_ITERATIONS = 50
_TOLERANCE_M_PER_S = 1e-9
_FRICTION_ROUNDS = 30
_FRICTION_SWEEPS = 2000


def midpoint_step(
    worm: Linkage, now: dict[str, NDArray[Any]], activation: Array, timestep_s: float
) -> tuple[dict[str, Array], bool]:
    """Returns the state of a worm one step on, and whether Newton's method has converged.

    The state is: coordinates ``q``, m, and momenta ``p``, kg m/s, NaN where a link would have had to stretch;
    ``muscle_force`` and ``friction`` (on both vertices of a segment together, along x) in the middle of the last step,
    N; the energies so far ``muscle_work``, ``positive_work`` and ``slip_loss`` of a segment, and ``damping_loss``, J.
    """
    q, p = now["q"], now["p"]
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
    sticks = np.abs(friction) < limit
    momentum, stopping_loss = _stop(worm, end, 2.0 * middle.mass @ velocity - p, sticks)
    slip = middle.jacobian[worm.vertices] @ velocity
    work = -timestep_s * pull * worm.heights(velocity)
    after = {
        "q": end,
        "p": momentum,
        "muscle_force": pull,
        "friction": friction,
        "muscle_work": now["muscle_work"] + work,
        "positive_work": now["positive_work"] + np.maximum(work, 0.0),
        "slip_loss": now["slip_loss"] + (stopping_loss - timestep_s * friction * np.where(sticks, 0.0, slip)),
        "damping_loss": np.asarray(
            now["damping_loss"] + timestep_s * float(velocity @ worm.damping(middle) @ velocity)
        ),
    }
    return after, converged


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


def coulomb(mobility: Array, free_slip: Array, limit: Array) -> Array:
    """Finds the friction forces ``f`` of all contacts at once, as a complementarity problem.

    With the slip ``v = free_slip + mobility f`` each contact has ``v = 0`` and ``|f| <= limit`` (it sticks), or
    ``f = -limit sign(v)`` (it slides). For a positive definite mobility there is exactly one solution. Contacts are
    guessed to stick or slide and the guess is corrected until it is right; where the corrections go round in a circle,
    projected Gauss-Seidel takes over. Mobility is slip per force, and the free slip that without friction.
    """
    slides = np.where(limit > 0.0, 0.0, -1.0)
    own = np.eye(len(limit))
    for _ in range(_FRICTION_ROUNDS):
        stick, at_limit = slides == 0.0, -slides * limit
        system = np.where(stick[:, np.newaxis], mobility, own)
        force = np.where(stick, np.linalg.solve(system, np.where(stick, -free_slip, at_limit)), at_limit)
        slip = free_slip + mobility @ force
        too_much = stick & (np.abs(force) > limit)
        reversed_ = ~stick & (slip * slides < 0.0) & (limit > 0.0)
        if not (too_much.any() or reversed_.any()):
            return force
        slides = np.where(too_much, -np.sign(force), np.where(reversed_, 0.0, slides))
    return _gauss_seidel(mobility, free_slip, limit)


def _gauss_seidel(mobility: Array, free_slip: Array, limit: Array) -> Array:
    force = np.zeros_like(free_slip)
    for _ in range(_FRICTION_SWEEPS):
        before = force.copy()
        for i in range(len(force)):
            slip = free_slip[i] + mobility[i] @ force
            force[i] = min(max(force[i] - slip / mobility[i, i], -limit[i]), limit[i])
        if np.abs(force - before).max() <= 1e-13 * limit.max():
            break
    return force
