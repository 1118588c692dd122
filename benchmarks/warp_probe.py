"""What MuJoCo Warp makes of a worm: whether it takes the model, how far it agrees with the engine, worms a second.

MuJoCo Warp needs an environment of its own: it asks for the metapackage `mujoco`, which holds `mujoco-core` at 4.0.0,
while annelid needs 4.0.1 or later. So install annelid first, then Warp without its dependencies:

    pip install -c constraints.txt . && pip install --no-deps mujoco-warp warp-lang etils absl-py importlib-resources
    python benchmarks/warp_probe.py --preset riddle2023-rods --worms 1 64 1024

Runs on a CUDA device where there is one, else on Warp's CPU device, whose speed means nothing. The first step compiles
kernels for some minutes. Both engines contract the first segment under the same constant activation.
"""

from __future__ import annotations

import argparse
from time import perf_counter

import mujoco
import numpy as np

from annelid.body import build_spec
from annelid.config import load_config

CONTACTS = 512
"""Room for the contacts of one worm, candidates of the broad phase among them."""


def compiled(preset: str, timestep_s: float, newton: bool) -> mujoco.MjModel:
    """Compiles a preset's worm at a physics step, and with the Newton solver if it has another."""
    spec = build_spec(load_config(preset))
    spec.option.timestep = timestep_s
    if newton:
        spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    return spec.compile()


def rows(model: mujoco.MjModel) -> int:
    """Returns room for twice the constraint rows of the worm at rest; Warp allots them once."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return 2 * data.nefc + 256


def compare(model: mujoco.MjModel, n_steps: int) -> None:
    """Steps one worm in both engines and prints how far their states part."""
    import mujoco_warp
    import warp

    ours, theirs = mujoco.MjData(model), mujoco.MjData(model)
    ours.ctrl[0] = theirs.ctrl[0] = 1.0
    try:
        warp_model, warp_data = (
            mujoco_warp.put_model(model),
            mujoco_warp.put_data(model, theirs, nworld=1, njmax=rows(model), nconmax=CONTACTS),
        )
    except (NotImplementedError, ValueError) as refusal:
        print(f"refused: {refusal}")
        return
    ring = model.tendon("ring_0").id
    for step in range(1, n_steps + 1):
        mujoco.mj_step(model, ours)
        mujoco_warp.step(warp_model, warp_data)
        warp.synchronize()
        if step in (1, 3, 10, n_steps):
            lengths = ours.ten_length[ring], float(warp_data.ten_length.numpy()[0][ring])
            apart = float(np.abs(warp_data.qpos.numpy()[0] - ours.qpos).max())
            print(
                f"step {step:3d}: ring {lengths[0]:.4f} and {lengths[1]:.4f} m, coordinates at most {apart:.1e} apart"
            )


def throughput(model: mujoco.MjModel, n_worms: int, n_steps: int = 50) -> None:
    """Prints steps of all worms a second, the recorded graph of a step replayed on a CUDA device."""
    import mujoco_warp
    import warp

    data = mujoco.MjData(model)
    data.ctrl[0] = 1.0
    warp_model, warp_data = (
        mujoco_warp.put_model(model),
        mujoco_warp.put_data(model, data, nworld=n_worms, njmax=rows(model), nconmax=CONTACTS),
    )
    mujoco_warp.step(warp_model, warp_data)
    with warp.ScopedCapture() as capture:
        mujoco_warp.step(warp_model, warp_data)
    warp.synchronize()
    began = perf_counter()
    for _ in range(n_steps):
        warp.capture_launch(capture.graph)
    warp.synchronize()
    spent = perf_counter() - began
    simulated = n_worms * n_steps * model.opt.timestep
    print(
        f"{n_worms:5d} worms: {1e3 * spent / n_steps:8.2f} ms a step of all, {simulated / spent:8.1f} times real time"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--preset", default="riddle2023-rods")
    parser.add_argument("--timestep", type=float, default=0.01, help="physics step, s")
    parser.add_argument("--newton", action="store_true", help="the Newton solver in place of the preset's")
    parser.add_argument("--steps", type=int, default=30, help="steps of the comparison")
    parser.add_argument("--worms", type=int, nargs="*", default=[1, 64, 1024], help="sizes of batches, on CUDA only")
    given = parser.parse_args()
    try:
        import mujoco_warp  # noqa: F401
        import warp
    except ImportError as missing:
        raise SystemExit(f"{missing}\n\n{__doc__}") from None
    model = compiled(given.preset, given.timestep, given.newton)
    print(f"{given.preset}: {model.nv} degrees of freedom, on {warp.get_device().name}")
    compare(model, given.steps)
    if warp.get_device().is_cuda:
        for n_worms in given.worms:
            throughput(model, n_worms)


if __name__ == "__main__":
    main()
