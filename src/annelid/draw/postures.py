"""The postures that a run of a 3D worm has recorded, checked against the body that they are shown with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from annelid.errors import RunFileError

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run


def postures_of(run: Run, n_coordinates: int) -> NDArray[np.floating]:
    """Returns the generalised positions of every frame, ``(n_frames, n_coordinates)``.

    Args:
        run: The run.
        n_coordinates: Generalised positions of the body that is built from its configuration.

    Raises:
        RunFileError: No postures were recorded, or those of another body.
    """
    data = run.data
    if "qpos" not in data or data.sizes.get("frame", 0) == 0:
        raise RunFileError(f"{run.path} holds no recorded postures to draw")
    if data.sizes["coordinate"] != n_coordinates:
        raise RunFileError(
            f"{run.path} holds postures of {data.sizes['coordinate']} coordinates, but the body built "
            f"from its configuration has {n_coordinates}: it was written by another version"
        )
    return data["qpos"].values
