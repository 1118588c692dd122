"""The explicit clock: how the body's and the nervous system's steps interleave."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["SLACK_S", "StepRatio"]

SLACK_S = 5e-7
"""Half the shortest time step: sums of time steps, rounded, miss a given moment by less than this."""


@dataclass(frozen=True, slots=True)
class StepRatio:
    """How many physics steps fall due at each control step; one step is an integer multiple of the other."""

    control_timestep_s: float
    physics_timestep_s: float

    @property
    def control_steps_per_move(self) -> int:
        """Control steps from one movement of the body to the next: 1 unless the physics is the coarser clock."""
        return max(1, round(self.physics_timestep_s / self.control_timestep_s))

    def physics_steps_due(self, control_step: int) -> int:
        """Number of physics steps that control step ``control_step`` (counted from 1) completes.

        With a finer physics it is the same each time, with a coarser one 1 at the end of a physics step, else 0.
        """
        if self.control_timestep_s >= self.physics_timestep_s:
            return round(self.control_timestep_s / self.physics_timestep_s)
        return int(control_step % self.control_steps_per_move == 0)
