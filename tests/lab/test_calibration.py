"""Identification: closed forms, errors of points, intervals that hold the truth, and data with defects."""

from __future__ import annotations

import importlib.util
import json
import tempfile
from collections.abc import Callable
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from annelid.body.worm import WormBody
from annelid.config import RunConfig, load_config
from annelid.errors import AnnelidError, ConfigError
from annelid.experiment.parameter_errors import read_spread
from annelid_lab.calibration.base import Data
from annelid_lab.calibration.doubts import confused
from annelid_lab.calibration.kinds.load_frame import FrameTest
from annelid_lab.calibration.kinds.ring_down import RingDown, first_root
from annelid_lab.calibration.kinds.tensile import Tensile, bending_secant, stress
from annelid_lab.calibration.noise import Noise, estimated
from annelid_lab.calibration.report import Identified, identify, tables, write_identified
from annelid_lab.calibration.simulations import Simulations
from annelid_lab.calibration.study import ROBOT, load_identify_study
from annelid_lab.logs.agreement import run_series
from outcome import Command

TUBE: dict[str, Any] = {
    "kind": "tensile",
    "name": "tube",
    "data": "tube.csv",
    "length_m": 0.034417,
    "outer_diameter_m": 0.00635,
    "inner_diameter_m": 0.004318,
}
STRAND: dict[str, Any] = {"kind": "ring-down", "name": "strand", "data": "strand.csv", "length_m": 1.2}
WORM = {"body.strands.radius_m": 0.00299, "body.strands.linear_density_kg_per_m": 0.01605}
TRUTH = {"young_modulus": 0.3e9, "softening_strain": 0.008, "damping_time": 0.06}
Table = dict[str, NDArray[Any]]


def study_of(parameters: dict[str, Any], *experiments: dict[str, Any]) -> dict[str, Any]:
    return {"preset": "riddle2023-rods", "set": WORM, "parameters": parameters, "experiments": list(experiments)}


def worm_of(young: float = TRUTH["young_modulus"], damping: float = TRUTH["damping_time"]) -> RunConfig:
    return load_config("riddle2023-rods", WORM | {
        "body.strands.young_modulus_Pa": young, "body.strands.damping_time_s": damping
    })  # fmt: skip


def tube_table(rng: np.random.Generator, noise_N: float = 0.3, n: int = 200) -> Table:
    elongation = np.linspace(0.0, 1.05e-3, n)
    tube = Tensile.model_validate(TUBE | {"softening_strain": TRUTH["softening_strain"]})
    force = tube.tension(worm_of(), elongation / tube.length_m) + rng.normal(0.0, noise_N, n)
    return {"time_s": 0.1 * np.arange(n), "elongation_mm": 1e3 * elongation, "force_N": force}


def strand_table(rng: np.random.Generator, noise_m: float = 3e-4, n: int = 400, **worm: Any) -> Table:
    time_s = 0.015 * np.arange(n)
    frequency, rate = RingDown.model_validate(STRAND).mode(load_config(worm_of().model_dump(exclude_none=True), worm))
    tip = 0.05 * np.exp(-rate * time_s) * np.cos(sqrt(frequency**2 - rate**2) * time_s) + rng.normal(0.0, noise_m, n)
    return {"time_s": time_s, "displacement_mm": 1e3 * tip}


def write(path: Path, table: Table) -> None:
    np.savetxt(path, np.column_stack([*table.values()]), delimiter=",", header=",".join(table), comments="")


def both(folder: Path, seed: int = 1, **more: Any) -> Identified:
    rng = np.random.default_rng(seed)
    write(folder / "tube.csv", tube_table(rng))
    write(folder / "strand.csv", strand_table(rng))
    parameters = {name: {} for name in TRUTH}
    return identify(load_identify_study(study_of(parameters, TUBE | more, STRAND)), folder)


# The tube, and a strand that rings down


def test_a_tube_of_a_law_that_hardly_softens_is_linear() -> None:
    assert bending_secant(0.02, 1e4, 0.68) == pytest.approx(1.0, abs=1e-5)
    assert stress(np.array([-0.01, 0.01]), 1e4) == pytest.approx([-0.01, 0.01], rel=1e-5)


