"""An outside peer: free Cosserat rods of PyElastica with the strands' material, without joints, contact or muscles."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from math import hypot, pi, sqrt
from time import perf_counter
from typing import Any

import numpy as np

from annelid.body.worm import Mesh, Strands, WormBody
from annelid.config import load_config
from annelid_studies.worms import CHAIN

PACKAGE, INSTALL = "pyelastica", "pip install pyelastica"
ELEMENTS = 48
SHEAR_CORRECTION = 27.0 / 28.0
"""PyElastica's shear correction factor of a round cross-section."""

_WAVE_M_PER_S = 0.05
_TRIAL_S, _TIMED_S = 0.02, 0.1
# The largest speed of a stable trial stays near the initial one; an unstable one has grown a thousandfold by its end.
_MOST_GROWTH = 10.0
_FACTOR, _STEPS = 1.1, 40


def peer() -> dict[str, Any]:
    """Times as many free rods as the paper's worm has strands, at their largest stable step.

    The step is the largest of a ladder of 2 % rungs, begun a tenth above the limit of `stable_step_s`, at which a
    bending wave stays bounded.

    Returns:
        ``installed``, and if so the numbers with their units in the keys; if not, the line that installs it.
    """
    if find_spec("elastica") is None:
        return {"installed": False, "install": INSTALL}
    strands, mesh = _worm()
    limit_s = stable_step_s(strands)
    _run(strands, mesh, limit_s / 2, 20)
    step_s = _FACTOR * limit_s
    for _ in range(_STEPS):
        if _run(strands, mesh, step_s, round(_TRIAL_S / step_s))[1]:
            break
        step_s *= 0.98
    else:
        return {"installed": True, "version": _version(), "failed": "no stable step was found"}
    n_steps = round(_TIMED_S / step_s)
    wall_s, stable = _run(strands, mesh, step_s, n_steps)
    return {
        "installed": True,
        "version": _version(),
        "rods": mesh.n_helices,
        "elements_per_rod": ELEMENTS,
        "stable": stable,
        "step_us": 1e6 * step_s,
        "step_limit_us": 1e6 * limit_s,
        "step_mean_ms": 1e3 * wall_s / n_steps,
        "real_time_factor": n_steps * step_s / wall_s,
    }


def stable_step_s(strands: Strands) -> float:
    """Largest stable step of a Verlet scheme for a thin, shearable rod, s.

    The stiffest motion of a thin Cosserat rod is the rotation of its cross-section against the shear stiffness,
    ``omega**2 = k G A / (rho I)`` with ``I / A = r**2 / 4``; the scheme is stable while ``omega * step < 2``. So the
    step depends neither on the length nor on the number of elements.
    """
    return strands.radius_m * sqrt(density_kg_per_m3(strands) / (SHEAR_CORRECTION * strands.shear_modulus_Pa))


def density_kg_per_m3(strands: Strands) -> float:
    """Density that gives a solid strand its mass a length."""
    return strands.linear_density_kg_per_m / (pi * strands.radius_m**2)


def _worm() -> tuple[Strands, Mesh]:
    body = load_config(CHAIN).body
    assert isinstance(body, WormBody)
    return body.strands, body.mesh


def _run(strands: Strands, mesh: Mesh, step_s: float, n_steps: int) -> tuple[float, bool]:
    """Steps the rods from a bending wave; returns the wall-clock time (s) and whether they stayed bounded."""
    elastica: Any = import_module("elastica")
    system, rods = _rods(elastica, strands, mesh)
    stepper = elastica.PositionVerlet()
    time: Any = 0.0
    with np.errstate(all="ignore"):
        began = perf_counter()
        for _ in range(n_steps):
            time = stepper.step(system, time, step_s)
        wall_s = perf_counter() - began
        fastest = max(float(np.abs(rod.velocity_collection).max()) for rod in rods)
    return wall_s, fastest < _MOST_GROWTH * _WAVE_M_PER_S


def _rods(elastica: Any, strands: Strands, mesh: Mesh) -> tuple[Any, list[Any]]:
    length_m = _mesh_length_m() * hypot(1.0, mesh.angular_rate_rad_per_m * mesh.radius_m)
    system = elastica.BaseSystemCollection()
    rods = []
    for index in range(mesh.n_helices):
        rod = elastica.CosseratRod.straight_rod(
            ELEMENTS,
            np.array([0.0, 0.1 * index, 0.0]),
            np.array([1.0, 0.0, 0.0]),
            np.array([0.0, 0.0, 1.0]),
            length_m,
            strands.radius_m,
            density_kg_per_m3(strands),
            youngs_modulus=strands.young_modulus_Pa,
            shear_modulus=strands.shear_modulus_Pa,
        )
        rod.velocity_collection[2] = _WAVE_M_PER_S * np.sin(2.0 * np.pi * np.linspace(0.0, 1.0, ELEMENTS + 1))
        system.append(rod)
        rods.append(rod)
    system.finalize()
    return system, rods


def _mesh_length_m() -> float:
    from annelid.body import mesh_of

    body = load_config(CHAIN).body
    assert isinstance(body, WormBody)
    return mesh_of(body.mesh).length_m


def _version() -> str:
    try:
        return version(PACKAGE)
    except PackageNotFoundError:
        return "unknown"
