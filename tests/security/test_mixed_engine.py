"""pip installs `mujoco` 3.x over `mujoco-core` in one folder; annelid says so before it computes with the mixture."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from annelid.draw.doctor import examine
from annelid.engine import REMEDY, mixed_engine, refuse_mixed_engine
from annelid.errors import AnnelidError


def install(folder: Path, name: str, version: str, content: str) -> None:
    """Lays the records of a package down, as pip does: one that owns `mujoco/LICENSE`, or nothing."""
    info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", encoding="utf-8")
    # Some readers of records leave out files that are not there.
    (folder / "mujoco").mkdir(exist_ok=True)
    (folder / "mujoco" / "LICENSE").touch()
    records = [f"mujoco/LICENSE,sha256={content},100"] if content else []
    (info / "RECORD").write_text("\n".join([*records, f"{info.name}/RECORD,,"]), encoding="utf-8")


def test_an_engine_over_another_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, "mujoco-core", "4.0.1", "aaaa")
    install(tmp_path, "mujoco", "3.17.0", "bbbb")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(AnnelidError) as refused:
        refuse_mixed_engine()
    assert isinstance(refused.value, ImportError)
    for word in ("mujoco 3.17.0", "mujoco-core 4.0.1", "1 files", "LICENSE", REMEDY):
        assert word in str(refused.value)
    assert tmp_path.name not in str(refused.value), "no folder of a user"
    engine = next(finding for finding in examine() if finding.item == "mujoco")
    assert not engine.ok
    assert REMEDY in engine.line()
    assert "3.17.0" in engine.line()


@pytest.mark.parametrize(
    ("folder", "version", "content"), [("one", "4.0.1", ""), ("one", "4.0.1", "aaaa"), ("other", "3.17.0", "bbbb")]
)
def test_no_files_the_same_files_and_other_folders_do_no_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, version: str, content: str
) -> None:
    install(tmp_path / "one", "mujoco-core", "4.0.1", "aaaa")
    install(tmp_path / folder, "mujoco", version, content)
    monkeypatch.syspath_prepend(tmp_path / "one")
    monkeypatch.syspath_prepend(tmp_path / folder)
    assert mixed_engine() is None


def test_the_first_use_of_the_engine_ends_in_a_sentence(tmp_path: Path) -> None:
    install(tmp_path, "mujoco-core", "4.0.1", "aaaa")
    install(tmp_path, "mujoco", "3.17.0", "bbbb")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import runpy; "
        "sys.argv = ['annelid', 'export', 'riddle2023-rods', '--to', 'mjcf']; "
        "runpy.run_module('annelid', run_name='__main__')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 2
    assert done.stderr.startswith("annelid: mujoco 3.17.0 and mujoco-core 4.0.1 are installed over each other")
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "worm.xml").exists()
