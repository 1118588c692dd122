"""Finding an OpenGL back-end that works without a screen, and drawing a MuJoCo scene with it.

A back-end may be missing, may fail, or may bring the whole process down, so each one is first tried in a
process of its own. ``MUJOCO_GL`` is obeyed where the user set it; where it is not set, Linux gets the first
of EGL, OSMesa and (with a display) GLFW that draws, and macOS and Windows their own.
"""

from __future__ import annotations

import importlib
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from annelid.errors import RenderingUnavailable

if TYPE_CHECKING:
    import mujoco

INSTALL_LINE = "apt install libegl1 libgl1 libgl1-mesa-dri"
"""What installs a back-end that needs neither a graphics card nor a screen; newer Debian has no OSMesa."""
UNSET = "unset MUJOCO_GL"
_OFF = {"disable", "disabled", "off", "false", "0"}
_DEFAULT = {"", "enable", "enabled", "on", "true", "1"}
_MODULES = {"egl": "egl", "osmesa": "osmesa", "glfw": "glfw", "glx": "glfw", "wgl": "glfw", "cgl": "cgl"}
_PROBE_LIMIT_S = 60.0


def candidates(environment: Mapping[str, str], system: str) -> list[str]:
    """Returns the back-ends worth trying, best first, on a system as `platform.system` calls it.

    Raises:
        RenderingUnavailable: ``MUJOCO_GL`` switches rendering off or names no back-end.
    """
    wanted = environment.get("MUJOCO_GL", "").strip().lower()
    if wanted in _OFF:
        raise RenderingUnavailable(f"rendering is switched off by MUJOCO_GL={wanted}: unset it to render")
    if wanted not in _DEFAULT:
        if wanted not in _MODULES:
            raise RenderingUnavailable(
                f"MUJOCO_GL={wanted} names no OpenGL back-end: unset it, or use one of {', '.join(_MODULES)}"
            )
        return [wanted]
    if system == "Darwin":
        return ["cgl", "glfw"]
    if system == "Windows":
        return ["glfw"]
    screen = environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")
    return ["egl", "osmesa", *(["glfw"] if screen else [])]


@cache
def works(backend: str) -> bool:
    """Whether a back-end draws a picture, tried in a process of its own."""
    command = [sys.executable, "-m", "annelid.draw.gl", backend]
    environment = {**os.environ, "MUJOCO_GL": backend}
    try:
        probe = subprocess.run(command, env=environment, capture_output=True, timeout=_PROBE_LIMIT_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return probe.returncode == 0


def find_backend() -> str:
    """Returns the first back-end that works here.

    Raises:
        RenderingUnavailable: None works; the sentence names the line that installs one.
    """
    tried = candidates(os.environ, platform.system())
    for backend in tried:
        if works(backend):
            return backend
    if os.environ.get("MUJOCO_GL", "").strip().lower() not in _DEFAULT:
        raise RenderingUnavailable(f"the OpenGL back-end {tried[0]} that MUJOCO_GL names does not work here: {UNSET}")
    remedy = (
        f"install one with: {INSTALL_LINE}"
        if platform.system() == "Linux"
        else "update the graphics driver, or render the run file on another machine"
    )
    raise RenderingUnavailable(f"no OpenGL back-end works here (tried {', '.join(tried)}): {remedy}")


class Canvas(AbstractContextManager):
    """An off-screen picture of a MuJoCo model, whose off-screen size and sampling are set here, from a free camera.

    Unlike `mujoco.Renderer`, whose back-end is fixed when `mujoco` is first imported, this one takes
    the back-end that `find_backend` chose. Smooth edges (``fine``) cost twice the time where software draws; ``sky`` is
    whether one is drawn. ``upright`` is the rotation from the model's axes to those that the camera's angles are meant
    in, ``(3, 3)``.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int,
        height: int,
        backend: str,
        *,
        fine: bool = True,
        sky: bool = True,
        upright: NDArray[np.float64] | None = None,
    ) -> None:
        import mujoco

        model.vis.global_.offwidth = width
        model.vis.global_.offheight = height
        model.vis.quality.offsamples = 4 if fine else 0
        self._model, self._size, self._upright = model, (width, height), upright
        self.camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, self.camera)
        # The rings stand for the actuators.
        self._option = mujoco.MjvOption()
        self._option.flags[mujoco.mjtVisFlag.mjVIS_ACTUATOR] = False
        self._context: Any = None
        self._buffers: Any = None
        try:
            module = importlib.import_module(f"mujoco.{_MODULES[backend]}")
            self._context = module.GLContext(width, height)
            self._context.make_current()
            self._buffers = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150.value)
        except (ImportError, AttributeError, RuntimeError, OSError, mujoco.FatalError) as error:
            self.close()
            raise RenderingUnavailable(f"the OpenGL back-end {backend} failed: {error}") from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._buffers)
        self._scene = mujoco.MjvScene(model, maxgeom=50_000)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = True
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = sky
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = True

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Frees the back-end."""
        for part in (self._buffers, self._context):
            if part is not None:
                part.free()
        self._buffers = self._context = None

    def draw(self, data: mujoco.MjData, add: Callable[[mujoco.MjvScene], object] | None = None) -> NDArray[np.uint8]:
        """Draws a posture, whose kinematics up to the tendons must be up to date, as pixels ``(height, width, 3)``.

        ``add`` may add to the scene before it is drawn.
        """
        import mujoco

        model, camera, scene = self._model, self.camera, self._scene
        # Another canvas may have been opened in between.
        self._context.make_current()
        mujoco.mjv_updateScene(model, data, self._option, None, camera, mujoco.mjtCatBit.mjCAT_ALL.value, scene)
        if add is not None:
            add(scene)
        if self._upright is not None:
            for eye in scene.camera:
                eye.pos = camera.lookat + (eye.pos - camera.lookat) @ self._upright
                eye.forward, eye.up = eye.forward @ self._upright, eye.up @ self._upright
        width, height = self._size
        pixels = np.empty((height, width, 3), dtype=np.uint8)
        view = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(view, scene, self._buffers)
        mujoco.mjr_readPixels(pixels, None, view, self._buffers)
        return pixels[::-1]


def _probe(backend: str) -> bool:
    """Draws a lit ball and sees whether anything shows up."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><light pos="0 0 5"/><geom size="1"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with Canvas(model, 32, 32, backend) as canvas:
        return bool(np.any(canvas.draw(data)))


if __name__ == "__main__":
    sys.exit(0 if _probe(sys.argv[1]) else 1)
