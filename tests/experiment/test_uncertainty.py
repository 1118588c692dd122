"""Error bars: the draw, how errors are joined, and what a study does with its runs."""

from __future__ import annotations

import json
import shlex
import tempfile
from collections.abc import Mapping
from math import exp, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import annelid
from annelid.config import field_value, load_config
from annelid.errors import ConfigError, SimulationStopped
from annelid.experiment.case import Case
from annelid.experiment.finer_runs import finer_steps, more_elements
from annelid.experiment.outcome import outcome
from annelid.experiment.parameter_errors import (
    ABSENT,
    CALIBRATION,
    EXACT,
    FIELDS,
    UNMEASURED,
    applicable,
    changes,
    draw,
)
from annelid.experiment.uncertainty import (
    Quantity,
    Spread,
    Uncertainty,
    plan,
    quantity_of,
    read_spread,
    readings,
    uncertainty,
    uncertainty_table,
    write_uncertainty,
)
from annelid.simulation.runfile import open_run
from annelid_studies.standard_cases import RODS
from outcome import Command

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

SHORT = {"duration_s": 0.1, "clock.physics_timestep_s": 0.02, "record.signals_interval_s": 0.02}


def spread(errors: Mapping[str, float], correlation: Any = None, exponent: float | None = None) -> Spread:
    matrix = np.eye(len(errors)) if correlation is None else np.asarray(correlation, dtype=float)
    return Spread(tuple(errors), np.array(list(errors.values())), matrix, "a test", exponent)


# The draw


NAMES = ("young_modulus", "dry_friction", "spring_rate", "floor_friction")


@st.composite
def spreads(draw_from: st.DrawFn) -> Spread:
    """Errors of one to four parameters, with any correlations, singular ones among them."""
    p = draw_from(st.integers(1, 4))
    rows = np.random.default_rng(draw_from(st.integers(0, 10**6))).normal(size=(p, draw_from(st.integers(1, 5))))
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    errors = [draw_from(st.floats(0.01, 0.3)) for _ in range(p)]
    return spread(dict(zip(NAMES, errors, strict=False)), rows @ rows.T)


def covariance(known: Spread) -> np.ndarray:
    return known.correlation * np.outer(known.relative_error, known.relative_error)


@settings(max_examples=100)
@given(known=spreads(), more=st.integers(1, 20), seed=st.integers(0, 10**6))
def test_a_sample_has_the_mean_errors_and_correlation_that_were_asked_for(known: Spread, more: int, seed: int) -> None:
    drawn = draw(len(known.names) + more, known, seed)
    assert drawn.mean(axis=0) == pytest.approx(0.0, abs=1e-9)
    assert np.atleast_2d(np.cov(drawn.T)) == pytest.approx(covariance(known), abs=1e-7)


@settings(max_examples=50)
@given(p=st.integers(1, 4), n=st.integers(2, 5), seed=st.integers(0, 10**6))
def test_too_few_worms_have_the_same_total_variance(p: int, n: int, seed: int) -> None:
    drawn = draw(n, spread(dict.fromkeys(NAMES[:p], 0.1)), seed)
    assert drawn.var(axis=0, ddof=1).sum() == pytest.approx(p * 0.1**2)


# The parameters


@pytest.mark.parametrize(
    ("preset", "field"), [("wang", "force_limit_N"), ("riddle2025", "force_limit_N"), (RODS, "peak_force_N")]
)
def test_friction_of_the_cable_scales_the_force_of_rings(preset: str, field: str) -> None:
    config = load_config(preset)
    m, change = 2.15, 0.3
    fields = changes(config, spread({"cable_friction": 0.05}, exponent=m), np.array([change]))

    def mean_over_pulled(exponent: float) -> float:
        """Mean of exp(-x) over the wrap."""
        return float(np.exp(-np.linspace(0.0, exponent, 20001)).mean())

    factor = mean_over_pulled(m * exp(change)) / mean_over_pulled(m)
    before = getattr(config.body.rings, field)  # type: ignore[union-attr]
    assert list(fields) == [f"body.rings.{field}"]
    assert np.asarray(fields[f"body.rings.{field}"]) == pytest.approx(factor * np.asarray(before), rel=1e-4)
    load_config(config.model_dump(), fields)


