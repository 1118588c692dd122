"""The 3D worm as a MuJoCo spec, in two formulations.

`build_spec` is the one way in, and `compile_spec` makes the engine's model of it. The formulations (`rods`, `chain`)
build the mesh with a site at every crossing; springs and ring muscles between those sites (`actuation`) are the same
for both. `elimination` orders the engine's factor along the tube.
"""

from annelid.engine import refuse_mixed_engine

# Every use of the engine begins here, and a mixed one fails in ways that tell nothing.
refuse_mixed_engine()

from annelid.body.assemble import build_spec, compile_spec, mesh_of  # noqa: E402

__all__ = ["build_spec", "compile_spec", "mesh_of"]
