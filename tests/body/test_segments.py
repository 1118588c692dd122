"""Segments that differ: what a list of one number per segment means, and what a worm makes of it."""

from __future__ import annotations

from math import pi, sin
from typing import Any

import mujoco
import numpy as np
import pytest

from annelid.body import build_spec, compile_spec
from annelid.body.assemble import mjcf_text
from annelid.body.worm import WormBody
from annelid.config import RunConfig, field_value, load_config
from annelid.errors import ConfigError
from annelid.morphology import MeshGeometry
from annelid.plausibility import check
from annelid.simulation.worm import WormPlant
from rods import rods_of, tolerance_window_m

RODS = "riddle2023-rods"
TAPER_M = [0.16, 0.14, 0.12]
TAPERED: dict[str, Any] = {
    "body.mesh.radius_m": TAPER_M,
    "body.rings.length_range_m": [[6.0 * 0.59 * radius, 6.0 * 1.11 * radius] for radius in TAPER_M],
}
FIELDS = (
    "body.mesh.radius_m",
    "body.strands.young_modulus_Pa",
    "body.strands.shear_modulus_Pa",
    "body.strands.linear_density_kg_per_m",
    "body.pins.mass_kg",
    "body.springs.stiffness_N_per_m",
    "body.springs.rest_length_m",
)
EVEN = {"body.mesh.rear_overhang_m": None, "body.mesh.elements_per_end": 1, "body.mesh.elements_per_side": 2}
"""A mesh whose rear is the image of its front."""
WEAK = [0.0, 0.01, 0.0]
"""Activation of the middle muscle by which it lengthens its segment by a third."""


def body_of(config: RunConfig) -> WormBody:
    assert isinstance(config.body, WormBody)
    return config.body


def mesh(config: RunConfig) -> MeshGeometry:
    return body_of(config).geometry()


def compiled(config: RunConfig) -> mujoco.MjModel:
    return compile_spec(build_spec(config, for_plant=True))


def test_a_list_of_another_length_is_refused_by_name(subtests: pytest.Subtests) -> None:
    for given, problem in (
        ([1.0, 1.0], "has 2 numbers for 3 segments: give a number, or 3 numbers, one per segment"),
        ([], "must be a number, or a list of numbers, one per segment"),
    ):
        for path in (*FIELDS, "body.rings.peak_force_N"):
            with subtests.test(path), pytest.raises(ConfigError, match=f"{path} = .*{problem}"):
                load_config(RODS, {path: given})


def test_a_bad_number_of_a_list_is_told_with_its_place() -> None:
    with pytest.raises(ConfigError, match=r"^body.springs.stiffness_N_per_m.1 = -1: must be at least 0$"):
        load_config(RODS, {"body.springs.stiffness_N_per_m": [1, -1, 1]})
    with pytest.raises(ConfigError, match=r"young_modulus_Pa = \[.*differs among the segments"):
        body_of(load_config(RODS, {"body.strands.young_modulus_Pa": [1e8, 2e8, 1e8]})).strands.one_number(
            "young_modulus_Pa"
        )


@pytest.mark.parametrize("preset", [RODS, "riddle2023", "wang"])
def test_equal_numbers_make_the_model_of_the_one_number_bit_for_bit(preset: str) -> None:
    one = load_config(preset)
    n = one.body.n_segments
    lists = {path: [value] * n for path in FIELDS if (value := field_value(one, path)) is not None}
    first, second = compiled(one), compiled(load_config(preset, lists))
    for name in dir(first):
        if isinstance(array := getattr(first, name), np.ndarray):
            assert array.tobytes() == getattr(second, name).tobytes(), name


