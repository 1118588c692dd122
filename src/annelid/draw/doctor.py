"""What a run and its pictures need, whether it is there, and the line that installs it.

It names no user, no machine and no folder, so that it can be pasted into a bug report.
"""

from __future__ import annotations

import os
import platform
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version

from annelid.draw.gl import UNSET, candidates, find_backend, works
from annelid.engine import REMEDY, mixed_engine
from annelid.errors import RenderingUnavailable

_PACKAGES = ("numpy", "pydantic", "xarray", "h5netcdf", "h5py", "matplotlib", "imageio", "typer", "rich")
_DEVELOPERS_EXTRAS = ("test", "dev")
_BACK_ENDS = {"egl", "osmesa", "glfw", "glx", "wgl", "cgl"}  # other values of MUJOCO_GL are not printed


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at."""

    item: str
    ok: bool  # whether it is there and works
    detail: str = ""  # its version, or what is wrong
    remedy: str = ""  # what to type where it is missing
    optional: bool = False  # whether annelid runs without it

    @property
    def state(self) -> str:
        """In one word: ok, optional or missing."""
        return "ok" if self.ok else "optional" if self.optional else "missing"

    def line(self) -> str:
        """Returns the finding as one line of text."""
        remedy = f": {self.remedy}" if self.remedy and not self.ok else ""
        return f"{self.state:<9}{self.item:<22}{self.detail}{remedy}".rstrip()


def examine() -> Iterator[Finding]:
    """Looks at Python, the engine, the packages, the OpenGL back-ends, ffmpeg and the extras, one at a time."""
    yield Finding("annelid", True, version("annelid"))
    machine = f"{platform.system()} {platform.release()} {platform.machine()}, {os.cpu_count()} cores"
    yield Finding("python", True, f"{platform.python_version()} on {machine}")
    yield _engine()
    yield _package("mujoco-core", REMEDY)
    yield from (_package(package, f"pip install {package}") for package in _PACKAGES)
    yield from _back_ends()
    yield _ffmpeg()
    for package, extra in _optional_packages().items():
        yield _package(package, f"pip install 'annelid[{extra}]'", optional=True)


def _engine() -> Finding:
    if mixed := mixed_engine():
        return Finding("mujoco", False, mixed, REMEDY)
    try:
        import mujoco
    except Exception as error:  # A back-end that MUJOCO_GL names fails in as many ways as there are libraries.
        remedy = "pip install 'mujoco-core[rendering]>=4.0.1'" if isinstance(error, ImportError) else UNSET
        return Finding("mujoco", False, f"cannot be imported ({type(error).__name__})", remedy)
    return Finding("mujoco", True, mujoco.__version__)


def _package(name: str, remedy: str, *, optional: bool = False) -> Finding:
    try:
        return Finding(name, True, version(name), optional=optional)
    except PackageNotFoundError:
        return Finding(name, False, "not installed", remedy, optional)


def _back_ends() -> Iterator[Finding]:
    try:
        tried = candidates()
    except RenderingUnavailable as error:
        yield Finding("OpenGL", False, str(error), optional=True)
        return
    for backend in tried:
        drawn = works(backend)
        name = backend if backend in _BACK_ENDS else "of MUJOCO_GL"
        yield Finding(f"OpenGL {name}", drawn, "draws" if drawn else "does not work here", optional=True)
    try:
        yield Finding("frames and videos", True, f"drawn with {find_backend()}")
    except RenderingUnavailable as error:
        detail = str(error) if _BACK_ENDS.issuperset(tried) else f"MUJOCO_GL names no back-end: {UNSET}"
        yield Finding("frames and videos", False, detail)


def _ffmpeg() -> Finding:
    remedy = "unset IMAGEIO_FFMPEG_EXE" if os.environ.get("IMAGEIO_FFMPEG_EXE") else "pip install imageio-ffmpeg"
    try:
        import imageio_ffmpeg

        found = imageio_ffmpeg.get_ffmpeg_version()
    # A program of that name may be another, of which nothing is known.
    except (ImportError, RuntimeError, OSError, IndexError, ValueError, subprocess.SubprocessError):
        found = ""
    return Finding("ffmpeg", bool(found), found or "does not work", remedy)


def _optional_packages() -> dict[str, str]:
    """Packages that an extra of annelid asks for, each with the smallest such extra; without those of developers."""
    extras: dict[str, list[str]] = {}
    for line in requires("annelid") or []:
        asked = re.match(r"([\w.-]+).*;.*extra == ['\"]([\w-]+)['\"]", line)
        if asked is not None and asked[2] not in _DEVELOPERS_EXTRAS:
            extras.setdefault(asked[2], []).append(asked[1])
    smallest_last = sorted(extras, key=lambda extra: len(extras[extra]), reverse=True)
    remedies = {package: extra for extra in smallest_last for package in extras[extra]}
    return dict(sorted(remedies.items(), key=lambda remedy: (remedy[1], remedy[0])))
