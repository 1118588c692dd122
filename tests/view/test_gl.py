from __future__ import annotations

from pathlib import Path

import pytest

from annelid.draw import gl
from annelid.draw.doctor import examine
from annelid.draw.render import render_frame
from annelid.errors import RenderingUnavailable
from annelid.simulation.runfile import Run


def test_mujoco_gl_is_obeyed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "OSMesa")
    assert gl.candidates() == ("osmesa",)
    monkeypatch.setenv("MUJOCO_GL", "off")
    with pytest.raises(RenderingUnavailable, match="MUJOCO_GL=off"):
        gl.candidates()
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    monkeypatch.setattr(gl, "works", lambda backend: False)
    with pytest.raises(RenderingUnavailable, match=r"osmesa .* unset MUJOCO_GL"):
        gl.find_backend()


def test_without_a_back_end_the_sentence_names_the_install_line(
    rods_run: Run, picture: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(gl, "works", lambda backend: False)
    monkeypatch.setattr(gl.platform, "system", lambda: "Linux")
    with pytest.raises(RenderingUnavailable, match="apt install libegl1"):
        render_frame(rods_run, 0.1, picture)
    assert not picture.exists()


def test_a_back_end_that_cannot_exist_does_not_work() -> None:
    gl.works.cache_clear()
    assert gl.works("nosuch") is False


def test_doctor_finds_what_the_tests_themselves_run_on() -> None:
    findings = {finding.item: finding for finding in examine()}
    for item in ("annelid", "python", "mujoco", "numpy", "xarray", "ffmpeg"):
        assert findings[item].ok, item
    assert all(finding.optional or finding.ok or finding.remedy for finding in findings.values())
