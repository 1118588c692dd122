"""A worm as MJCF, stepped in plain MuJoCo: no annelid after the file is written.

    python examples/worm_in_plain_mujoco.py [worm.xml]

The second ring contracts and lets go. Takes a few seconds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np

from annelid import load_config
from annelid.body import build_spec, compile_spec


def write(path: Path) -> None:
    """Writes the paper's worm of rods, as `annelid export riddle2023-rods --to mjcf` does."""
    spec = build_spec(load_config("riddle2023-rods"))
    compile_spec(spec)
    path.write_text(spec.to_xml(), encoding="utf-8")


def main(path: Path, duration_s: float = 2.0) -> None:
    """Steps the model and prints what its ring does."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    print(f"{model.nv} degrees of freedom, {model.nu} muscles, steps of {1000 * model.opt.timestep:g} ms")
    for until_s in np.linspace(0.0, duration_s, 6)[1:]:
        data.ctrl[1] = 1.0 if until_s <= 0.6 * duration_s else 0.0
        while data.time < until_s - model.opt.timestep / 2:
            mujoco.mj_step(model, data)
        ring_m, force_N = data.actuator_length[1], -data.actuator_force[1]
        print(f"{data.time:.2f} s: ring {100 * ring_m:5.1f} cm, {force_N:5.2f} N")


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        model_path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(folder) / "worm.xml"
        write(model_path)
        main(model_path)
