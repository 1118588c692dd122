"""Robots of one's own: read as data, driven and sensed by the names in their files."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import annelid
from annelid.body.assemble import mjcf_text
from annelid.config import RunConfig, load_config
from annelid.errors import ConfigError
from annelid.protocols import Sensation
from annelid_lab.robots.body import EXAMPLE, MjcfBody
from annelid_lab.robots.plant import MjcfPlant

ROBOT = Path(__file__).parents[2] / "examples" / "robot" / "robot.xml"
FLOOR = '<geom name="floor" type="plane" size="5 5 1"/>'


def robot(xml: str = EXAMPLE, changes: dict[str, Any] | None = None, **body: Any) -> RunConfig:
    """A configuration of a robot with steps of 2 ms."""
    body = {"kind": "mjcf", "xml": xml, **body}
    return load_config({"body": body, "clock": {"physics_timestep_s": 0.002}}, changes)


def plant_of(config: RunConfig) -> MjcfPlant:
    """The robot of a configuration."""
    assert isinstance(config.body, MjcfBody)
    return MjcfPlant(config.body, config)


def held(plant: MjcfPlant, activation: float, n_steps: int) -> Sensation:
    """What a robot senses after so many steps under one activation of all its actuators."""
    sensed = plant.reset(0)
    for _ in range(n_steps):
        sensed = plant.step(np.full(plant.n_muscles, activation))
    return sensed


def one_motor(motor: str, joint: str = "") -> str:
    """A robot of one mass that a motor pulls towards the world along x."""
    return (
        '<mujoco><compiler autolimits="true"/><option gravity="0 0 0"/><worldbody><body pos="0.5 0 0">'
        f'<joint name="s" type="slide" axis="1 0 0" {joint}/><geom size="0.05" mass="2"/></body></worldbody>'
        f'<actuator>{motor}</actuator><sensor><jointpos name="stretch_1" joint="s"/></sensor></mujoco>'
    )


def test_a_file_is_a_whole_robot_with_its_ground_and_its_step() -> None:
    config = load_config(ROBOT)
    assert isinstance(config.body, MjcfBody)
    assert (config.name, config.body.n_segments, config.arena) == ("robot", 3, None)
    assert config.clock.physics_timestep_s == 0.005
    plant = plant_of(config)
    assert (plant.n_segments, plant.n_muscles, plant.total_mass_kg) == (3, 3, pytest.approx(0.8))
    assert plant.length_m == pytest.approx(0.3)
    assert plant.reset(0).heading == pytest.approx([-1.0, 0.0, 0.0])


def test_the_papers_worm_from_its_mjcf_moves_as_the_papers_worm(tmp_path: Path) -> None:
    """The oracle is the body that wrote the file; MJCF holds six digits."""
    fewer = {"body.mesh.n_helices": 6, "body.mesh.elements_per_side": 1, "duration_s": 0.2}
    own = load_config("riddle2023", fewer)
    (tmp_path / "worm.xml").write_text(mjcf_text(own))
    tree = own.model_dump(exclude_none=True) | MjcfBody.from_file(tmp_path / "worm.xml")
    for name in ("arena", "published"):
        tree.pop(name, None)
    tree["body"] |= {"first_segment": 0, "sensors": [f"stretch_{{segment}}_{i}" for i in range(3)]}
    there, here = (
        annelid.simulate(config, tmp_path / name, progress=False).data
        for name, config in (("own", own), ("read", load_config(tree)))
    )
    for name in ("stretch_length", "ring_length", "center_of_mass"):
        assert here[name].values == pytest.approx(there[name].values, abs=1e-4), name
    assert np.ptp(there["ring_length"].values) > 0.05
    weight_N = 9.81 * there.attrs["total_mass_kg"]
    assert here["contact_force"].values[-1, :, 2].sum() == pytest.approx(weight_N, rel=0.5)


@pytest.mark.parametrize(
    ("motor", "joint", "force_N"),
    [
        ('<motor name="ring_1" joint="s" ctrlrange="-3 1"/>', "", 3.0),
        ('<motor name="ring_1" joint="s" gear="-2" ctrlrange="0 3"/>', "", 6.0),
        ('<general name="ring_1" joint="s" gainprm="-4" ctrlrange="0 1"/>', "", 4.0),
        (
            '<muscle name="ring_1" joint="s" force="5" ctrlrange="0 1" lengthrange="-0.25 0.05" timeconst=".01 .01"/>',
            'armature="1e4"',
            5.0,
        ),
        ('<position name="ring_1" joint="s" kp="10" ctrlrange="-0.2 0.1"/>', 'damping="1e5"', 2.0),
    ],
)
def test_activation_goes_from_rest_to_the_hardest_pull(motor: str, joint: str, force_N: float) -> None:
    plant = plant_of(robot(one_motor(motor, joint)))
    at_rest = held(plant, 0.0, 100)
    assert at_rest.muscle_force_N == pytest.approx([-1.0 if "position" in motor else 0.0], abs=0.01)
    pulled = held(plant, 1.0, 100)
    assert pulled.muscle_force_N == pytest.approx([force_N], rel=0.02)
    assert pulled.stretch_m[0, 0] < 0.0


def test_the_ground_carries_the_robot_at_rest() -> None:
    plant = plant_of(robot())
    sensed = held(plant, 0.0, 2000)
    assert sensed.contact_force_N[:, 2].sum() == pytest.approx(0.8 * 9.81, rel=0.01)
    assert plant.alarm() is None


def test_a_run_goes_on_to_the_last_bit(tmp_path: Path) -> None:
    config = load_config(ROBOT, {"duration_s": 0.6, "sensor.tolerance_m": 0.005})
    whole = annelid.simulate(config, tmp_path / "whole", progress=False).data
    first = annelid.simulate(config.model_copy(update={"duration_s": 0.3}), tmp_path / "a", progress=False)
    rest = annelid.simulate(config, tmp_path / "b", resume=first, progress=False).data
    for name in ("stretch_length", "muscle_force", "contact_force", "kinetic_energy"):
        assert np.array_equal(rest[name].values, whole[name].values[-len(rest["time"]) :]), name
    assert np.ptp(whole["stretch_length"].values) > 0.01


def test_a_guard_stops_a_robot_that_flies_off() -> None:
    plant = plant_of(robot(one_motor('<motor name="ring_1" joint="s" ctrlrange="-900 0"/>')))
    held(plant, 1.0, 60)
    assert "kinetic energy" in (plant.alarm() or "")


def test_a_cable_of_mujoco_3_sags_as_a_beam(tmp_path: Path) -> None:
    """Euler and Bernoulli: the tip of a cantilever sinks by w L^4 / (8 E I) under its own weight w a metre."""
    n, mass_kg, modulus_Pa = 40, 0.06, 8e9
    vertices = " ".join(f"{x:.9g} 0 1" for x in np.linspace(0.0, 1.0, n + 1))
    (tmp_path / "beam.xml").write_text(
        '<mujoco><extension><plugin plugin="mujoco.elasticity.cable"/></extension><size memory="4G"/>'
        '<compiler autolimits="true"/><option integrator="implicitfast" timestep="0.005"/><worldbody>'
        f'<composite type="cable" prefix="c" initial="none" vertex="{vertices}">'
        '<plugin plugin="mujoco.elasticity.cable"><config key="bend" value="8e9"/><config key="twist" value="4e8"/>'
        '</plugin><joint kind="main" damping="2"/><geom size="0.005" contype="0" conaffinity="0" mass="0.0015"/>'
        '</composite><body pos="0 0 2"><joint name="pulled"/><geom size="0.1"/></body></worldbody>'
        '<actuator><motor name="ring_1" joint="pulled" ctrlrange="-1 0"/></actuator>'
        '<sensor><jointpos name="stretch_1" joint="pulled"/></sensor></mujoco>'
    )
    plant = plant_of(load_config(tmp_path / "beam.xml"))
    held(plant, 0.0, 4000)
    last = plant.data.body("cB_last")
    tip_m = last.xpos + last.xmat.reshape(3, 3)[:, 0] / n
    bending = modulus_Pa * np.pi * 0.005**4 / 4
    # The first element is clamped, and the hinge at its end bends for half of it.
    free_m = 1.0 - 0.5 / n
    assert 1.0 - tip_m[2] == pytest.approx(mass_kg * 9.81 * free_m**4 / (8 * bending), rel=0.01)


def test_a_coil_of_mujoco_3_has_its_places_and_its_sites(tmp_path: Path) -> None:
    """Its curve is a helix: 1.5 turns of 0.2 m radius over a metre, from its first site to its last."""
    (tmp_path / "coil.xml").write_text(
        '<mujoco><compiler autolimits="true"/><worldbody>'
        '<composite type="cable" prefix="w" curve="cos(s) sin(s) s" count="31 1 1" size="1 0.2 3" initial="free"/>'
        '</worldbody><tendon><spatial name="stretch_1"><site site="wS_first"/><site site="wS_last"/></spatial></tendon>'
        '<actuator><motor name="ring_1" tendon="stretch_1" ctrlrange="-1 0"/></actuator></mujoco>'
    )
    plant = plant_of(load_config(tmp_path / "coil.xml"))
    share = np.arange(30) / 30
    helix_m = np.stack([0.2 * np.cos(3 * np.pi * share), 0.2 * np.sin(3 * np.pi * share), share], axis=1)
    places_m = [plant.data.body(f"wB_{name}").xpos for name in ("first", *range(1, 29), "last")]
    np.testing.assert_allclose(places_m, helix_m, atol=1e-8)
    np.testing.assert_allclose(plant.data.site("wS_last").xpos, [-0.2, 0.0, 1.0], atol=1e-8)


@pytest.mark.parametrize(
    "actuator",
    [
        '<velocity name="ring_1" joint="s" ctrlrange="-0.1 0.1" kv="50"/>',
        '<intvelocity name="ring_1" joint="s" ctrlrange="-0.1 0.1" kp="500" actrange="-0.02 0.02"/>',
    ],
)
def test_a_speed_as_command_shortens_when_contracted(actuator: str) -> None:
    plant = plant_of(robot(one_motor(actuator)))
    assert held(plant, 1.0, 100).stretch_m[0, 0] < held(plant, 0.0, 100).stretch_m[0, 0] - 0.005


REFUSED = {
    "no segment": (
        EXAMPLE,
        {"actuators": ["pull_{segment}"]},
        r"no actuator named pull_1; it has ring_1, ring_2, ring_3: write actuators = \[.ring_\{segment\}.\]",
    ),
    "no sensor": (EXAMPLE, {"sensors": ["s_{segment}"]}, "no tendon, joint or sensor named 's_1'; it has s1, s2"),
    "no place": (EXAMPLE, {"actuators": ["ring"]}, r"must have \{segment\} once"),
    "no actuator": (
        '<mujoco><worldbody><geom size="1"/></worldbody></mujoco>',
        {},
        "no actuator named ring_1; it has none: without any it can be an arena",
    ),
    "busy engine": ('<mujoco><option iterations="1000000"/></mujoco>', {}, "at most 10000"),
}


def test_what_no_robot_can_have_is_refused_in_a_sentence(subtests: pytest.Subtests) -> None:
    for case in REFUSED:
        with subtests.test(f"{case!r:.60}"):
            xml, fields, words = REFUSED[case]
            with pytest.raises(ConfigError, match=words):
                robot(xml, **fields)


@pytest.mark.parametrize(
    ("xml", "words"),
    [
        (one_motor('<motor name="ring_1" joint="s"/>'), "'ring_1' has no ctrlrange"),
        (one_motor('<motor name="ring_1" joint="s" ctrlrange="0 1"/>'), "'ring_1' cannot pull"),
        (one_motor('<motor name="ring_1" joint="t" ctrlrange="0 1"/>'), "the engine refuses the robot: .*unknown"),
        (one_motor('<damper name="ring_1" joint="s" ctrlrange="0 1"/>'), "'ring_1' cannot pull"),
    ],
)
def test_an_actuator_that_is_no_ring_is_refused(xml: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        plant_of(robot(xml))


def test_a_composite_that_is_no_cable_is_refused(subtests: pytest.Subtests, tmp_path: Path) -> None:
    for text, words in (
        ('<composite type="grid" prefix="c" count="9 9 1"/>', "only a cable"),
        ('<composite type="cable" prefix="c" vertex="0 0 0 1 1"/>', "three numbers"),
        (f'<composite type="cable" prefix="c" vertex="{"1 " * 9}"/>', "no two vertices alike"),
        (f'<composite type="cable" prefix="c" vertex="{"x " * 9}"/>', "must be numbers"),
        (f'<composite type="cable" prefix="c" vertex="{"1 " * 900}"/>', "of each of 3 to 180 places"),
        ('<composite type="cable" prefix="c" vertex="0" quat="1 0 0 0"/>', "<composite quat=..>: a cable cannot"),
        ('<composite type="cable" prefix="c" vertex="0"><plugin plugin="x"/></composite>', "others are code"),
        (
            f'<composite type="cable" prefix="c" vertex="{"1 " * 9}"><plugin plugin="mujoco.elasticity.cable">'
            '<config key="flat" value="true"/></plugin></composite>',
            "'flat'>: a cable cannot have it",
        ),
    ):
        with subtests.test(f"{text!r:.60}"):
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            (folder / "c.xml").write_text(f"<mujoco><worldbody>{FLOOR}{text}</worldbody></mujoco>")
            with pytest.raises(ConfigError, match=words):
                load_config(folder / "c.xml")


def test_what_a_robot_includes_is_read_from_its_folder(tmp_path: Path) -> None:
    whole = load_config(ROBOT)
    parts = ROBOT.read_text()
    start, end = parts.index("<actuator>"), parts.index("</actuator>") + len("</actuator>")
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "motors.xml").write_text(f"<mujocoinclude>{parts[start:end]}</mujocoinclude>")
    robot_file = tmp_path / "robot.xml"
    robot_file.write_text(f'{parts[:start]}<include file="parts\\motors.xml"/>{parts[end:]}')
    in_two = load_config(robot_file)
    assert mjcf_text(in_two).replace("\n", "") == mjcf_text(whole).replace("\n", "")
    outside = tmp_path.parent / f"{tmp_path.name}.xml"
    outside.write_text("<mujocoinclude/>")
    for file in (f"../{outside.name}", str(outside), "robot.xml", "parts/none.xml"):
        robot_file.write_text(f'<mujoco><include file="{file}"/></mujoco>')
        with pytest.raises(ConfigError, match=r"below the folder|included twice|cannot read"):
            load_config(robot_file)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<mujoco>\n<worldbody>\n<flexcomp/></worldbody></mujoco>", "line 3: <flexcomp>.*write its bodies out"),
        ('<mujoco>\n<worldbody>\n<composite type="cable" count="2"/></worldbody></mujoco>', "line 3: .*needs vertex="),
        ("<mujoco>\n<worldbody>\n<flexcomp\n name='a'\n dim='2'\n/></worldbody></mujoco>", "line 6: <flexcomp>"),
        ("<mujocoinclude/>", "an MJCF file begins with <mujoco>"),
        ('<robot name="worm"/>', "this is URDF; load it in MuJoCo and save it"),
        ('<Lems><include file="Cells.xml"/></Lems>', "a network of NeuroML; write it as TOML"),
    ],
)
def test_what_is_no_robot_is_refused_with_its_line_and_what_to_do(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(text)
    with pytest.raises(ConfigError, match=words):
        load_config(tmp_path / "robot.xml")


def test_what_the_engine_refuses_has_its_line(tmp_path: Path) -> None:
    text = one_motor('<damper\nname="ring_1" joint="s" ctrlrange="-3 0"/>').replace("<worldbody>", "\n<worldbody>")
    (tmp_path / "robot.xml").write_text(text)
    with pytest.raises(ConfigError, match="control range cannot be negative Element 'damper', line 3"):
        plant_of(load_config(tmp_path / "robot.xml"))


ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
GYMNASIUM = {
    "swimmer": ('["motor{segment}_rot"]', 'kind = "sine"', 2),
    "ant": ('["hip_{segment}", "ankle_{segment}"]', 'kind = "timed"', 4),
}


@pytest.mark.parametrize("name", GYMNASIUM)
def test_robots_of_gymnasium_run_with_a_file_of_ten_lines(name: str, tmp_path: Path) -> None:
    names, controller, n_segments = GYMNASIUM[name]
    text = (
        f'extends = "{name}.xml"\nduration_s = 0.2\n[body]\nactuators = {names}\nsensors = {names}\n'
        f"[controller]\n{controller}\n[guard]\nkinetic_energy_J = 1000.0\n"
    )
    assert len(text.splitlines()) <= 10
    (tmp_path / f"{name}.xml").write_bytes((ASSETS / f"{name}.xml").read_bytes())
    (tmp_path / "robot.toml").write_text(text)
    with pytest.warns(UserWarning, match="are angles"):
        run = annelid.simulate(load_config(tmp_path / "robot.toml"), tmp_path / "run", progress=False)
    assert run.status == "complete"
    assert run.config.body.n_segments == n_segments
    assert run.data["ring_length"].attrs["units"] == "rad"
    assert np.ptp(run.data["ring_length"].values) > 0.1


def test_attributes_of_the_file_are_fields() -> None:
    stiff = robot(changes={"body.attributes.position.ring_1.kp": 50.0, "body.attributes.geom.floor.friction": "0.3"})
    model = plant_of(stiff).model
    assert model.actuator("ring_1").gainprm[0] == 50.0
    assert model.geom("floor").friction[0] == 0.3
    for path, words in (
        ("position.ring_9.kp", "body.attributes: the file has 0 <position> named 'ring_9': did you mean"),
        ("position.ring_1.file", "cannot have this attribute"),
        ("position.ring_1.kp", "numbers must be finite"),
    ):
        with pytest.raises(ConfigError, match=words):
            robot(changes={f"body.attributes.{path}": 1e9})


def test_a_scene_is_the_arena_of_a_robot() -> None:
    scene = '<mujoco><worldbody><geom name="block" type="box" pos="0 0 0.03" size="0.5 0.5 0.03"/></worldbody></mujoco>'
    config = robot(changes={"arena.kind": "scene", "arena.xml": scene, "arena.gravity_m_per_s2": 3.7})
    plant = plant_of(config)
    assert plant.total_mass_kg == pytest.approx(0.8)
    assert held(plant, 0.0, 1000).contact_force_N[:, 2].sum() == pytest.approx(0.8 * 3.7, rel=0.02)
    assert plant.data.xpos[1, 2] == pytest.approx(0.06 - 0.009 + 0.03, abs=2e-3)
    assert "scene/block" in mjcf_text(config)


def test_the_section_has_its_own_ground() -> None:
    with pytest.raises(ConfigError, match=r"arena\.kind = 'floor' cannot be beside .*: --arena takes a scene"):
        robot(changes={"arena.kind": "floor"})
    with pytest.raises(ConfigError, match=r"trial.pull = 0.1: body.kind = 'mjcf' cannot be pulled"):
        robot(changes={"trial.pull": 0.1})