def test_what_a_worm_lacks_is_left_out_with_its_reason() -> None:
    chosen, left_out = applicable(load_config(RODS), read_spread())
    assert chosen.names == ("young_modulus", "cable_friction")
    known = read_spread()
    assert chosen.correlation[0, 1] == known.correlation[0, known.names.index("cable_friction")]
    assert left_out["dry_friction"] == ABSENT
    assert left_out["floor_friction"] == UNMEASURED
    assert set(chosen.names) | set(left_out) == set(FIELDS)
    rubbing = load_config(RODS, {"body.joints.dry_friction_Nm": 0.0083})
    assert applicable(rubbing, read_spread())[0].names == ("young_modulus", "dry_friction", "cable_friction")
    assert applicable(rubbing, read_spread().but({"young_modulus": 0.0}))[1]["young_modulus"] == EXACT


def test_given_errors_stand_beside_those_of_the_fit() -> None:
    known = read_spread()
    both = known.but({"floor_friction": 0.2, "dry_friction": 0.5})
    assert both.names == (*known.names, "floor_friction")
    assert dict(zip(both.names, both.relative_error, strict=True))["dry_friction"] == 0.5
    assert (both.correlation[:3, :3] == known.correlation).all()
    assert both.correlation[3].tolist() == [0.0, 0.0, 0.0, 1.0]


def test_errors_out_of_range_are_refused(subtests: pytest.Subtests) -> None:
    for errors, says in (
        ({"floor_frction": 0.1}, "did you mean 'floor_friction'"),
        ({"spring_rate": -0.1}, "spring_rate = -0.1 must be at least 0 and below 1"),
        ({"spring_rate": 1.0}, "below 1"),
        ({"spring_rate": float("nan")}, "below 1"),
        ({"cable_friction": 0.1}, "has no value of it"),
    ):
        with subtests.test(f"{errors!r:.60}"), pytest.raises(ConfigError, match=says):
            spread({"young_modulus": 0.1}).but(errors)


def calibration() -> dict[str, Any]:
    path = Path(annelid.__file__).parent / "data" / CALIBRATION
    return json.loads(path.read_text(encoding="utf-8"))


def test_the_fit_that_comes_along_is_whole() -> None:
    """Errors and correlations follow from the singular values, the directions and the residual."""
    content, known = calibration(), read_spread()
    directions, singular = np.array(content["directions"]), np.array(content["singular_values_N"])
    residual = np.array(content["fitted_N"]) - np.array(content["measured_N"])
    covariance = (residual**2).mean() * directions.T @ np.diag(singular**-2.0) @ directions
    assert known.relative_error == pytest.approx(np.sqrt(np.diag(covariance)))
    assert known.correlation * np.outer(known.relative_error, known.relative_error) == pytest.approx(covariance)
    assert known.cable_exponent == content["parameters"]["cable_friction"]["value"]


def test_a_damaged_fit_is_refused(subtests: pytest.Subtests, tmp_path: Path) -> None:
    for text, says in (("{", "not valid JSON"), ("[]", r"no calibration\.json")):
        (tmp_path / "bad.json").write_text(text)
        with pytest.raises(ConfigError, match=says):
            read_spread(tmp_path / "bad.json")
    for damage, says in (
        (lambda c: c["parameters"]["dry_friction"].update(relative_error=None), "does not determine dry_friction"),
        (lambda c: c["parameters"].update(mass=c["parameters"].pop("dry_friction")), "unknown parameter 'mass'"),
        (lambda c: c["correlation"][0].__setitem__(1, 0.9), "correlation must be symmetric"),
        (lambda c: c["correlation"].pop(), "no calibration.json"),
        (lambda c: c.pop("parameters"), "no calibration.json"),
    ):
        with subtests.test(f"{damage!r:.60}"):
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            content = calibration()
            damage(content)
            path = folder / "mine.json"
            path.write_text(json.dumps(content))
            with pytest.raises(ConfigError, match=says):
                read_spread(path)


# Joining errors


def quantity(
    value: float | None, parameters: float | None, time_step: float | None, elements: float | None
) -> Quantity:
    return Quantity("elongation_mean_max_m.1", value, parameters, time_step, elements, 8)


def test_values_are_written_to_two_digits_of_their_error() -> None:
    assert str(quantity(0.0615, 0.0021, 0.0, 0.0)) == "6.15 +- 0.21 cm"
    assert str(quantity(-0.1159, 0.117, 0.0, 0.0)) == "-12 +- 12 cm"
    assert str(quantity(0.0615, None, None, None)) == "6.15 cm"
    assert str(quantity(None, None, None, None)) == "-"


# The runs of a study


