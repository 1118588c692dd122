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


def test_each_picture_is_announced_before_it_is_drawn(
    planar_run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said: list[str] = []
    for draw in ("figure7", "render_frame", "render_video"):
        monkeypatch.setattr(gallery, draw, lambda *_, **__: said.append(capsys.readouterr().err))
    list(gallery.draw_all(planar_run, tmp_path, video=True, quiet=False, complain=lambda _: None))
    assert said == ["drawing figure7.png\n", "drawing frame.png\n", "drawing video.mp4\n"]
