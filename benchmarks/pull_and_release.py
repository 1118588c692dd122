"""A strand and a small net that are pulled, held and let go, here and in other simulators: error against speed.

The strand is a cantilever along the worm's helix, whose tip is drawn towards the axis of the helix by a force. The net
is a free braid of six strands with fifteen crossings, half as wide as the worm, whose middle ring contracts. The
material is the paper's with a damping time of 5 ms; the net is also of the worm's own, 145 ms. The force rises
smoothly, holds, and is gone at once. The peers are PyElastica (explicit Cosserat rods with shear and stretch, joined by
springs), dismech-newton (implicit discrete elastic rods in single precision, which share nodes; here by the midpoint
rule) and the paper's chain of capsules on joints, in the same engine as annelid's rods.

Every simulator runs on up to four meshes, each twice as fine as the one before, and with numerics of its own (its step,
an added inertia, the time of a soft constraint) that go with the square of an element's length; but annelid's step,
which is of second order, with the length. From the two finest meshes its path is extrapolated, annelid's from two more
runs whose steps go with the square. The distance of a path from that is its own error; the other error is the distance
from annelid's extrapolated path. The paths are those of the tip, and of the lengths of the ring's sides.

The time is that of one core, for all steps but those up to the first sample, in which programs compile. The factor is
the cost over that of annelid at the same error, interpolated between the logarithms of annelid's errors and costs: at
least so much where annelid's coarsest run is better already, at most where its finest is not yet as good. Planar worms
have no such error: only their speed is printed.

Needs ``pip install -c constraints.txt ".[bench]" dismech-newton==0.1.0.post2`` in an environment of its own
(dismech-newton is GPL, and its later releases do not import on Python 3.11). It takes ten minutes:

    python benchmarks/pull_and_release.py --csv docs/results/peers.csv
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.metadata import version
from math import ceil, cos, nan, pi
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import mujoco
import numpy as np

from annelid.body import compile_spec
from annelid.body.constraint_rows import add_row, tendons_to_rows
from annelid.body.formulations import BDF2_SHARE
from annelid.body.formulations.chain import Chain
from annelid.body.formulations.chain.capsules import SOLVER_ITERATIONS, add_chain
from annelid.body.formulations.rods import Rods
from annelid.body.formulations.rods.net import add_rod, add_vertex, lumped_masses
from annelid.body.formulations.rods.strains import RodStrains, vertex_stiffness
from annelid.body.formulations.rods.two_step import TwoStep
from annelid.body.mesh import Strands
from annelid.config import load_config
from annelid.morphology import Array, helical_mesh
from annelid.output import write_csv
from annelid.simulation import simulate
from annelid_studies.bench.measure import keep_to_one_core

Place = tuple[int, int]
"""A strand and one of its vertices."""
Step = Callable[[Array], Array]
"""A step under forces on the pulled vertices, N, which returns their positions, m, ``(n_pulled, 3)`` both."""
SHEAR_CORRECTION = 27.0 / 28.0
"""PyElastica's shear correction factor of a round cross-section."""
MATERIAL = Strands()
YOUNG_PA, SHEAR_PA = MATERIAL.one_number("young_modulus_Pa"), MATERIAL.one_number("shear_modulus_Pa")
DENSITY = MATERIAL.one_number("linear_density_kg_per_m") / (pi * MATERIAL.radius_m**2)
TORSION = SHEAR_PA * pi * MATERIAL.radius_m**4 / 2
WORM_DAMPING_S = 0.145
"""Of the preset riddle2023-rods."""
RADIUS_M, RATE_RAD_PER_M = 0.16, 14.0
RISEN_S, RELEASED_S, END_S, SAMPLE_S = 0.3, 0.6, 1.0, 0.01
CLAMP_KG = 1e6
LENGTH_M = 0.05
"""Of the element that the numerics below are for; they are as the square of an element's length."""
ANNELID_S, EXACT_S, EDGE_S, TOLERANCE = 4e-3, 2.2e-3, 0.0002, 1e-20
CHAIN_S, CHAIN_KG_M2, CHAIN_PIN_S = 4e-3, 6e-6, 0.005
PAPERS_S = 1e-3
DISMECH_S, DISMECH_THETA = 8e-3, 0.5
ELASTICA_HEAVIER, ELASTICA_SHARE = 600.0, 0.3
"""Multiple of the rotary inertia, and share of the closed form of the largest step: with 0.4 one run diverges."""
PLANAR = ("riddle2022-planar", "daltorio2013", "boxerbaum2012")


