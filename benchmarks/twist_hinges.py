"""What the rods' twist hinges cost, and what it costs to do without them.

A rod has one hinge an edge. Here they are dropped (the engine then penalises the turn of neighbouring planes of
curvature instead), locked by stiff joint springs, by inertia or by damping, and compared with the full model: the
middle ring contracts within three seconds, the paper's worm lying on its floor. The engine refuses a strand with hinges
on some of its edges only. Run ``python benchmarks/twist_hinges.py``; it takes about two minutes.
"""

from __future__ import annotations

from collections.abc import Callable
from time import thread_time

import mujoco
import numpy as np

from annelid import load_config
from annelid.body import build_spec, compile_spec, mesh_of

TIMESTEP_S = 0.01
DURATION_S = 3.0
ACTIVATION = 0.04
STEPS_A_TURN = 10
LOCKING_STIFFNESS_NM_PER_RAD = 1e3
LOCKING_INERTIA_KG_M2 = 1e-4
LOCKING_DAMPING_NMS_PER_RAD = 1e3


def _hinges(spec: mujoco.MjSpec) -> list[mujoco.MjsBody]:
    return [body for body in spec.worldbody.bodies if "_twist" in body.name]


def kept(spec: mujoco.MjSpec) -> None:
    """Leaves the hinges as they are."""


def dropped(spec: mujoco.MjSpec) -> None:
    """Removes every hinge."""
    for body in _hinges(spec):
        spec.delete(body)


def sprung(spec: mujoco.MjSpec) -> None:
    """Holds every hinge by a stiff spring."""
    for body in _hinges(spec):
        body.joints[0].stiffness = [LOCKING_STIFFNESS_NM_PER_RAD, 0.0, 0.0]


def heavy(spec: mujoco.MjSpec) -> None:
    """Gives every hinge an inertia that never turns."""
    for body in _hinges(spec):
        body.joints[0].armature = LOCKING_INERTIA_KG_M2


def damped(spec: mujoco.MjSpec) -> None:
    """Gives every hinge a dashpot that hardly turns."""
    for body in _hinges(spec):
        body.joints[0].damping = [LOCKING_DAMPING_NMS_PER_RAD, 0.0, 0.0]


VARIANTS: dict[str, Callable[[mujoco.MjSpec], None]] = {
    "one an edge": kept,
    "dropped": dropped,
    "locked by springs": sprung,
    "locked by inertia": heavy,
    "locked by damping": damped,
}


class Worm:
    """One variant of the worm, stepped and measured."""

    def __init__(self, alter: Callable[[mujoco.MjSpec], None], elements: int) -> None:
        """Builds the three-segment worm at rest.

        Args:
            alter: What is done to its hinges.
            elements: Elements a side.
        """
        changes = {"body.mesh.n_segments": 3, "body.mesh.elements_per_side": elements}
        config = load_config("riddle2023-rods", changes)
        geometry = mesh_of(config.body.mesh)  # type: ignore[union-attr]
        spec = build_spec(config)
        spec.option.timestep = TIMESTEP_S
        alter(spec)
        self.model = compile_spec(spec)
        self.data = mujoco.MjData(self.model)
        self.springs = [self.model.tendon(f"spring_{index}").id for index in geometry.sensor_springs[1]]
        self.ring = self.model.tendon("ring_1").id
        self.milliseconds: list[float] = []
        self.rest = self._lengths()

    def _lengths(self) -> tuple[float, float]:
        mujoco.mj_forward(self.model, self.data)
        return float(self.data.ten_length[self.ring]), float(self.data.ten_length[self.springs].mean())

    def turn(self) -> None:
        """Takes some steps with the middle ring active."""
        self.data.actuator("ring_1").ctrl[0] = ACTIVATION
        began = thread_time()
        mujoco.mj_step(self.model, self.data, STEPS_A_TURN)
        self.milliseconds.append(1e3 * (thread_time() - began) / STEPS_A_TURN)

    def row(self) -> tuple[float, float, float, float]:
        """Contraction of the ring (part of its rest length), elongation (m) and ms a step, after what was stepped."""
        ring, spring = self._lengths()
        return (
            1.0 - ring / self.rest[0],
            spring - self.rest[1],
            float(np.median(self.milliseconds)),
            float(self.data.solver_nnz[0]),
        )


def main() -> None:
    """Prints the table."""
    heading = ("elements", "hinges", "nv", "contraction", "elongation", "ms a step", "factor entries")
    print("{:8} {:18} {:>6} {:>12} {:>12} {:>10} {:>15}".format(*heading))
    for elements in (2, 3):
        worms = {name: Worm(alter, elements) for name, alter in VARIANTS.items()}
        for _ in range(round(DURATION_S / TIMESTEP_S / STEPS_A_TURN)):
            for worm in worms.values():
                worm.turn()
        for name, worm in worms.items():
            contraction, elongation, cost, entries = worm.row()
            print(
                f"{elements:8d} {name:18} {worm.model.nv:6d} {contraction:11.1%} {1e3 * elongation:9.1f} mm"
                f" {cost:10.2f} {entries:15.0f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
