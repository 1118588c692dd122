"""Pictures of environments' worms; what draws them is opened with the first one."""

from __future__ import annotations

import weakref

import numpy as np
from numpy.typing import NDArray

from annelid.draw.camera import view_angles
from annelid.draw.scene import PostureScene
from annelid.environments.episode import Episode
from annelid.errors import require_at_least


class Pictures:
    """Draws worms as they are now, with one scene for each different model."""

    def __init__(self, camera: str, width: int, height: int) -> None:
        """Keeps how they are to be drawn.

        Raises:
            RunFileError: No camera has that name.
            ConfigError: A picture without pixels.
        """
        view_angles(camera)
        require_at_least(1, width=width, height=height)
        self._camera, self._width, self._height = camera, width, height
        self._scenes: dict[str, PostureScene] = {}
        # OpenGL cannot be freed any more once Python is shutting down, and environments are often left open.
        weakref.finalize(self, _close, self._scenes)

    def draw(self, episode: Episode) -> NDArray[np.uint8]:
        """Draws a worm: pixels, ``(height, width, 3)``.

        Raises:
            RenderingUnavailable: No OpenGL back-end works.
        """
        config = episode.task.config
        drawn = config.model_dump_json(include={"body", "arena"})
        if drawn not in self._scenes:
            self._scenes[drawn] = PostureScene(config, self._width, self._height, self._camera)
        caption = f"{episode.sensation.time_s:.2f} s"
        return self._scenes[drawn].picture(episode.worm.qpos, episode.activation, caption)

    def close(self) -> None:
        """Frees what was opened."""
        _close(self._scenes)


def _close(scenes: dict[str, PostureScene]) -> None:
    for scene in scenes.values():
        scene.close()
    scenes.clear()
