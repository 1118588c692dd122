"""Coulomb friction as a complementarity problem: each contact sticks, or slides at the limit against its slip."""

from __future__ import annotations

import numpy as np

from annelid.protocols import Array

_ROUNDS = 30
_SWEEPS = 2000


def coulomb(mobility: Array, free_slip: Array, limit: Array) -> Array:
    """Finds the friction forces ``f`` of all contacts at once.

    With the slip ``v = free_slip + mobility f`` each contact has ``v = 0`` and ``|f| <= limit`` (it sticks), or
    ``f = -limit sign(v)`` (it slides). For a positive definite mobility there is exactly one solution. Contacts are
    guessed to stick or slide and the guess is corrected until it holds; where the corrections go round in a circle,
    projected Gauss-Seidel takes over.

    Args:
        mobility: Slip per force, symmetric and positive definite, shape ``(n, n)``.
        free_slip: Slip without friction, shape ``(n,)``.
        limit: Largest force of each contact, not negative, shape ``(n,)``.
    """
    slides = np.where(limit > 0.0, 0.0, -1.0)
    own = np.eye(len(limit))
    for _ in range(_ROUNDS):
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
    for _ in range(_SWEEPS):
        before = force.copy()
        for i in range(len(force)):
            slip = free_slip[i] + mobility[i] @ force
            force[i] = min(max(force[i] - slip / mobility[i, i], -limit[i]), limit[i])
        if np.abs(force - before).max() <= 1e-13 * limit.max():
            break
    return force
