"""Stable heteroclinic channel: a ring of saddles that is visited in order, with a dwell time that noise or input sets.

Node i of N has an activity x_i >= 0 of unit size (Lotka-Volterra competition; Horchler, Daltorio, Chiel and Quinn
2015, "Designing responsive pattern generators: stable heteroclinic channel cycles for modeling and control"):

    dx_i = x_i (alpha - sum_j rho_ij x_j) dt + mu_i dt + epsilon dW_i,   reflected at 0.

With rho_ii = alpha every x = e_i is a saddle, near which x_j grows at the rate alpha - rho_ji: here alpha / nu for the
successor of i (its only unstable direction, lambda_u) and -alpha for all others (so lambda_s = alpha). The ring of
saddles attracts for a saddle value nu = lambda_s / lambda_u above 1.

Near e_i the successor obeys dx = (lambda_u x + mu) dt + epsilon dW, reflected at 0. So a node is left after about
ln(1 / mu) / lambda_u or ln(1 / epsilon) / lambda_u; tests/studies/test_shc.py has the dwell times in closed form.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from annelid.errors import ConfigError
from annelid.protocols import Array


class HeteroclinicRing:
    """Copies of a ring of saddles 1-2-..-N-1, in steps.

    One step multiplies each activity by the exponential of its growth rate times the step, which keeps the rates at
    the saddles exact, then adds input and noise (Euler-Maruyama) and reflects at 0.

    Attributes:
        n_nodes: Number of nodes N.
        growth_rate_per_s: alpha, 1/s; a node's activity also settles and decays at this rate.
        saddle_value: nu, above 1: how many times faster trajectories are drawn in than they leave.
        leaving_rate_per_s: lambda_u, the rate at which a node's successor grows, 1/s.
        competition_per_s: rho, 1/s: ``rho[i, j]`` is how much node j slows the growth of node i.
        timestep_s: Step, s.

    Raises:
        ConfigError: A time step of more than half of 1 / growth_rate_per_s.
    """

    def __init__(self, n_nodes: int, growth_rate_per_s: float, saddle_value: float, timestep_s: float) -> None:
        """Prepares a step."""
        if not 0 < timestep_s * growth_rate_per_s <= 0.5:
            raise ConfigError(
                f"a time step of {timestep_s:g} s does not fit growth_rate_per_s = {growth_rate_per_s:g}: "
                f"it must be in 0 .. {0.5 / growth_rate_per_s:g} s"
            )
        self.n_nodes, self.growth_rate_per_s, self.saddle_value = n_nodes, growth_rate_per_s, saddle_value
        self.timestep_s = timestep_s
        self.leaving_rate_per_s = growth_rate_per_s / saddle_value
        self.competition_per_s = rho = np.full((n_nodes, n_nodes), 2.0 * growth_rate_per_s)
        np.fill_diagonal(rho, growth_rate_per_s)
        node = np.arange(n_nodes)
        rho[(node + 1) % n_nodes, node] = growth_rate_per_s - self.leaving_rate_per_s
        self._competition = rho.T.copy()

    def largest_gain_per_s(self) -> float:
        """Gain of `handover_input`, 1/s, from which the ring can rest between nodes, with every cue on; maybe infinite.

        With mu_i = k x_{i-1} the ring has a fixed point with all nodes alike, x = (alpha + k) / (alpha s) with
        s = 2 N - 2 - 1/nu. A perturbation that turns by the angle t = 2 pi / N from node to node grows there at the
        rate -k (1 - cos t) + x alpha (1 + (1 + 1/nu) cos t), which is negative beyond

            k = alpha A / (1 - A),    A = (1 + (1 + 1/nu) cos t) / (s (1 - cos t)).
        """
        cosine, over = np.cos(2.0 * np.pi / self.n_nodes), 1.0 + 1.0 / self.saddle_value
        # Larger turns have smaller cosines and decay before this one does.
        share = (1.0 + over * cosine) / ((2.0 * self.n_nodes - 1.0 - over) * (1.0 - cosine))
        return self.growth_rate_per_s * share / (1.0 - share) if share < 1.0 else float("inf")

    def initial_state(self, n_copies: int = 1) -> Array:
        """Returns copies that rest at node 1, ``(n_copies, n_nodes)``."""
        state = np.zeros((n_copies, self.n_nodes))
        state[:, 0] = 1.0
        return state

    def advance(self, state: Array, input_per_s: ArrayLike = 0.0, kick: ArrayLike = 0.0) -> Array:
        """Returns the activities one step on.

        Args:
            state: Activities, ``(n_copies, n_nodes)``.
            input_per_s: mu, 1/s, broadcast to that shape.
            kick: epsilon times standard normal numbers, 1/sqrt(s), likewise; 0 without noise.

        Returns:
            Shape ``(n_copies, n_nodes)``; no activity is negative.
        """
        dt = self.timestep_s
        grown = state * np.exp(dt * (self.growth_rate_per_s - state @ self._competition))
        return np.abs(grown + dt * np.asarray(input_per_s) + np.sqrt(dt) * np.asarray(kick))


def handover_input(state: Array, cue: ArrayLike, gain_per_s: float) -> Array:
    """Returns the input that excites the successor of every node whose segment gives its cue.

    Args:
        state: Activities, ``(n_copies, n_nodes)``.
        cue: 1 for every node whose successor may take over, else 0; broadcast to that shape.
        gain_per_s: Input to the successor of a fully active node, 1/s.

    Returns:
        mu, 1/s, ``(n_copies, n_nodes)``: ``gain x_{i-1} cue_{i-1}`` at node i.
    """
    return gain_per_s * np.roll(state * np.asarray(cue), 1, axis=-1)
