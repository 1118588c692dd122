"""Worms on a GPU: batches stepped by MuJoCo Warp, with their nervous systems, beside the engine on the CPU.

MuJoCo Warp needs an environment of its own: it asks for the metapackage `mujoco`, which holds `mujoco-core` at 4.0.0,
while annelid needs 4.0.1 or later. So install annelid first, then Warp without its dependencies:

    pip install -c constraints.txt . && pip install --no-deps mujoco-warp warp-lang etils absl-py importlib-resources
    python benchmarks/gpu_batch.py --worms 1 64 1024 8192

What annelid does in each step beside the engine is done on the device too: the dampers follow the posture, steps are of
second order where the configuration says so, and the stretch sensors are read there. The networks are stepped on the
CPU, a copy for each worm, so that every step carries lengths from the device and activations to it. Worms differ in the
tolerance of their stretch sensors, by up to 1 %.

On a CUDA device it prints the agreement of four worms with the engine, then worms a second for every size of batch.
Without one it compares some steps of one worm on Warp's CPU device, whose speed means nothing. The first step compiles
kernels, on a CUDA device for five minutes.
"""

from __future__ import annotations

import argparse
import csv
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import mujoco
import numpy as np

try:
    import mujoco_warp
    import warp as wp
    from mujoco_warp._src import smooth
except ImportError as missing:
    raise SystemExit(f"{missing}\n\n{__doc__}") from None

import annelid
from annelid.analysis.rhythm import rhythm, run_rhythm
from annelid.body import build_spec, compile_spec
from annelid.body.damping import (
    MaterialDamping,
    RodVertices,
    Ties,
    damped_edge,
    damper_name,
    tendons_to_rows,
    twist_joints,
)
from annelid.body.twist import TwistCoupling
from annelid.config import RunConfig, load_config
from annelid.control.sns import CopySettings, SnsController
from annelid.protocols import Array
from annelid.simulation.stepping import build_controller
from annelid.simulation.worm import WormPlant

STRAIGHT = wp.constant(wp.float32(1e-5))
"""Sine of the bend below which a vertex is straight, in single precision."""
COLUMNS = ("worms", "step_ms", "network_ms", "simulated_s_per_s", "memory_MiB")
SPREAD = 0.01
"""Largest difference of a worm's sensor tolerance from that of the configuration."""


@wp.kernel
def renew(
    qpos: wp.array2d(dtype=float),
    slide: wp.array3d(dtype=int),
    place: wp.array2d(dtype=wp.vec3),
    at: wp.array3d(dtype=int),
    along: wp.array4d(dtype=wp.vec3),
    angle: wp.array3d(dtype=wp.vec2),
    rows: wp.array2d(dtype=float),
):
    """The rows of `annelid.body.damping` for the posture, and how every vertex is bent."""
    world, strand, bend = wp.tid()
    x0, x1, x2 = wp.vec3(0.0), wp.vec3(0.0), wp.vec3(0.0)
    for k in range(3):
        x0[k] = place[strand, bend][k] + qpos[world, slide[k, strand, bend]]
        x1[k] = place[strand, bend + 1][k] + qpos[world, slide[k, strand, bend + 1]]
        x2[k] = place[strand, bend + 2][k] + qpos[world, slide[k, strand, bend + 2]]
    per0, per1 = 1.0 / wp.length(x1 - x0), 1.0 / wp.length(x2 - x1)
    t0, t1 = (x1 - x0) * per0, (x2 - x1) * per1
    across = wp.cross(t0, t1)
    sine, cosine = wp.length(across), wp.dot(t0, t1)
    b = wp.vec3(0.0)
    if sine > STRAIGHT:
        b = across * (2.0 / (1.0 + cosine) / sine)
    in_rear = bend % 2 == 0
    f0, f1 = cosine, wp.float32(1.0)
    if in_rear:
        f0, f1 = wp.float32(1.0), cosine
    front, rear = b * (per0 * f0), b * (per1 * f1)
    for k in range(3):
        rows[world, at[strand, bend, k]] = front[k]
        rows[world, at[strand, bend, 3 + k]] = -front[k] - rear[k]
        rows[world, at[strand, bend, 6 + k]] = rear[k]
    rows[world, at[strand, bend, 9]] = -sine * 2.0 / (1.0 + cosine)
    along[world, strand, bend, 0] = b * per0
    along[world, strand, bend, 1] = b * per1
    angle[world, strand, bend] = wp.vec2(sine, cosine)


