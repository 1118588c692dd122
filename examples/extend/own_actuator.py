"""A ring actuator of your own: a cable that pulls with a force in proportion to the activation, whatever its length.

    python examples/extend/own_actuator.py [folder]

Takes a few seconds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, ClassVar, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from annelid import load_config, simulate
from annelid.body import ActuatorKind
from annelid.body.actuators import PerSegment

if TYPE_CHECKING:
    from annelid.body.actuators import Slopes


class Winch(ActuatorKind):
    """A cable under a force that follows the activation."""

    force_field: ClassVar[str] = "pull_N"
    kind: Literal["winch"] = "winch"
    pull_N: PerSegment = Field(default=2.0, description="tension at full activation")

    def add(self, spec: mujoco.MjSpec, name: str, span_m: list[float], force_N: float) -> None:
        """Adds one cable: MuJoCo's plainest actuator on the ring's tendon."""
        cable = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_TENDON, lengthrange=span_m)
        cable.ctrllimited, cable.ctrlrange = True, [0.0, 1.0]
        cable.gaintype, cable.gainprm = mujoco.mjtGain.mjGAIN_FIXED, [-force_N, *[0.0] * 9]

    def slopes(self, model: mujoco.MjModel) -> Slopes:
        """Returns zeros: the force depends on nothing else."""

        def slopes(length_m: NDArray, *_: NDArray) -> tuple[NDArray, NDArray]:
            return np.zeros_like(length_m), np.zeros_like(length_m)

        return slopes


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        folder = Path(sys.argv[1] if len(sys.argv) > 1 else temporary)
        winch = {"body.rings": {"kind": "winch", "pull_N": 1.5}, "duration_s": 0.3}
        run = simulate(load_config("riddle2023-fast", winch), folder)
        print(f"greatest force {run.data['muscle_force'].values.max():.2f} N of 1.5 N")