@dataclass(frozen=True)
class Scene:
    """Strands at rest, where they cross, and how they are pulled; functions of the pulled vertices' positions, m."""

    vertices_m: Array  # (n_strands, n_vertices, 3)
    crossings: list[tuple[Place, Place]]
    pulled: list[Place]
    forces_N: Callable[[Array], Array]  # on the pulled vertices while they are held, (n_pulled, 3)
    seen_m: Callable[[Array], Array]  # what is compared, (n, 1 or 3)
    clamped: bool  # the first edge of every strand, or free
    damping_s: float
    longer: float = 1.0  # multiplies the numerics

    @property
    def element_m(self) -> float:
        """Length of an element."""
        return float(np.linalg.norm(self.vertices_m[0, 1] - self.vertices_m[0, 0]))

    @property
    def coarseness(self) -> float:
        """What multiplies the numerics."""
        return self.longer * (self.element_m / LENGTH_M) ** 2

    @property
    def strands(self) -> Strands:
        """The material."""
        return Strands(damping_time_s=self.damping_s)


def strand(refined: int) -> Scene:
    """A helical cantilever; the clamp is the middle of the first edge, which every simulator holds."""
    elements = 4 * refined
    arc = (np.arange(elements + 2) - 0.5) * 0.3 / (elements + 0.5)
    angle = arc * RATE_RAD_PER_M / np.hypot(1.0, RADIUS_M * RATE_RAD_PER_M)
    place = np.stack([angle / RATE_RAD_PER_M, RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle)], axis=-1)
    force_N = -0.025 * place[None, -1] * [0.0, 1.0, 1.0] / RADIUS_M
    return Scene(place[None], [], [(0, elements + 1)], lambda _: force_N, lambda at: at, True, 0.005)


def net(refined: int, damping_s: float) -> Scene:
    """A free braid with five planes of crossings, the middle one a ring; 0 is mesh 1 at four times the step."""
    refined, longer = max(refined, 1), 1.0 if refined else 4.0
    mesh = helical_mesh(
        1,
        n_helices=6,
        radius_m=RADIUS_M / 2.0,
        angular_rate_rad_per_m=RATE_RAD_PER_M * 2.0,
        free_planes_at_ends=2,
        elements_per_side=2 * refined,
        elements_per_end=refined,
    )
    plane = mesh.crossing_vertex[mesh.crossing_plane].tolist()
    crossings = [((a, v), (b, v)) for (a, b), v in zip(mesh.crossing_strands.tolist(), plane, strict=True)]

    def sides_m(at: Array) -> Array:
        return np.linalg.norm(np.roll(at, -1, axis=0) - at, axis=1, keepdims=True)

    def tension_N(at: Array) -> Array:
        along = 0.2 * (np.roll(at, -1, axis=0) - at) / sides_m(at)
        return along - np.roll(along, 1, axis=0)

    pulled = [crossings[crossing][0] for crossing in mesh.rings[0]]
    return Scene(mesh.vertices_m, crossings, pulled, tension_N, sides_m, False, damping_s, longer)


def share(time_s: float) -> float:
    """Share of the force."""
    return 0.0 if time_s >= RELEASED_S else 0.5 - 0.5 * cos(pi * min(time_s / RISEN_S, 1.0))


def dividing(step_s: float) -> float:
    """The longest step, no longer than that given, of which a sample is a multiple."""
    return SAMPLE_S / ceil(SAMPLE_S / step_s - 1e-9)


def sampled(scene: Scene, step: Step, step_s: float) -> tuple[Array, float]:
    """Steps to the end; returns what is seen at every sample, m, and the processor's time for a second, s."""
    at, per_sample = np.array([scene.vertices_m[place] for place in scene.pulled]), round(SAMPLE_S / step_s)
    path, began = [scene.seen_m(at)], 0.0
    for sample in range(round(END_S / SAMPLE_S)):
        for index in range(per_sample):
            at = step(share(sample * SAMPLE_S + index * step_s) * scene.forces_N(at))
        path.append(scene.seen_m(at).copy())
        began = began or process_time()
    return np.array(path), (process_time() - began) / (END_S - SAMPLE_S)


