"""Where the muscles' work goes, over the time step, and whether the totals close.

The numerical loss stands twice: as what is left of the muscles' work when all else is subtracted, which is what a run
tells, and from the matrices with which the engine's integrator takes springs and dampers. The residual is the
difference, over the muscles' work.

    python benchmarks/energy_balance.py
    python benchmarks/energy_balance.py --presets riddle2025 --steps-ms 10 5 2 1 --seconds 4
    python benchmarks/energy_balance.py --seconds 2 --csv docs/results/energy_balance.csv
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from annelid.config import RunConfig, load_config
from annelid.morphology import Array
from annelid.output import write_csv
from annelid.simulation import build_controller
from annelid.simulation.objects import in_scene
from annelid.simulation.worm import WormPlant

HELD = ("kinetic_energy", "elastic_energy", "potential_energy")


class AuditedWorm(WormPlant):
    """A worm of rods that adds up what its integrator takes.

    Attributes:
        integrator_J: Energy that the change of velocity within a step, and the integrator's own stiffness and damping,
            have taken.
        spring_J: Work of the springs' forces as they were at the beginning of each step.
    """

    def __init__(self, config: RunConfig) -> None:
        super().__init__(config)
        self.integrator_J = self.spring_J = 0.0
        slides = self.model.jnt_type == int(mujoco.mjtJoint.mjJNT_SLIDE)
        # Those of a scene are none of the integrator's points.
        self._slides = slides[self.model.dof_jntid] & ~in_scene(self.model)[self.model.dof_bodyid]

    def add_step(self, drive: Array) -> None:
        """Adds a step to the energy totals and audits it."""
        super().add_step(drive)
        data, h = self.data, float(self.model.opt.timestep)
        inertial = np.zeros(self.model.nv)
        mujoco.mj_mulM(self.model, data, inertial, data.qacc)
        known = data.qfrc_passive + data.qfrc_constraint - data.qfrc_bias
        # The hinges' own matrix, and a scene's, the engine does not show; their share is told by the missing force.
        implicit = np.where(self._slides, self._implicit_force(), inertial - known)
        self.integrator_J += 0.5 * h * h * float(inertial @ data.qacc) - h * float(implicit @ data.qvel)
        self.spring_J += h * float(data.qfrc_spring @ data.qvel)

    def _implicit_force(self) -> Array:
        """Force by which the integrator corrects springs and dampers on the slides, N."""
        model, data = self.model, self.data
        acceleration, lever = data.qacc, data.ten_J.ravel()
        flexes = product(data.efm_K_val, data.efm_K_rownnz, data.efm_K_rowadr, data.efm_K_colind, acceleration)
        rate = np.zeros(model.ntendon)
        rate[data.efm_tid[: data.nefmT]] = data.efm_ts[: data.nefmT]
        tension = rate * product(lever, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind, acceleration)
        rows = np.repeat(np.arange(model.ntendon), model.ten_J_rownnz)
        columns = model.ten_J_colind[: len(rows)]
        tendons = np.bincount(columns, lever[: len(rows)] * tension[rows], minlength=model.nv)
        return data.efm_c - flexes - tendons


def product(
    values: Array, row_sizes: NDArray[np.int32], row_starts: NDArray[np.int32], columns: NDArray[np.int32], x: Array
) -> Array:
    """Multiplies a compressed sparse matrix, whose rows follow one another, by a vector."""
    assert np.array_equal(row_starts[1:], np.cumsum(row_sizes)[:-1])
    rows = np.repeat(np.arange(len(row_sizes)), row_sizes)
    return np.bincount(rows, values[: len(rows)] * x[columns[: len(rows)]], minlength=len(row_sizes)).astype(np.float64)


def balance(config: RunConfig, progress: Progress) -> dict[str, float]:
    """Runs a worm without recording it; returns its books, J."""
    worm = AuditedWorm(config)
    controller = build_controller(config, worm)
    controller.reset(config.seed)
    felt, start = worm.reset(config.seed), worm.read(False)
    steps = round(config.duration_s / config.clock.control_timestep_s)
    for _ in progress.track(range(steps), description=f"{config.name}, {config.clock.physics_timestep_s:g} s"):
        felt = worm.step(controller.step(felt))
    end = worm.read(False)
    gain = {name: float(np.sum(end[name]) - np.sum(start[name])) for name in end if name in start}
    held = sum(gain[name] for name in HELD)
    work, damping, constraint = gain["muscle_work"], gain["damping_loss"], gain["constraint_loss"]
    integrator = worm.integrator_J - worm.spring_J - gain["elastic_energy"]
    left = work - held - damping - constraint
    return {
        "work": work,
        "held": held,
        "slip": gain["slip_loss"],
        "contacts": constraint - gain["slip_loss"],
        "damping": damping,
        "left": left,
        "integrator": integrator,
        "residual": (left - integrator) / work,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Prints one row for every preset and time step."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--presets", nargs="+", default=["riddle2025", "riddle2025-muscles", "riddle2023-rods"])
    parser.add_argument("--steps-ms", nargs="+", type=float, default=[10.0, 5.0, 2.0, 1.0])
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--csv", type=Path, help="file for the numbers")
    given = parser.parse_args(arguments)
    table = Table(
        "preset", "step", "work", "held", "slip", "contacts, edges", "damping", "left", "integrator", "residual"
    )
    rows = []
    try:
        with Progress(transient=True) as progress:
            for preset in given.presets:
                for step_ms in given.steps_ms:
                    changes = {"clock.physics_timestep_s": step_ms / 1000, "duration_s": given.seconds}
                    # The books of one step of the engine.
                    changes["body.formulation.integrator"] = "Euler"
                    books = balance(load_config(preset, changes), progress)
                    cells = [f"{books[name]:.3f} J" for name in list(books)[:-2]]
                    share = f"{books['integrator']:.3f} J ({100 * books['integrator'] / books['work']:.1f} %)"
                    rows.append({"case": f"{preset} {step_ms:g} ms", "preset": preset, "step_ms": step_ms, **books})
                    table.add_row(preset, f"{step_ms:g} ms", *cells, share, f"{100 * books['residual']:.4f} %")
    finally:
        Console(width=160).print(table)
    if given.csv:
        write_csv(given.csv, rows[0], (row.values() for row in rows))


if __name__ == "__main__":
    main()
