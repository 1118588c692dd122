"""Every command of README and pages is one that annelid understands, and those that take seconds are executed."""

from __future__ import annotations

import os
import re
import runpy
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from doc_commands import PAGES, ROOT, Command, Script, Written, commands_of, steps_of
from typer.main import get_command
from typer.testing import CliRunner

import annelid
from annelid.cli import app
from annelid.cli.common import config_of, overrides_of

ANNELID: Any = get_command(app)

MEANT = {"RUN": "run", "RUN..": "run", "NAME": "riddle2023", "LEVEL": "fast", "COMMAND": "run"}
"""What stands in a page for something that the reader chooses; RUN is the latest run."""

QUICK = {
    ("annelid", "run", "--resume"): ("--duration", "0.06", "--quiet", "--no-video"),
    # The chain takes fourteen seconds for one of simulated time.
    ("annelid", "run", "riddle2023"): ("--duration", "0.02", "--quiet", "--no-video"),
    # Four of its own steps.
    ("annelid", "run", "small.toml"): ("--duration", "0.0448", "--quiet", "--no-video"),
    ("annelid", "run"): ("--duration", "0.04", "--quiet", "--no-video"),
    ("annelid", "draw"): (),
    ("annelid", "show"): (),
    ("annelid", "list", "runs"): (),
    ("annelid", "check"): (),
    ("annelid", "new"): ("--force",),
    ("annelid", "export-network"): ("--force",),
    ("annelid", "export"): ("--force",),
    ("annelid", "list", "presets"): (),
    ("annelid", "list", "arenas"): (),
    ("annelid", "list", "numbers"): (),
    ("annelid", "study", "load-frame"): (),
    ("annelid", "cite"): (),
    ("annelid", "compare"): (),
    ("annelid", "doctor"): (),
    ("annelid", "--help"): (),
}
"""Commands that are executed, and what shortens each; an option that is given twice counts as given last."""

CHANGED_WORDS = {"--time": "0.04"}
"""Values of options that would not fit a shortened run."""

SCRIPTS = (
    (r'"duration_s": [\d.]+', '"duration_s": 0.04'),
    (r'(load_config\("[\w-]+", {"arena\.friction": [\w.]+)}', r'\1, "duration_s": 0.04}'),
    (r"range\(100\)", "range(1)"),
    (r"episode_s=[\d.]+", "episode_s=0.24"),
    (r'simulate\("riddle2023-rods"', 'simulate(annelid.load_config("riddle2023-rods", {"duration_s": 0.04})'),
    (r'(open_run\("long"\)\n.*)"duration_s": 0\.04', r'\1"duration_s": 0.08'),
)
"""What shortens the Python on a page."""

LONG = {
    ("annelid", "run", "--uncertainty"): ("thirteen runs", ("--uncertainty", "2", "--duration", "0.5", "--no-video")),
    ("annelid", "paper"): ("an hour, or 6 minutes with --quick", ("--quick",)),
    ("annelid", "study", "bench"): ("up to half an hour", ("--quick",)),
    ("annelid", "study", "challenge"): ("hours, or minutes with --quick", ("--quick",)),
    ("annelid", "study", "robustness"): ("an hour", ("--quick",)),
    ("annelid", "tune"): ("an hour", ("--trials", "2", "--duration", "1")),
    ("annelid", "calibrate", "mine/study.toml"): ("some minutes", ("--free", "young_modulus")),
    ("annelid", "calibrate", "twin/study.toml"): ("some minutes", ("--free", "young_modulus")),
    ("annelid", "calibrate"): ("some minutes", ("--free", "dry_friction", "--free", "cable_friction")),
    ("annelid", "study", "limit-cycle"): ("ten seconds of one core", ()),
    ("annelid", "study", "weak-middle"): ("minutes", ("--quick",)),
    ("annelid", "study", "speed"): ("an hour", ("--quick",)),
    ("annelid", "study", "gaits"): ("hours", ("--quick",)),
    ("annelid", "study", "slip"): ("minutes", ("--quick",)),
    ("annelid", "study", "slip-detector"): ("minutes", ("--quick",)),
    ("annelid", "study", "turning"): ("many minutes", ("--quick",)),
    ("annelid", "study", "pipes"): ("an hour", ("--quick",)),
}
"""Commands that only the slow tests execute: why, and what shortens them there."""

