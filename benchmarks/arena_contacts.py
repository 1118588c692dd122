"""How the ground is best felt: planes that move with the skin, panels, a height field, or a mesh as a distance field.

The six-segment worm with muscles walks into a bend, and over rough ground, once for each candidate. Printed are the
time to build the model, the time of a physics step (planes are laid within it), contacts a step, the most contacts of
one vertex, and the leak: how far the centre of a vertex, a strand's radius inside the skin, ever was outside.

    python benchmarks/arena_contacts.py --seconds 4 --csv docs/results/arena_contacts.csv
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from time import perf_counter, process_time
from unittest.mock import patch

import mujoco
import numpy as np

from annelid.arena.geoms import contact_options, skin_geoms
from annelid.arena.ground import surface_of
from annelid.arena.kinds import pipe
from annelid.arena.kinds.floor import Floor
from annelid.body import build_spec, compile_spec
from annelid.body.constraint_rows import tendons_to_rows
from annelid.body.worm import WormBody
from annelid.config import ArenaKind, RunConfig, load_config
from annelid.output import write_csv
from annelid.simulation.anatomy import Anatomy
from annelid.simulation.stepping import build_controller
from annelid.simulation.worm import WormPlant

WORM = {
    "arena.friction": 0.7,
    "body.rings": {"kind": "muscle", "layout": "whole", "peak_force_N": 31.0, "length_range_m": [0.62, 1.1]},
    "controller.gate_time_constant_ms": 300.0,
    "sensor.tolerance_m": 0.005,
    "sensor.startup_hold_s": 0.2,
}
SOFT = {"arena.contact_time_constant_s": 0.02, "arena.contact_impedance": [0.9, 0.95, 0.001]}
"""The presets' contacts, the engine's default."""
HARD = {
    "clock.physics_timestep_s": 0.005,
    "arena.contact_time_constant_s": 0.01,
    "arena.contact_impedance": [0.99, 0.999, 0.001],
}
"""The engine takes no contact to be faster than two steps."""
WALL_M = 0.03
SDF_STEPS = 10
Ground = Callable[[mujoco.MjSpec, ArenaKind, float], None]


class StillGround(WormPlant):
    """The worm on a ground that stands still."""

    def __init__(self, config: RunConfig, add_ground: Ground) -> None:
        assert config.arena is not None
        assert isinstance(config.body, WormBody)
        far = Floor(**config.arena.model_dump(include=set(ArenaKind.model_fields) - {"kind"}), floor_gap_m=50.0)
        spec = build_spec(config.model_copy(update={"arena": far}), for_plant=True)
        tendons_to_rows(spec)
        add_ground(spec, config.arena, spec.stat.extent)
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        spec.delete(spec.geom("floor"))
        _add_contact_sensors(spec)
        super().__init__(config, Anatomy(compile_spec(spec), config.body, config.arena))
        self.ground = None


def _add_contact_sensors(spec: mujoco.MjSpec) -> None:
    """Adds a sensor of the whole world's force on every vertex: one for each panel would be far too many."""
    for geom in skin_geoms(spec):
        spec.add_sensor(
            name=f"world_on_{geom.name}",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            objname="world",
            reftype=mujoco.mjtObj.mjOBJ_GEOM,
            refname=geom.name,
            intprm=[1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1],
        )


def panels(around: int) -> Ground:
    """Returns what adds a pipe of so many panels round it, or a height field."""

    def add(spec: mujoco.MjSpec, arena: ArenaKind, length_m: float) -> None:
        with patch.object(pipe, "PANELS_AROUND", around):
            arena.add_panels(spec, length_m)

    return add


def mesh_field(spec: mujoco.MjSpec, arena: ArenaKind, length_m: float) -> None:
    """Adds a pipe's wall, closed and 3 cm thick, as a mesh whose distance field the engine computes."""
    inner = arena.shape(length_m)
    assert inner is not None
    surface = surface_of(arena)
    outer = inner.vertices_m - WALL_M * surface.normal(inner.vertices_m)
    n, around = len(inner.vertices_m), int(inner.faces[1, 1])
    last = n - around
    ring = np.stack([np.arange(around), (np.arange(around) + 1) % around], axis=-1)
    rims = []
    for start, flip in ((0, False), (last, True)):
        a, b = start + ring[:, 0], start + ring[:, 1]
        rim = np.concatenate([np.stack([a, b, a + n], axis=-1), np.stack([b, b + n, a + n], axis=-1)])
        rims.append(rim[:, ::-1] if flip else rim)
    faces = np.concatenate([inner.faces[:, ::-1], inner.faces + n, *rims])
    corners = np.concatenate([inner.vertices_m, outer])
    volume = np.einsum("ij,ij->", corners[faces[:, 0]], np.cross(corners[faces[:, 1]], corners[faces[:, 2]])) / 6
    faces = faces if volume > 0 else faces[:, ::-1]
    spec.add_mesh(name="wall", uservert=corners.ravel(), userface=faces.ravel())
    geom = {"type": mujoco.mjtGeom.mjGEOM_SDF, "meshname": "wall", **contact_options(arena)}
    spec.worldbody.add_geom(name="wall", **geom)


