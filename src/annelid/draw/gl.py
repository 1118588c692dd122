"""Finding an OpenGL back-end that works without a screen.

A back-end may be missing, may fail, or may bring the whole process down, so each one is first tried in a
process of its own. ``MUJOCO_GL`` is obeyed where the user set it.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from functools import cache

from annelid.errors import RenderingUnavailable

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
