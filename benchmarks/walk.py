"""Three segments that walk, here and in other programs: shape and travel, from the paths of the crossings alone.

The body is that of the preset `riddle2023-rods`, with its material and rigid crossings, on level ground with Coulomb
friction of 1. In place of muscles, each ring is a cord whose tension is a given function of time and of the ring's
length: a stiffness that rises and falls, segment after segment, times what the ring is longer than the cord. So there
is no controller.

A scenario is physics only (`Worm`). A solver takes it and returns a step: forces on the crossings in, their
positions out. What is measured sees these positions only, one set every 10 ms: the largest elongation of a segment
and its shortest ring, over the last cycle; the travel of the crossings' mean, cycle by cycle; its mean height.

The programs are annelid's rods (also with the engine's own settings of
friction and contact) and chain, the rods of dismech-newton with contact (implicit, by ADMM), and PyElastica
(explicit, crossings as springs). The time is that of one core after the first sample, in which programs compile.

It needs the environment of ``pull_and_release.py`` and takes five minutes:

    python benchmarks/walk.py --csv docs/results/walk_elsewhere.csv
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import cached_property, partial
from importlib import import_module
from importlib.metadata import version
from math import ceil
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from pull_and_release import DENSITY, MATERIAL, SHEAR_CORRECTION, SHEAR_PA, YOUNG_PA, cosserat_rod, discrete_rods

from annelid.body import Mesh
from annelid.config import load_config
from annelid.morphology import Array
from annelid.output import write_csv
from annelid.simulation import WormPlant

PRESET = "riddle2023-rods"
GRAVITY, FRICTION, FLOOR_M, PIN_KG, SPRING_N_PER_M, DAMPING_S = 9.81, 1.0, -0.009, 0.00052, 19.9, 0.145
"""The preset's, which the solvers of other programs are given."""
PERIOD_S, CYCLES, SAMPLE_S = 1.5, 2, 0.01
CORD_N_PER_M, CORD_M = 12.0, 0.36
HEAVIER, ELASTICA_SHARE, CONTACT_N_PER_M, CONTACT_NS_PER_M, SLIDES_M_PER_S = 5000.0, 0.3, 300.0, 0.3, 1e-3
"""PyElastica's: multiple of the rotary inertia, share of the closed form of the largest step, contact, and the speed
below which friction holds."""
Step = Callable[[Array], Array]
"""A step under forces on the crossings, N, which returns their positions, m, ``(n_crossings, 3)`` both."""


class Worm:
    """The body at rest, and the forces on its crossings as functions of their positions, m, ``(n_crossings, 3)``."""

    def __init__(self, elements: int) -> None:
        """Makes a mesh with a number of elements between two crossings."""
        self.overrides = {"body.mesh.elements_per_side": elements, "body.mesh.elements_per_end": max(elements // 2, 1)}
        self.elements = elements

    @cached_property
    def mesh(self) -> Any:
        """Its geometry."""
        body: Any = load_config(PRESET, self.overrides).body
        mesh: Mesh = body.mesh
        return mesh.geometry()

    @property
    def crossings(self) -> list[tuple[tuple[int, int], tuple[int, int]]]:
        """The strand and its vertex on either side of every crossing."""
        at = self.mesh.crossing_vertex[self.mesh.crossing_plane].tolist()
        return [((a, v), (b, v)) for (a, b), v in zip(self.mesh.crossing_strands.tolist(), at, strict=True)]

    def ring_forces_N(self, at: Array, time_s: float) -> Array:
        """Forces of the cords."""
        phase = time_s / PERIOD_S - np.arange(self.mesh.n_segments) / self.mesh.n_segments
        turn = np.where(phase < 0.0, 0.0, phase % 1.0)
        pulled = np.where(turn < 2 / 3, np.sin(1.5 * np.pi * turn) ** 2, 0.0)
        sides = np.roll(at[self.mesh.rings], -1, axis=1) - at[self.mesh.rings]
        lengths = np.linalg.norm(sides, axis=-1, keepdims=True)
        longer = np.maximum(lengths.sum(axis=1, keepdims=True) - CORD_M, 0.0)
        along = pulled[:, None, None] * CORD_N_PER_M * longer * sides / lengths
        forces = np.zeros_like(at)
        forces[self.mesh.rings] = along - np.roll(along, 1, axis=1)
        return forces

    def spring_forces_N(self, at: Array) -> Array:
        """Forces of the axial springs, for programs without them."""
        front, rear = self.mesh.springs.T
        sides = at[rear] - at[front]
        lengths = np.linalg.norm(sides, axis=-1)
        along = (SPRING_N_PER_M * (1.0 - self.mesh.spring_length_m / lengths))[:, None] * sides
        forces = np.zeros_like(at)
        np.add.at(forces, front, along)
        np.add.at(forces, rear, -along)
        return forces


def annelid(worm: Worm, step_s: float, **overrides: Any) -> tuple[Step, float]:
    """The package's worm, without muscles; its rods, or with overrides of the preset."""
    own = {"clock.control_timestep_s": step_s, "clock.physics_timestep_s": step_s, "arena.friction": FRICTION}
    own |= {"body.rings.peak_force_N": 1e-6} | worm.overrides | overrides
    plant = WormPlant(load_config(PRESET, own))

    def step(forces_N: Array) -> Array:
        plant.push(forces_N)
        plant.move(np.zeros(plant.n_muscles), 1)
        return plant.posture.crossing

    return step, step_s


def dismech(worm: Worm, step_s: float) -> tuple[Step, float]:
    """Implicit discrete elastic rods, whose capsules touch a plane."""
    newton: Any = import_module("newton")
    peer: Any = import_module("dismech_newton")
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, -GRAVITY))
    peer.register_custom_attributes(builder)
    discrete_rods(builder, peer.ADMMDiSMechSolver.add_rod, worm.mesh.vertices_m, worm.crossings, DAMPING_S)
    crossing = [strand * worm.mesh.vertices_m.shape[1] + vertex for (strand, vertex), _ in worm.crossings]
    for node in crossing:
        builder.particle_mass[node] += PIN_KG
    builder.add_ground_plane(height=FLOOR_M)
    model = builder.finalize(device="cpu")
    solver = peer.ADMMDiSMechSolver(model, self_contact=False, friction=FRICTION, linear_solver="scipy")
    pipeline = newton.CollisionPipeline(
        model, soft_contact_max=0, contact_matching="latest", rigid_contact_max=4 * model.body_count
    )
    contacts, states = pipeline.contacts(), [model.state(), model.state()]
    forces, at = np.zeros((builder.particle_count, 3), dtype=np.float32), worm.mesh.crossings_m

    def step(forces_N: Array) -> Array:
        nonlocal at
        forces[crossing] = forces_N + worm.spring_forces_N(at)
        states[0].particle_f.assign(forces)
        pipeline.collide(states[0], contacts)
        solver.step(states[0], states[1], None, contacts, step_s)
        states.reverse()
        at = states[0].particle_q.numpy()[crossing].astype(float)
        return at

    return step, step_s