@wp.kernel
def extrapolate(now: wp.array2d(dtype=float), before: wp.array2d(dtype=float), start: wp.array2d(dtype=float)):
    """Moves a state to where the engine's step of second order starts (`annelid.simulation.two_step`)."""
    world, i = wp.tid()
    x = now[world, i]
    now[world, i] = x + (x - before[world, i]) / 3.0
    start[world, i] = now[world, i]
    before[world, i] = x


@wp.func
def sideways(
    velocity: wp.array2d(dtype=float),
    dof: wp.array3d(dtype=int),
    along: wp.array4d(dtype=wp.vec3),
    world: int,
    strand: int,
    bend: int,
    of: int,
) -> float:
    """Rate at which one of the two edges of a bend moves across it, 1/s."""
    b, rate, edge = along[world, strand, bend, of], wp.float32(0.0), bend + of
    for k in range(3):
        rate += b[k] * (velocity[world, dof[k, strand, edge + 1]] - velocity[world, dof[k, strand, edge]])
    return rate


@wp.kernel
def twist_torque(
    qvel: wp.array2d(dtype=float),
    start: wp.array2d(dtype=float),
    dof: wp.array3d(dtype=int),
    along: wp.array4d(dtype=wp.vec3),
    angle: wp.array3d(dtype=wp.vec2),
    stiff: wp.array2d(dtype=wp.vec3),
    torque: wp.array3d(dtype=float),
):
    """What the vertices do to the twist of every edge (`annelid.body.twist`)."""
    world, strand, edge = wp.tid()
    total = wp.float32(0.0)
    for side in range(2):
        bend = edge - 1 + side
        if bend >= 0 and bend < angle.shape[2]:
            p0 = sideways(qvel, dof, along, world, strand, bend, 0)
            p1 = sideways(qvel, dof, along, world, strand, bend, 1)
            q0 = sideways(start, dof, along, world, strand, bend, 0)
            q1 = sideways(start, dof, along, world, strand, bend, 1)
            sine, cosine = angle[world, strand, bend][0], angle[world, strand, bend][1]
            twisted = stiff[strand, bend][0] * (p0 + p1) - stiff[strand, bend][1] * (q0 + q1)
            torque_of_bend = 0.5 * sine * twisted
            if side == 0:
                total += stiff[strand, bend][2] * (cosine * p1 - p0) - torque_of_bend
            else:
                total += stiff[strand, bend][2] * (p1 - cosine * p0) + torque_of_bend
    torque[world, strand, edge] = total


@wp.kernel
def follow(
    torque: wp.array3d(dtype=float),
    inverse: wp.array3d(dtype=float),
    hinge_qpos: wp.array2d(dtype=int),
    hinge: wp.array2d(dtype=int),
    step_s: float,
    qpos: wp.array2d(dtype=float),
    qvel: wp.array2d(dtype=float),
):
    """Lets the twist of every edge follow the vertices."""
    world, strand, edge = wp.tid()
    change = wp.float32(0.0)
    for other in range(torque.shape[2]):
        change += inverse[strand, edge, other] * torque[world, strand, other]
    qvel[world, hinge[strand, edge]] = qvel[world, hinge[strand, edge]] + change
    qpos[world, hinge_qpos[strand, edge]] = qpos[world, hinge_qpos[strand, edge]] + step_s * change


