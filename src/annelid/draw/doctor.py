"""What a run and its pictures need, whether it is there, and the line that installs it."""

from __future__ import annotations

import os
import platform
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec

from annelid.draw.gl import candidates, find_backend, works
from annelid.engine import REMEDY, mixed_engine
from annelid.errors import RenderingUnavailable

MINIMUM_MUJOCO = (4, 0, 1)
_PACKAGES = ("numpy", "pydantic", "xarray", "h5netcdf", "h5py", "matplotlib", "imageio", "typer", "rich")
_DEVELOPERS_EXTRAS = ("test", "dev")


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        item: What.
        ok: Whether it is there and works.
        detail: Its version, or what is wrong.
        remedy: What to type where it is missing.
        optional: Whether annelid runs without it.
    """

    item: str
    ok: bool
    detail: str = ""
    remedy: str = ""
    optional: bool = False

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
    yield Finding("python", True, f"{platform.python_version()} on {platform.system()} {platform.machine()}")
    yield _engine()
    for package in _PACKAGES:
        yield _package(package)
    yield from _back_ends()
    yield _ffmpeg()
    for package, extra in _optional_packages().items():
        yield _package(package, optional=True, remedy=f"pip install 'annelid[{extra}]'")


def _engine() -> Finding:
    remedy = "pip install 'mujoco-core[rendering]>=4.0.1'"
    if mixed := mixed_engine():
        return Finding("mujoco", False, mixed, REMEDY)
    try:
        import mujoco
    except ImportError as error:
        return Finding("mujoco", False, str(error).splitlines()[0], remedy)
    except RuntimeError as error:
        return Finding("mujoco", False, str(error).splitlines()[0], "unset MUJOCO_GL")
    found = tuple(int(part) for part in mujoco.__version__.split(".")[:3] if part.isdigit())
    if found < MINIMUM_MUJOCO:
        return Finding("mujoco", False, f"{mujoco.__version__} is too old", remedy)
    return Finding("mujoco", True, mujoco.__version__)


def _package(name: str, *, optional: bool = False, remedy: str = "") -> Finding:
    try:
        return Finding(name, True, version(name), optional=optional)
    except PackageNotFoundError:
        return Finding(name, False, "not installed", remedy or f"pip install {name}", optional)


def _back_ends() -> Iterator[Finding]:
    try:
        tried = candidates(os.environ, platform.system())
    except RenderingUnavailable as error:
        yield Finding("OpenGL", False, str(error), optional=True)
        return
    results = {backend: works(backend) for backend in tried}
    for backend, drawn in results.items():
        yield Finding(f"OpenGL {backend}", drawn, "draws" if drawn else "does not work here", optional=True)
    if any(results.values()):
        yield Finding("frames and videos", True, f"drawn with {next(b for b in tried if results[b])}")
    else:
        try:
            find_backend()
        except RenderingUnavailable as error:
            yield Finding("frames and videos", False, str(error))


def _ffmpeg() -> Finding:
    remedy = "unset IMAGEIO_FFMPEG_EXE" if os.environ.get("IMAGEIO_FFMPEG_EXE") else "pip install imageio-ffmpeg"
    if find_spec("imageio_ffmpeg") is None:
        return Finding("ffmpeg", False, "not installed", remedy)
    import imageio_ffmpeg

    try:
        if found := imageio_ffmpeg.get_ffmpeg_version():
            return Finding("ffmpeg", True, found)
    except (RuntimeError, OSError):
        return Finding("ffmpeg", False, "not found", remedy)
    except (IndexError, ValueError, subprocess.SubprocessError):
        pass
    return Finding("ffmpeg", False, f"{imageio_ffmpeg.get_ffmpeg_exe()} is no ffmpeg", remedy)


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