ELSEWHERE = {
    ("pip",): "the environment that runs this test was made by such a line",
    ("python", "-m"): "the same",
    ("python3", "-m"): "the same",
    ("pytest",): "these are the tests",
    ("python", "examples/"): "tests/test_examples.py runs the examples",
    ("python", "benchmarks/"): "minutes each: `test_a_benchmark_runs` executes them",
    ("python", "docs/site/"): "tests/docs calls these",
    ("python", "-c"): "arithmetic",
    ("annelid", "sweep"): "minutes, and workers; the command has tests of its own",
    ("annelid", "compare", "--map"): "test_newcomer.py executes it on a log of its own",
    ("annelid", "--install-completion"): "it changes the settings of the shell",
    ("annelid", "--show-completion"): "tests/cli/test_commands.py asks for completions",
    ("annelid", "study", "gallery"): "tests/docs/test_gallery_list.py calls it",
    ("annelid", "export-network", "network.toml"): "tests/cli/test_commands.py exports such a file",
    ("annelid", "loop"): "it needs hardware; tests/lab/loop/test_hardware_loop.py calls it",
    ("annelid", "study", "paper"): "an hour: tests/studies/test_paper_command.py",
    ("annelid", "view"): "it opens a browser; the command has tests of its own",
    ("annelid", "run", "my_robot.xml"): "a robot of the reader's own; tests/lab/test_own_robot.py runs some",
    ("annelid", "run", "robot.xml"): "the same",
    ("annelid", "export", "my_robot.xml"): "the same",
    ("annelid", "run", "tune/best.toml"): "the file is what a search found",
    ("annelid", "run", "mine/calibrated.toml"): "the file is what a fit found",
    ("annelid", "run", "twin/calibrated.toml"): "the same",
    ("annelid", "draw", "course", "--time"): "its run is that of the page's example, which takes minutes",
    ("annelid", "draw", "course", "--video", "course.mp4", "--camera", "course"): "evidence/turning.md executes it",
}
"""Commands that are not executed here, and why."""

FAST = ("README.md", "docs/how_to/read_a_run.md")
"""Pages whose commands the fast tests execute; those of the others are understood there, and executed by the slow."""

SCRIPTS_ELSEWHERE = {
    "docs/tutorials/": "tests/docs/test_site.py runs the tutorials",
    "docs/sweeps.md": "executors of batch systems and of MPI, which are not installed with the tests",
}
"""Pages whose Python is not executed here, and why."""


def starts_with(words: Sequence[str], start: Sequence[str]) -> bool:
    """Whether a command begins so; an option counts wherever it stands, a folder stands for all that is in it."""
    if start and start[-1].startswith("--") and len(start) > 2:
        return starts_with(words, start[:-1]) and start[-1] in words
    pairs = list(zip(start, words, strict=False))
    return len(words) >= len(start) and all(b.startswith(a) if a.endswith("/") else a == b for a, b in pairs)


NAMED = {command for page in PAGES for command in commands_of(page)}
BENCHMARKS = sorted((one for one in NAMED if starts_with(one.words, ("python", "benchmarks/"))), key=str)
"""Benchmarks that pages name, with their arguments."""

BENCHMARKS_NEED = {
    # They take hours; tests/lab/test_calibration.py identifies two of the robots.
    "identify_recovery": False,
    "identify_walks": False,
    "instructions": shutil.which("valgrind"),
    "firmware": shutil.which("cc") and shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm"),
}
"""Benchmarks that run only where something is installed, or never."""

