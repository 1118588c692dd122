from __future__ import annotations

import ctypes
import sys

import pytest

from annelid.draw import doctor


def finding(item: str) -> str:
    return next(each.line() for each in doctor.examine() if each.item == item)


@pytest.mark.parametrize("program", ["/bin/false", "/bin/echo", "/nonexistent"])
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such programs")
def test_a_program_that_is_no_ffmpeg_is_found_out(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    monkeypatch.setattr(doctor, "works", lambda backend: True)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", program)
    line = finding("ffmpeg")
    assert line.startswith("missing")
    assert line.endswith("unset IMAGEIO_FFMPEG_EXE")
    assert program not in line


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