def engine(spec: mujoco.MjSpec, step_s: float) -> None:
    """Sets what rods and chain have in common."""
    spec.option.gravity = [0.0, 0.0, 0.0]
    spec.option.timestep = step_s
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    spec.compiler.degree = False


def annelid(scene: Scene, *, exact: bool = False) -> tuple[Step, float]:
    """The package's rods, with steps that go with the length of an element, or with its square."""
    step_s = dividing(EXACT_S * scene.coarseness if exact else ANNELID_S * scene.coarseness**0.5)
    n_strands, n_vertices = scene.vertices_m.shape[:2]
    spec = mujoco.MjSpec()
    engine(spec, BDF2_SHARE * step_s)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    rods, strands = Rods(edge_time_constant_s=EDGE_S), scene.strands
    spec.option.tolerance = TOLERANCE
    masses = np.array([lumped_masses(one, strands.one_number("linear_density_kg_per_m")) for one in scene.vertices_m])
    names = [[f"vertex_{s}_{v}" for v in range(n_vertices)] for s in range(n_strands)]
    for first, second in scene.crossings:
        masses[first] += masses[second]
        names[second[0]][second[1]] = names[first[0]][first[1]]
    if scene.clamped:
        # Rows know no fixed vertices: mass clamps the rods.
        masses[:, :2] = CLAMP_KG
    crossing = [first for first, _ in scene.crossings]
    shared = {place for pair in scene.crossings for place in pair}
    for place in [*crossing, *(place for place in np.ndindex(masses.shape) if place not in shared)]:
        add_vertex(spec, names[place[0]][place[1]], scene.vertices_m[place], float(masses[place]))
    edges_m = np.linalg.norm(np.diff(scene.vertices_m, axis=1), axis=-1)
    stiffness_Nm = vertex_stiffness(edges_m, strands, np.ones((2, n_strands, n_vertices - 2)))
    edge_s = rods.edge_time_constant_s
    for s, vertices_m in enumerate(scene.vertices_m):
        add_rod(spec, f"strand_{s}", vertices_m, names[s], strands, edge_s, stiffness_Nm=stiffness_Nm[:, s])
        if scene.clamped:
            spec.joint(f"strand_{s}_twist_0").armature = CLAMP_KG
    tendons_to_rows(spec)
    model = compile_spec(spec)
    data = mujoco.MjData(model)
    strains = RodStrains(model, stiffness_Nm, strands.damping_time_s)
    two_step = TwoStep(model, data, strains, first_order=False)
    pulled = [model.body(names[s][v]).id for s, v in scene.pulled]
    slides = model.jnt_qposadr[model.body_jntadr[pulled]][:, None] + np.arange(3)

    def step(forces_N: Array) -> Array:
        data.xfrc_applied[pulled, :3] = forces_N
        two_step.step(lambda: None)
        return model.body_pos[pulled] + data.qpos[slides]

    return step, step_s


def chain(scene: Scene, *, published: bool) -> tuple[Step, float]:
    """The paper's capsules on joints, which here resist torsion as the material does.

    With the paper's numerics, or with those that vanish with the mesh: the paper's added inertia is there for its
    explicit method, and Euler's method is implicit in the damping.
    """
    coarseness = scene.coarseness
    finer = {
        "armature_kg_m2": CHAIN_KG_M2 * coarseness,
        "pin_time_constant_s": CHAIN_PIN_S * coarseness,
    }
    settings = Chain().model_copy(update={} if published else finer)
    step_s = PAPERS_S if published else dividing(CHAIN_S * coarseness)
    spec = mujoco.MjSpec()
    engine(spec, step_s)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4 if published else mujoco.mjtIntegrator.mjINT_EULER
    spec.option.solver = mujoco.mjtSolver.mjSOL_PGS
    spec.option.iterations = SOLVER_ITERATIONS
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    n_elements = scene.vertices_m.shape[1] - 1
    root = 0 if scene.clamped else n_elements // 2
    for s, vertices_m in enumerate(scene.vertices_m):
        add_chain(
            spec, f"strand_{s}", vertices_m, scene.strands, settings.armature_kg_m2, root=root, fixed_root=scene.clamped
        )

    def attached(place: Place) -> tuple[str, Array]:
        """An element that ends at a vertex, and the vertex in the axes of that element."""
        s, v = place
        element = min(v, n_elements - 1)
        joint = element if element >= root else element + 1
        return f"strand_{s}_{element}", scene.vertices_m[s, v] - scene.vertices_m[s, joint]

    solver = {"solref": [settings.pin_time_constant_s, 1.0], "solimp": [*settings.pin_impedance, 0.5, 2.0]}
    for index, pair in enumerate(scene.crossings):
        (first, at), (second, _) = map(attached, pair)
        kinds = mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtObj.mjOBJ_BODY
        add_row(spec, *kinds, f"pin_{index}", first, second, data=[*at, *([0.0] * 9)], **solver)
    sites = []
    for place in scene.pulled:
        body, at = attached(place)
        sites.append(spec.body(body).add_site(name=f"pulled_{len(sites)}", pos=at).name)
    model = spec.compile()
    data = mujoco.MjData(model)
    pulled = [model.site(name).id for name in sites]
    bodies = model.site_bodyid[pulled]
    mujoco.mj_forward(model, data)

    def step(forces_N: Array) -> Array:
        data.xfrc_applied[bodies, :3] = forces_N
        data.xfrc_applied[bodies, 3:] = np.cross(data.site_xpos[pulled] - data.xipos[bodies], forces_N)
        mujoco.mj_step(model, data)
        return data.site_xpos[pulled]

    return step, step_s


