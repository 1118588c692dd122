"""Does the load frame call for a nonlinear bending law? (docs/calibration.md)

Fits friction of crossings and cable to the measured loop with strands that are linear, at several moduli, and with
strands whose bending stiffness follows the tube's law: the stiffness of every vertex is renewed before each step, as
the secant at its change of curvature in the material frame. Also prints the strains that the strands reach. Run
``python benchmarks/tube_law.py RESULTS.csv``; about ten minutes of one core.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from annelid import load_config, simulate
from annelid.body import build_spec, compile_spec
from annelid.body.damping import twist_name
from annelid.experiment import SHEAR_OVER_YOUNG, load_frame
from annelid.experiment.identify.kinds.tensile import bending_secant
from annelid.experiment.identify.study import ROBOT, load_identify_study
from annelid.experiment.load_frame import Loop, cable_force, read_loop
from annelid.output import write_csv

Array = NDArray[np.float64]
INITIAL_PA, SOFTENING, OUTER_M, BORE = 0.408e9, 0.0070, 3.175e-3, 0.68
"""Law of the tube and its section: docs/calibration.md."""
SECANT_PA = 0.29e9
"""Of the law in bending, at the mean strain of half of the way."""
SPRINGS = {"24.5 N/m, rest 0.065 m": {}, "19.9 N/m, unstretched": {"stiffness_N_per_m": 19.9, "rest_length_m": "none"}}
PER_VERTEX = 10
POINTS, STEP = 20, 0.04


class Softening:
    """Bending of the strands of one model, read and renewed."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Finds the stiffness of every vertex; the first number of each strand's is how many follow."""
        self.model, n = model, int(model.flex_edgenum[0])
        self.stiffness = model.flex_bending.reshape(model.nflex, -1)[:, 1:].reshape(model.nflex, n - 1, PER_VERTEX)[
            :, :, 4
        ]
        self.linear, self.rest = self.stiffness.copy(), None
        self.bodies = model.flex_vertbodyid.reshape(model.nflex, -1)
        names = [[twist_name(f"strand_{strand}", edge, n) for edge in range(n)] for strand in range(model.nflex)]
        self.twist = np.array([[model.jnt_qposadr[model.joint(name).id] for name in strand] for strand in names])
        self.curvature = np.zeros(self.linear.shape)
        self.table = np.geomspace(1e-6, 0.2, 400)
        self.share = bending_secant(self.table, SOFTENING, BORE)

    def read(self, data: mujoco.MjData) -> None:
        """Reads the change of curvature against the first call, 1/m, ``(n_strands, n_vertices)``."""
        edge = np.diff(data.xpos[self.bodies], axis=1)
        length = np.linalg.norm(edge, axis=-1, keepdims=True)
        t = edge / length
        n = t.shape[1]
        frames = np.stack([data.plastic[at : at + 6 * n] for at in self.model.flex_plasticadr]).reshape(-1, n, 2, 3)
        before, u = frames[:, :, 0], frames[:, :, 1]
        turn, cosine = np.cross(before, t), (before * t).sum(axis=-1, keepdims=True)
        u = u * cosine + np.cross(turn, u) + turn * (turn * u).sum(axis=-1, keepdims=True) / (1.0 + cosine)
        angle = data.qpos[self.twist][..., None]
        first = np.cos(angle) * u + np.sin(angle) * np.cross(t, u)
        axes = [(one[:, :-1] + one[:, 1:]) / 2 for one in (first, np.cross(t, first))]
        t0, t1 = t[:, :-1], t[:, 1:]
        bend = 4 * np.cross(t0, t1) / (1 + (t0 * t1).sum(axis=-1, keepdims=True)) / (length[:, :-1] + length[:, 1:])
        now = np.stack([(bend * axis).sum(axis=-1) for axis in axes], axis=-1)
        self.rest = now if self.rest is None else self.rest
        self.curvature = np.linalg.norm(now - self.rest, axis=-1)

    def renew(self) -> None:
        """Gives every vertex the law's secant at its curvature."""
        self.stiffness[:] = self.linear * np.interp(OUTER_M * self.curvature, self.table, self.share)


