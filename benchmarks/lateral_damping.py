"""How a fast contraction depends on the time step: the engine's damping of rods, the material's, and the chain's.

The middle ring of the paper's worm is pulled by 2.5 N at once; its length after 0.2 s is printed for four steps, beside
that of the paper's chain of damped joints. The engine's Rayleigh damping of a curved rod has no part across the plane
of its rest curvature (``docs/upstream/curved_rod_damping.md``), so that a fast motion there meets only the step's own
dissipation. The material's time is that of the chain's joints. Takes about a minute.

    python benchmarks/lateral_damping.py --csv docs/results/lateral_damping.csv
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import mujoco

from annelid import load_config
from annelid.body import build_spec, compile_spec
from annelid.body.damping import MaterialDamping, tendons_to_rows
from annelid.body.worm import WormBody
from annelid.output import write_csv

FORCE_N = 2.5
DURATION_S = 0.2
RING = "ring_1"
CHAIN_S = 0.98
"""Damping over stiffness of the chain's joints, 0.12 N m s/rad over E I by the elements' length, s."""
STEPS_S = (0.0005, 0.001, 0.005, 0.010)
ROWS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    (
        "rods, the engine's damping",
        "riddle2023",
        {"body.formulation.kind": "rods", "body.formulation.edge_time_constant_s": 0.0002},
    ),
    (
        "rods, the material's damping time",
        "riddle2023-rods",
        {"body.strands.damping_time_s": CHAIN_S, "body.formulation.integrator": "Euler"},
    ),
    ("chain of damped joints", "riddle2023", {"body.formulation.pin_time_constant_s": 0.004}),
)


def ring_after(preset: str, changes: dict[str, Any], timestep_s: float) -> float:
    """Length of the middle ring after a sudden pull, m.

    Args:
        preset: The preset whose body is taken.
        changes: What is changed in it.
        timestep_s: The engine's time step, s.
    """
    mesh = {"body.mesh.elements_per_side": 3, "clock.physics_timestep_s": timestep_s}
    config = load_config(preset, mesh | changes)
    assert isinstance(config.body, WormBody)
    strands = config.body.strands
    spec = build_spec(config, for_plant=True)
    muscle = spec.actuator(RING)
    muscle.gaintype, muscle.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_NONE
    muscle.gainprm = [-FORCE_N, *[0.0] * 9]
    tendons_to_rows(spec)
    model = compile_spec(spec)
    data = mujoco.MjData(model)
    data.actuator(RING).ctrl[0] = 1.0
    dampers = MaterialDamping(model, strands) if strands.material_damping_s else None
    for _ in range(round(DURATION_S / timestep_s)):
        if dampers is not None:
            dampers.renew(data.qpos)
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return float(data.tendon(RING).length[0])


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--csv", type=Path, help="file for the numbers")
    path = parser.parse_args().csv
    print(f"{'ring after 0.2 s, m, at a step of':34}", *(f"{1e3 * step:7.1f} ms" for step in STEPS_S))
    rows = []
    for label, preset, changes in ROWS:
        is_chain = "body.formulation.kind" not in changes and preset == "riddle2023"
        # A chain's explicit integrator takes no longer steps.
        lengths = [math.nan if is_chain and step > 0.001 else ring_after(preset, changes, step) for step in STEPS_S]
        rows.append([label, *lengths])
        print(f"{label:34}", *(f"{length:10.3f}" for length in lengths), flush=True)
    if path:
        write_csv(path, ["body", *(f"ring_m_at_{1e3 * step:g}_ms" for step in STEPS_S)], rows)


if __name__ == "__main__":
    main()