@pytest.mark.parametrize("bore", [0.0, 0.68])
def test_the_moment_of_a_tube_is_that_of_its_stress_over_the_section(bore: float) -> None:
    """Against strips of a round section, counted."""
    strain, softening = 0.02, 0.007
    y, z = np.meshgrid(*[np.linspace(-1.0, 1.0, 2001)[:-1] + 5e-4] * 2)
    inside = (y**2 + z**2 <= 1.0) & (y**2 + z**2 >= bore**2)
    moment = (y * stress(strain * y, softening))[inside].sum() / (strain * y**2)[inside].sum()
    assert bending_secant(strain, softening, bore) == pytest.approx(moment, rel=1e-3)


def test_one_law_fits_the_measured_tube_within_5_percent_up_to_3_percent_strain() -> None:
    study = load_identify_study(ROBOT)
    alone = study.model_copy(update={"experiments": study.experiments[:1]}).only(["young_modulus", "softening_strain"])
    found = identify(alone, ROBOT.parent)
    (part,) = found.fit.parts
    assert part.rms < 0.02 * part.data.values.max()
    # Below, a newton of preload and the clamps' play count for more.
    beyond_slack = part.data.at > 0.003
    assert np.abs(part.residual / part.data.values)[beyond_slack].max() < 0.05
    assert found.fit.values["softening_strain"] == pytest.approx(0.007, rel=0.15)


def test_a_cantilever_has_the_frequency_of_beam_theory() -> None:
    assert first_root(0.0) == pytest.approx(1.8751041)
    heavy = RingDown.model_validate(STRAND | {"tip_mass_kg": 20.0})
    body = worm_of().body
    assert isinstance(body, WormBody)
    frequency, rate = heavy.mode(worm_of())
    # A mass on a massless beam, but for 33/140 of the beam's own.
    expected = sqrt(3 * body.strands.bending_rigidity_Nm2 / 1.2**3 / (20.0 + 33 / 140 * 0.01605 * 1.2))
    assert frequency == pytest.approx(expected, rel=1e-5)
    assert rate == pytest.approx(frequency**2 * 0.06 / 2)


# Errors of points


def slow_points(rng: np.random.Generator, noise: Noise, n: int = 150) -> Data:
    at = np.sort(rng.uniform(0.0, 10.0, n))
    data = Data(at, np.zeros(n), np.zeros(n, dtype=int), ("x", "y"), "1")
    return Data(at, noise.root(data) @ rng.normal(size=n), data.series, data.labels, "1")


def test_white_noise_leaves_every_point_and_a_slow_error_few() -> None:
    data = slow_points(np.random.default_rng(0), Noise(1.0))
    assert Noise(1.0).effective_points(data) == pytest.approx(150)
    assert Noise(0.01, 1.0, 5.0).effective_points(data) < 5
    found = estimated(data, data.values, np.ones((150, 1)), np.zeros((1, 1)), None)
    assert found.noise == pytest.approx(1.0, abs=0.25)
    assert found.effective_points(data) > 60
    assert estimated(data, data.values, np.ones((150, 1)), np.zeros((1, 1)), 0.7).noise == 0.7


# Fits


def test_several_experiments_are_fitted_at_once(tmp_path: Path) -> None:
    found = both(tmp_path)
    assert found.fit.values == pytest.approx(TRUTH, rel=0.05)
    truth = np.array([*TRUTH.values()])
    ends = found.intervals.profile
    assert ((ends[:, 0] < truth) & (truth < ends[:, 1])).all()
    assert (ends[:, 1] / ends[:, 0] < 1.25).all()
    # Profile and linear theory agree, since the model is nearly linear over so short a way.
    reach = found.intervals.quantile * found.intervals.relative_error
    linear = np.exp(found.fit.logs[:, None] + np.outer(reach, [-1.0, 1.0]))
    assert ends == pytest.approx(linear, rel=0.03)
    assert not found.warnings
    assert found.fit.n_tests == 0


