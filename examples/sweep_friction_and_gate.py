"""On which ground does a faster rhythm pay? A grid of frictions and gate time constants as one labelled dataset.

    python examples/sweep_friction_and_gate.py [folder]

Sixteen runs of some seconds each, on all cores; a second call computes none of them again.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import annelid

STUDY = {
    "name": "friction and gate",
    "preset": "riddle2025-muscles",
    "set": {"duration_s": 9.0},
    "vary": [
        {"field": "arena.friction", "values": [0.1, 0.3, 0.7, 1.2]},
        {"field": "controller.gate_time_constant_ms", "from": 150.0, "to": 500.0, "log": True, "number": 4},
    ],
    "outputs": ["speed_m_per_s", "slip_ratio", "period_s"],
}


def main(folder: Path, study: dict = STUDY) -> None:
    """Runs the sweep and tells the best gate on every friction."""
    data = annelid.sweep(study, folder)
    gate = "controller.gate_time_constant_ms"
    for friction in data["arena.friction"].values:
        here = data.sel({"arena.friction": friction})
        walking = here.speed_m_per_s.where(here.status == "complete").dropna(gate)
        if not walking.size:
            print(f"friction {friction:g}: none walks")
            continue
        best = walking.idxmax(gate).item()
        slip = here.slip_ratio.sel({gate: best}).item()
        print(f"friction {friction:g}: {100 * walking.max().item():.1f} cm/s at {best:g} ms, slip ratio {slip:.2f}")


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else temporary))