@settings(max_examples=50)
@given(
    control_ms=st.integers(1, 5),
    ratio=st.integers(1, 24),
    faster=st.booleans(),
    record=st.integers(1, 20),
)
def test_finer_steps_fit_the_control_step(control_ms: int, ratio: int, faster: bool, record: int) -> None:
    control = control_ms / 1e3
    step = control / ratio if faster else control * ratio
    config = load_config(
        RODS,
        {
            "clock.control_timestep_s": control,
            "clock.physics_timestep_s": step,
            "record.signals_interval_s": control * record,
            "record.frames_interval_s": control * 20,
            "duration_s": control * 200,
        },
    )
    finer = finer_steps(config)
    assert len(finer) == (2 if not faster and ratio % 4 == 0 else 1)
    for divisor, of_it in zip((2, 4), finer, strict=False):
        refined = load_config(config.model_dump(), of_it)
        shorter = refined.clock.physics_timestep_s
        exact = step / divisor
        assert shorter <= exact * (1 + 1e-9) or (shorter == control < step)
        assert shorter > exact - control * (1 - 1e-9)
        assert shorter < step
        assert refined.record.signals_interval_s <= config.record.signals_interval_s * (1 + 1e-9)
    if len(finer) == 2:
        assert finer[1]["clock.physics_timestep_s"] == pytest.approx(step / 4)


def test_elements_end_where_the_mesh_does() -> None:
    field = "body.mesh.elements_per_side"
    assert more_elements(load_config(RODS)) == [{field: 3}, {field: 4}]
    assert more_elements(load_config(RODS, {field: 31})) == [{field: 32}]


def test_a_plan_changes_only_what_it_says() -> None:
    # A quarter of this step is a whole number of control steps.
    config = load_config(RODS, {"clock.physics_timestep_s": 0.02})
    planned = plan(config, 4, applicable(config, read_spread())[0])
    assert {kind: len(of_kind) for kind, of_kind in planned.items()} == {"parameters": 4, "time step": 2, "elements": 2}
    for changed in (one for of_kind in planned.values() for one in of_kind):
        varied = Case(config.name, changed, config).config
        assert {path: field_value(varied, path) for path in changed} == changed
        back = {path: field_value(config, path) for path in changed}
        assert load_config(varied.model_dump(), back) == config


def test_errors_are_the_scatter_of_samples_and_the_largest_difference_of_finer_runs() -> None:
    found = quantity_of("period_s", 1.5, {"parameters": [1.0, 3.0, None], "time step": [None], "elements": [2.0, 1.2]})
    assert found.parameters == pytest.approx(sqrt(2.0))
    assert (found.n_samples, found.time_step, found.elements) == (2, None, 0.5)
    assert quantity_of("period_s", None, {"parameters": [1.0], "time step": [1.0], "elements": []}).total is None


@pytest.fixture(scope="module")
def tiny(runs_in_this_process: None, tmp_path_factory: pytest.TempPathFactory) -> Uncertainty:
    """The first moments of a worm with two others drawn about it."""
    return uncertainty(load_config(RODS, SHORT), 2, tmp_path_factory.mktemp("tiny") / "run", jobs=1)


def test_error_bars_are_those_of_the_runs(tiny: Uncertainty) -> None:
    """The force of a ring pulls from the start, and so do the sampled differences of it."""
    name = "contraction_force_median_N"
    force = {
        kind: [readings(outcome(open_run(done.outcome.path)))[name] for _, done in of_kind if done.outcome]
        for kind, of_kind in tiny.variants.items()
    }
    [found] = [each for each in tiny.quantities if each.name == name]
    assert found.value == readings(outcome(open_run(tiny.folder)))[name] is not None
    assert found == quantity_of(name, found.value, force)
    assert all(error is not None and error > 0.0 for error in found.errors.values())
    with pytest.raises(ConfigError, match="n = 1 worms have no standard deviation"):
        uncertainty(tiny.config, 1, tiny.folder)


def test_files_tell_all_and_are_json_csv_and_a_picture(tiny: Uncertainty) -> None:
    json_path, csv_path, png_path = write_uncertainty(tiny)
    content = json.loads(json_path.read_text(encoding="utf-8"))
    assert len(content["runs"]) == 7
    assert all((tiny.folder / run["path"] / "run.nc").exists() for run in content["runs"])
    assert content["samples"] == "0 of 2 Monte Carlo samples kept an ordered rhythm (2 too short to tell)"
    lines = csv_path.read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + len(content["quantities"])
    assert png_path.read_bytes().startswith(b"\x89PNG")
    table = uncertainty_table(tiny)
    assert content["samples"] in str(table.title)
    words = str(table.caption)
    assert "20 ms against 10 and 5 ms; elements a side: 2 against 3 and 4" in words
    assert f"dry_friction, softening_strain, spring_rest_length, viscous_friction ({ABSENT})" in words


