"""The same player in MuJoCo's own window, where there is a display."""

from __future__ import annotations

import sys
import warnings
from time import perf_counter, sleep

import glfw
import mujoco.viewer

from annelid.config import RunConfig
from annelid.draw.scene import DrawnWorm
from annelid.errors import RenderingUnavailable, SimulationStopped
from annelid.live.player import config_of, player_of
from annelid.simulation.runfile import Run

FRAMES_A_SECOND = 30.0
_SPACE, _BACKSPACE = 32, 259
_NO_DISPLAY = "no window can be opened here (no display, or no OpenGL on it): leave out --native to view in a browser"
_NO_MJPYTHON = "on macOS MuJoCo's window needs its own Python: type  mjpython -m annelid view --native"


def show_native(source: RunConfig | Run, *, speed: float = 1.0) -> None:
    """Opens MuJoCo's window and returns when it is closed: space plays and pauses, backspace restarts.

    Args:
        source: A configuration to run, or a run to play.
        speed: Simulated seconds per second.

    Raises:
        RenderingUnavailable: There is no display, no OpenGL on it, or on macOS it is not run by mjpython.
        ConfigError: The body is planar, or cannot be built.
        RunFileError: The run holds no postures.
        SimulationStopped: A guard stopped the worm.
    """
    config = config_of(source)
    _require_display()
    player, _ = player_of(source, speed)
    worm = DrawnWorm(config)
    pressed: list[int] = []
    try:
        window = mujoco.viewer.launch_passive(
            worm.model, worm.posture, key_callback=pressed.append, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError:
        raise RenderingUnavailable(_NO_MJPYTHON) from None
    with window:
        last = perf_counter()
        while window.is_running():
            begun = perf_counter()
            while pressed:
                {_SPACE: player.toggle, _BACKSPACE: player.restart}.get(pressed.pop(0), lambda: None)()
            player.tick(begun - last, deadline=begun + 1.0 / FRAMES_A_SECOND)
            last = begun
            with window.lock():
                worm.pose(player.moment.qpos, player.moment.activation)
            window.sync()
            if player.stopped:
                break
            sleep(max(0.0, begun + 1.0 / FRAMES_A_SECOND - perf_counter()))
    if player.stopped:
        raise SimulationStopped(player.stopped)


def _require_display() -> None:
    """Opens and closes a hidden window, since MuJoCo's own would wait for ever where none can be opened."""
    if sys.platform == "darwin":
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if not glfw.init():
            raise RenderingUnavailable(_NO_DISPLAY)
        glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
        window = glfw.create_window(64, 64, "annelid", None, None)
        if not window:
            raise RenderingUnavailable(_NO_DISPLAY)
        glfw.destroy_window(window)
        glfw.default_window_hints()
