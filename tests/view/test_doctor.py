from __future__ import annotations

import ctypes
import sys
from importlib.metadata import PackageNotFoundError, version

import pytest

from annelid.draw import doctor


def finding(item: str) -> str:
    return next(each.line() for each in doctor.examine() if each.item == item)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such programs")
def test_a_program_that_is_no_ffmpeg_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "works", lambda backend: True)
    for program in ("/bin/false", "/bin/echo", "/nonexistent"):
        monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", program)
        assert finding("ffmpeg") == f"{'missing':<9}{'ffmpeg':<22}does not work: unset IMAGEIO_FFMPEG_EXE"


def test_an_engine_that_cannot_be_imported_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken:
        def find_spec(self, name: str, *_: object) -> None:
            if name == "mujoco":
                raise ctypes.ArgumentError("argument 1: no attribute 'glGetError'")

    monkeypatch.delitem(sys.modules, "mujoco", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Broken(), *sys.meta_path])
    line = finding("mujoco")
    assert line.startswith("missing")
    assert line.endswith("cannot be imported (ArgumentError): unset MUJOCO_GL")


def test_a_value_of_mujoco_gl_that_names_no_back_end_is_not_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "secret-token")
    lines = [each.line() for each in doctor.examine()]
    assert not [line for line in lines if "secret" in line]
    assert any("OpenGL of MUJOCO_GL" in line for line in lines)
    assert finding("frames and videos").endswith("unset MUJOCO_GL")


def test_an_engine_of_another_name_is_not_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    def found(name: str) -> str:
        if name == "mujoco-core":
            raise PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(doctor, "works", lambda backend: True)
    monkeypatch.setattr(doctor, "version", found)
    line = finding("mujoco-core")
    assert line.startswith("missing")
    assert line.endswith(doctor.REMEDY)
