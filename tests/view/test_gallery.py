from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from annelid.draw import gallery
from annelid.simulation.runfile import Run


def test_a_picture_that_fails_does_not_cost_the_others(
    planar_run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(gallery, "figure7", full)
    said: list[str] = []
    drawn = gallery.draw_all(
        planar_run, tmp_path, video=False, quiet=True, complain=lambda what: said.append(str(what))
    )
    assert list(drawn) == [tmp_path / "frame.png"]
    assert len(said) == 1
    assert "figure7.png not drawn" in said[0]
    assert os.strerror(errno.ENOSPC) in said[0]
    assert f"annelid draw {tmp_path}" in said[0]
    assert [path.name for path in tmp_path.iterdir()] == ["frame.png"]