def measure(name: str, config: RunConfig, ground: Ground | None, n_moves: int) -> dict[str, object]:
    """Walks, prints a line and returns its numbers."""
    assert config.arena is not None
    assert isinstance(config.body, WormBody)
    began = perf_counter()
    plant = WormPlant(config) if ground is None else StillGround(config, ground)
    built = perf_counter() - began
    controller = build_controller(config, plant)
    controller.reset(0)
    sensation = plant.reset(0)
    surface = surface_of(config.arena)
    skin = sorted({int(g) for g in np.flatnonzero(_is_skin(plant.model))})
    radius = config.body.strands.radius_m
    spent, contacts, most, leak, strain = 0.0, [], 0, -radius, 0.0
    stride = plant.steps_to_move()
    for _ in range(n_moves):
        for _ in range(stride):
            activation = controller.step(sensation)
            before = process_time()
            sensation = plant.step(activation)
            spent += process_time() - before
        touched = plant.data.contact.geom
        contacts.append(len(touched))
        if len(touched):
            most = max(most, int(np.bincount(touched[np.isin(touched, skin)].ravel()).max()))
        leak = max(leak, -float(surface.distance_m(plant.data.geom_xpos[skin]).min()))
        strain = max(strain, float(plant.read(False)["edge_strain"]))
    travel = plant.geometry.length_m / 2 - sensation.center_of_mass_m[0]
    print(
        f"{name:34s} {built:6.1f} s {1e3 * spent / n_moves:8.2f} ms {np.mean(contacts):8.1f} {most:4d}"
        f" {1e3 * leak:8.2f} mm {100 * strain:7.2f} % {100 * travel:7.1f} cm"
    )
    return {
        "candidate": name,
        "build_s": built,
        "step_ms": 1e3 * spent / n_moves,
        "contacts": np.mean(contacts),
        "most": most,
        "leak_mm": 1e3 * leak,
        "edge_strain": strain,
        "travel_m": travel,
    }


def _is_skin(model: mujoco.MjModel) -> np.ndarray:
    """Spheres that can touch: those of the strands, not of the pins."""
    spheres = model.geom_type == int(mujoco.mjtGeom.mjGEOM_SPHERE)
    paired = np.zeros(model.ngeom, dtype=bool)
    paired[model.pair_geom1], paired[model.pair_geom2] = True, True
    return spheres & (paired | (model.geom_conaffinity > 0))


def main() -> None:
    """Measures all candidates."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=4.0, help="simulated time of each candidate")
    parser.add_argument("--csv", type=Path, help="file for the numbers")
    given = parser.parse_args()
    seconds, rows = given.seconds, []
    heads = ("build", 8), ("step", 11), ("contacts", 8), ("most", 4), ("leak", 11), ("strain", 9), ("travel", 10)
    print(f"{'candidate':34s}", *(f"{word:>{width}s}" for word, width in heads))
    for name, worm in (("10 ms, soft", WORM | SOFT), ("5 ms, hard", WORM | HARD)):
        level = load_config("riddle2025", worm, arena="floor")
        bend = load_config("riddle2025", worm | {"arena.straight_m": 0.0}, arena="pipe.bend")
        rough = load_config("riddle2025", worm | {"arena.start_m": 0.0}, arena="rough")
        moves = round(seconds / bend.clock.physics_timestep_s)
        rows.append(measure(f"{name}: level floor, one plane", level, None, moves))
        rows.append(measure(f"{name}: bend, moving planes", bend, None, moves))
        rows.append(measure(f"{name}: rough, moving planes", rough, None, moves))
    rows += [measure(f"{name}: bend, {n} panels around", bend, panels(n), moves) for n in (16, 32, 64)]
    rows.append(measure(f"{name}: rough, height field of 2 cm", rough, panels(0), moves))
    rows.append(measure(f"{name}: bend, mesh, {SDF_STEPS} steps only", bend, mesh_field, SDF_STEPS))
    if given.csv:
        write_csv(given.csv, rows[0], (row.values() for row in rows))


if __name__ == "__main__":
    main()
