"""A formulation of your own: rods whose crossings carry a weight each, on top of annelid's.

    python examples/extend/own_formulation.py [folder]

Takes a few seconds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from annelid import load_config, simulate
from annelid.body import Rods
from annelid.config.sections import NonNegative

if TYPE_CHECKING:
    import mujoco


class WeightedRods(Rods):
    """Rods with a weight at every crossing, as of sensors and their wires."""

    kind: Literal["weighted-rods"] = "weighted-rods"  # type: ignore[assignment]
    weight_kg: NonNegative = Field(default=0.002, description="mass that is added at each crossing")

    def add(self, spec: mujoco.MjSpec, *mesh: Any, **options: Any) -> None:
        """Adds the rods, then the weights."""
        super().add(spec, *mesh, **options)
        for body in spec.bodies:
            if body.name.startswith("crossing_"):
                body.mass += self.weight_kg


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        folder = Path(sys.argv[1] if len(sys.argv) > 1 else temporary)
        for weight_kg in (0.0, 0.01):
            rods = {"body.formulation": {"kind": "weighted-rods", "weight_kg": weight_kg}, "duration_s": 0.3}
            run = simulate(load_config("riddle2023-rods", rods), folder / f"{weight_kg}")
            height_m = float(run.data["center_of_mass"][-1, 2])
            print(f"{1e3 * weight_kg:g} g a crossing: centre of mass at {1e3 * height_m:.1f} mm")
