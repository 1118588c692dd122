"""The 3D worm's books: what muscles have done, and where it went, physics step by physics step.

The engine moves the body by the step h times the new velocity v', and the work of a generalised force f in a step is
``h f . v'``. With the mass matrix M constant, as it is for point masses on slides,

    change of kinetic energy = work of all forces - 1/2 |v' - v|^2_M

holds to rounding. Forces are the engine's own: weight, constraints, dampers, springs, actuators. The integrator
`discrete` takes springs, dampers and actuators at the end of the step to first order, with simpler matrices than
theirs. What that takes beyond the true change of elastic energy and the dampers' own work, and the square above, is the
numerical loss. It is what is left of the muscles' work when everything else is subtracted (docs/gait.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.body.actuators import ActuatorKind
from annelid.morphology import Array

Engine = Mapping[str, NDArray[Any]]
"""The engine's arrays of one worm by name."""


@dataclass(frozen=True, slots=True)
class Books:
    """Work done and energy lost since the start, J.

    Attributes:
        muscle_work: Net work of every ring actuator on the body, ``(n_muscles,)``.
        positive_work: What every ring actuator did in the physics steps in which its work was positive, likewise.
        damping_loss: Energy that dampers have taken, ``()``.
        constraint_loss: Energy that contacts, their friction included, and other constraints have taken, ``()``.
    """

    muscle_work: Array
    positive_work: Array
    damping_loss: Array
    constraint_loss: Array

    def __add__(self, step: Books) -> Books:
        """Returns the books after one more step."""
        return Books(
            self.muscle_work + step.muscle_work,
            self.positive_work + step.positive_work,
            self.damping_loss + step.damping_loss,
            self.constraint_loss + step.constraint_loss,
        )


class Bookkeeper:
    """Reads from the engine's arrays what one physics step did.

    Attributes:
        outputs: Names of the engine's arrays that `step` needs.
        slopes: Slopes of the actuators where the integrator needs them, else None.
    """

    outputs = (
        "qvel",
        "qfrc_damper",
        "qfrc_constraint",
        "actuator_force",
        "actuator_length",
        "actuator_velocity",
        "actuator_moment",
        "moment_colind",
        "moment_rowadr",
    )

    def __init__(self, model: mujoco.MjModel, rings: ActuatorKind) -> None:
        """Notes the time step and what the actuators are."""
        self._n_muscles = model.nu
        self._timestep_s = float(model.opt.timestep)
        # Other integrators take the actuators' forces as they are at the start of a step.
        implicit = model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_DISCRETE)
        self.slopes = rings.slopes(model) if implicit else None

    def opened(self) -> Books:
        """Returns the books before the first step."""
        return Books(np.zeros(self._n_muscles), np.zeros(self._n_muscles), np.zeros(()), np.zeros(()))

    def step(self, engine: Engine, drive: Array) -> tuple[Array, Books]:
        """Tells what the actuators pulled with in one step, and what the step did.

        Args:
            engine: The engine's arrays named in `outputs`, of one worm, after the step.
            drive: What the actuators' gain was multiplied by during it: the control, or the engine's actuator states
                before the step where there are any; ``(n_muscles,)``.

        Returns:
            Tension of every ring actuator that acted over the step, N, ``(n_muscles,)``: its work is this times the
            shortening. And the step's entries.
        """
        velocity, h = engine["qvel"], self._timestep_s
        rate, earlier = self._rates(engine, velocity), engine["actuator_velocity"]
        tension = -engine["actuator_force"]
        if self.slopes is not None:
            per_length, per_rate = self.slopes(engine["actuator_length"], earlier, drive, tension)
            tension = tension + per_length * (h * rate) + per_rate * (rate - earlier)
        work = -h * tension * rate
        entries = Books(
            work,
            np.maximum(work, 0.0),
            np.asarray(-h * (engine["qfrc_damper"] @ velocity)),
            np.asarray(-h * (engine["qfrc_constraint"] @ velocity)),
        )
        return tension, entries

    def _rates(self, engine: Engine, velocity: Array) -> Array:
        """Rates of the actuators' lengths at a velocity of the body, m/s, with the lever arms of the step."""
        products = engine["actuator_moment"] * velocity[engine["moment_colind"]]
        return np.add.reduceat(products, engine["moment_rowadr"])