def test_a_run_that_a_guard_stops_has_no_error_bars_but_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("annelid.experiment.uncertainty.plan", lambda *_: {})
    config = load_config(RODS, SHORT | {"guard.edge_strain": 1e-6})
    with pytest.raises(SimulationStopped, match="strain"):
        uncertainty(config, 2, tmp_path / "run")
    assert open_run(tmp_path / "run").status == "stopped_by_guard"


def test_a_variant_that_fails_is_named_and_has_no_part_in_the_errors(
    tiny: Uncertainty, monkeypatch: pytest.MonkeyPatch
) -> None:
    planned = {kind: [changed for changed, _ in of_kind] for kind, of_kind in tiny.variants.items()}
    planned["parameters"] += [{"body.strands.young_modulus_Pa": -1.0}, {"guard.edge_strain": 1e-6}]
    monkeypatch.setattr("annelid.experiment.uncertainty.plan", lambda *_: planned)
    found = uncertainty(tiny.config, 4, tiny.folder)
    assert found.quantities == tiny.quantities
    words = str(uncertainty_table(found).caption)
    assert "failed, no part in the errors: parameters young_modulus_Pa = -1: " in words
    assert "stopped, no part in the errors: parameters edge_strain = 1e-06: " in words


def test_an_interrupted_study_names_the_command_that_goes_on(annelid: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[dict[str, Any]] = []

    def interrupted(config: object, n: int, folder: Path, **options: Any) -> None:
        seen.append({"config": config, "n": n, "folder": folder, "errors": options["spread"].relative_error.tolist()})
        raise KeyboardInterrupt

    monkeypatch.setattr("annelid.experiment.uncertainty.uncertainty", interrupted)
    words = ("--segments", "4", "--set", "controller={kind='sns-robust'}", "--vary", "floor_friction=0.2")
    done = annelid("run", RODS, *words, "--seed", "5", "--uncertainty", "3", "-o", "my walk")
    assert done.exit_code == 130
    sentence = done.sentence()
    assert "finished runs are kept in my walk" in sentence
    program, *again = shlex.split(sentence.partition("go on with: ")[2])
    assert program == "annelid"
    annelid(*again)
    assert seen[0] == seen[1]
    # A folder that was found for it is named, so that the command goes on there.
    sentence = annelid("run", RODS, "--uncertainty", "3").sentence()
    again = shlex.split(sentence.partition("go on with: ")[2])
    assert again[-2:] == ["--out", str(seen[-1]["folder"])]


def test_bad_input_ends_in_one_sentence_and_leaves_nothing(annelid: Command, subtests: pytest.Subtests) -> None:
    short = ("--uncertainty", "2", "--duration", "0.1")
    for arguments, says in (
        (("riddle2022-planar", *short), "body.kind = 'riddle2022' has no calibrated parameters"),
        ((RODS, *short, "--vary", "floor_frction=0.1"), "did you mean 'floor_friction'"),
        ((RODS, *short, "--vary", "floor_friction=much"), "the relative error must be a number"),
        ((RODS, *short, "--vary", "floor_friction=true"), "the relative error must be a number"),
        ((RODS, *short, "--uncertainty-from", "none.json"), "cannot read none.json"),
        (("--uncertainty", "1"), "greater than or equal to 2"),
        (("--vary", "spring_rate=0.1"), "need --uncertainty"),
        (("--jobs", "2"), "--jobs needs --check or --uncertainty"),
        (("--uncertainty-from", "c.json"), "need --uncertainty"),
        (("--uncertainty", "2", "--resume", "walk"), "does not go with --resume"),
        (("--check", "--uncertainty", "4"), "--uncertainty has what --check does"),
        (("--check", "--resume", "walk"), "makes whole runs"),
    ):
        with subtests.test(says):
            done = annelid("run", *arguments)
            assert done.exit_code == 2
            assert says in " ".join(done.err.split())
            assert not list(Path().iterdir())


@pytest.mark.usefixtures("undrawn")
def test_a_checked_run_says_how_far_its_numbers_move(annelid: Command) -> None:
    command = ("run", "riddle2022-planar", "--duration", "3", "--check", "--jobs", "1", "-o", "walk")
    done = annelid(*command)
    assert done.exit_code == 0, done.err
    assert "moves by" in done.out
    assert "Resolved: with half the step (0.5 ms) no number moves by more than 10 %" in " ".join(done.out.split())
    content = json.loads(annelid(*command, "--json").out)["results"]["check.json"]
    assert content == json.loads(Path("walk/check.json").read_text())
    assert content["resolved"] is True
