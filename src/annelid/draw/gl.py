"""Finding an OpenGL back-end that works without a screen, and drawing a MuJoCo scene with it.

A back-end may be missing, may fail, or may bring the whole process down, so each one is first tried in a
process of its own. ``MUJOCO_GL`` is obeyed where the user set it.
"""

from __future__ import annotations

import importlib
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Sequence
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
BACK_ENDS = {"Linux": ("egl", "osmesa", "glfw"), "Darwin": ("cgl", "glfw"), "Windows": ("glfw",)}
"""Best first, by the system."""
_OFF = {"disable", "disabled", "off", "false", "0"}
_DEFAULT = {"", "enable", "enabled", "on", "true", "1"}
_PROBE_LIMIT_S = 60.0
# Draws a lit ball and sees whether anything shows up.
_PROBE = """
import mujoco
ball = '<mujoco><worldbody><light pos="0 0 5"/><geom size="1"/></worldbody></mujoco>'
model = mujoco.MjModel.from_xml_string(ball)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 32, 32) as renderer:
    renderer.update_scene(data)
    assert renderer.render().any()
"""


def candidates() -> Sequence[str]:
    """Returns the back-ends worth trying, best first: the one that ``MUJOCO_GL`` names, or those of the system.

    Raises:
        RenderingUnavailable: ``MUJOCO_GL`` switches rendering off.
    """
    if (wanted := _wanted()) in _OFF:
        raise RenderingUnavailable(f"rendering is switched off by MUJOCO_GL={wanted}: unset it to render")
    return BACK_ENDS.get(platform.system(), ("glfw",)) if wanted in _DEFAULT else (wanted,)


def _wanted() -> str:
    return os.environ.get("MUJOCO_GL", "").strip().lower()


@cache
def works(backend: str) -> bool:
    """Whether a back-end draws a picture, tried in a process of its own."""
    environment = {**os.environ, "MUJOCO_GL": backend}
    command = [sys.executable, "-c", _PROBE]
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
    tried = candidates()
    if (found := next(filter(works, tried), None)) is not None:
        return found
    if _wanted() not in _DEFAULT:
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
    the back-end that `find_backend` chose. Smooth edges (``fine``) cost twice the time where software draws.
    ``upright`` is the rotation from the model's axes to those that the camera's angles are meant in, ``(3, 3)``.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int,
        height: int,
        *,
        fine: bool = True,
        upright: NDArray[np.float64] | None = None,
    ) -> None:
        import mujoco

        backend = find_backend()
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
            module = importlib.import_module(f"mujoco.{'glfw' if backend in ('glx', 'wgl') else backend}")
            self._context = module.GLContext(width, height)
            self._context.make_current()
            self._buffers = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150.value)
        except (ImportError, AttributeError, RuntimeError, OSError, mujoco.FatalError) as error:
            self.close()
            raise RenderingUnavailable(f"the OpenGL back-end {backend} failed: {error}") from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._buffers)
        self._scene = mujoco.MjvScene(model, maxgeom=50_000)
        for flag, shown in (("SHADOW", True), ("SKYBOX", True), ("REFLECTION", False), ("FOG", True)):
            self._scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = shown

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