def pyelastica(worm: Worm, heavier: float) -> tuple[Step, float]:
    """Cosserat rods with an enlarged rotary inertia, at the longest stable step, and its contact with a plane."""
    ea: Any = import_module("elastica")
    vertices_m = worm.mesh.vertices_m
    element_m = float(np.linalg.norm(np.diff(vertices_m, axis=1), axis=-1).min())
    shear = MATERIAL.radius_m * np.sqrt(heavier * DENSITY / (SHEAR_CORRECTION * SHEAR_PA))
    viscous = DENSITY * heavier * element_m**2 / (4.0 * YOUNG_PA * DAMPING_S)
    step_s = ELASTICA_SHARE * min(shear, viscous, element_m * np.sqrt(DENSITY / YOUNG_PA))
    step_s = SAMPLE_S / ceil(SAMPLE_S / step_s)

    class System(ea.BaseSystemCollection, ea.Forcing, ea.Contact):
        pass

    system, rods = System(), [cosserat_rod(place, heavier) for place in vertices_m]
    plane = ea.Plane(plane_origin=np.array([0.0, 0.0, FLOOR_M]), plane_normal=np.array([0.0, 0.0, 1.0]))
    for each in (*rods, plane):
        system.append(each)
    (first, second), vertex = worm.mesh.crossing_strands.T, worm.mesh.crossing_vertex[worm.mesh.crossing_plane]
    for strand, v in zip(first, vertex, strict=True):
        rods[strand].mass[v] += PIN_KG
    weight_N = np.zeros((len(rods), 3, vertices_m.shape[1]))
    weight_N[:, 2] = [-GRAVITY * rod.mass for rod in rods]
    rest, before = [rod.kappa.copy() for rod in rods], [rod.kappa.copy() for rod in rods]
    # As in the other benchmark: two nodes on a spring, a fourth of the stable frequency.
    pin_N_per_m = 0.5 * DENSITY * np.pi * MATERIAL.radius_m**2 * element_m * (0.5 / step_s) ** 2
    now_N = np.zeros_like(worm.mesh.crossings_m)

    def gaps() -> tuple[Array, Array]:
        """The crossings, and from one strand to the other, m."""
        at = np.stack([rod.position_collection for rod in rods])
        return 0.5 * (at[first, :, vertex] + at[second, :, vertex]), at[second, :, vertex] - at[first, :, vertex]

    class Loads(ea.NoForces):
        """Weight, pins, springs, cords, and Kelvin-Voigt damping: a rest curvature that trails that of the rod."""

        def apply_forces(self, system: Any, time: float = 0.0) -> None:
            at, gap = gaps()
            half, pin, forces = 0.5 * (now_N + worm.spring_forces_N(at)), pin_N_per_m * gap, weight_N.copy()
            forces[first, :, vertex] += half + pin
            forces[second, :, vertex] += half - pin
            for rod, force, straight, old in zip(rods, forces, rest, before, strict=True):
                rod.external_forces += force
                rod.rest_kappa[:] = straight - DAMPING_S / step_s * (rod.kappa - old)
                old[:] = rod.kappa

    system.add_forcing_to(rods[0]).using(Loads)
    friction = np.full(3, FRICTION)
    for rod in rods:
        system.detect_contact_between(rod, plane).using(
            ea.RodPlaneContactWithAnisotropicFriction,
            k=CONTACT_N_PER_M,
            nu=CONTACT_NS_PER_M,
            slip_velocity_tol=SLIDES_M_PER_S,
            static_mu_array=friction,
            kinetic_mu_array=friction,
        )
    system.finalize()
    stepper = ea.PositionVerlet()

    def step(forces_N: Array) -> Array:
        now_N[:] = forces_N
        stepper.step(system, 0.0, step_s)
        return gaps()[0]

    return step, step_s