@wp.kernel
def sense(
    qpos: wp.array2d(dtype=float),
    slide: wp.array3d(dtype=int),
    place: wp.array2d(dtype=wp.vec3),
    lengths_m: wp.array2d(dtype=float),
):
    """Lengths of the springs that serve as sensors."""
    world, sensor = wp.tid()
    apart = place[sensor, 1] - place[sensor, 0]
    for k in range(3):
        apart[k] += qpos[world, slide[k, sensor, 1]] - qpos[world, slide[k, sensor, 0]]
    lengths_m[world, sensor] = wp.length(apart)


class GpuWorms:
    """Copies of one worm whose bodies are stepped by MuJoCo Warp."""

    def __init__(self, config: RunConfig, n_worms: int) -> None:
        """Compiles the worm as a plant does, but for the sensors of contact forces, and puts it onto the device."""
        self.plant = plant = WormPlant(config)
        if not plant.model.nflex:
            raise SystemExit(f"{config.name}: only nets of rods are stepped here")
        if plant.model.na:
            raise SystemExit(f"{config.name}: its actuators have states, which this benchmark does not follow")
        spec = build_spec(config, for_plant=True)
        tendons_to_rows(spec)
        model = compile_spec(spec)
        body: Any = config.body
        self._damping = MaterialDamping(model, body.strands)
        if body.formulation.tie is not None:
            Ties(model, body.formulation.tie)
        self._shape = n_worms, model.nflex, int(model.flex_edgenum[0])
        self.n_worms, self.nv = n_worms, model.nv
        self._second_order = plant.two_step is not None
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        data.qacc_warmstart[:] = 0.0
        rows, contacts = 2 * data.nefc, 2 * max(data.ncon, 64)
        entries = int(2 * data.efc_J_rownnz.sum()) if data.efc_J_rownnz.size else rows * model.nv
        self._model = mujoco_warp.put_model(model)
        self._data = mujoco_warp.put_data(model, data, nworld=n_worms, nconmax=contacts, njmax=rows, njmax_nnz=entries)
        self._find(model, TwistCoupling(model, body.strands) if self._second_order else None)
        self._graph: Any = None
        self.control = np.zeros((n_worms, model.nu), dtype=np.float32)

    def _find(self, model: Any, twist: TwistCoupling | None) -> None:
        """Puts onto the device where the vertices, dampers and sensors are, and the coefficients of twist."""
        n_worms, n_strands, n_edges = self._shape
        vertices = RodVertices(model)

        def ints(values: Any) -> Any:
            return wp.array(np.ascontiguousarray(values, dtype=np.int32), dtype=int)

        def vectors(values: Array) -> Any:
            return wp.array(np.ascontiguousarray(values, dtype=np.float32), dtype=wp.vec3)

        self._slide, self._dof = ints(vertices._slide), ints(vertices.dof)
        self._place = vectors(vertices._place.transpose(1, 2, 0))
        hinges = twist_joints(model)
        starts, counts = self._model.ten_J_rowadr.numpy(), self._model.ten_J_rownnz.numpy()
        columns = self._model.ten_J_colind.numpy()
        at = np.zeros((n_strands, n_edges - 1, 10), dtype=np.int32)
        for strand, bend in np.ndindex(n_strands, n_edges - 1):
            tendon = model.tendon(damper_name(f"strand_{strand}", bend + 1)).id
            own = slice(starts[tendon], starts[tendon] + counts[tendon])
            place_of = {int(dof): own.start + k for k, dof in enumerate(columns[own])}
            dofs = vertices.dof[:, strand, bend : bend + 3].T.ravel().tolist()
            dofs.append(int(model.jnt_dofadr[hinges[strand, damped_edge(bend + 1)]]))
            at[strand, bend] = [place_of[dof] for dof in dofs]
        self._at = ints(at)
        self._along = wp.zeros((n_worms, n_strands, n_edges - 1, 2), dtype=wp.vec3)
        self._angle = wp.zeros((n_worms, n_strands, n_edges - 1), dtype=wp.vec2)
        if twist is not None:
            self._hinge, self._hinge_qpos = ints(model.jnt_dofadr[hinges]), ints(model.jnt_qposadr[hinges])
            self._stiff = vectors(np.stack([twist._all_torsion, twist._viscous, twist._lateral], axis=-1))
            self._inverse = wp.array(twist._inverse.astype(np.float32), dtype=float)
            self._torque = wp.zeros(self._shape, dtype=float)
            self._step_s = float(model.opt.timestep)
            self._before = wp.clone(self._data.qpos), wp.clone(self._data.qvel)
            self._start = wp.clone(self._data.qpos), wp.clone(self._data.qvel)
        anatomy = self.plant.anatomy
        ends = anatomy.crossing_body[anatomy.geometry.springs[anatomy._sensors.ravel()]]
        first = model.jnt_qposadr[model.body_jntadr[ends]]
        self._sensor_slide = ints(first + np.arange(3)[:, None, None])
        self._sensor_place = vectors(model.body_pos[ends])
        self._lengths = wp.zeros((n_worms, len(ends)), dtype=float)

    def _body_step(self) -> None:
        """One physics step and what is sensed after it."""
        data, second_order = self._data, self._second_order
        n_worms, n_strands, n_edges = self._shape
        if second_order:
            for now, before, start in zip((data.qpos, data.qvel), self._before, self._start, strict=True):
                wp.launch(extrapolate, dim=now.shape, inputs=[now, before, start])
        own_tendon = smooth.tendon

        def tendon(model: Any, data: Any) -> None:
            own_tendon(model, data)
            bends = n_worms, n_strands, n_edges - 1
            inputs = [data.qpos, self._slide, self._place, self._at, self._along, self._angle, data.ten_J]
            wp.launch(renew, dim=bends, inputs=inputs)

        smooth.tendon = tendon
        try:
            mujoco_warp.step(self._model, data)
        finally:
            smooth.tendon = own_tendon
        if second_order:
            start = self._start[1]
            inputs = [data.qvel, start, self._dof, self._along, self._angle, self._stiff, self._torque]
            wp.launch(twist_torque, dim=self._shape, inputs=inputs)
            inputs = [self._torque, self._inverse, self._hinge_qpos, self._hinge, self._step_s, data.qpos, data.qvel]
            wp.launch(follow, dim=self._shape, inputs=inputs)
        inputs = [data.qpos, self._sensor_slide, self._sensor_place, self._lengths]
        wp.launch(sense, dim=self._lengths.shape, inputs=inputs)

    def step(self, activation: Array) -> Array:
        """Takes a physics step under an activation, ``(n_worms, n_muscles)``; returns what the sensors read, m."""
        self.control[:] = activation
        self._data.ctrl.assign(self.control)
        if not wp.get_device().is_cuda:
            self._body_step()
        elif self._graph is None:
            self._body_step()
            with wp.ScopedCapture() as capture:
                self._body_step()
            self._graph = capture.graph
        else:
            wp.capture_launch(self._graph)
        rest = self.plant.anatomy.rest_stretch_m
        return self._lengths.numpy().astype(float).reshape(self.n_worms, *rest.shape)

    def qpos(self) -> Array:
        """Generalised positions, ``(n_worms, nq)``."""
        return self._data.qpos.numpy()

    def iterations(self) -> int:
        """Iterations of the solver in the last step, of the worm with the most."""
        return int(self._data.solver_niter.numpy().max())

    def overflow(self) -> str:
        """Says whether the device ran out of room for contacts or rows."""
        return f"{int(self._data.nacon.numpy()[0]) / self.n_worms:.0f} contacts, {self._data.nefc.numpy().max()} rows"