def test_an_experiment_with_another_payload_is_fitted_beside_the_first(tmp_path: Path) -> None:
    density = "body.strands.linear_density_kg_per_m"
    rng = np.random.default_rng(1)
    write(tmp_path / "strand.csv", strand_table(rng))
    write(tmp_path / "heavy.csv", strand_table(rng, 3e-4, 400, **{density: 0.05}))
    heavy = STRAND | {"name": "heavy", "data": "heavy.csv", "set": {density: 0.05}}
    found = identify(load_identify_study(study_of({"young_modulus": {}, "damping_time": {}}, STRAND, heavy)), tmp_path)
    assert [*found.fit.values.values()] == pytest.approx([0.3e9, 0.06], rel=0.02)
    assert not found.warnings


def test_an_experiment_that_is_held_out_is_predicted_from_the_others(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    write(tmp_path / "strand.csv", strand_table(rng))
    payload: dict[str, Any] = {"body.strands.linear_density_kg_per_m": 0.03}
    write(tmp_path / "heavy.csv", strand_table(rng, **payload))
    held = STRAND | {"name": "heavy", "data": "heavy.csv", "set": payload}
    study = study_of({"young_modulus": {}, "damping_time": {}}, STRAND, held)
    with pytest.raises(ConfigError, match="unknown experiment 'heay': did you mean 'heavy'"):
        load_identify_study(study).holding_out(["heay"])
    write(tmp_path / "tube.csv", tube_table(rng))
    of_both = load_identify_study(study_of({"softening_strain": {}, "damping_time": {}}, STRAND, TUBE))
    with pytest.raises(ConfigError, match="softening_strain is only of an experiment that is held out"):
        identify(of_both.holding_out(["tube"]), tmp_path)
    found = identify(load_identify_study(study).holding_out(["heavy"]), tmp_path)
    strand, heavy = found.fit.parts
    assert (len(strand.held.at), len(heavy.data.at)) == (0, 0)
    n, inside = found.intervals.held_out["heavy"]
    assert n == len(heavy.held.at) == len(strand.data.at)
    assert 0.9 <= inside / n <= 0.99
    assert heavy.noise == strand.noise
    assert heavy.rms == pytest.approx(strand.rms, rel=0.3)
    assert [*tables(found)[1].columns[4].cells] == [
        f"{strand.noise.effective_points(strand.data):.1f} of {n}",
        "not fitted",
    ]
    alone = identify(load_identify_study(study_of(study["parameters"], STRAND)), tmp_path)
    assert found.fit.values == pytest.approx(alone.fit.values, rel=1e-6)
    written = json.loads(write_identified(found, tmp_path)[0].read_text())["experiments"]["heavy"]
    assert (written["held_out"], written["fitted"]) == (n, [])
    assert len(written["held_out_predicted"]) == len(written["held_out_half_interval"]) == n
    light = identify(
        load_identify_study(study_of(study["parameters"], STRAND, held | {"set": {}})).holding_out(["heavy"]), tmp_path
    )
    assert "points held out lie in their predicted intervals" in light.warnings[-1]


def test_the_noise_of_an_experiment_that_is_held_out_is_known_or_that_between_neighbours(tmp_path: Path) -> None:
    write(tmp_path / "tube.csv", tube_table(np.random.default_rng(4), noise_N=0.5))
    tube = Tensile.model_validate(TUBE)
    data = tube.read(tmp_path)
    assert tube.noise_held_out(data) == pytest.approx(0.5 / sqrt(200 / len(data.at)), rel=0.3)
    assert Tensile.model_validate(TUBE | {"noise_sd": 0.2}).noise_held_out(data) == pytest.approx(0.2)


def test_what_the_data_cannot_tell_apart_is_said(tmp_path: Path) -> None:
    write(tmp_path / "strand.csv", strand_table(np.random.default_rng(1)))
    density = {"start": 0.02, "low": 0.002, "high": 0.2, "fields": {"body.strands.linear_density_kg_per_m": 1.0}}
    study = study_of({"young_modulus": {}, "damping_time": {}, "density": density}, STRAND)
    found = identify(load_identify_study(study), tmp_path)
    (sentence, *_) = found.warnings
    assert "do not tell young_modulus and density apart" in sentence
    prior = {"mean": 0.01605, "sd": 0.0005}
    study["parameters"]["density"] = density | {"prior": prior}
    known = identify(load_identify_study(study), tmp_path)
    assert known.fit.values["young_modulus"] == pytest.approx(0.3e9, rel=0.1)
    assert known.intervals.relative_error[0] == pytest.approx(0.0005 / 0.01605, rel=0.2)


def test_a_parameter_that_changes_nothing_is_named() -> None:
    sentences = confused(("a", "b"), np.eye(2), np.array([1e6, 0.01]), np.array([[0.0, 1.0], [1.0, 0.0]]))
    assert len(sentences) == 1
    assert sentences[0].startswith("the data do not determine b: its relative error is 1e+06")


def test_a_stiffer_tube_widens_the_intervals_by_its_discrepancy(tmp_path: Path) -> None:
    """A linear law cannot follow the tube: the size of what it leaves out is reported and counts."""
    write(tmp_path / "tube.csv", tube_table(np.random.default_rng(1)))
    law = identify(load_identify_study(study_of({"young_modulus": {}, "softening_strain": {}}, TUBE)), tmp_path)
    line = identify(load_identify_study(study_of({"young_modulus": {}}, TUBE)), tmp_path)
    assert line.fit.parts[0].noise.discrepancy > 10 * law.fit.parts[0].noise.discrepancy
    assert line.fit.parts[0].noise.effective_points(line.fit.parts[0].data) < 10
    assert line.intervals.relative_error[0] > 5 * law.fit.parts[0].rms / law.fit.parts[0].data.values.max()


# Load frame and walk, with stand-ins for the engine where it would take long


def stand_in(test: FrameTest, config: RunConfig) -> dict[str, NDArray[np.float64]]:
    body = config.body
    assert isinstance(body, WormBody)
    x = np.concatenate([np.linspace(0, 0.3, 400), np.linspace(0.3, 0, 400)[1:]])
    friction = 0.0 if body.joints is None else 100 * body.joints.dry_friction_Nm
    elastic = (
        30e-9 * body.strands.one_number("young_modulus_Pa") * x
        + 0.1 * body.springs.one_number("stiffness_N_per_m") * x**2
    )
    return {"displacement_m": x, "tension_N": elastic + np.where(np.arange(len(x)) < 400, friction, -friction)}


FRAME = {"kind": "load-frame", "name": "frame", "data": "loop.csv"}


def test_a_study_of_one_loop_finds_the_worm_that_made_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FrameTest, "run", stand_in)
    made = load_config("riddle2023-rods", {"body.strands.young_modulus_Pa": 7e8, "body.joints.dry_friction_Nm": 0.013})
    loop = stand_in(FrameTest(0.3, 0.01, 8.0), made)
    way = 1e3 * loop["displacement_m"]
    side = np.where(np.arange(len(way)) < 400, 0.9 / (1 - np.exp(-0.9)), 0.9 / (np.exp(0.9) - 1))
    force = side * loop["tension_N"] + np.random.default_rng(1).normal(0.0, 0.02, len(way))
    # As the authors' file: no header.
    np.savetxt(tmp_path / "loop.csv", np.column_stack([way, force]), delimiter=",")
    parameters = {"young_modulus": {}, "dry_friction": {}, "cable_friction": {}}
    study = load_identify_study(study_of(parameters, FRAME))
    first = Simulations(tmp_path / "kept")
    found = identify(study, tmp_path, first)
    assert [*found.fit.values.values()] == pytest.approx([7e8, 0.013, 0.9], rel=0.02)
    assert found.fit.parts[0].numbers["lost_share_fitted"] == pytest.approx(
        found.fit.parts[0].numbers["lost_share_measured"], abs=0.01
    )
    assert first.computed > 5
    again = Simulations(tmp_path / "kept")
    identify(study, tmp_path, again)
    assert again.computed == 0