READERS_FILES = {"mine.toml": 'extends = "riddle2023-rods"\n', "mine.csv": "mm,N\n0,0\n1,1\n"}
"""Files of the reader's own that a page takes for granted."""

done: set[Command] = set()
"""Commands that have been executed on some page."""


def rule_of(table: dict[tuple[str, ...], Any], command: Command) -> Any:
    return next((rule for start, rule in table.items() if starts_with(command.words, start)), None)


def chosen(command: Command) -> tuple[str, ...]:
    return tuple(MEANT.get(word, word) for word in command.words)


def names_only(command: Command) -> bool:
    """Whether it lacks the run that the command needs, as in a sentence about it or one of its options."""
    needs_run = command.words[1] in ("compare", "draw", "export", "show")
    return needs_run and all(word.startswith("--") for word in command.words[2:])


def parsed(words: Sequence[str]) -> tuple[str, dict[str, Any]]:
    """Reads a command line of annelid as its entry point does, without executing it."""
    command: Any = ANNELID
    parent, name, rest = None, "annelid", list(words)
    while getattr(command, "commands", None):
        parent = command.make_context(name, [], parent=parent, resilient_parsing=True)
        name = rest.pop(0)
        assert name in command.commands, f"there is no command {name!r}"
        command = command.commands[name]
    return name, command.make_context(name, rest, parent=parent).params


def check_annelid(command: Command) -> None:
    words = chosen(command)
    if words[-1] == "--help":
        assert words[1] in ("--help", *ANNELID.commands)
        return
    if words[1:] in (("--install-completion",), ("--show-completion",)):
        assert words[1] in {option for parameter in ANNELID.params for option in parameter.opts}
        return
    if names_only(command) or words[-1] == "--arena":
        # In a sentence on a command or on one of its options.
        assert words[1] in ANNELID.commands
        return
    name, given = parsed(words[1:])
    if "preset" in given and not given.get("resume") and not str(given["preset"]).endswith((".toml", ".xml")):
        options = {"duration_s": given.get("duration"), "seed": given.get("seed")}
        overrides = overrides_of(given.get("assignments"), **options)
        arena = given.get("arena")
        if arena is None or not str(arena).endswith(".toml"):
            segments, fidelity = given.get("segments"), given.get("fidelity")
            config_of(given["preset"], overrides, segments, fidelity, arena)
    assert name in words


def check_program(command: Command) -> None:
    """Checks that what a command of another program names exists, and that its options do."""
    program, *words = command.words
    if program == "pip":
        extras = re.findall(r"\[(\w+)]", " ".join(words))
        pyproject = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
        assert all(re.search(rf"^{extra} = \[", pyproject, re.MULTILINE) for extra in extras), command
        return
    files = [word for word in words if word.endswith(".py") or word.startswith("tests/")]
    assert all((ROOT / file).exists() for file in files), command
    if files and program == "python":
        source = (ROOT / files[0]).read_text(encoding="utf-8")
        assert all(f'"{word}"' in source for word in words if word.startswith("--")), command


def test_every_command_is_understood(subtests: pytest.Subtests) -> None:
    for page in PAGES:
        for command in commands_of(page):
            with subtests.test(page=page, command=str(command)):
                (check_annelid if command.words[0] == "annelid" else check_program)(command)


def test_an_unknown_option_field_or_preset_is_found() -> None:
    for line in (
        "annelid run riddle2023-rods --spede 3",
        "annelid run riddle2024",
        "annelid run --set arena.frictoin=0.3",
        "annelid sing",
        "pytest tests/test_nothing.py",
        "python benchmarks/environments.py --elephants 2",
    ):
        check = check_annelid if line.startswith("annelid") else check_program
        with pytest.raises((Exception, SystemExit)):
            check(Command(tuple(line.split())))


def test_every_command_is_executed_somewhere() -> None:
    """Nothing falls between the tables."""
    for page in PAGES:
        for command in commands_of(page):
            known = (rule_of(table, command) for table in (LONG, QUICK, ELSEWHERE))
            assert any(rule is not None for rule in known), f"{page}: no rule for {command}"


