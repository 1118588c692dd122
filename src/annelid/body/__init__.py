"""The 3D worm as a MuJoCo spec, in two formulations.

`build_spec` is the one way in. The formulations (`rods`, `chain`) build the mesh and return the sites of its
crossings; springs, ring muscles and sensors (`actuation`) are the same for both.
"""

from annelid.body.assemble import build_spec, mesh_of

__all__ = ["build_spec", "mesh_of"]
