"""Kinds, figures and formats of other people's, each in one file of its own."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

EXTEND = Path(__file__).parent.parent / "examples" / "extend"
OUTPUT = {"own_study": "--output"}
HOLDS: dict[str, Callable[[list[str]], bool]] = {
    # The worm lies the lower, the deeper the troughs and the heavier the crossings.
    "own_arena": lambda lines: number(lines[1], "at ([0-9.]+) mm") < number(lines[0], "at ([0-9.]+) mm") - 3.0,
    "own_formulation": lambda lines: number(lines[1], "at ([0-9.]+) mm") < number(lines[0], "at ([0-9.]+) mm") - 3.0,
    "own_actuator": lambda lines: lines == ["greatest force 1.50 N of 1.5 N"],
    "own_circuit": lambda lines: all(Path(line).stat().st_size > 500 for line in lines[-3:]),
    "own_study": lambda lines: number(lines[1], "0.1: ([0-9.]+) cm") > number(lines[0], "1: ([0-9.]+) cm"),
    "own_outputs": lambda lines: all(Path(line).stat().st_size > 20 for line in lines[-2:]),
}
"""What an example's output must say, beyond that it runs."""
FAST = ("own_arena", "own_circuit", "own_outputs")
"""Examples that run in a few seconds; only the slow tests run the others."""


def number(line: str, pattern: str) -> float:
    found = re.search(pattern, line)
    assert found is not None, line
    return float(found[1])


def answer(*command: str, path: Path | None = None) -> str:
    paths = [str(path), *filter(None, [os.environ.get("PYTHONPATH")])] if path is not None else None
    environment = os.environ | ({"PYTHONPATH": os.pathsep.join(paths)} if paths is not None else {})
    done = subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, timeout=200, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in FAST)) for name in HOLDS])
def test_one_file_is_enough(name: str, tmp_path: Path) -> None:
    option = [OUTPUT[name]] if name in OUTPUT else []
    lines = answer(str(EXTEND / f"{name}.py"), *option, str(tmp_path)).splitlines()
    assert HOLDS[name](lines), lines


