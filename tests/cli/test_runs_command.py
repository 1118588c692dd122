from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from outcome import Command


def kept(finished: Path, *names: str) -> list[Path]:
    return [Path(shutil.copytree(finished, Path("runs") / name)) for name in names]


def test_runs_are_listed_with_what_they_are(annelid: Command, finished: Path) -> None:
    kept(finished, "a", "below/b")
    Path("runs/c").mkdir()
    Path("runs/c/run.nc").write_bytes(b"nothing")
    Path("runs/d").mkdir()
    Path("runs/d/outcome.json").write_text('{"reader": "", "summary": {}, "rhythm": {}}')
    Path("runs/e").mkdir()
    Path("runs/e/outcome.json").write_text("{}")
    listed = {entry["folder"]: entry for entry in json.loads(annelid("list", "runs", "--json").out)}
    assert list(listed) == ["runs/a", "runs/below/b", "runs/c", "runs/d"]
    first = listed["runs/a"]
    assert (first["preset"], first["duration_s"], first["status"]) == ("riddle2022-planar", 1.0, "complete")
    assert first["size_bytes"] == sum(path.stat().st_size for path in Path("runs/a").iterdir())
    assert (listed["runs/c"]["status"], listed["runs/d"]["status"]) == ("unreadable", "outcome only")
    assert "riddle2022-planar" in annelid("list", "runs").out


def test_nothing_is_listed_where_nothing_is(annelid: Command) -> None:
    assert json.loads(annelid("list", "runs", "--json").out) == []
    assert annelid("list", "runs", "elsewhere").exit_code == 2


def test_clean_removes_what_is_named_and_nothing_else(annelid: Command, finished: Path) -> None:
    mine, other, left = kept(finished, "a", "b", "c")
    (other / "notes.txt").write_text("mine")
    done = annelid("list", "runs", "--clean", mine, "--clean", other, "--yes")
    assert done.exit_code == 0, done.err
    assert not mine.exists()
    assert [path.name for path in other.iterdir()] == ["notes.txt"]
    assert (left / "run.nc").exists()


def test_clean_asks_first(annelid: Command, finished: Path) -> None:
    [run] = kept(finished, "a")
    assert annelid("list", "runs", "--clean", run).exit_code != 0
    assert (run / "run.nc").exists()


def test_clean_refuses_what_is_not_in_the_list(annelid: Command, finished: Path) -> None:
    [run] = kept(finished, "a")
    outside = Path(shutil.copytree(finished, "outside"))
    for wrong in (outside, Path("runs"), Path("runs/none")):
        assert annelid("list", "runs", "--clean", run, "--clean", wrong, "--yes").exit_code == 2
    assert (outside / "run.nc").exists()
    assert (run / "run.nc").exists()


def test_clean_follows_no_link(annelid: Command, finished: Path) -> None:
    outside = Path(shutil.copytree(finished, "outside"))
    Path("runs").mkdir()
    Path("runs/linked").symlink_to(outside.resolve())
    assert json.loads(annelid("list", "runs", "--json").out) == []
    assert annelid("list", "runs", "--clean", "runs/linked", "--yes").exit_code == 2
    assert (outside / "run.nc").exists()


def test_clean_removes_no_file_of_another_program(annelid: Command, finished: Path) -> None:
    [run] = kept(finished, "a")
    (run / "run.nc").write_bytes(b"another program's")
    assert annelid("list", "runs", "--clean", run, "--yes").exit_code == 2
    assert (run / "run.nc").exists()


@pytest.mark.parametrize("busy", ["runs", "runs/a"])
def test_clean_leaves_a_run_that_is_being_written(annelid: Command, finished: Path, busy: str) -> None:
    [run] = kept(finished, "a")
    code = "import sys; from annelid.simulation.lock import locked\nwith locked(sys.argv[1]): print(flush=1); input()"
    with subprocess.Popen([sys.executable, "-c", code, busy], stdin=-1, stdout=-1) as writer:
        assert writer.stdout is not None
        writer.stdout.readline()
        done = annelid("list", "runs", "--clean", run, "--yes")
        writer.communicate(b"\n")
    assert done.exit_code == 2
    assert (run / "run.nc").exists()
