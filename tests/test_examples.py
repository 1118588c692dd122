"""Every example does what its first line says, on runs as short as will tell."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest

import annelid

EXAMPLES = Path(__file__).parent.parent / "examples"
MOST_LINES = 60


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def test_examples_are_short_and_say_what_they_are() -> None:
    texts = {path.name: path.read_text(encoding="utf-8") for path in EXAMPLES.glob("*.py")}
    assert [name for name, text in texts.items() if not text.startswith('"""')] == []
    assert [name for name, text in texts.items() if len(text.splitlines()) > MOST_LINES] == []


SHORT: dict[str, tuple[tuple[object, ...], str, str]] = {
    "round_a_post": ((1.0,), "after 1 s", "track.png"),
    "through_a_taper": ((1.0,), "0.183", ""),
    "resume_a_run": ((0.4,), "are the whole, bit for bit", ""),
    "pipe_of_your_own": ((0.4,), "inside", "crawler.png"),
    "scatter_over_seeds": ((0.005, 0.4, range(2)), "seed 1: too short", ""),
    "rigid_tube_and_soft_worms": ((), "", "tube.png"),
}
"""Examples by name: what they are given beside a folder, what they say, and what they draw there."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name == "through_a_taper")) for name in SHORT]
)
def test_an_example_says_and_draws_its_result(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given, says, drawn = SHORT[name]
    example(name).main(tmp_path / drawn if name.startswith("rigid") else tmp_path, *given)
    assert says in capsys.readouterr().out
    assert not drawn or (tmp_path / drawn).stat().st_size > 10_000


def test_setae_make_travel_of_breathing(tmp_path: Path) -> None:
    breathing = example("breathing_on_setae")
    even = breathing.travel_m(0.6, None, 2.0, tmp_path / "even")
    setae = breathing.travel_m(0.2, 1.0, 2.0, tmp_path / "setae")
    assert setae > 0.1
    assert setae > 3.0 * abs(even)


@pytest.mark.slow
def test_a_wave_that_feels_the_ground_goes_round(tmp_path: Path) -> None:
    config = annelid.load_config("riddle2025-muscles", {"duration_s": 6.0})
    run = annelid.simulate(config, tmp_path, controller=example("felt_ground").Wave())
    numbers = annelid.summary(run)
    assert numbers.full_cycles >= 1
    assert numbers.travel_m is not None
    assert numbers.travel_m > 0.1


@pytest.mark.slow
def test_a_worm_learns_to_do_better_than_at_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = {"body.mesh.n_segments": 3, "body.mesh.n_helices": 6, "body.rings.peak_force_N": 16.0}
    cheap = {"changes": body | {"clock.physics_timestep_s": 0.04}, "episode_s": 2.4}
    start, learned = example("learn_to_crawl").main(tmp_path, generations=4, **cheap)
    assert learned > start
    assert "return of the start" in capsys.readouterr().out
    assert (tmp_path / "learning_curve.png").stat().st_size > 5_000


@pytest.mark.slow
def test_the_best_gate_of_every_friction_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    module = example("sweep_friction_and_gate")
    vary = [
        {"field": "arena.friction", "values": [0.3]},
        {"field": "controller.gate_time_constant_ms", "values": [150.0]},
    ]
    module.main(tmp_path, {**module.STUDY, "set": {"duration_s": 0.1}, "vary": vary})
    assert capsys.readouterr().out == "friction 0.3: none walks\n"
    assert (tmp_path / "sweep.nc").exists()


@pytest.mark.slow
def test_the_body_sets_the_pace_of_a_stretch_controller(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example("stretch_controller").main(tmp_path, 0.8)
    contractions = [int(line.split()[2]) for line in capsys.readouterr().out.splitlines()]
    assert contractions[0] > contractions[1] > contractions[2] == 1


def test_the_baton_is_passed_by_stretch(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example("network_by_name").main(tmp_path, 1.0)
    assert annelid.summary(annelid.open_run(tmp_path)).order[:3] == [1, 2, 3]
    assert (tmp_path / "network.svg").read_text(encoding="utf-8").count("segment6") >= 1
    assert "fewer than two cycles" in capsys.readouterr().out


@pytest.fixture(scope="module")
def short_run(tmp_path_factory: pytest.TempPathFactory) -> annelid.Run:
    config = annelid.load_config("riddle2023-rods", {"duration_s": 1.0})
    return annelid.simulate(config, tmp_path_factory.mktemp("short"))


def test_a_run_is_read_signal_by_signal(
    short_run: annelid.Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    example("signals_with_xarray").main(short_run, tmp_path / "signals.csv")
    lines = (tmp_path / "signals.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "time_s,segment1_m,segment2_m,segment3_m"
    assert len(lines) == 11
    assert "belly" in capsys.readouterr().out


def test_sensitivity_is_told_for_each_field(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sensitivity = example("sensitivity")
    monkeypatch.setattr(sensitivity, "FIELDS", ("body.springs.stiffness_N_per_m",))
    sensitivity.main(tmp_path, 0.6)
    row = next(line for line in capsys.readouterr().out.splitlines() if "stiffness" in line)
    assert float(row.split("\u2502")[2]) < 0, "stiffer springs let a segment elongate less"


def test_the_load_frame_is_laid_over_the_measured_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    compare = example("compare_with_measured_data")
    compare.main(tmp_path / "loops.png", compare.read_loop(), displacement_m=0.15, speed_m_per_s=0.04)
    assert (tmp_path / "loops.png").stat().st_size > 10_000
    assert 0.5 < float(capsys.readouterr().out.split()[0]) < 10.0


def test_plain_mujoco_contracts_the_ring(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plain = example("worm_in_plain_mujoco")
    plain.write(tmp_path / "worm.xml")
    plain.main(tmp_path / "worm.xml", 1.0)
    rings_cm = [float(line.split()[3]) for line in capsys.readouterr().out.splitlines()[1:]]
    assert min(rings_cm) < 45.0
    assert rings_cm[-1] > 90.0


def test_a_heading_is_told_as_time_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example("turn_to_a_heading").main(tmp_path, 30.0, 2.0)
    last = capsys.readouterr().out.splitlines()[-2]
    assert float(last.split()[2]) > 1.0, "to the left"


def test_all_controllers_drive_the_rod_worm(capsys: pytest.CaptureFixture[str]) -> None:
    controllers = example("all_controllers_on_the_rod_worm")
    controllers.main(0.1)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + len(controllers.CONTROLLERS)


def test_one_network_drives_four_bodies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bodies = example("one_network_on_all_bodies")
    monkeypatch.setattr(bodies, "DURATION_S", 0.3)
    bodies.main(tmp_path)
    assert all(name in capsys.readouterr().out or (tmp_path / name).exists() for name in bodies.BODIES)


def test_slip_is_told_for_each_metre(tmp_path: Path) -> None:
    slip, name = example("slip_of_two_controllers"), "channel"
    run = annelid.simulate(slip.CASES[name].but({"duration_s": 0.6}).config, tmp_path, progress=False)
    name, speed, slip_J_per_m, work_J_per_m, afloat = slip.measure(name, run)
    assert name == "channel"
    assert speed > 0
    assert 0 < slip_J_per_m < work_J_per_m
    assert 0 <= afloat <= 1


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_worm_crawls_alike_with_its_controller_in_c(tmp_path: Path) -> None:
    ours, theirs = (annelid.summary(run) for run in example("firmware_in_the_loop").main(tmp_path))
    assert ours.order == theirs.order
    assert ours.period_s == pytest.approx(theirs.period_s, rel=1e-6)
    assert ours.elongation_mean_max_m == pytest.approx(theirs.elongation_mean_max_m, rel=0.01)


def test_another_file_under_the_firmware_s_name_is_refused(tmp_path: Path) -> None:
    (tmp_path / "SEC_ver2.ino").write_text("void setup() {}\nvoid loop() {}\n", encoding="utf-8")
    with pytest.raises(SystemExit, match="SHA-256"):
        example("laboratory_firmware").main(tmp_path / "SEC_ver2.ino", tmp_path / "turn")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler")
def test_a_sketch_of_the_laboratory_s_protocol_turns_the_twin(tmp_path: Path) -> None:
    example("laboratory_firmware").main(EXAMPLES / "laboratory_firmware" / "bend.ino", tmp_path / "turn")
    lines = (tmp_path / "turn" / "waves.csv").read_text(encoding="utf-8").splitlines()
    (_, path_m, heading_deg, slip_m, *_) = map(float, lines[1].split(","))
    assert len(lines) == 2
    assert path_m > 0.01
    assert heading_deg > 1.0, "to the left, where wheels 1 to 6 wind more"
    assert slip_m > 0
    assert (tmp_path / "turn" / "waves.png").stat().st_size > 10_000


def test_every_example_is_run_here() -> None:
    own = Path(__file__).read_text(encoding="utf-8")
    assert [path.stem for path in sorted(EXAMPLES.glob("*.py")) if f'"{path.stem}"' not in own] == []