PINS = {"pin_time_constant_s": 0.004, "pin_impedance": [0.99, 0.999, 0.001]}
CHAIN = partial(annelid, **{"body.formulation": {"kind": "chain", "armature_kg_m2": 1e-4, **PINS}})
"""The paper's capsules, with a hundredth of its added inertia and pins that are nearly rigid."""
RATIO = partial(annelid, **{"body.formulation.friction_impedance_ratio": 1.0})
SOFTER = partial(annelid, **{"arena.contact_impedance": [0.9, 0.95, 0.001]})
"""The engine's own settings of friction and contact, to see what travel owes to them."""
RUNS: list[tuple[str, str, Callable[..., tuple[Step, float]], int, float]] = [
    ("annelid, rods", "annelid", annelid, 2, 0.01),
    ("annelid, rods", "annelid", annelid, 2, 0.005),
    ("annelid, rods", "annelid", annelid, 4, 0.005),
    ("annelid, rods", "annelid", annelid, 4, 0.0025),
    ("annelid, rods, impedance ratio 1", "annelid", RATIO, 4, 0.005),
    ("annelid, rods, softer contact", "annelid", SOFTER, 4, 0.005),
    ("annelid, chain", "annelid", CHAIN, 2, 0.002),
    ("dismech-newton", "dismech-newton", dismech, 2, 0.005),
    ("dismech-newton", "dismech-newton", dismech, 4, 0.005),
    ("dismech-newton", "dismech-newton", dismech, 4, 0.0025),
    ("PyElastica", "pyelastica", pyelastica, 2, 2.0 * HEAVIER),
    ("PyElastica", "pyelastica", pyelastica, 2, HEAVIER),
]
"""Program, package, solver, elements a side, and step, s; PyElastica's step goes with its rotary inertia."""


def walked(worm: Worm, step: Step, step_s: float) -> tuple[Array, float]:
    """Returns the crossings at every sample, m, ``(n, n_crossings, 3)``, and the processor's time for a second, s."""
    at, path, per_sample, began = worm.mesh.crossings_m, [worm.mesh.crossings_m], round(SAMPLE_S / step_s), 0.0
    for sample in range(round(CYCLES * PERIOD_S / SAMPLE_S)):
        for index in range(per_sample):
            at = step(worm.ring_forces_N(at, sample * SAMPLE_S + index * step_s))
        path.append(at.copy())
        began = began or process_time()
    return np.array(path), (process_time() - began) / (CYCLES * PERIOD_S - SAMPLE_S)


def measured(worm: Worm, path: Array) -> dict[str, float]:
    """Returns what a path of crossings shows."""
    mesh, cycle, mean_m = worm.mesh, round(PERIOD_S / SAMPLE_S), path.mean(axis=1)
    ends = path[:, mesh.springs[mesh.sensor_springs]]
    springs_m = np.linalg.norm(ends[..., 1, :] - ends[..., 0, :], axis=-1)
    longer_m = (springs_m - springs_m[0]).mean(axis=-1)[-cycle:].max(axis=0)
    rings_m = np.linalg.norm(np.roll(path[:, mesh.rings], -1, axis=2) - path[:, mesh.rings], axis=-1).sum(axis=-1)
    found = {f"elongation_m_{s}": value for s, value in enumerate(longer_m, 1)}
    found |= {f"ring_m_{s}": value for s, value in enumerate(rings_m[-cycle:].min(axis=0), 1)}
    found |= {f"travel_m_{n}": value for n, value in enumerate(-np.diff(mean_m[::cycle, 0]), 1)}
    return found | {"height_m": mean_m[-cycle:, 2].mean()}


def main() -> None:
    """Prints the table, and writes it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--csv", type=Path, help="file to write")
    parser.add_argument("--only", help="a program")
    chosen = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for program, package, build, elements, resolution in RUNS:
        if chosen.only not in (None, program):
            continue
        worm = Worm(elements)
        step, step_s = build(worm, resolution)
        path, cost = walked(worm, step, step_s)
        row = {"program": program, "version": version(package), "elements": elements, "step_ms": 1e3 * step_s}
        rows.append(row | {"s_per_s": cost} | measured(worm, path))
        print(
            "  ".join(
                f"{key} {value:.4g}" if isinstance(value, float) else str(value) for key, value in rows[-1].items()
            ),
            flush=True,
        )
        if chosen.csv is not None:
            write_csv(chosen.csv, rows[0], ([row[column] for column in rows[0]] for row in rows))


if __name__ == "__main__":
    main()