def tolerances(config: RunConfig, n_worms: int) -> Array:
    """Tolerance of the stretch sensors of every worm, m: that of the configuration first, then up to 1 % around it."""
    around = np.random.default_rng(1).uniform(-SPREAD, SPREAD, n_worms)
    around[0] = 0.0
    return config.sensor.tolerance_m * (1.0 + around)


def walk(worms: GpuWorms, config: RunConfig, duration_s: float) -> tuple[Array, Array, dict[str, float]]:
    """Lets worms walk, closed loop; returns activation and lengths from the start on, and where the time went, s."""
    controller = build_controller(config, worms.plant)
    assert isinstance(controller, SnsController)
    sensation = worms.plant.reset(0)
    controller.reset(0)
    n, n_moves = worms.n_worms, round(duration_s / config.clock.physics_timestep_s)
    states = {
        name: value if name == "n_steps" else np.stack([value] * n) for name, value in controller.get_state().items()
    }
    own = controller.own
    each = CopySettings(
        tolerances(config, n), *(np.full(n, v) for v in (own.hysteresis_m, own.sensor_current_nA, own.kick_nA))
    )
    sensed = np.stack([sensation.stretch_m] * n)
    every = worms.plant.steps_to_move()
    activations, lengths, spent = [], [sensed], {"network": 0.0, "body": 0.0}
    for move in range(n_moves):
        began = perf_counter()
        seen = replace(sensation, time_s=move * config.clock.physics_timestep_s, stretch_m=sensed)
        states, activation = controller.step_copies(states, seen, every, each)
        between = perf_counter()
        sensed = worms.step(activation)
        # The first steps compile, allocate and record.
        if move >= 2:
            spent["network"] += between - began
            spent["body"] += perf_counter() - between
        activations.append(activation)
        lengths.append(sensed)
    return np.array([np.zeros_like(activations[0]), *activations]), np.array(lengths), spent


