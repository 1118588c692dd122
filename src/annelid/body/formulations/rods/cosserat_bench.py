"""annelid's rods as a solver of cosseratbench, a bench of rods by others: `cosseratbench run --solver annelid`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from importlib.metadata import version

import mujoco
import numpy as np
from cosseratbench import Capability, Diverged, End, EndCondition, Rod, Scenario, Trajectory

from annelid.body.constraint_rows import add_row, tendons_to_rows
from annelid.body.formulations import BDF2_SHARE
from annelid.body.formulations.rods.net import SOLVER_ITERATIONS, SOLVER_TOLERANCE, add_rod, add_vertex, lumped_masses
from annelid.body.formulations.rods.strains import RodStrains, twist_name, vertex_stiffness
from annelid.body.formulations.rods.two_step import TwoStep
from annelid.body.mesh import Strands
from annelid.morphology import Array

Hold = tuple[str, Array, Array]
"""Of a coordinate that is held: its joint, times, s, and by how much it has moved at each of them."""


class AnnelidSolver:
    """Rods of a worm, each on its own, which bend and twist.

    They are not sheared or stretched, and touch neither one another nor cylinders: what needs that is unsupported.
    """

    name = "annelid"
    backend_version = version("annelid")
    capabilities = frozenset[Capability]()

    def __init__(self, time_step_scale: float = 1.0) -> None:
        """Takes a scale of the step, which is 50 ms times the length of an element in m where that is 1.

        Edges are held as stiffly as the step allows for the mass of a node, so that shorter ones need shorter steps.
        """
        self._step_s_per_m = 0.05 * time_step_scale

    def settings(self, scenario: Scenario, *, n_elements: int, n_frames: int) -> dict[str, object]:
        """Returns the step, s, and the damping, 1/s, that a quasi-static scenario is given."""
        step_s, _ = self._steps(scenario, n_elements, n_frames)
        return {"integrator": "BDF2", "time_step": step_s, "damping_rate": _damping_per_s(scenario)}

    def _steps(self, scenario: Scenario, n_elements: int, n_frames: int) -> tuple[float, int]:
        """The step, s, and how many of them are between two frames."""
        frame_s = scenario.duration / (n_frames - 1)
        n_steps = math.ceil(frame_s * n_elements / self._step_s_per_m / min(rod.length for rod in scenario.rods))
        return frame_s / n_steps, n_steps

    def run(self, scenario: Scenario, *, n_elements: int, n_frames: int) -> Trajectory:
        """Returns nodes and directors over time.

        Raises:
            Diverged: If a node is no longer a number.
            NotImplementedError: For ends that turn across the rod or slide in no direction of the axes.
        """
        step_s, n_steps = self._steps(scenario, n_elements, n_frames)
        rods = scenario.rods
        ahead, behind = (rods[0].condition(end) is EndCondition.CLAMPED for end in End)
        if any((rod.start, rod.end) != (rods[0].start, rods[0].end) for rod in rods):
            raise NotImplementedError("rods that are held differently")
        # A clamp is one more edge, which is held: so the rod bends and twists from its very end on.
        nodes = np.stack([_continued(rod.nodes(n_elements), ahead, behind) for rod in rods])
        own = slice(ahead, ahead + n_elements + 1)
        shares = np.ones((2, nodes.shape[1] - 2))
        shares[:, 0] *= 1 + ahead
        shares[:, -1] *= 1 + behind
        lengths = np.linalg.norm(np.diff(nodes, axis=1), axis=-1)
        held = [hold for number, rod in enumerate(rods) for hold in _holds(f"strand_{number}", rod, nodes[number])]
        spec = mujoco.MjSpec()
        spec.option.integrator, spec.option.solver = mujoco.mjtIntegrator.mjINT_DISCRETE, mujoco.mjtSolver.mjSOL_NEWTON
        spec.option.iterations, spec.option.tolerance = SOLVER_ITERATIONS, SOLVER_TOLERANCE
        spec.option.timestep, spec.option.gravity = BDF2_SHARE * step_s, scenario.gravity
        straight = np.zeros_like(nodes)
        straight[:, 1:, 0] = np.cumsum(lengths, axis=1)
        names = [[f"strand_{number}_{node}" for node in range(nodes.shape[1])] for number in range(len(rods))]
        for places, bodies, rod in zip(straight, names, rods, strict=True):
            # A rod that begins stretched has the mass of its length at rest.
            element_kg = rod.material.density * rod.area * rod.length / n_elements
            masses = lumped_masses(np.arange(float(len(places)))[:, None], element_kg)
            for name, place, mass in zip(bodies, places, masses.tolist(), strict=True):
                add_vertex(spec, name, place, mass)
        materials = [_strands(rod) for rod in rods]
        stiffness = [vertex_stiffness(*each, shares) for each in zip(lengths, materials, strict=True)]
        for number, (places, bodies, material) in enumerate(zip(straight, names, materials, strict=True)):
            add_rod(spec, f"strand_{number}", places, bodies, material, step_s, stiffness_Nm=stiffness[number])
        for joint, _, _ in held:
            limits = {"solref": [2.0 * step_s, 1.0], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2.0]}
            add_row(spec, mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT, f"hold_{joint}", joint, **limits)
        tendons_to_rows(spec)
        model = spec.compile()
        model.dof_damping[: nodes.size] = _damping_per_s(scenario) * model.body_mass[model.dof_bodyid[: nodes.size]]
        data = mujoco.MjData(model)
        strains = RodStrains(model, np.stack(stiffness, axis=1), 0.0)
        two_step = TwoStep(model, data, strains, first_order=False)
        data.qpos[: nodes.size] = (nodes - straight).ravel()
        begin = [np.pad(rod.directors(n_elements), ((ahead, behind), (0, 0)), mode="edge") for rod in rods]
        strains.restore(data.qpos, np.stack(begin).transpose(2, 0, 1))
        two_step.rest()
        for bodies, rod in zip(names, rods, strict=True):
            for load in rod.loads:
                data.xfrc_applied[model.body(bodies[own][0 if load.at is End.START else -1]).id, :3] += load.force
        rows = [(model.equality(f"hold_{joint}").id, float(data.joint(joint).qpos[0])) for joint, _, _ in held]

        def hold() -> None:
            for (row, start), (_, times, moves) in zip(rows, held, strict=True):
                model.eq_data[row, 0] = start + np.interp(data.time + step_s, times, moves)

        positions, directors = [nodes], [strains.director.copy()]
        for frame in range(1, n_frames):
            for _ in range(n_steps):
                two_step.step(hold)
                data.time += step_s - model.opt.timestep
            positions.append(straight + data.qpos[: nodes.size].reshape(nodes.shape))
            directors.append(strains.director.copy())
            if not np.isfinite(positions[-1]).all() or data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
                raise Diverged("a node is no longer a number", time=frame * scenario.duration / (n_frames - 1))
        times = np.linspace(0.0, scenario.duration, n_frames)
        edges = slice(ahead, ahead + n_elements)
        return Trajectory(
            times,
            tuple(np.stack(positions, axis=1)[..., own, :]),
            tuple(np.stack(directors).transpose(2, 0, 3, 1)[..., edges, :]),
        )


def _damping_per_s(scenario: Scenario) -> float:
    """Damping in proportion to mass by which a quasi-static scenario comes to rest, 1/s."""
    return 2.0 * scenario.slowest_frequency() if scenario.quasi_static else 0.0


def _continued(nodes: Array, ahead: bool, behind: bool) -> Array:
    """Nodes with one more edge, straight on, before the first and after the last."""
    first, last = 2.0 * nodes[:1] - nodes[1:2], 2.0 * nodes[-1:] - nodes[-2:-1]
    return np.concatenate([first] * ahead + [nodes] + [last] * behind)


def _strands(rod: Rod) -> Strands:
    """A rod's material, without damping."""
    return Strands(
        radius_m=rod.radius,
        young_modulus_Pa=rod.material.youngs_modulus,
        shear_modulus_Pa=rod.material.shear_modulus,
        linear_density_kg_per_m=rod.material.density * rod.area,
        damping_time_s=0.0,
    )


