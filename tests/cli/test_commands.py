from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import imageio.v3
import pytest
from typer.main import get_command

from annelid.arena.kinds.pipe import Pipe
from annelid.cli import app, command
from annelid.config import field_paths, load_config, preset_names
from annelid.errors import ConfigError
from annelid.simulation.runfile import open_run
from outcome import Command


def test_run_ends_with_table_file_and_pictures(annelid: Command) -> None:
    done = annelid("run", "riddle2022-planar", "--duration", "0.5", "--segments", "4", "--seed", "7")
    assert done.exit_code == 0, done.err
    folder = Path("runs/riddle2022-planar-001")
    assert sorted(p.name for p in folder.iterdir()) == ["figure7.png", "frame.png", "run.nc", "video.mp4"]
    lines = done.out.splitlines()
    assert lines[0].startswith("riddle2022-planar: the planar worm")
    assert lines[0].endswith(", 4 segments, 0.5 s")
    assert lines[-1] == f"files in {folder}: run.nc figure7.png frame.png video.mp4"
    assert len(lines) <= 20
    config = open_run(folder).config
    assert (config.body.n_segments, config.duration_s, config.seed) == (4, 0.5, 7)


@pytest.mark.usefixtures("undrawn")
def test_runs_without_a_folder_are_numbered(annelid: Command) -> None:
    assert annelid("run", "riddle2022-planar", "--duration", "0.1", "--no-video", "-q").exit_code == 0
    Path("runs/riddle2022-planar-007").mkdir()
    assert annelid("run", "riddle2022-planar", "--duration", "0.1", "--no-video", "-q").exit_code == 0
    assert sorted(p.name[-3:] for p in Path("runs").iterdir()) == ["001", "007", "008"]


def test_quiet_prints_paths_only(annelid: Command) -> None:
    done = annelid("run", "riddle2022-planar", "--duration", "0.1", "--no-video", "-q", "--out", "here")
    assert done.out.split() == ["here/run.nc", "here/figure7.png", "here/frame.png"]
    assert done.err == ""


@pytest.mark.usefixtures("undrawn")
def test_a_file_of_ones_own_runs_under_its_name(annelid: Command) -> None:
    Path("mine.toml").write_text('extends = "riddle2022-planar"\nname = "mine"\nduration_s = 0.2\n')
    assert annelid("run", "mine.toml", "--no-video", "-q", "--set", "body.gain=1.9").exit_code == 0
    config = open_run("runs/mine-001").config
    assert (config.name, config.duration_s) == ("mine", 0.2)
    assert config.body.model_dump()["gain"] == 1.9


def test_resume_goes_on_bit_for_bit(annelid: Command) -> None:
    common = ("--no-video", "-q")
    annelid("run", "riddle2022-planar", "--duration", "1", *common, "--out", "whole")
    annelid("run", "riddle2022-planar", "--duration", "0.4", *common, "--out", "first")
    assert "--resume continues a run as it is" in annelid("run", "riddle2023", "--resume", "first").err
    done = annelid("run", "--resume", "first", "--duration", "1", *common, "--out", "second")
    assert done.exit_code == 0, done.err
    whole, second = open_run("whole").data, open_run("second").data
    assert float(second["time"][0]) > 0.39
    for name in ("potential", "stretch_length", "activation"):
        assert whole[name].isel(time=slice(-second.sizes["time"], None)).equals(second[name]), name