def numbers(times_s: Array, activation: Array, lengths_m: Array, rest_m: Array) -> tuple[tuple[int, ...], float, Array]:
    """Order, period, s, and largest mean elongation of every segment, m, of one worm."""
    found = rhythm(times_s, activation)
    return found.order, found.period_s or np.nan, (lengths_m - rest_m).mean(axis=-1).max(axis=0)


def agreement(config: RunConfig, n_worms: int, duration_s: float) -> None:
    """Prints what four worms do on the device and by the engine."""
    worms = GpuWorms(config, n_worms)
    activation, lengths, _ = walk(worms, config, duration_s)
    step_s = config.clock.physics_timestep_s
    times_s, rest = step_s * np.arange(len(activation)), worms.plant.anatomy.rest_stretch_m
    same = [
        config.model_copy(
            update={"sensor": config.sensor.model_copy(update={"tolerance_m": float(t)}), "duration_s": duration_s}
        )
        for t in tolerances(config, n_worms)
    ]
    with TemporaryDirectory() as folder:
        runs = annelid.simulate_batch(same, folder, progress=False)
        print(f"the engine: {n_worms * duration_s / runs.wall_time_s:.1f} s simulated a second, a thread a worm")
        for worm, run in enumerate(runs):
            found, summary = run_rhythm(run), annelid.summary(run)
            assert found is not None
            order, period_s, longer = numbers(times_s, activation[:, worm], lengths[:, worm], rest)
            theirs = np.array(summary.elongation_mean_max_m, dtype=float)
            apart = [f"{x:+.2%}" for x in longer / theirs - 1.0]
            equal = order[: len(found.order)] == found.order[: len(order)]
            orders = "the same order" if equal else f"orders {order} and {found.order}"
            periods = f"period {period_s:.4f} and {found.period_s or np.nan:.4f} s"
            print(f"worm {worm}: {orders}, {periods}, elongation {', '.join(apart)}", flush=True)
    print(worms.overflow(), flush=True)


