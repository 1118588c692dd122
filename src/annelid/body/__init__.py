"""The 3D worm: its sections, and its MuJoCo spec.

`build_spec` is the one entrance to the engine, and `compile_spec` makes the engine's model of it. Kinds of formulation
(`formulations`) build the mesh with a site at every crossing; springs and ring actuators (`actuators`) between those
sites are the same for all. The sections (`worm`) are read
without the engine, which is loaded on first use of the names below.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from annelid.engine import refuse_mixed_engine
from annelid.lazy import lazy

if TYPE_CHECKING:
    from annelid.body.actuation import crossing_site, ring_names, stretch_sensors
    from annelid.body.actuators import ActuatorKind
    from annelid.body.actuators.muscle import Rings, muscle_force
    from annelid.body.actuators.servo import ServoRings, wrap_factors
    from annelid.body.assemble import build_spec, compile_robot, compile_spec, robot_spec
    from annelid.body.estimates import bearable_force_N, longest_step_s, rhombus_of
    from annelid.body.formulations import FormulationKind
    from annelid.body.formulations.rods import Rods
    from annelid.body.mesh import Mesh
    from annelid.body.worm import WormBody, worm_of

# Every use of the engine begins here, and a mixed one fails with errors that explain nothing.
refuse_mixed_engine()

__all__ = [
    "ActuatorKind",
    "FormulationKind",
    "Mesh",
    "Rings",
    "Rods",
    "ServoRings",
    "WormBody",
    "bearable_force_N",
    "build_spec",
    "compile_robot",
    "compile_spec",
    "crossing_site",
    "longest_step_s",
    "muscle_force",
    "rhombus_of",
    "ring_names",
    "robot_spec",
    "stretch_sensors",
    "worm_of",
    "wrap_factors",
]

__getattr__, __dir__ = lazy(__name__, {"mesh_of": "a body's own method geometry() returns its mesh"})
