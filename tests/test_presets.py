"""The presets carry the published numbers (the paper, and the authors' model files)."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from annelid.body.formulations.rods import Rods
from annelid.body.worm import WormBody
from annelid.config import fields_of, load_config
from annelid.experiment.case import Case
from annelid_studies.riddle2023.examinations.pins import DAMPING_TIME_S, tie_stiffness_N_per_m

PUBLISHED = {
    "duration_s": 5.0,
    "body.mesh.n_segments": 3,
    "body.mesh.n_helices": 12,
    "body.mesh.radius_m": 0.16,
    "body.mesh.angular_rate_rad_per_m": 14.0,
    "body.mesh.planes_between_rings": 4,
    "body.strands.radius_m": 0.002,
    "body.strands.young_modulus_Pa": 0.3e9,
    "body.strands.shear_modulus_Pa": 0.2e9,
    "body.pins.mass_kg": 0.00052,
    "body.springs.stiffness_N_per_m": 19.9,
    "body.rings.layout": "whole",
    "body.rings.minimum_length": 0.58,
    "body.rings.maximum_length": 1.6,
    "body.rings.maximum_velocity": 1.5,
    "body.rings.passive_peak": 1.3,
    "body.rings.lengthening_peak": 1.2,
    "arena.friction": 1.0,
    "arena.floor_gap_m": 0.009,
    "arena.gravity_m_per_s2": 9.81,
    "controller.capacitance_nF": 5.0,
    "controller.leak_conductance_uS": 1.0,
    "controller.range_mV": 20.0,
    "controller.bifurcation_mV": 0.01,
    "controller.offset_mV": 0.1,
    "controller.inhibitory_reversal_mV": -40.0,
    "controller.excitatory_reversal_mV": 194.0,
    "controller.sodium_reversal_mV": 110.0,
    "controller.gate_slope_per_mV": 0.05,
    "controller.gate_time_constant_ms": 300.0,
    "controller.sensor_current_nA": 20.0,
    "controller.kick_nA": 1.0,
    "clock.control_timestep_s": 0.001,
}
PAPER_S_FORMULATION = {
    "body.mesh.elements_per_side": 3,
    "body.formulation.kind": "chain",
    "body.formulation.armature_kg_m2": 0.01,
    "body.rings.length_range_m": ((0.548, 1.052), (0.609, 1.080), (0.541, 1.071)),
    "clock.physics_timestep_s": 0.001,
    "controller.gate_start": "toolbox",
    "controller.activation": "sigmoid",
    "controller.activation_slope_per_mV": 0.35,
    "sensor.tolerance_m": 0.010,
    "sensor.startup_hold_s": 0.2,
}
PLANAR = {
    "body.side_m": 0.073,
    "body.height_min_m": 0.065,
    "body.height_max_m": 0.11,
    "body.gain": 1.3,
    "sensor.tolerance_m": 0.0001,
    "controller.activation": "linear",
}


def value_at(preset: str, path: str) -> object:
    value: object = load_config(preset)
    for name in path.split("."):
        value = getattr(value, name)
    return value


NETWORK = {path: value for path, value in PUBLISHED.items() if path.startswith("controller.")}
ROBOTS = {
    "body.mesh.n_helices": 12,
    "body.mesh.radius_m": 0.16,
    "body.strands.radius_m": 0.00299,
    "body.springs.sensors": "sides",
    "body.rings.kind": "servo",
    "body.rings.layout": "halves",
    "body.springs.stiffness_N_per_m": 24.5,
    "body.springs.rest_length_m": 0.065,
}
AUTHORS_SERVOS_AND_RODS = {
    "body.strands.young_modulus_Pa": 2.0e9,
    "body.strands.shear_modulus_Pa": 1.33e9,
    "body.rings.length_range_m": (0.62, 0.96),
    "body.rings.stiffness_N_per_m": 1000.0,
    "body.rings.damping_Ns_per_m": 10.0,
}
ROBOTS_NETWORK = {path: value for path, value in NETWORK.items() if path != "controller.gate_time_constant_ms"}
OF_PRESETS = {
    "riddle2023": PUBLISHED | PAPER_S_FORMULATION,
    "riddle2023-rods": PUBLISHED,
    "daltorio2013": NETWORK,
    "boxerbaum2012": NETWORK,
    "riddle2022-planar": NETWORK | PLANAR,
    "wang": ROBOTS,
    "wang-network": ROBOTS_NETWORK,
    "riddle2025": ROBOTS | AUTHORS_SERVOS_AND_RODS | ROBOTS_NETWORK,
}


def test_presets_have_the_published_numbers() -> None:
    has = {name: {path: value_at(name, path) for path in numbers} for name, numbers in OF_PRESETS.items()}
    assert has == OF_PRESETS


def test_the_peak_force_is_the_compiler_s_of_the_paper_s_time() -> None:
    assert value_at("riddle2023", "body.rings.peak_force_N") == pytest.approx(550_000 / 4678, abs=0.01)


def test_the_sprung_rods_ties_and_damping_are_near_the_chain_s() -> None:
    """Calibrated near what the chain's pin constraints have, 24 N/m, and below its joints' damping."""
    sprung = Case("riddle2023-fast")
    assert tie_stiffness_N_per_m(sprung) == pytest.approx(tie_stiffness_N_per_m(Case("riddle2023")), rel=0.15)
    body = sprung.config.body
    assert isinstance(body, WormBody)
    assert isinstance(body.formulation, Rods)
    assert body.formulation.pin_damping_Ns_per_m == pytest.approx(DAMPING_TIME_S * tie_stiffness_N_per_m(sprung))
    assert 0.5 < body.strands.damping_time_s / value_at("riddle2023", "body.strands.damping_time_s") < 1.0  # type: ignore[operator]


def test_the_chain_s_joints_damp_as_in_the_paper_s_files() -> None:
    """0.12 N m s/rad in bending between two elements of a third of a side."""
    body = load_config("riddle2023").body
    assert isinstance(body, WormBody)
    element_m = float(np.linalg.norm(np.diff(body.geometry().vertices_m[0], axis=0), axis=1).max())
    joint = body.strands.damping_time_s * body.strands.bending_rigidity_Nm2 / element_m
    assert joint == pytest.approx(0.12, rel=1e-3)


def differing(one: str, other: str) -> set[str]:
    """Paths of the fields in which two presets differ."""
    configs = load_config(one), load_config(other)
    assert fields_of(configs[0]).keys() == fields_of(configs[1]).keys()
    return {path for path in fields_of(configs[0]) if value_at(one, path) != value_at(other, path)}


def test_the_crawlers_have_the_robot_s_body() -> None:
    """What a comparison of speeds forbids to tune: mass, mesh, springs, friction, and the rings' forces and speed."""
    tuned = {"name", "summary", "controller.gate_time_constant_ms", "controller.activation_slope_per_mV"}
    steps = {"clock.physics_timestep_s", "record.signals_interval_s"}
    assert differing("crawler", "riddle2025-muscles") == tuned | steps
    for gait, robot in (("crawler-timed", "riddle2025-muscles"), ("crawler-servo", "riddle2025")):
        own, other = (load_config(name).model_dump() for name in (gait, robot))
        assert own["arena"] == other["arena"]
        rings = own["body"].pop("rings"), other["body"].pop("rings")
        assert own["body"] == other["body"]
        differ = {name for name in rings[0] if rings[0][name] != rings[1][name]}
        assert differ == ({"force_limit_N", "speed_limit_m_per_s"} if gait == "crawler-servo" else set())
    assert value_at("crawler-servo", "body.rings.speed_limit_m_per_s") == 0.064
    assert value_at("crawler-servo", "body.rings.force_limit_N") == 13.0


@pytest.mark.parametrize(
    ("preset", "n_segments", "n_crossings", "length_m"), [("wang", 4, 114, 0.71), ("riddle2025", 6, 120, 0.75)]
)
def test_the_robots_have_the_authors_size_density_and_weight(
    preset: str, n_segments: int, n_crossings: int, length_m: float
) -> None:
    config = load_config(preset)
    assert isinstance(config.body, WormBody)
    geometry = config.body.geometry()
    assert (geometry.n_segments, geometry.n_crossings) == (n_segments, n_crossings)
    assert geometry.length_m == pytest.approx(length_m, abs=0.002)
    strands = config.body.strands
    assert strands.one_number("linear_density_kg_per_m") == pytest.approx(571.6 * pi * strands.radius_m**2, rel=1e-3)
    mass = strands.one_number("linear_density_kg_per_m") * geometry.strand_length_m * geometry.n_strands
    mass += config.body.pins.one_number("mass_kg") * geometry.n_crossings
    assert mass == pytest.approx(1.981, rel=0.005)
