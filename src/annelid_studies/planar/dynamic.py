"""The dynamic planar worms as plants: sensation, recording, saving, and the alarm."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from annelid.clock import StepRatio
from annelid.errors import SimulationStopped
from annelid.protocols import Array, SavedAndRecorded, Sensation, State, Values
from annelid_studies.planar.linkage import Linkage
from annelid_studies.planar.midpoint import midpoint_step
from annelid_studies.planar.sections import DynamicPlanarWorm

if TYPE_CHECKING:
    from annelid.config import Clock

_STEEPEST = 0.9999
_HALVINGS = 80
# What the state has for every segment: last forces, N, and energies so far, J.
_OF_SEGMENTS = ("muscle_force", "friction", "muscle_work", "positive_work", "slip_loss")
_OF_WALLS = ("contact_force", "slip_loss")


class DynamicPlanarPlant(SavedAndRecorded):
    """A `Linkage` as a plant; the worms of the literature derive from it.

    Segment 1 is at the front, which points to -x. A segment's one stretch sensor is its length, at rest when the worm
    lies unactuated. ``contact_force`` is the force of the walls along x on both vertices, and along z that of the lower
    wall. Energies add up: kinetic + elastic = muscle work - damping loss - slip loss + the start's energy, up to the
    error of the integrator (`annelid_studies.planar.midpoint`).

    Attributes:
        description: What it is, for the run file.
        linkage: Makes its mechanics from its section of the configuration.
    """

    description: ClassVar[str]
    linkage: ClassVar[Callable[[Any], Linkage]]
    recorded = (
        (
            "contact_force",
            ("segment", "axis"),
            "N",
            "force of the walls along x on a segment, and of the lower wall along z",
        ),
        ("slip_loss", ("segment",), "J", "work of a segment lost to friction so far"),
        ("stretch_length", ("segment", "sensor"), "m", "length of a segment"),
        ("ring_length", ("muscle",), "m", "height of a rhombus"),
        ("muscle_force", ("muscle",), "N", "contractile force of an actuator"),
        ("center_of_mass", ("axis",), "m", "centre of mass; the front points to -x"),
        ("outline", ("corner", "plane_axis"), "m", "upper half, front tip first: x and z"),
        ("kinetic_energy", (), "J", "kinetic energy"),
        ("elastic_energy", (), "J", "energy of springs and walls"),
        ("muscle_work", ("muscle",), "J", "net work done by an actuator so far"),
        ("positive_work", ("muscle",), "J", "positive work of an actuator so far, none regained"),
        ("damping_loss", (), "J", "energy lost to dampers so far"),
    )

    def __init__(self, body: DynamicPlanarWorm, clock: Clock) -> None:
        """Puts the worm at rest.

        Args:
            body: Section of the body.
            clock: Section of the time steps.
        """
        self.worm = worm = type(self).linkage(body)
        self._ratio = StepRatio(clock.control_timestep_s, clock.physics_timestep_s)
        self.n_segments = self.n_muscles = worm.n_segments
        self._rest = _resting_posture(worm)
        self._rest_length_m = worm.lengths(worm.posture(self._rest))[:, np.newaxis]
        self.reset(0)

    def reset(self, seed: int) -> Sensation:
        """Returns to rest at time zero, the front tip at x = 0; nothing here is random."""
        self._now = {
            "q": self._rest.copy(),
            "p": np.zeros_like(self._rest),
            **{name: np.zeros(self.n_segments) for name in _OF_SEGMENTS},
            "damping_loss": np.zeros(()),
            "n_control_steps": np.array(0),
        }
        self._converged = True
        self._posture = self.worm.posture(self._now["q"])
        return self._sense()

    def step(self, activation: Array) -> Sensation:
        """Advances by one control step, as `annelid.Plant.step`.

        Raises:
            SimulationStopped: The step has no unique solution.
        """
        activation = np.asarray(activation, dtype=np.float64)
        self._now["n_control_steps"] += 1
        for _ in range(self._ratio.physics_steps_due(int(self._now["n_control_steps"]))):
            try:
                after, converged = midpoint_step(self.worm, self._now, activation, self._ratio.physics_timestep_s)
            except np.linalg.LinAlgError:
                raise SimulationStopped(
                    "the planar worm's equations of motion have no unique solution: its masses, stiffnesses or "
                    "dampings differ by too much"
                ) from None
            self._now |= after
            self._converged &= converged
        self._posture = self.worm.posture(self._now["q"])
        return self._sense()

    def kinetic_energy_J(self) -> float:
        """Returns the present kinetic energy, J."""
        momentum = self._now["p"]
        return 0.5 * float(momentum @ np.linalg.solve(self._posture.mass, momentum))

    def elastic_energy_J(self) -> float:
        """Returns the present energy of springs and walls, J."""
        return self.worm.elastic_energy(self._posture)

    def _values(self) -> Values:
        sensed, now = self._sense(), self._now
        values = {
            "contact_force": sensed.contact_force_N,
            "slip_loss": now["slip_loss"].copy(),
            "stretch_length": sensed.stretch_m,
            "ring_length": sensed.ring_length_m,
            "muscle_force": sensed.muscle_force_N,
            "center_of_mass": sensed.center_of_mass_m,
            "outline": self.worm.places(self._posture)[self.worm.outline],
            "kinetic_energy": self.kinetic_energy_J(),
            "elastic_energy": self.elastic_energy_J(),
            "muscle_work": now["muscle_work"].copy(),
            "positive_work": now["positive_work"].copy(),
            "damping_loss": float(now["damping_loss"]),
        }
        walls = bool(self.worm.wall_stiffness_N_per_m)
        return {name: value for name, value in values.items() if walls or name not in _OF_WALLS}

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"segment": list(range(1, self.n_segments + 1)), "axis": ["x", "y", "z"]}

    def _attrs(self) -> dict[str, float | int | str]:
        return {"plant": self.description, "total_mass_kg": float(self.worm.lump_mass_kg.sum())}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        super().set_state(state)
        self._posture = self.worm.posture(self._now["q"])

    def alarm(self) -> str | None:
        """Returns a sentence if a side stands upright, a segment is squeezed flat, or a step had no solution."""
        slope = np.abs(self._posture.rise) / self.worm.link_length_m
        # Written so that NaN fails it.
        if not slope.max() <= _STEEPEST:
            return f"a side rises by {slope.max():.4g} of its length, more than {_STEEPEST:g}: the worm has folded up"
        height = self.worm.heights(self._now["q"])
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
        contact[:, 0] = self._now["friction"]
        contact[:, 2] = worm.wall_force(posture.q)
        places_x = posture.q[0] + worm.lump_runs @ posture.run
        return Sensation(
            time_s=int(self._now["n_control_steps"]) * self._ratio.control_timestep_s,
            stretch_m=worm.lengths(posture)[:, np.newaxis],
            rest_stretch_m=self._rest_length_m.copy(),
            ring_length_m=worm.heights(posture.q).copy(),
            muscle_force_N=self._now["muscle_force"].copy(),
            contact_force_N=contact,
            center_of_mass_m=np.array([worm.lump_mass_kg @ places_x / worm.lump_mass_kg.sum(), 0.0, 0.0]),
        )


def _resting_posture(worm: Linkage) -> Array:
    """Returns the coordinates of the straight worm, m, at the height where return springs and walls balance."""
    high = worm.body.height_relaxed_m
    low = min(high, 2.0 * worm.wall_radius_m)
    for _ in range(_HALVINGS):
        height = 0.5 * (low + high)
        q = height * worm.straight
        outward = worm.heights(worm.spring_force(worm.posture(q))) - worm.wall_force(q)
        low, high = (height, high) if outward.sum() > 0.0 else (low, height)
    return high * worm.straight
