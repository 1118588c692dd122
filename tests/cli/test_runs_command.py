from __future__ import annotations

import json
import shutil
from pathlib import Path

from outcome import Command


def kept(finished: Path, *names: str) -> list[Path]:
    return [Path(shutil.copytree(finished, Path("runs") / name)) for name in names]


def test_runs_are_listed_with_what_they_are(annelid: Command, finished: Path) -> None:
    kept(finished, "a", "below/b")
    Path("runs/c").mkdir()
    Path("runs/c/run.nc").write_bytes(b"nothing")
    Path("runs/d").mkdir()
    Path("runs/d/outcome.json").write_text("{}")
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


def test_links_are_not_followed(annelid: Command, finished: Path) -> None:
    outside = Path(shutil.copytree(finished, "outside"))
    Path("runs").mkdir()
    Path("runs/linked").symlink_to(outside.resolve())
    assert json.loads(annelid("list", "runs", "--json").out) == []