def test_rings_of_a_tapering_worm_are_polygons_of_its_radius_there() -> None:
    config = load_config(RODS, TAPERED)
    geometry = mesh(config)
    assert geometry.ring_length_m == pytest.approx([2.0 * radius * sin(pi / 6) * 6 for radius in TAPER_M])
    radius = np.hypot(geometry.vertices_m[..., 1], geometry.vertices_m[..., 2] - 0.16)
    rings_m = geometry.plane_x_m[geometry.ring_planes]
    expected = np.interp(geometry.vertices_m[0, :, 0], rings_m, TAPER_M)
    assert radius == pytest.approx(np.broadcast_to(expected, radius.shape))
    plant = WormPlant(config)
    assert plant.posture.ring_length == pytest.approx(geometry.ring_length_m)
    slant = 0.02 / (rings_m[1] - rings_m[0])
    assert plant.anatomy.rest_stretch_m[1] == pytest.approx(np.hypot(1.0, slant) * 4 * pi / 12 / 14.0, rel=1e-3)


@pytest.mark.parametrize(
    ("preset", "radii_m"), [(RODS, TAPER_M[::-1]), (RODS, [0.16, 0.12, 0.16]), ("riddle2023", TAPER_M)]
)
def test_a_tapering_worm_starts_on_its_belly(preset: str, radii_m: list[float]) -> None:
    ranges = [[0.59 * 6.0 * radius, 1.11 * 6.0 * radius] for radius in radii_m]
    changes = {"body.mesh.radius_m": radii_m, "body.rings.length_range_m": ranges}
    plant = WormPlant(load_config(preset, changes))
    rings = plant.posture.crossing[plant.geometry.rings]
    lowest = rings[..., 2].min(axis=1)
    assert lowest[0] == pytest.approx(lowest[-1], abs=0.005)
    # The lowest vertex of a strand lies at most a chord's height below the lowest crossings.
    assert 0.0 <= lowest.min() <= 0.16 * (1.0 - np.cos(pi / 6)) + 1e-3
    assert plant.posture.ring_length == pytest.approx(plant.geometry.ring_length_m)
    assert plant.elastic_energy_J() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("preset", [RODS, "riddle2023"])
def test_masses_of_segments_add_up(preset: str) -> None:
    """Pins by their plane, strands by the middle of each element: the nearest ring, midway the mean of two."""
    pins, lines = [0.001, 0.002, 0.004], [0.01, 0.03, 0.02]
    config = load_config(preset, {"body.pins.mass_kg": pins, "body.strands.linear_density_kg_per_m": lines})
    geometry = mesh(config)
    # Planes 0 to 4 are the first ring's, 5 lies midway.
    by_plane = [pins[0]] * 5 + [0.0015] + [pins[1]] * 3 + [0.003] + [pins[2]] * 5
    x, lengths = geometry.vertices_m[0, :, 0], np.linalg.norm(np.diff(geometry.vertices_m[0], axis=0), axis=1)
    midway = geometry.plane_x_m[[5, 9]]
    of_element = np.array(lines)[np.searchsorted(midway, (x[1:] + x[:-1]) / 2)]
    expected = 6 * sum(by_plane) + 12 * float(of_element @ lengths)
    model = compiled(config)
    # Hinges, and the coordinate that dampers refer to, have next to no mass.
    assert float(model.body_mass.sum()) == pytest.approx(expected, rel=2e-5)


def test_springs_pull_by_the_rate_and_the_length_of_their_segment() -> None:
    rates, lengths = [10.0, 30.0, 20.0], [0.06, 0.05, 0.07]
    changes = {"body.springs.stiffness_N_per_m": rates, "body.springs.rest_length_m": lengths}
    model = compiled(load_config(RODS, changes))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    geometry = mesh(load_config(RODS))
    springs = [model.tendon(f"spring_{index}").id for index in range(len(geometry.springs))]
    pull = model.tendon_stiffness[springs] * (data.ten_length[springs] - model.tendon_lengthspring[springs, 1])
    # Seven bays of six springs, on planes 0-2, 2-4, .. 12-14; that on 4-6 and that on 8-10 lie midway.
    of_bay = [(10.0, 0.06)] * 2 + [(20.0, 0.055), (30.0, 0.05), (25.0, 0.06)] + [(20.0, 0.07)] * 2
    along = 4 * pi / 12 / 14.0
    expected = [rate * (along - rest) for rate, rest in of_bay]
    assert pull.reshape(7, 6) == pytest.approx(np.repeat(expected, 6).reshape(7, 6), rel=1e-9)


@pytest.fixture(scope="module")
def weightless() -> dict[str, Any]:
    return {"arena.gravity_m_per_s2": 0.0, "arena.floor_gap_m": 5.0, "guard.height_m": 10.0, **EVEN}


def elongation(changes: dict[str, Any], activation: list[float]) -> np.ndarray:
    """By how much every segment is longer after 0.6 s under a constant activation, m."""
    plant = WormPlant(load_config(RODS, changes))
    rest = plant.posture.stretch.mean(axis=1)
    for _ in range(600):
        plant.step(np.array(activation))
    return plant.posture.stretch.mean(axis=1) - rest


def test_a_reversed_worm_moves_as_the_mirror_image(weightless: dict[str, Any]) -> None:
    lists: dict[str, list[Any]] = {
        **TAPERED,
        "body.springs.stiffness_N_per_m": [20.0, 40.0, 30.0],
        "body.strands.young_modulus_Pa": [3e8, 4e8, 6e8],
        "body.strands.shear_modulus_Pa": [2e8, 3e8, 4e8],
        "body.strands.linear_density_kg_per_m": [0.013, 0.02, 0.03],
        "body.pins.mass_kg": [0.001, 0.002, 0.003],
    }
    there = elongation({**weightless, **lists}, [0.7, 0.2, 0.0])
    back = elongation({**weightless, **{path: value[::-1] for path, value in lists.items()}}, [0.0, 0.2, 0.7])
    assert np.abs(there).max() > 0.02
    assert back[::-1] == pytest.approx(there, abs=1e-3 * there.max())


def test_the_check_names_the_segment_that_does_not_fit() -> None:
    found = check(load_config(RODS, {"body.mesh.radius_m": [0.16, 0.16, 0.05]}))
    (first, *_) = found
    assert (first.field, first.severity) == ("body.rings.length_range_m", "error")
    assert first.problem.startswith("segment 3: a ring is 0.3 m long at rest")
    assert not [one for one in check(load_config(RODS, TAPERED)) if one.severity == "error"]
    assert tolerance_window_m(load_config(RODS)) is not None
    assert tolerance_window_m(load_config(RODS, TAPERED)) is None


def test_stiffness_along_rods_is_no_mjcf() -> None:
    stiffer = {"body.strands.young_modulus_Pa": [3e8, 6e8, 3e8]}
    with pytest.raises(ConfigError, match="cannot be written as MJCF"):
        mjcf_text(load_config(RODS, stiffer))
    assert mujoco.MjModel.from_xml_string(mjcf_text(load_config(RODS, TAPERED))).nflex == 12
    assert mujoco.MjModel.from_xml_string(mjcf_text(load_config("riddle2023", stiffer))).nflex == 0


def test_damping_of_rods_is_in_proportion_to_their_stiffness_there() -> None:
    plain = rods_of(WormPlant(load_config(RODS))).strains
    differ = rods_of(WormPlant(load_config(RODS, {"body.strands.young_modulus_Pa": [3e8, 6e8, 9e8]}))).strains
    geometry = mesh(load_config(RODS))
    x, midway = geometry.vertices_m[0, 1:-1, 0], geometry.plane_x_m[[5, 9]]
    shares = np.select(
        [np.isclose(x, midway[0]), np.isclose(x, midway[1]), x < midway[0], x < midway[1]], [1.5, 2.5, 1.0, 2.0], 3.0
    )
    # Bending alone follows Young's modulus.
    bends = differ._damping[..., :2] / plain._damping[..., :2]
    assert bends == pytest.approx(np.broadcast_to(shares[:, np.newaxis], bends.shape))