@pytest.mark.parametrize(
    "page", [pytest.param(page, marks=[pytest.mark.slow] * (not page.startswith(FAST))) for page in PAGES]
)
def test_what_takes_seconds_is_executed(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ROOT / "examples")
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    # Runs draw nothing here: what they would draw has tests of its own, and takes longer than the run.
    monkeypatch.setattr("annelid.draw.gallery.draw_all", lambda *_, **__: [])
    for name, text in READERS_FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    session: dict[str, Any] = {"__name__": "__main__"}
    here: set[Command] = set()
    steps = steps_of(page)
    words = {word for step in steps if isinstance(step, Command) for word in step.words}
    names_its_runs = bool(words & {"-o", "--out"}) or any(word.startswith("runs/") for word in words)
    stands_alone = not names_its_runs and not any(isinstance(step, Script) for step in steps)
    for step in steps:
        if isinstance(step, Written):
            (tmp_path / step.name).write_text(step.text, encoding="utf-8")
        elif isinstance(step, Script) and not page.startswith(tuple(SCRIPTS_ELSEWHERE)):
            run_script(step.code, session)
        elif isinstance(step, Command) and step not in (done if stands_alone else here):
            run_command(step, tmp_path)
            done.add(step)
            here.add(step)


def run_script(code: str, session: dict[str, Any]) -> None:
    """Runs a block of Python behind those above it on its page."""
    for pattern, instead in SCRIPTS:
        code = re.sub(pattern, instead, code)
    exec(compile(code, "page", "exec"), session)


def run_command(command: Command, folder: Path) -> None:
    shorter = rule_of(QUICK, command)
    if shorter is None or rule_of(LONG, command) or rule_of(ELSEWHERE, command) or names_only(command):
        return
    words = [str(latest_run(folder)) if word in ("RUN", "RUN..") else word for word in command.words]
    words = [MEANT.get(word, word) for word in words]
    if words[-1] == "--arena":
        return
    for option, value in CHANGED_WORDS.items():
        if option in words:
            words[words.index(option) + 1] = value
    if words[1] == "draw" and os.environ.get("MUJOCO_GL") in ("off", "disable"):
        return
    answer = CliRunner().invoke(app, [*words[1:], *shorter], prog_name="annelid")
    assert answer.exit_code == 0 or "OpenGL" in answer.output, f"{command}\n{answer.output}"


def latest_run(folder: Path) -> Path:
    """The run of this page that was made last; the reader's own where it makes none."""
    if not list(folder.rglob("run.nc")):
        annelid.simulate(annelid.load_config("riddle2023-rods", {"duration_s": 0.04}), folder / "own", progress=False)
    return max(folder.rglob("run.nc"), key=lambda path: path.stat().st_mtime).parent


@pytest.mark.slow
@pytest.mark.parametrize("start", LONG, ids=" ".join)
def test_what_takes_long_is_executed_in_short(
    start: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _, shorter = LONG[start]
    words = [word for word in start if not word.startswith("--")]
    output = () if "limit-cycle" in start else ("-o", "out")
    answer = CliRunner().invoke(app, [*words[1:], *shorter, *output], prog_name="annelid")
    assert answer.exit_code == 0, answer.output


def test_the_names_that_a_benchmark_imports_are_there(
    subtests: pytest.Subtests, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    for script in sorted((ROOT / "benchmarks").glob("*.py")):
        with subtests.test(script=script.name):
            runpy.run_path(str(script), run_name=script.stem)


@pytest.mark.slow
@pytest.mark.parametrize("command", BENCHMARKS, ids=str)
def test_a_benchmark_runs(command: Command, tmp_path: Path) -> None:
    script = ROOT / command.words[1]
    if not BENCHMARKS_NEED.get(script.stem, True):
        pytest.skip(f"{script.name} needs hours, or what is not installed")
    answer = subprocess.run(
        [sys.executable, script, *command.words[2:]],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=1200,
    )
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout
