"""Scenes: a plane is a floor, things move by closed forms, the skin feels them, and the energy totals close."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from annelid import RunConfig, load_config, simulate
from annelid.body import build_spec, compile_spec
from annelid.draw.drawn_worm import DrawnWorm
from annelid.errors import ConfigError
from annelid.simulation import Run
from annelid.simulation.worm import WormPlant

ROOT = Path(__file__).parents[2]
PLANE = '<geom name="floor" type="plane" size="5 5 1"/>'
STEP_S = 0.005
COARSE: dict[str, Any] = {
    "body.mesh.elements_per_side": 1,
    "clock": {"control_timestep_s": STEP_S, "physics_timestep_s": STEP_S},
    "record": {"signals_interval_s": STEP_S, "frames_interval_s": 0.02},
}
QUICK = {"body.strands.damping_time_s": 0.1}
"""Damped little, so that a worm soon comes to rest."""


def config(world: str, assets: str = "", changes: dict[str, Any] | None = None) -> RunConfig:
    xml = f"<mujoco><asset>{assets}</asset><worldbody>{PLANE}{world}</worldbody></mujoco>"
    tree = load_config("riddle2023-rods").model_dump()
    # The preset's contacts, but its friction on every side.
    arena = {name: tree["arena"][name] for name in ("friction", "contact_time_constant_s", "contact_impedance")}
    return load_config({**tree, "arena": {**arena, "kind": "scene", "xml": xml}}, {**COARSE, **(changes or {})})


def plant_in(world: str, assets: str = "", changes: dict[str, Any] | None = None) -> WormPlant:
    plant = WormPlant(config(world, assets, changes))
    plant.reset(0)
    return plant


def moved(plant: WormPlant, duration_s: float, activation: float = 0.0) -> WormPlant:
    for _ in range(round(duration_s / STEP_S)):
        plant.step(np.full(plant.n_muscles, activation))
    return plant


def total_J(plant: WormPlant) -> float:
    """All that is held, and all that was lost but for the integrator."""
    losses = float(plant.energies.damping_loss + plant.energies.constraint_loss)
    return plant.kinetic_energy_J() + plant.elastic_energy_J() + plant.potential_energy_J() + losses


def assert_same(ours: Run, theirs: Run) -> None:
    start = ours.data["time"].values[0]
    for name, variable in ours.data.data_vars.items():
        if "time" in variable.dims and name != "wall_time":
            other = theirs.data[name].isel(time=theirs.data["time"] >= start)
            assert np.array_equal(variable, other, equal_nan=True), name


def test_a_plane_of_a_scene_is_a_floor_bit_for_bit(tmp_path: Path) -> None:
    (tmp_path / "plane.xml").write_text(f"<mujoco><worldbody>{PLANE}</worldbody></mujoco>")
    changes = {**COARSE, "duration_s": 0.6}
    arenas = {"floor": "floor", "scene": tmp_path / "plane.xml"}
    floor, scene = (
        simulate(load_config("riddle2023-rods", changes, arena=arena), tmp_path / name, progress=False)
        for name, arena in arenas.items()
    )
    assert float(floor.data["touch"][-1].sum()) > 0.5
    assert_same(scene, floor)


def test_a_thing_on_a_spring_sinks_by_weight_over_stiffness_and_its_energy_closes() -> None:
    """A mass of 0.2 kg on a slide of 40 N/m, damped by 4 N s/m: 49 mm; half of the fall is stored, half is lost."""
    sunk = 0.2 * 9.81 / 40

    def lift(rest_m: float) -> WormPlant:
        slide = f'<joint type="slide" axis="0 0 1" stiffness="40" damping="4" springref="{rest_m}"/>'
        return plant_in(f'<body name="lift" pos="-2 0 1">{slide}<geom size="0.02" mass="0.2"/></body>')

    # The other one is at rest from the start.
    plant, bare = lift(0.0), lift(sunk)
    start, bare_start = total_J(plant), total_J(bare)
    held = bare.elastic_energy_J() - plant.elastic_energy_J()
    for worm in (plant, bare):
        moved(worm, 1.0)
    assert plant.posture.objects[0] == pytest.approx([-2.0, 0.0, 0.991 - sunk], abs=1e-5)
    stored = plant.elastic_energy_J() - bare.elastic_energy_J() + held
    lost = float(plant.energies.damping_loss - bare.energies.damping_loss)
    assert stored == pytest.approx(0.5 * 40 * sunk**2, rel=1e-3)
    assert plant.potential_energy_J() - bare.potential_energy_J() == pytest.approx(-0.2 * 9.81 * sunk, rel=1e-3)
    # The integrator takes less than a tenth of the half that is lost at this step.
    assert lost == pytest.approx(0.5 * 40 * sunk**2, rel=0.1)
    missing = (total_J(plant) - start) - (total_J(bare) - bare_start)
    assert abs(missing) < 0.1 * lost


SLAB = '<body name="slab" pos="0.4 0 0.02"><freejoint/><geom type="box" size="1.5 0.6 0.02" mass="2"/></body>'
BLOCK = "".join(f"{x} {y} {z} " for x in (-1.5, 1.5) for y in (-0.6, 0.6) for z in (0.0, 0.04))


@pytest.mark.parametrize("kind", ["slab", "mesh", "hfield"])
def test_a_worm_at_rest_on_a_thing_presses_on_it_with_its_weight(kind: str) -> None:
    grid = " ".join(["0 0 0 0 0", *["0 1 1 1 0"] * 3, "0 0 0 0 0"])
    world, assets = {
        "slab": (SLAB, ""),
        "mesh": ('<geom type="mesh" mesh="b" pos="0.4 0 0"/>', f'<mesh name="b" vertex="{BLOCK}"/>'),
        "hfield": (
            '<geom type="hfield" hfield="h" pos="0.4 0 0"/>',
            f'<hfield name="h" nrow="5" ncol="5" size="3 1.2 0.04 0.1" elevation="{grid}"/>',
        ),
    }[kind]
    plant = plant_in(world, assets, {**QUICK, "arena.floor_gap_m": 0.05})
    moved(plant, 3.0)
    weight = 9.81 * plant.total_mass_kg
    felt = plant.observe()
    assert felt.touch_N is not None
    assert felt.contact_force_N.sum(axis=0) == pytest.approx([0.0, 0.0, weight], abs=0.03 * weight)
    assert felt.touch_N.sum() == pytest.approx(weight, rel=0.05)
    assert -0.01 < plant._depth_m() < 0.004
    assert plant.alarm() is None
    if kind == "slab":
        assert plant._encounter.force[0] == pytest.approx(-felt.contact_force_N.sum(axis=0), abs=1e-9)
        assert plant.total_mass_kg == pytest.approx(plant_in("").total_mass_kg)


BOX = (
    '<body name="box" pos="-0.06 0 0.1"><freejoint/>'
    '<geom type="box" size="0.05 0.3 0.1" mass="0.03" friction="0.3" priority="1"/></body>'
)


def test_the_energy_totals_close_with_a_box_that_the_worm_pushes() -> None:
    """What is left of the work is the integrator's, and goes with the step."""
    shares = []
    for step_s in (0.005, 0.0025):
        clock = {"control_timestep_s": step_s, "physics_timestep_s": step_s}
        plant = plant_in(BOX, changes={"clock": clock, "record.signals_interval_s": step_s})
        start, place_m, pushed = total_J(plant), plant.posture.objects[0].copy(), 0.0
        for _ in range(round(0.8 / step_s)):
            plant.step(np.ones(plant.n_muscles))
            pushed = min(pushed, float(np.asarray(plant.read(False)["object_force"])[0, 0]))
        assert plant.posture.objects[0, 0] < place_m[0] - 0.01, "the box must move"
        assert pushed < -0.3 * 9.81 * 0.03, "the worm must push it ahead"
        work = float(plant.energies.muscle_work.sum())
        assert work > 0.5
        shares.append(abs(work - (total_J(plant) - start)) / work)
    assert shares[1] < 0.6 * shares[0]
    assert shares[0] < 0.1


def test_what_a_thing_states_counts_for_the_skin_and_the_rest_is_the_arena_s() -> None:
    world = '<geom name="ice" size="0.1" pos="-3 0 0" friction="0.05"/><geom name="plain" size="0.1" pos="-4 0 0"/>'
    model = WormPlant(config(world, changes={"arena.friction": 0.6})).model
    assert model.geom("scene/ice").friction[0] == 0.05
    assert model.geom("scene/plain").friction[0] == 0.6
    skin = (model.geom_conaffinity != 0) & (model.geom_contype == 0)
    assert (model.geom_priority[skin] < model.geom("scene/ice").priority).all()


def test_a_scene_continues_bit_for_bit_without_its_file(tmp_path: Path) -> None:
    for name in ("scene.xml", "ramp.obj"):
        (tmp_path / name).write_bytes((ROOT / "examples" / "scene" / name).read_bytes())
    changes = {**COARSE, "duration_s": 0.4}
    made = load_config("riddle2023-rods", changes, arena=tmp_path / "scene.xml")
    whole = simulate(made, tmp_path / "whole", progress=False)
    simulate(made.model_copy(update={"duration_s": 0.2}), tmp_path / "first", progress=False)
    for name in ("scene.xml", "ramp.obj"):
        (tmp_path / name).unlink()
    rest = simulate(made, tmp_path / "rest", resume=tmp_path / "first", progress=False)
    assert_same(rest, whole)
    assert whole.data["object"].values.tolist() == ["box", "ball", "post"]
    assert whole.data["object_position"].dims == ("time", "object", "axis")