def loop_of(young_Pa: float, dry_Nm: float, springs: dict[str, Any], *, softens: bool) -> tuple[Loop, list[Array]]:
    """Winds the ring of a worm; returns the loop and the outer strains of all vertices at each sample."""
    fields = {
        "body.strands.young_modulus_Pa": young_Pa,
        "body.strands.shear_modulus_Pa": young_Pa * SHEAR_OVER_YOUNG,
        "body.joints.dry_friction_Nm": dry_Nm,
        **{f"body.springs.{name}": value for name, value in springs.items()},
    }
    config = load_config("riddle2023-rods", dict(load_identify_study(ROBOT).set) | fields)
    strands: list[Softening] = []
    strains: list[Array] = []
    plain, locate = load_frame._steps, load_frame._locate

    def steps(model: mujoco.MjModel, data: mujoco.MjData, n_steps: int) -> None:
        for _ in range(n_steps):
            if strands:
                strands[0].read(data)
                if softens:
                    strands[0].renew()
            plain(model, data, 1)
            if not strands:
                # The engine has its frames after the first step.
                strands.append(Softening(model))

    def located(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        locate(model, data)
        strains.append(OUTER_M * strands[0].curvature)

    load_frame._steps, load_frame._locate = steps, located
    try:
        return load_frame.load_frame(config), strains
    finally:
        load_frame._steps, load_frame._locate = plain, locate


def fitted(measured: Loop, young_Pa: float | None, springs: dict[str, Any], *, softens: bool) -> dict[str, float]:
    """Fits friction, and the modulus where none is given, to the loop."""
    at = measured.places(POINTS)
    wanted = measured.branches(at)
    known: dict[tuple[float, float], Loop] = {}

    def simulated(logs: Array) -> Loop:
        dry, cable, *rest = np.exp(logs).tolist()
        young = rest[0] if rest else (young_Pa or 0.0)
        if (young, dry) not in known:
            known[young, dry] = loop_of(young, dry, springs, softens=softens)[0]
        return cable_force(known[young, dry], cable)

    def residual(logs: Array) -> Array:
        return (simulated(logs).branches(at) - wanted).ravel()

    def slopes(logs: Array) -> Array:
        here = residual(logs)
        return np.stack([(residual(logs + step) - here) / STEP for step in STEP * np.eye(len(logs))], axis=-1)

    start = np.log([0.006, 2.3, *([] if young_Pa else [0.3e9])])
    found = least_squares(residual, start, jac=slopes, max_nfev=7, xtol=1e-3, ftol=1e-4)  # pyright: ignore[reportArgumentType]
    dry, cable, *rest = np.exp(found.x).tolist()
    rms = float(np.sqrt((found.fun**2).mean()))
    return {
        "young_modulus_Pa": rest[0] if rest else (young_Pa or 0.0),
        "dry_friction_Nm": dry,
        "cable_friction": cable,
        "rms_N": rms,
        "rms_share": rms / float(wanted.max()),
        "lost_share": simulated(found.x).lost_share(),
    }


def walking_strains(preset: str = "wang") -> Array:
    """Lets a worm walk; returns the changes of the amount of curvature as outer strains, ``(n_frames, n_vertices)``.

    They are less than the changes in the material frame, which a run does not record.
    """
    config = load_config(preset, {"duration_s": 9.0, "record.frames_interval_s": 0.1})
    with tempfile.TemporaryDirectory() as folder:
        postures = simulate(config, folder, progress=False).data["qpos"].values
    model = compile_spec(build_spec(config, for_plant=True))
    data = mujoco.MjData(model)
    bodies = model.flex_vertbodyid.reshape(model.nflex, -1)

    def curvature(qpos: Array) -> Array:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        edge = np.diff(data.xpos[bodies], axis=1)
        length = np.linalg.norm(edge, axis=-1, keepdims=True)
        t0, t1 = (edge / length)[:, :-1], (edge / length)[:, 1:]
        bend = 4 * np.cross(t0, t1) / (1 + (t0 * t1).sum(axis=-1, keepdims=True)) / (length[:, :-1] + length[:, 1:])
        return np.linalg.norm(bend, axis=-1).ravel()

    return OUTER_M * np.abs(np.stack([curvature(each) for each in postures]) - curvature(model.qpos0))


def main(path: Path) -> None:
    """Writes a row for each strand and each pair of springs."""
    walked = walking_strains()
    worst = walked[walked.max(axis=1).argmax()]
    print(
        f"walking: outer strain {worst.max():.2%} at most, {(worst**3).sum() / (worst**2).sum():.2%} in the mean there"
    )
    measured = read_loop()
    _, strains = loop_of(0.29e9, 0.0053, {}, softens=False)
    print(
        "share of the way in, outer strain: greatest, mean weighted with energy, secant modulus in bending there (GPa)"
    )
    for share in (0.25, 0.5, 0.75, 1.0):
        now = strains[round(share * (len(strains) // 2))]
        mean = float((now**3).sum() / (now**2).sum())
        secant = INITIAL_PA * float(bending_secant(mean, SOFTENING, BORE)) / 1e9
        print(f"{share:4}  {now.max():.2%}  {mean:.2%}  {secant:.3f}")
    cases = {
        "linear, small-strain modulus": (INITIAL_PA, False),
        "linear, secant modulus": (SECANT_PA, False),
        "linear, modulus fitted": (None, False),
        "the tube's law": (INITIAL_PA, True),
    }
    rows: list[list[object]] = []
    for springs, changes in SPRINGS.items():
        for name, (young_Pa, softens) in cases.items():
            numbers = fitted(measured, young_Pa, changes, softens=softens)
            rows.append([springs, name, *(f"{value:.4g}" for value in numbers.values())])
            print(rows[-1], flush=True)
            write_csv(path, ["springs", "strands", *numbers], rows)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "tube_law.csv"))