def test_a_missing_back_end_costs_the_pictures_and_not_the_run(
    annelid: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    from annelid.draw import gl

    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(gl, "works", lambda backend: False)
    done = annelid("run", "riddle2023-rods", "--duration", "0.05", "--out", "rods")
    assert done.exit_code == 0
    assert sorted(p.name for p in Path("rods").iterdir()) == ["figure7.png", "run.nc"]
    assert "no OpenGL back-end works here" in done.err


def test_plot_and_render_write_where_they_are_told(annelid: Command, finished: Path) -> None:
    assert annelid("draw", finished, "-o", "f.svg").exit_code == 0
    assert Path("f.svg").read_text().lstrip().startswith("<?xml")
    assert annelid("draw", finished, "--figure", "network", "-o", "n.svg").out.split() == ["n.svg"]
    assert 'id="neuron-1"' in Path("n.svg").read_text()
    more = ("--video", "v.mp4", "--fps", "5", "--background", "dark")
    done = annelid("draw", finished, "--time", "0.5", "-o", "frame.png", *more)
    assert done.exit_code == 0, done.err
    assert done.out.split() == ["frame.png", "v.mp4"]
    assert imageio.v3.imread("frame.png")[0, 0].tolist()[:3] == [0, 0, 0], "a dark page"
    assert Path("v.mp4").stat().st_size > 1000


def test_a_network_file_is_exported_and_kept_without_force(annelid: Command) -> None:
    from annelid.nervous import peristalsis_network

    Path("network.toml").write_text(peristalsis_network(3).to_toml())
    words = ("export-network", "network.toml", "-o", "c", "--float", "--timestep-ms", "0.5", "--scheme", "heun")
    done = annelid(*words)
    assert done.exit_code == 0, done.err
    paths = [Path(line) for line in done.out.splitlines()]
    assert [path.suffix for path in paths] == [".h", ".c", ".c"]
    assert "typedef float" in paths[0].read_text()
    assert "0.5 ms (Heun's method)" in paths[0].read_text()
    assert "exists" in annelid(*words).err
    assert annelid(*words, "--force").exit_code == 0
    assert "has no effect on a network" in annelid("export-network", "network.toml", "--segments", "4").err
    assert "has no effect on a controller" in annelid("export-network", "riddle2022-planar", "--scheme", "heun").err


@pytest.mark.usefixtures("undrawn")
def test_a_level_of_fidelity_resolves_the_worm_as_asked(annelid: Command) -> None:
    run = ("riddle2023-rods", "--fidelity", "accurate", "--duration", "0.02", "--no-video", "--out", "accurate")
    done = annelid("run", *run)
    assert done.exit_code == 0, done.err
    config = open_run(Path("accurate")).config
    assert config.name == "riddle2023-rods"
    assert config == load_config("riddle2023-rods", {"duration_s": 0.02}, fidelity="accurate")
    refused = annelid("run", "riddle2023-rods", "--fidelity", "paper", "--no-video", "--out", "paper")
    assert "annelid run riddle2023" in refused.sentence()
    assert not Path("paper").exists()


@pytest.mark.usefixtures("undrawn")
def test_the_first_run_is_the_worm_with_soft_pins_and_says_what_it_compares_with(annelid: Command) -> None:
    done = annelid("run", "--duration", "0.02", "--no-video", "--out", "first")
    assert done.exit_code == 0, done.err
    assert open_run(Path("first")).config == load_config("riddle2023-fast", {"duration_s": 0.02})
    first, *lines = done.out.splitlines()
    assert first == "riddle2023-fast: the paper's worm with soft crossings, 3 segments, 0.02 s"
    assert lines[0].split() == ["this", "run", "reference", "off", "by"]
    assert "differs from riddle2023-fast in duration_s" in " ".join(lines)
    assert "annelid show first --all" in done.out
    assert lines[-1] == "files in first: run.nc"
    longer = annelid("check", "--segments", "4")
    assert longer.exit_code == 2
    assert "next: annelid check --segments 4 riddle2023-rods" in longer.sentence()


def test_presets_lists_prints_and_explains(annelid: Command) -> None:
    listing = annelid("list", "presets").out
    assert all(name in listing for name in preset_names())
    text = annelid("list", "presets", "riddle2023").out
    Path("copy.toml").write_text(text)
    assert annelid("run", "copy.toml", "--set", "duration_s=-1").sentence().startswith("duration_s = -1")
    fields = annelid("list", "presets", "riddle2022-planar", "--fields").out
    assert "body.gain = 1.3" in fields
    assert "body.mesh" not in fields
    meaning = field_paths()["arena.friction"]
    assert meaning in annelid("list", "presets", "--fields").out


def test_every_command_teaches_by_example(annelid: Command) -> None:
    def commands(group: Any, *above: str) -> Iterator[tuple[str, ...]]:
        for name, one in group.commands.items():
            yield from commands(one, *above, name) if hasattr(one, "commands") else [(*above, name)]

    silent = []
    for words in commands(get_command(app)):
        done = annelid(*words, "--help")
        assert done.exit_code == 0
        if not re.search(rf"\n  annelid (study )?{' '.join(words)}", done.out):
            silent.append(words)
    assert not silent


def test_the_help_fits_a_page_and_cuts_no_line(annelid: Command) -> None:
    text = annelid("--help").out
    panels = text.partition("\nMake:")[2]
    assert 12 <= len(re.findall(r"^  [a-z]", panels, re.MULTILINE)) <= 17
    for words in (("--help",), ("study", "--help"), ("list", "--help")):
        assert "...\n" not in annelid(*words).out.partition("\n")[2]


@pytest.mark.parametrize(
    ("old", "now"),
    [(("plot", "RUN"), "draw"), (("presets", "wang"), "list presets"), (("experiment", "--help"), "study")],
)
def test_an_old_name_goes_on_with_a_hint(annelid: Command, finished: Path, old: tuple[str, ...], now: str) -> None:
    done = annelid(*(finished if word == "RUN" else word for word in old))
    assert f"hint: annelid {old[0]} is now annelid {now}" in done.err
    assert done.out


def test_every_option_with_a_unit_says_it() -> None:
    def options(command: Any) -> Iterator[Any]:
        yield from command.params
        for below in getattr(command, "commands", {}).values():
            yield from options(below)

    numbers = [each for each in options(get_command(app)) if "float" in str(each.type_descriptor.annotation)]
    assert numbers
    unit = re.compile(r"(?<!')\b(s|ms|mV|mm|m|N|Pa|rad|share|per second|seconds)\b", re.IGNORECASE)
    for option in numbers:
        assert unit.search(option.help), option.opts


def test_the_shell_completes_options_presets_arenas_and_runs(tmp_path: Path, finished: Path) -> None:
    shutil.copytree(finished, tmp_path / "runs" / "mine-001")
    for typed, offers in (
        ("annelid run --fid", "--fidelity"),
        ("annelid run riddle2022", "riddle2022-planar"),
        ("annelid run --arena pipe.b", "pipe.bend"),
        ("annelid show runs/m", "runs/mine-001"),
    ):
        asked = {"COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" ")), "_ANNELID_COMPLETE": "complete_bash"}
        done = subprocess.run(
            [sys.executable, "-m", "annelid"],
            env={**os.environ, **asked},
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
        )
        assert offers in done.stdout.split(), done.stderr


def test_the_version_comes_from_the_module_as_well() -> None:
    line = [sys.executable, "-m", "annelid", "--version"]
    done = subprocess.run(line, capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout.startswith("annelid 0.")


@pytest.mark.usefixtures("undrawn")
def test_arenas_are_listed_printed_built_and_walked_in(annelid: Command) -> None:
    assert "pipe.hourglass" in annelid("list", "arenas").out
    assert 'course = "bend"' in annelid("list", "arenas", "pipe.bend").out
    short = ("--duration", "0.1", "--no-video", "-q", "--out", "bent")
    walked = annelid("run", "riddle2023-rods", "--arena", "pipe.bend", "--set", "arena.radius=0.5", *short)
    assert walked.exit_code == 0, walked.err
    arena = open_run(Path("bent")).config.arena
    assert isinstance(arena, Pipe)
    assert (arena.course, arena.radius_m) == ("bend", 0.5)
    assert annelid("run", "--resume", "bent", "--arena", "floor").exit_code == 2


def test_the_command_prints_findings_and_refuses(annelid: Command) -> None:
    assert annelid("check").out.strip() == "no doubts: the numbers fit together"
    assert annelid("check", "riddle2022-planar").exit_code == 0
    unstable = ("--set", "controller.kind=sns-robust", "--set", "clock.control_timestep_s=0.02")
    assert "clock.control_timestep_s = 0.02 must be at most" in annelid("check", *unstable).err, "as run says"
    same = annelid("check", "riddle2023-rods", "--set", "arena.friction=0.5", "--set", "body.mesh.radius=0.16")
    note = "note: body.mesh.radius_m = 0.16 changes nothing: riddle2023-rods has this value"
    assert same.sentence() == note
    thin = annelid("check", "wang", "--set", "body.mesh.radius=0.05")
    assert thin.exit_code == 2
    assert thin.out.startswith("error: body.rings.length_range_m = [0.45, 0.96]: a ring is 0.3 m long at rest")
    told = json.loads(annelid("check", "riddle2023-rods", "--set", "sensor.tolerance=0.07", "--json").out)
    assert [finding["severity"] for finding in told] == ["warning"]
    refused = annelid("run", "wang", "--set", "body.mesh.radius=0.05", "--out", "thin")
    assert refused.exit_code == 2
    assert "set [0.195, 0.3]" in refused.sentence()
    assert not Path("thin").exists()


def test_a_folder_of_runs_is_said_to_be_one(annelid: Command, finished: Path) -> None:
    said = annelid("show", str(finished.parent)).sentence()
    assert f"{finished.parent} holds 1 run: name one of them, as {finished}" in said


def test_a_run_comes_before_a_preset_of_its_name(annelid: Command, finished: Path) -> None:
    shutil.copytree(finished, "wang")
    assert annelid("export", "wang", "--to", "csv", "-o", "tables").exit_code == 0
    assert annelid("cite", "wang").out == annelid("cite", finished).out != annelid("cite", "riddle2025").out


def test_a_command_in_no_panel_of_the_help_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"panel = 'Sea'.*did you mean 'See'"):
        command("rings", "Sea")