def test_pictures_show_things_where_they_are(tmp_path: Path) -> None:
    run = simulate(
        config(BOX, changes={"duration_s": 0.3}), tmp_path / "run", controller=lambda _: np.ones(3), progress=False
    )
    drawn = DrawnWorm(run.config)
    box = drawn.model.body("scene/box").id
    for frame, time_s in enumerate(run.data["frame_time"].values):
        drawn.pose(run.data["qpos"].values[frame])
        there = run.data["object_position"].sel(time=time_s, method="nearest").values[0]
        assert drawn.posture.xipos[box] == pytest.approx(there, abs=1e-6)
    geom = int(np.flatnonzero(drawn.model.geom_bodyid == box)[0])
    assert drawn.model.geom_rgba[geom, 3] == 1.0
    assert drawn.model.geom_group[geom] <= 2, "as the engine draws"
    # The camera keeps to the worm.
    ends = drawn.outline(run.data["qpos"].values[-1])
    assert ends[:, 0].min() > run.data["crossing_position"].values[..., 0].min() - 0.1


def test_a_picture_is_a_height_field_with_white_high_and_its_first_row_to_the_left(tmp_path: Path) -> None:
    shades = np.zeros((3, 4), dtype=np.uint8)
    shades[0, 3] = 255
    Image.fromarray(shades).save(tmp_path / "field.png")
    path = tmp_path / "scene.xml"
    field = '<asset><hfield name="h" file="field.png" size="2 1 0.1 0.1"/></asset>'
    path.write_text(f'<mujoco>{field}<worldbody><geom type="hfield" hfield="h"/></worldbody></mujoco>')
    model = compile_spec(build_spec(load_config("riddle2023-rods", COARSE, arena=path), for_plant=True))
    # The engine's rows go from -y to +y, its columns from -x to +x.
    height = model.hfield_data.reshape(3, 4)
    assert height[2, 3] == 1.0
    assert height.sum() == 1.0


def test_a_binary_mesh_and_a_text_give_the_same_ground(tmp_path: Path) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    record = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["corners"] = corners[faces]
    (tmp_path / "m.stl").write_bytes(b"\0" * 80 + len(faces).to_bytes(4, "little") + record.tobytes())
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    # With texture and normal numbers, counted from the end, and a face of four corners made of two.
    lines += [f"f {' '.join(f'{corner - 4}/1/1' for corner in face)}" for face in faces]
    (tmp_path / "m.obj").write_text("\n".join(lines))
    volumes = []
    for name in ("m.stl", "m.obj"):
        (tmp_path / "scene.xml").write_text(
            f'<mujoco><asset><mesh name="m" file="{name}"/></asset><worldbody>{PLANE}'
            '<body name="thing" pos="-3 0 0"><freejoint/><geom type="mesh" mesh="m" density="6"/></body>'
            "</worldbody></mujoco>"
        )
        made = load_config("riddle2023-rods", COARSE, arena=tmp_path / "scene.xml")
        volumes.append(float(WormPlant(made).model.body("scene/thing").mass[0]))
    assert volumes == pytest.approx([1.0, 1.0])


def test_nothing_of_a_scene_counts_as_worm() -> None:
    """Neither bodies that are at rest, named or not, nor those that move."""
    world = f'<body pos="-3 0 0"><geom size="0.1"/><body><geom size="0.2"/></body></body>{BOX}'
    with_scene, bare = plant_in(world), plant_in("")
    assert with_scene.total_mass_kg == bare.total_mass_kg
    assert with_scene.posture.center_of_mass == pytest.approx(bare.posture.center_of_mass, abs=1e-12)
    assert with_scene.model.body_mass.sum() > bare.total_mass_kg + 30.0


def test_setae_are_refused_in_a_scene() -> None:
    with pytest.raises(ConfigError, match=r"arena\.backward_friction = 1: must be left out"):
        config("", changes={"arena.friction": 0.3, "arena.backward_friction": 1.0})