def cosserat_rod(place_m: Array, heavier: float) -> Any:
    """Returns a rod of PyElastica, with a multiple of its rotary inertia, at rest through ``(n_vertices, 3)``, m."""
    ea: Any = import_module("elastica")
    edges = np.diff(place_m, axis=0)
    tangents = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    across = np.cross(tangents, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    rod = ea.CosseratRod.straight_rod(
        len(edges),
        place_m[0],
        tangents[0],
        across[0],
        float(np.linalg.norm(edges, axis=1).sum()),
        MATERIAL.radius_m,
        DENSITY,
        youngs_modulus=YOUNG_PA,
        shear_modulus=SHEAR_PA,
        position=place_m.T,
        directors=np.stack([across, np.cross(tangents, across), tangents]).transpose(0, 2, 1),
    )
    rod.mass_second_moment_of_inertia *= heavier
    rod.inv_mass_second_moment_of_inertia /= heavier
    rod.rest_kappa[:] = rod.kappa
    return rod


def pyelastica(scene: Scene) -> tuple[Step, float]:
    """Cosserat rods with an enlarged rotary inertia, at the longest stable step."""
    ea: Any = import_module("elastica")
    heavier = ELASTICA_HEAVIER * scene.coarseness
    # The limits of shear, of stretch, and half that of the viscous bending, which is explicit here.
    shear = MATERIAL.radius_m * np.sqrt(heavier * DENSITY / (SHEAR_CORRECTION * SHEAR_PA))
    stretch = scene.element_m * np.sqrt(DENSITY / YOUNG_PA)
    viscous = DENSITY * heavier * scene.element_m**2 / (4.0 * YOUNG_PA * scene.damping_s)
    step_s = dividing(ELASTICA_SHARE * min(shear, stretch, viscous))

    class System(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Connections):
        pass

    class Pull(ea.NoForces):
        """The forces on a rod, and Kelvin-Voigt damping: a rest curvature that trails the rate of curvature."""

        def __init__(self, rod: Any, pulled: list[tuple[int, int]]) -> None:
            self.rest, self.before, self.pulled = rod.kappa.copy(), rod.kappa.copy(), pulled

        def apply_forces(self, system: Any, time: float = 0.0) -> None:
            for index, vertex in self.pulled:
                system.external_forces[:, vertex] += now_N[index]
            system.rest_kappa[:] = self.rest - scene.damping_s / step_s * (system.kappa - self.before)
            self.before[:] = system.kappa

    system, rods, now_N = System(), [], np.zeros((len(scene.pulled), 3))
    for s, place in enumerate(scene.vertices_m):
        rod = cosserat_rod(place, heavier)
        system.append(rod)
        rods.append(rod)
        if scene.clamped:
            held = {"constrained_position_idx": (0, 1), "constrained_director_idx": (0,)}
            system.constrain(rod).using(ea.FixedConstraint, **held)
        system.add_forcing_to(rod).using(Pull, rod, [(i, v) for i, (of, v) in enumerate(scene.pulled) if of == s])
    # As stiff as the step allows: two nodes on a spring, a fourth of the stable frequency.
    stiffness = 0.5 * DENSITY * pi * MATERIAL.radius_m**2 * scene.element_m * (0.5 / step_s) ** 2
    for (a, v), (b, w) in scene.crossings:
        joined = system.connect(rods[a], rods[b], first_connect_idx=v, second_connect_idx=w)
        joined.using(ea.FreeJoint, k=stiffness, nu=0.0)
    system.finalize()
    stepper = ea.PositionVerlet()

    def step(forces_N: Array) -> Array:
        now_N[:] = forces_N
        stepper.step(system, 0.0, step_s)
        return np.array([rods[s].position_collection[:, v] for s, v in scene.pulled])

    return step, step_s


def discrete_rods(
    builder: Any,
    add_rod: Any,
    vertices_m: Array,
    crossings: list[tuple[Place, Place]],
    damping_s: float,
    **options: Any,
) -> list[list[int]]:
    """Adds strands that share nodes at crossings to a model of dismech-newton; returns what `add_rod` returned."""
    newton: Any = import_module("newton")
    n_vertices, added = vertices_m.shape[1], []
    for place in vertices_m:
        element_m = float(np.linalg.norm(place[1] - place[0]))
        rod = newton.Rod(points=place, radius=MATERIAL.radius_m, youngs_modulus=YOUNG_PA, shear_modulus=SHEAR_PA)
        damping = {
            "bend_damping": damping_s * MATERIAL.bending_rigidity_Nm2 / element_m,
            "twist_damping": damping_s * TORSION / element_m,
        }
        cfg = newton.ModelBuilder.ShapeConfig(density=DENSITY, collision_group=-1)
        added.append(add_rod(builder, rod, cfg=cfg, **damping, **options))
    for (a, v), (b, w) in crossings:
        kept, replaced = a * n_vertices + v, b * n_vertices + w
        builder.particle_mass[kept] += builder.particle_mass[replaced]
        builder.particle_flags[replaced] &= ~newton.ParticleFlags.ACTIVE
        for name in ("dismech:edge_node0", "dismech:edge_node1"):
            nodes = builder.custom_attributes[name].values
            for edge, node in enumerate(nodes):
                if node == replaced:
                    nodes[edge] = kept
    return added


def dismech(scene: Scene) -> tuple[Step, float]:
    """Implicit discrete elastic rods."""
    newton: Any = import_module("newton")
    peer: Any = import_module("dismech_newton")
    step_s, n_vertices = dividing(DISMECH_S * scene.coarseness), scene.vertices_m.shape[1]
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    peer.register_custom_attributes(builder)
    strands = discrete_rods(builder, peer.add_rod, scene.vertices_m, scene.crossings, scene.damping_s, proxies=False)
    for edges in strands if scene.clamped else []:
        peer.fix_segment(builder, edge=edges[0])
    model = builder.finalize(device="cpu")
    solver = peer.DiSMechSolver(model, theta=DISMECH_THETA)
    states = [model.state(), model.state()]
    pulled = [s * n_vertices + v for s, v in scene.pulled]
    forces = np.zeros((builder.particle_count, 3), dtype=np.float32)

    def step(forces_N: Array) -> Array:
        forces[pulled] = forces_N
        states[0].particle_f.assign(forces)
        solver.step(states[0], states[1], None, None, step_s)
        states.reverse()
        return states[0].particle_q.numpy()[pulled].astype(float)

    return step, step_s


SIMULATORS: dict[str, tuple[Callable[[Scene], tuple[Step, float]], str]] = {
    "annelid": (annelid, "annelid"),
    "PyElastica": (pyelastica, "pyelastica"),
    "dismech-newton": (dismech, "dismech-newton"),
    "chain, the paper's numerics": (partial(chain, published=True), "mujoco-core"),
    "chain": (partial(chain, published=False), "mujoco-core"),
}
"""What runs a scene, and the package whose version counts."""
ALL, PAPERS = (1, 2, 4), {"chain, the paper's numerics": (2,)}
SCENES: dict[str, tuple[Callable[[int], Scene], dict[str, tuple[int, ...]]]] = {
    "strand": (strand, PAPERS | {"annelid": (1, 2, 4, 8)}),
    "net": (partial(net, damping_s=0.005), PAPERS | {"annelid": (0, *ALL), "PyElastica": (1, 2)}),
    "worm's material": (partial(net, damping_s=WORM_DAMPING_S), PAPERS | {"annelid": (0, *ALL), "PyElastica": (1,)}),
}
"""Meshes, and who has others than the three: annelid more, PyElastica those of less than two minutes."""
ERRORS = ("held", "released", "held_own", "released_own")
HELD = round(RELEASED_S / SAMPLE_S)


def rms_mm(difference: Array) -> list[float]:
    """Root mean squares of a difference of paths at the end of the hold, and from the release on."""
    square = (1e3 * difference) ** 2
    return [float(np.sqrt(part.sum(axis=-1).mean())) for part in (square[HELD], square[HELD + 1 :])]


def slower(cost: float, error: float, costs: Array, errors: Array) -> str:
    """Times that a cost is annelid's at the same error, from annelid's costs and errors, ``(n_points,)`` each."""
    order = np.argsort(errors)
    # A run that costs less with a smaller error stands for those with a larger one.
    least = np.minimum.accumulate(costs[order])
    factor = cost / np.exp(np.interp(np.log(error), np.log(errors[order]), np.log(least)))
    bound = "at least " if error > errors.max() else "at most " if error < errors.min() else ""
    return bound + (f"{factor:.0f}" if factor >= 100 else f"{factor:.2g}")


def compared(name: str) -> Iterator[dict[str, Any]]:
    """Yields the rows of a scene."""
    scene_of, own = SCENES[name]
    limit, ours = np.zeros(0), np.zeros(0)
    for simulator, (build, package) in SIMULATORS.items():
        scenes = [scene_of(refined) for refined in own.get(simulator, ALL)]
        try:
            steppers = [build(scene) for scene in scenes]
        except (ImportError, TypeError) as failed:
            print(f"{name}: {simulator} is not there: {failed}")
            continue
        runs = [sampled(scene, *stepper) for scene, stepper in zip(scenes, steppers, strict=True)]
        best = np.full_like(runs[0][0], nan)
        if len(runs) > 1:
            (rough, _), (fine, _) = runs[-2:]
            if simulator == "annelid":
                (rough, _), (fine, _) = (sampled(scene, *annelid(scene, exact=True)) for scene in scenes[-2:])
            best = fine + (fine - rough) / (scenes[-2].coarseness / scenes[-1].coarseness - 1.0)
        limit = best if simulator == "annelid" else limit
        points = np.array([[cost, *rms_mm(path - limit), *rms_mm(path - best)] for path, cost in runs])
        ours = points if simulator == "annelid" else ours
        apart, moved = rms_mm(best - limit), rms_mm(limit - limit[:1])
        for scene, (_, step_s), point in zip(scenes, steppers, points, strict=True):
            factors = [slower(point[0], point[k], ours[:, 0], ours[:, k]) for k in range(1, 5)]
            yield {
                "scene": name,
                "simulator": simulator,
                "version": version(package),
                "elements": scene.vertices_m.shape[1] - 1 - scene.clamped,
                "step_ms": 1e3 * step_s,
                "s_per_s": point[0],
                **dict(zip([f"{error}_mm" for error in ERRORS], point[1:].tolist(), strict=True)),
                **dict(zip([f"slower_{error}" for error in ERRORS], factors, strict=True)),
                "apart_held_mm": apart[0],
                "apart_released_mm": apart[1],
                "moved_held_mm": moved[0],
                "moved_released_mm": moved[1],
            }


def planar() -> Iterator[dict[str, Any]]:
    """Yields the rows of planar worms, in the closed loop and with recording, which have a speed only."""
    for preset in PLANAR:
        config = load_config(preset)
        with TemporaryDirectory() as folder:
            began = process_time()
            simulate(config, folder)
            cost = (process_time() - began) / config.duration_s
        yield {"scene": "planar worm", "simulator": preset, "version": version("annelid"), "s_per_s": cost}


def main() -> None:
    """Prints the table, and writes it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--csv", type=Path, help="file to write")
    chosen = parser.parse_args()
    keep_to_one_core()
    rows: list[dict[str, Any]] = []
    for each in (*map(compared, SCENES), planar()):
        for row in each:
            rows.append(row)
            shown = (f"{key} {value:.4g}" if isinstance(value, float) else str(value) for key, value in row.items())
            print("  ".join(shown), flush=True)
    if chosen.csv is not None:
        write_csv(chosen.csv, rows[0], ([row.get(column) for column in rows[0]] for row in rows))


if __name__ == "__main__":
    main()