def _holds(name: str, rod: Rod, nodes: Array) -> Iterator[Hold]:
    """The coordinates of a rod's ends that are held or moved."""
    n_edges = len(nodes) - 1
    for end, first, on in ((End.START, 0, 1), (End.END, n_edges, -1)):
        condition, motion = rod.condition(end), rod.motion(end)
        if condition is EndCondition.FREE:
            continue
        times, moved, turned, slides = np.zeros(1), np.zeros((1, 3)), np.zeros(1), np.zeros(3)
        if motion is not None:
            tangent = on * (nodes[first + on] - nodes[first]) / np.linalg.norm(nodes[first + on] - nodes[first])
            times, moved, turns = (np.asarray(part) for part in (motion.times, motion.displacement, motion.rotation))
            turned = turns @ tangent
            slides = np.zeros(3) if motion.slides_along is None else np.abs(motion.axis)
            if slides.max() not in (0.0, 1.0) or np.abs(turns - turned[:, None] * tangent).max() > 0.01 * np.ptp(turns):
                raise NotImplementedError("an end that turns across the rod, or slides across the axes")
        clamped = condition is EndCondition.CLAMPED
        for node in (first, first + on)[: 1 + clamped]:
            for number, axis in enumerate("xyz"):
                if not slides[number]:
                    yield f"{name}_{node}_{axis}", times, moved[:, number]
        if clamped:
            yield twist_name(name, min(first, n_edges - 1), n_edges), times, turned
