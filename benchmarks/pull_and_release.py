"""A strand that is pulled, held and let go, here and in two other simulators: how far apart are the paths of its tip?

A cantilever along the worm's helix, of the paper's material with a damping time of 5 ms, is drawn towards the axis of
the helix by a force at its tip, which rises smoothly, holds, and is gone at once. The peers are PyElastica (explicit
Cosserat rods with shear and stretch) and dismech-newton (implicit discrete elastic rods in single precision).
Every simulator runs on two meshes and with two settings of its own numerics; from these its path is extrapolated, and
the distance of its finest run from that is its convergence error. Two simulators agree if their extrapolated paths are
no further apart than the sum of these errors.

Needs ``pip install ".[bench]" dismech-newton==0.1.0.post2`` in an environment of its own (dismech-newton is GPL, and
its later releases do not import on Python 3.11). Run ``python benchmarks/pull_and_release.py``; it takes some minutes.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from math import cos, pi
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.body.damping import MaterialDamping, add_damper_rows
from annelid.body.formulations.rods import Rods
from annelid.body.formulations.rods.net import add_rod, add_vertex, lumped_masses
from annelid.body.worm import Strands

Path = NDArray[np.float64]
DAMPING_S = 0.005
STRANDS = Strands(damping_time_s=DAMPING_S)
LENGTH_M, RADIUS_M, RATE_RAD_PER_M = 0.3, 0.16, 14.0
RISEN_S, RELEASED_S, END_S, SAMPLE_S = 0.4, 1.0, 1.6, 0.002
FORCE_N = 0.025
DENSITY = STRANDS.linear_density_kg_per_m / (pi * STRANDS.radius_m**2)
BENDING = STRANDS.young_modulus_Pa * pi * STRANDS.radius_m**4 / 4
TORSION = STRANDS.shear_modulus_Pa * pi * STRANDS.radius_m**4 / 2
CLAMP_KG = 1e6
COARSE, FINE = 8, 16
"""Elements beyond the half one that is clamped."""


def vertices(elements: int) -> Path:
    """Rest positions; the clamp is the middle of the first edge, which every simulator holds, ``(elements + 2, 3)``."""
    arc = (np.arange(elements + 2) - 0.5) * LENGTH_M / (elements + 0.5)
    angle = arc * RATE_RAD_PER_M / np.hypot(1.0, RADIUS_M * RATE_RAD_PER_M)
    return np.stack([angle / RATE_RAD_PER_M, RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle)], axis=-1)


TO_AXIS = -vertices(COARSE)[-1] * [0.0, 1.0, 1.0] / RADIUS_M


def pull(time_s: float) -> Path:
    """Force on the tip, N, ``(3,)``."""
    share = 0.0 if time_s >= RELEASED_S else 0.5 - 0.5 * cos(pi * min(time_s / RISEN_S, 1.0))
    return share * FORCE_N * TO_AXIS


def sampled(step: Callable[[float], Path], step_s: float) -> Path:
    """Steps to the end; returns the tip at every sample, m, ``(n_samples, 3)``."""
    per_sample = round(SAMPLE_S / step_s)
    path = []
    for sample in range(round(END_S / SAMPLE_S)):
        for index in range(per_sample - 1):
            step(sample * SAMPLE_S + index * step_s)
        path.append(step((sample + 1) * SAMPLE_S - step_s).copy())
    return np.array(path)


def annelid(elements: int, coarseness: int) -> Path:
    """The package's rods; coarseness multiplies the step."""
    place, step_s = vertices(elements), 1e-4 * coarseness
    spec = mujoco.MjSpec()
    spec.option.gravity = [0.0, 0.0, 0.0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.timestep = step_s
    spec.option.tolerance = 1e-20
    masses = lumped_masses(place, STRANDS.linear_density_kg_per_m)
    # The dampers know no fixed vertices: mass clamps the rod.
    masses[:2] = CLAMP_KG
    names = [f"v{index}" for index in range(elements + 2)]
    for name, vertex, mass in zip(names, place, masses, strict=True):
        add_vertex(spec, name, vertex, mass)
    add_rod(spec, "strand_0", place, names, STRANDS, Rods())
    spec.joint("strand_0_twist_0").armature = CLAMP_KG
    add_damper_rows(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    damping, tip = MaterialDamping(model, STRANDS), model.body(names[-1])
    slides = model.jnt_qposadr[tip.jntadr[0]] + np.arange(3)

    def step(time_s: float) -> Path:
        data.xfrc_applied[tip.id, :3] = pull(time_s)
        damping.renew(data.qpos)
        mujoco.mj_step(model, data)
        return place[-1] + data.qpos[slides]

    return sampled(step, step_s)


def pyelastica(elements: int, coarseness: int) -> Path:
    """Cosserat rods; coarseness multiplies the rotary inertia, enlarged 100 times so that steps of microseconds do."""
    ea: Any = import_module("elastica")
    place = vertices(elements)
    edges = np.diff(place, axis=0)
    tangents = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    across = np.cross(tangents, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    rod = ea.CosseratRod.straight_rod(
        elements + 1,
        place[0],
        tangents[0],
        across[0],
        float(np.linalg.norm(edges, axis=1).sum()),
        STRANDS.radius_m,
        DENSITY,
        youngs_modulus=STRANDS.young_modulus_Pa,
        shear_modulus=STRANDS.shear_modulus_Pa,
        position=place.T,
        directors=np.stack([across, np.cross(tangents, across), tangents]).transpose(0, 2, 1),
    )
    heavier = 100.0 * coarseness
    rod.mass_second_moment_of_inertia *= heavier
    rod.inv_mass_second_moment_of_inertia /= heavier
    rest = rod.kappa.copy()
    rod.rest_kappa[:] = rest

    class System(ea.BaseSystemCollection, ea.Constraints, ea.Forcing):
        pass

    length = LENGTH_M / (elements + 0.5)
    # Viscous bending and twist are explicit here: their fastest mode sets the step.
    fastest = 4.0 * STRANDS.young_modulus_Pa / (DENSITY * heavier * length**2)
    step_s = SAMPLE_S / np.ceil(SAMPLE_S / (0.4 / (fastest * DAMPING_S)))

    class Pull(ea.NoForces):
        """The force, and Kelvin-Voigt damping: a rest curvature that trails the rate of curvature."""

        def __init__(self) -> None:
            self.before = rest.copy()

        def apply_forces(self, system: Any, time: float = 0.0) -> None:
            system.external_forces[:, -1] += pull(float(time))
            system.rest_kappa[:] = rest - DAMPING_S * (system.kappa - self.before) / step_s
            self.before[:] = system.kappa

    system = System()
    system.append(rod)
    system.constrain(rod).using(ea.FixedConstraint, constrained_position_idx=(0, 1), constrained_director_idx=(0,))
    system.add_forcing_to(rod).using(Pull)
    system.finalize()
    stepper = ea.PositionVerlet()

    def step(time_s: float) -> Path:
        stepper.step(system, time_s, step_s)
        return rod.position_collection[:, -1]

    return sampled(step, step_s)


def dismech(elements: int, coarseness: int) -> Path:
    """Implicit discrete elastic rods; coarseness multiplies the step."""
    newton: Any = import_module("newton")
    peer: Any = import_module("dismech_newton")
    place, step_s = vertices(elements), 5e-4 * coarseness
    length = LENGTH_M / (elements + 0.5)
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    peer.register_custom_attributes(builder)
    rod = newton.Rod(
        points=place,
        radius=STRANDS.radius_m,
        youngs_modulus=STRANDS.young_modulus_Pa,
        shear_modulus=STRANDS.shear_modulus_Pa,
    )
    peer.add_rod(
        builder,
        rod,
        cfg=newton.ModelBuilder.ShapeConfig(density=DENSITY),
        bend_damping=DAMPING_S * BENDING / length,
        twist_damping=DAMPING_S * TORSION / length,
        proxies=False,
    )
    peer.fix_segment(builder, edge=0)
    model = builder.finalize(device="cpu")
    solver = peer.DiSMechSolver(model)
    states = [model.state(), model.state()]
    forces = np.zeros((elements + 2, 3), dtype=np.float32)

    def step(time_s: float) -> Path:
        forces[-1] = pull(time_s)
        states[0].particle_f.assign(forces)
        solver.step(states[0], states[1], None, None, step_s)
        states.reverse()
        return states[0].particle_q.numpy()[-1].astype(float)

    return sampled(step, step_s)


def rms(path: Path) -> float:
    """Root mean square of a path's length, mm."""
    return 1e3 * float(np.sqrt((path**2).sum(axis=1).mean()))


def main() -> None:
    """Prints the table."""
    held, free = round(RELEASED_S / SAMPLE_S) - 1, slice(round(RELEASED_S / SAMPLE_S), None)
    best: dict[str, Path] = {}
    error: dict[str, Path] = {}
    for simulator in (annelid, pyelastica, dismech):
        name = simulator.__name__
        try:
            coarse, rough, fine = simulator(COARSE, 1), simulator(COARSE, 2), simulator(FINE, 1)
        except (ImportError, TypeError) as failed:
            print(f"{name:12} not there: {failed}")
            continue
        # Second order in the element's length, first order in the step or the added inertia.
        best[name] = fine + (fine - coarse) / (((FINE + 0.5) / (COARSE + 0.5)) ** 2 - 1) + (coarse - rough)
        error[name] = best[name] - fine
        moved = best[name] - vertices(FINE)[-1]
        print(f"{name:12} held {1e3 * np.linalg.norm(moved[held]):.3f} mm from rest", end="; ")
        print(f"convergence error held {1e3 * np.linalg.norm(error[name][held]):.3f}", end=", ")
        print(f"released {rms(error[name][free]):.3f} mm rms of {rms(moved[free]):.3f}", flush=True)
    for name in list(best)[1:]:
        apart = best["annelid"] - best[name]
        allowed = rms(error["annelid"][free]) + rms(error[name][free])
        print(f"annelid and {name}: held {1e3 * np.linalg.norm(apart[held]):.3f} mm apart", end="; ")
        print(f"released {rms(apart[free]):.3f} mm rms, convergence errors together {allowed:.3f}")


if __name__ == "__main__":
    main()