def compare(config: RunConfig, n_steps: int) -> None:
    """Steps one worm in both engines under a constant activation of its first muscle and prints how far they part."""
    worms = GpuWorms(config, 1)
    plant = worms.plant
    activation = np.zeros(plant.n_muscles)
    activation[0] = 1.0
    every = plant.steps_to_move()
    for step in range(1, n_steps + 1):
        theirs = worms.step(activation[None])[0]
        ours = plant.stride(activation, every).stretch_m
        if step in (1, 2, 3, 10, n_steps):
            apart = np.abs(worms.qpos()[0] - plant.qpos).max()
            print(
                f"step {step}: sensors {1e3 * np.abs(theirs - ours).max():.3g} mm apart (moved "
                f"{1e3 * np.abs(ours - plant.anatomy.rest_stretch_m).max():.3g} mm), coordinates {apart:.2g}, "
                f"iterations {worms.iterations()} and {plant.data.solver_niter[0]}",
                flush=True,
            )


def on_cpu(config: RunConfig, n_worms: int, n_steps: int) -> None:
    """Prints worms a second of a batch on all processors of this machine."""
    short = config.model_copy(update={"duration_s": n_steps * config.clock.physics_timestep_s})
    with TemporaryDirectory() as folder:
        took_s = annelid.simulate_batch(short, folder, n_worms=n_worms, progress=False).wall_time_s
    print(
        f"{n_worms} worms on {os.cpu_count()} processors: {n_worms * short.duration_s / took_s:.1f} s a second",
        flush=True,
    )


def throughput(config: RunConfig, n_worms: int, n_steps: int) -> dict[str, float]:
    """Prints worms a second of a closed loop, and what memory they take."""
    free = wp.get_device().free_memory
    worms = GpuWorms(config, n_worms)
    step_s = config.clock.physics_timestep_s
    _, _, spent = walk(worms, config, (n_steps + 2) * step_s)
    taken = free - wp.get_device().free_memory
    total = sum(spent.values())
    rate = n_worms * n_steps * step_s / total
    print(
        f"{n_worms:6d} worms: {1e3 * total / n_steps:9.2f} ms a step of all, of which networks "
        f"{1e3 * spent['network'] / n_steps:7.2f}; {rate:8.1f} s simulated a second; "
        f"{taken / n_worms / 2**20:7.2f} MiB a worm; {worms.overflow()}; "
        f"finite {bool(np.isfinite(worms.qpos()).all())}",
        flush=True,
    )
    network_ms = 1e3 * spent["network"] / n_steps
    return dict(zip(COLUMNS, (n_worms, 1e3 * total / n_steps, network_ms, rate, taken / n_worms / 2**20), strict=True))


def main(given: Sequence[str] | None = None) -> None:
    """Runs what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--preset", default="riddle2023-rods")
    parser.add_argument("--timestep", type=float, help="physics step, s; default: the preset's")
    parser.add_argument("--steps", type=int, default=30, help="steps of the comparison and of each batch")
    parser.add_argument("--seconds", type=float, default=8.0, help="simulated time of the closed loop that is compared")
    parser.add_argument("--worms", type=int, nargs="*", default=[1, 64, 1024], help="sizes of batches, on CUDA only")
    parser.add_argument("--csv", type=Path, help="where to write the table of sizes")
    options = parser.parse_args(given)
    config = load_config(options.preset)
    if options.timestep:
        clock = config.clock.model_copy(update={"physics_timestep_s": options.timestep})
        config = config.model_copy(update={"clock": clock})
    device = wp.get_device()
    print(f"{config.name}, steps of {config.clock.physics_timestep_s:g} s, on {device.name}", flush=True)
    compare(config, options.steps)
    if device.is_cuda:
        agreement(config, 4, options.seconds)
        on_cpu(config, 16 * (os.cpu_count() or 1), options.steps)
        sizes: list[dict[str, float]] = []
        for n_worms in options.worms:
            try:
                sizes.append(throughput(config, n_worms, options.steps))
            except RuntimeError as error:
                print(f"{n_worms} worms: {error}", flush=True)
        if options.csv:
            with options.csv.open("w", newline="") as file:
                table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
                table.writeheader()
                table.writerows(sizes)


if __name__ == "__main__":
    main()
