"""The model of a run for plain MuJoCo, with the run's last state as a keyframe."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.body.assemble import mjcf_text
from annelid.errors import RunFileError
from annelid.output import whole_file

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run

FINAL, POSTURE = "final", "last_posture"


def write_mjcf(run: Run, path: Path) -> Path:
    """Writes a run's worm and arena as MJCF.

    The keyframe ``final`` is the last checkpoint, whole but for the frames of rods, which the engine keeps outside its
    keyframes. A run that cannot be continued has the keyframe ``last_posture`` instead: its last frame, at rest.

    Args:
        run: The run of a 3D worm.
        path: File to write.

    Raises:
        ConfigError: The worm is planar or started with a heading, or its friction depends on the direction.
        RunFileError: The file cannot be written.
    """
    text = mjcf_text(run.config, [] if run.config.body.is_planar else _keyframes(run))
    with whole_file(path) as draft:
        draft.write_text(text, encoding="utf-8")
    return path


def _keyframes(run: Run) -> list[dict[str, Any]]:
    from annelid.simulation.runfile import read_checkpoint
    from annelid.simulation.worm import WormPlant

    plant = WormPlant(run.config)
    try:
        state = read_checkpoint(run.path).plant
    except RunFileError:
        if not run.data.sizes.get("frame"):
            return []
        time_s, posture = float(run.data["frame_time"].values[-1]), run.data["qpos"].values[-1]
        return [{"name": POSTURE, "time": time_s, "qpos": posture, "act": plant.anatomy.first_act}]
    plant.set_state(state)
    parts = {name: np.array(getattr(plant.data, name)) for name in ("qpos", "qvel", "act", "ctrl")}
    return [{"name": FINAL, "time": float(plant.data.time), **parts}]