def test_every_example_is_tried() -> None:
    assert {path.stem for path in EXTEND.glob("*.py")} == HOLDS.keys()


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A folder as pip would make it of the example package."""
    package = EXTEND / "standing_wave"
    project = tomllib.loads((package / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (folder,) = {path.parent for path in package.glob("*/*.py")}
    shutil.copytree(folder, tmp_path / folder.name, ignore=shutil.ignore_patterns("__pycache__"))
    about = tmp_path / f"{folder.name}-{project['version']}.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    lines = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in entries.items())
        for group, entries in project["entry-points"].items()
    ]
    (about / "entry_points.txt").write_text("".join(lines), encoding="utf-8")
    return tmp_path


def test_a_package_adds_a_kind_by_its_entry_point(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(installed)
    told = answer(
        "-c",
        "from annelid import load_config, simulate, open_run\n"
        "from annelid.references import bibtex, references_of\n"
        "kind = {'controller.kind': 'standing-wave', 'controller.period': 1.0, 'duration_s': 1.0}\n"
        "run = simulate(load_config('riddle2022-planar', kind), 'wave')\n"
        "config = open_run('wave').config\n"
        "print(config.controller.period_s, run.data['activation'].values[1].round(2).tolist())\n"
        "print('A standing wave' in bibtex(references_of(config)))\n",
        path=installed,
    )  # fmt: skip
    assert told.splitlines() == ["1.0 [1.0, 0.0, 1.0]", "True"]


def test_a_package_adds_a_command_and_a_format_by_their_entry_points(installed: Path, finished: Path) -> None:
    told = answer("-m", "annelid", "rings", str(finished), path=installed)
    assert re.match(r"ring 1: [0-9.]+ cm\n", told)
    lengths = installed / "lengths.txt"
    answer("-m", "annelid", "export", str(finished), "--to", "txt", "-o", str(lengths), path=installed)
    assert all(float(line) > 0 for line in lengths.read_text().splitlines())


def test_a_body_of_a_package_runs_and_is_checked_drawn_viewed_and_exported(
    installed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(installed)
    answer(
        "-c",
        "from pathlib import Path\n"
        "from annelid import check, load_config, simulate\n"
        "from annelid.draw import render_frame\n"
        "from annelid.export import FORMATS\n"
        "from annelid.live.page import export_page\n"
        "config = load_config('mass-chain', {'duration_s': 1.0})\n"
        "(found,) = check(load_config('mass-chain', {'clock.physics_timestep_s': 0.005}))\n"
        "assert not check(config) and found.severity == 'error'\n"
        "run = simulate(config, 'run')\n"
        "assert run.data['center_of_mass'].values[-1, 0] < run.data['center_of_mass'].values[0, 0] - 0.02\n"
        "render_frame(run, 0.5, 'frame.png')\n"
        "export_page(run, 'recorded.html')\n"
        "export_page(load_config('mass-chain', {'duration_s': 0.2}), 'living.html')\n"
        "for name, path in (('csv', 'tables'), ('html', 'out.html')):\n"
        "    FORMATS.find(name).write(run, Path(path), lambda done, total: None)\n",
        path=installed,
    )  # fmt: skip
    assert all((installed / name).stat().st_size > 5000 for name in ("frame.png", "recorded.html", "living.html"))
    assert (installed / "out.html").stat().st_size > 5000
    assert len(list((installed / "tables").iterdir())) > 1


def test_a_body_without_outlines_is_refused_where_they_are_needed(
    installed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(installed)
    said = answer(
        "-c",
        "from typing import Literal\n"
        "from annelid import load_config, simulate\n"
        "from annelid.analysis import summary\n"
        "from annelid.config import BodyKind\n"
        "from annelid.draw import render_frame\n"
        "from annelid.errors import ConfigError\n"
        "from annelid.live.page import export_page\n"
        "from annelid_standing_wave.bodies import MassChain\n"
        "for planar in (True, False):\n"
        "    name = f'bare-{planar}'.lower()\n"
        "    own = {'is_planar': planar, 'outlines': BodyKind.outlines, 'kind': name, '__module__': __name__,\n"
        "        '__annotations__': {'kind': Literal[name]}}\n"
        "    type('Bare', (MassChain,), own)\n"
        "    clock = {'physics_timestep_s': 0.001}\n"
        "    tree = {'body': {'kind': name}, 'controller': {'kind': 'sine'}, 'clock': clock, 'duration_s': 0.1}\n"
        "    config = load_config(tree)\n"
        "    run = simulate(config, name, progress=False)\n"
        "    assert summary(run).duration_s\n"
        "    for ask in (lambda: render_frame(run, 0.05, 'a.png'), lambda: export_page(run, 'a.html'),\n"
        "                lambda: export_page(config, 'b.html')):\n"
        "        try:\n"
        "            ask()\n"
        "        except ConfigError as error:\n"
        "            print(error)\n",
        path=installed,
    ).splitlines()  # fmt: skip
    assert len(said) == 6
    for kind, sentences in (("bare-true", said[:3]), ("bare-false", said[3:])):
        for sentence in sentences:
            assert sentence.startswith(f"body.kind = '{kind}'")
            assert "is_planar = True" in sentence
            assert "outlines(values)" in sentence


@pytest.mark.slow
def test_the_code_of_another_package_s_kind_is_part_of_a_kept_run_s_key(installed: Path) -> None:
    code = (
        "from annelid.experiment.case import Case\n"
        "from annelid.experiment.store import case_key\n"
        "print(case_key(Case('riddle2022-planar', {'controller.kind': 'standing-wave'})))\n"
    )
    module = installed / "annelid_standing_wave" / "kinds.py"
    text = module.read_text(encoding="utf-8")
    keys = []
    for changed in (text, text.replace("Contracts odd", "Draws in odd"), text.replace("0.5 * (1.0", "0.4 * (1.0")):
        module.write_text(changed, encoding="utf-8")
        keys.append(answer("-c", code, path=installed))
    assert keys[0] == keys[1] != keys[2]


def test_an_unknown_kind_is_refused_without_it() -> None:
    from annelid import load_config
    from annelid.errors import ConfigError

    with pytest.raises(ConfigError, match=r"controller\.kind = 'standing-wave': must be one of 'sns', 'adaptive'"):
        load_config("riddle2022-planar", {"controller.kind": "standing-wave"})


def test_a_package_that_fails_is_told_of_and_left_out(installed: Path) -> None:
    (installed / "annelid_standing_wave" / "kinds.py").write_text("raise RuntimeError('broken')\n")
    code = "from annelid import load_config; load_config('riddle2022-planar')"
    environment = os.environ | {"PYTHONPATH": str(installed)}
    command = [sys.executable, "-W", "error::UserWarning", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=environment, check=False)
    assert "what annelid-standing-wave adds (annelid_standing_wave.kinds) cannot be loaded: broken" in done.stderr