@pytest.mark.slow
def test_a_walk_identifies_the_gates_of_a_planar_worm(tmp_path: Path) -> None:
    from annelid.simulation.loop import simulate

    field = "controller.gate_time_constant_ms"
    config = load_config("riddle2022-planar", {"duration_s": 6.0, field: 330.0})
    run = simulate(config, tmp_path / "run", progress=False)
    clock = np.arange(0.0, 4.5, 0.02)
    table: Table = {"t_s": clock}
    for segment in (1, 2):
        time_s, values, _ = run_series(run, f"stretch_length[{segment}, 0]")
        noise = np.random.default_rng(segment).normal(0.0, 3e-4, len(clock))
        table[f"s{segment}_mm"] = 1e3 * (np.interp(clock + 0.8, time_s, values) + noise)
    write(tmp_path / "walk.csv", table)
    (tmp_path / "map.toml").write_text(
        'time = "t_s"\n[map]\ns1_mm = "stretch_length[1, 0]"\ns2_mm = "stretch_length[2, 0]"\n'
    )
    gates = {"start": 315.0, "low": 200.0, "high": 500.0, "unit": "ms", "fields": {field: 1.0}}
    walk = {"kind": "walk", "name": "walk", "data": "walk.csv", "map": "map.toml"}
    study = {
        "preset": "riddle2022-planar",
        "set": {"duration_s": 6.0},
        "parameters": {"gates": gates},
        "experiments": [walk],
    }
    found = identify(load_identify_study(study), tmp_path)
    assert found.fit.values["gates"] == pytest.approx(330.0, rel=0.01)
    study["set"] = {"duration_s": 2.0}
    with pytest.raises(ConfigError, match="raise duration_s"):
        identify(load_identify_study(study), tmp_path)


# What is written


def test_a_study_is_written_as_numbers_a_worm_and_a_picture(tmp_path: Path) -> None:
    found = both(tmp_path, hold_out=[[0.5, 0.75]])
    n, inside = found.intervals.held_out["tube"]
    assert n == 10
    assert inside >= 8, "they lie in the intervals predicted for them"
    report, worm, picture = write_identified(found, tmp_path)
    assert picture.stat().st_size > 10_000
    body = load_config(worm).body
    assert isinstance(body, WormBody)
    assert body.strands.young_modulus_Pa == pytest.approx(found.fit.values["young_modulus"], rel=1e-3)
    assert body.strands.radius_m == 0.00299
    numbers = json.loads(report.read_text())
    one = numbers["parameters"]["damping_time"]
    assert one["low"] < one["value"] < one["high"]
    assert numbers["experiments"]["tube"]["held_out"] == 10
    assert {"discrepancy_sd", "effective_points", "rms"} <= set(numbers["experiments"]["tube"])
    spread = read_spread(report)
    assert spread.relative_error == pytest.approx(found.intervals.relative_error)
    assert len(tables(found)) == 2


# Defects of studies and of their tables


def changed(**columns: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Callable[[Table], Table]:
    return lambda table: {name: columns.get(name, lambda one: one)(column) for name, column in table.items()}


def renamed(old: str, new: str) -> Callable[[Table], Table]:
    return lambda table: {new if name == old else name: column for name, column in table.items()}


def emptied(force: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.arange(len(force)) % 3, force, np.nan)


def whole(table: Table) -> Table:
    return table


def test_a_defect_is_refused_in_a_sentence(subtests: pytest.Subtests, tmp_path: Path) -> None:
    cases: tuple[tuple[Callable[[Table], Table], dict[str, Any], str], ...] = (
        (renamed("force_N", "load_N"), {}, "no column 'force_N'"),
        (renamed("force_N", "force_mm"), {"tube": {"force": "force_mm"}}, "is in m, not in N"),
        (changed(force_N=lambda force: 1e3 * force), {}, "is a unit wrong"),
        (changed(force_N=lambda force: np.full_like(force, 3.0)), {}, "never changes"),
        (lambda table: {name: column[:6] for name, column in table.items()}, {}, "6 rows"),
        (whole, {"tube": {"data": "../tube.csv"}}, "must lie beside the study"),
        (whole, {"parameters": {"young_modulus": {"low": 5e9, "high": 1e8}}}, "low = 5e\\+09 must be below high"),
        (whole, {"parameters": {"young_modulus": {"start": 1.0}}}, "start = 1 must be from low"),
        (whole, {"parameters": {}}, "must name parameters"),
        (whole, {"parameters": {"damping_time": {}, "cable_friction": {}}}, "no experiment has one of its fields"),
        (whole, {"preset": "riddle2203-rods"}, "did you mean 'riddle2023-rods'"),
        (whole, {"tube": {"inner_diameter_m": 0.01}}, "must be less than outer_diameter_m"),
        (whole, {"tube": {"hold_out": [[0.0, 0.95]]}}, "points to fit"),
        (whole, {"tube": {"hold_out": [[0.0, 1.0]]}}, "leaves nothing to fit"),
        (whole, {"tube": {"set": {"body.strands.young_modulus_Pa": 1e8}}}, "is fitted by a parameter"),
    )
    for damage, study, says in cases:
        with subtests.test(f"{damage!r:.60}"):
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            write(folder / "tube.csv", damage(tube_table(np.random.default_rng(1))))
            tube = TUBE | study.pop("tube", {})
            with pytest.raises(AnnelidError, match=says) as error:
                identify(load_identify_study(study_of({"young_modulus": {}}, tube) | study), folder)
            assert len(str(error.value)) < 700
            assert "\n" not in str(error.value)


def test_a_file_that_a_link_leads_elsewhere_is_refused(tmp_path: Path) -> None:
    (tmp_path / "outside.csv").write_text("time_s\n")
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "tube.csv").symlink_to(tmp_path / "outside.csv")
    with pytest.raises(ConfigError, match="must lie beside the study"):
        identify(load_identify_study(study_of({"young_modulus": {}}, TUBE)), tmp_path / "study")


def test_gaps_and_empty_cells_are_handled_and_noted(tmp_path: Path) -> None:
    table = changed(force_N=emptied)(tube_table(np.random.default_rng(1)))
    kept = np.r_[0:80, 130:200]
    write(tmp_path / "tube.csv", {name: column[kept] for name, column in table.items()})
    notes: list[str] = []
    study = load_identify_study(study_of({"young_modulus": {}, "softening_strain": {}}, TUBE))
    found = identify(study, tmp_path, note=notes.append)
    assert found.fit.values["young_modulus"] == pytest.approx(0.3e9, rel=0.1)
    assert any("missing" in note for note in notes)


@pytest.mark.slow
def test_synthetic_robots_are_identified_blind(tmp_path: Path) -> None:
    path = Path(__file__).parents[2] / "benchmarks" / "identify_recovery.py"
    spec = importlib.util.spec_from_file_location("identify_recovery", path)
    assert spec is not None
    assert spec.loader is not None
    recovery: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(recovery)
    recovery.main(tmp_path / "found.csv", 2)
    rows = (tmp_path / "found.csv").read_text().splitlines()[1:]
    assert len(rows) == 10
    numbers = [[float(cell) for cell in row.split(",")[2:]] for row in rows]
    inside = [low <= truth <= high for truth, _, low, high, *_ in numbers]
    assert np.mean(inside) >= 0.8


@pytest.mark.parametrize("example", ["walk", "robot"])
def test_an_example_comes_with_its_data_and_replaces_none(annelid: Command, example: str) -> None:
    done = annelid("calibrate", "--example", example, "-o", "new/folder")
    assert done.exit_code == 0, done.err
    folder = Path("new/folder")
    study = load_identify_study(folder / "study.toml")
    assert all(len(one.read(folder).at) >= 8 for one in study.experiments)
    data = next(path for path in folder.iterdir() if path.suffix == ".csv")
    (folder / "study.toml").unlink()
    data.write_text("mine")
    assert annelid("calibrate", "--example", example, "-o", "new/folder").exit_code == 2
    assert data.read_text() == "mine"
