"""How much the load frame's forces depend on speed, steps, elements and number of segments (docs/calibration.md).

Prints the largest change of a force against a reference loop, of its peak, at the displacements that a fit compares.
Run ``python benchmarks/load_frame_numerics.py``; it takes about a minute.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from annelid import load_config
from annelid.experiment.case import SHEAR_OVER_YOUNG
from annelid_lab.calibration import ROBOT, cable_force, load_frame, load_identify_study, read_loop

POINTS = 20
YOUNG_MODULUS_PA, DRY_FRICTION_NM, CABLE_FRICTION = 0.28e9, 0.0055, 2.3
"""About those of the default fit."""
WORM = dict(load_identify_study(ROBOT).set) | {
    "body.strands.young_modulus_Pa": YOUNG_MODULUS_PA,
    "body.strands.shear_modulus_Pa": SHEAR_OVER_YOUNG * YOUNG_MODULUS_PA,
    "body.joints.dry_friction_Nm": DRY_FRICTION_NM,
}
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "half the speed in the simulation": ({}, {"haste": 4.0}),
    "half the cable's speed": ({}, {"speed_m_per_s": 0.005}),
    "steps of 10 ms in place of 20": ({"clock.physics_timestep_s": 0.01}, {}),
    "four elements a side in place of three": ({"body.mesh.elements_per_side": 4}, {}),
    "four segments in place of three": ({"body.mesh.n_segments": 4}, {}),
}


def main() -> None:
    measured = read_loop()
    reach_m, at_m = float(measured.displacement_m.max()), measured.places(POINTS)

    def forces(changes: dict[str, Any], options: dict[str, Any]) -> NDArray[np.float64]:
        config = load_config("riddle2023-rods", WORM | changes)
        loop = load_frame(config, displacement_m=reach_m, **options)
        return cable_force(loop, CABLE_FRICTION).branches(at_m)

    reference = forces({}, {})
    for name, (changes, options) in CASES.items():
        change = np.abs(forces(changes, options) - reference).max() / reference.max()
        print(f"{name:40} {change:6.2%} of the peak")


if __name__ == "__main__":
    main()
