"""An outside peer: free Cosserat rods of PyElastica with the strands' material, without joints, contact or muscles."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from math import hypot, pi, sqrt
from time import perf_counter
from typing import Any

import numpy as np

from annelid.body import WormBody, mesh_of
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


def peer() -> dict[str, Any]:
    """Times as many free rods as the paper's worm has strands, at their largest stable step.

    The step is the largest of a ladder of 2 % rungs, begun a tenth above the limit of `stable_step_s`, at which a
    bending wave stays bounded.

    Returns:
        ``installed``, and if so the numbers with their units in the keys; if not, the line that installs it.
    """
    try:
        found = {"installed": True, "version": version(PACKAGE)}
    except PackageNotFoundError:
        return {"installed": False, "install": INSTALL}
    body = papers_body()
    limit_s = stable_step_s(body)
    _run(body, limit_s / 2, 20)
    for rung in range(40):
        step_s = 1.1 * limit_s * 0.98**rung
        if _run(body, step_s, round(_TRIAL_S / step_s))[1]:
            break
    else:
        return {**found, "failed": "no stable step was found"}
    n_steps = round(_TIMED_S / step_s)
    wall_s, stable = _run(body, step_s, n_steps)
    return {
        **found,
        "rods": body.mesh.n_helices,
        "elements_per_rod": ELEMENTS,
        "stable": stable,
        "step_us": 1e6 * step_s,
        "step_limit_us": 1e6 * limit_s,
        "step_mean_ms": 1e3 * wall_s / n_steps,
        "real_time_factor": n_steps * step_s / wall_s,
    }


def papers_body() -> WormBody:
    """Returns the body of the paper's worm."""
    body = load_config(CHAIN).body
    assert isinstance(body, WormBody)
    return body


def stable_step_s(body: WormBody) -> float:
    """Largest stable step of a Verlet scheme for a thin, shearable rod of a worm's strands, s.

    The stiffest motion of a thin Cosserat rod is the rotation of its cross-section against the shear stiffness,
    ``omega**2 = k G A / (rho I)`` with ``I / A = r**2 / 4``; the scheme is stable while ``omega * step < 2``. So the
    step depends neither on the length nor on the number of elements.
    """
    shear_Pa = SHEAR_CORRECTION * body.strands.one_number("shear_modulus_Pa")
    return body.strands.radius_m * sqrt(_density_kg_per_m3(body) / shear_Pa)


def _density_kg_per_m3(body: WormBody) -> float:
    """Density that gives a solid strand its mass a length."""
    return body.strands.one_number("linear_density_kg_per_m") / (pi * body.strands.radius_m**2)


def _run(body: WormBody, step_s: float, n_steps: int) -> tuple[float, bool]:
    """Steps the rods from a bending wave; returns the wall-clock time (s) and whether they stayed bounded."""
    elastica: Any = import_module("elastica")
    strands, mesh = body.strands, body.mesh
    length_m = mesh_of(mesh).length_m * hypot(1.0, mesh.angular_rate_rad_per_m * mesh.one_number("radius_m"))
    system, rods = elastica.BaseSystemCollection(), []
    for index in range(mesh.n_helices):
        rod = elastica.CosseratRod.straight_rod(
            ELEMENTS,
            np.array([0.0, 0.1 * index, 0.0]),
            np.array([1.0, 0.0, 0.0]),
            np.array([0.0, 0.0, 1.0]),
            length_m,
            strands.radius_m,
            _density_kg_per_m3(body),
            youngs_modulus=strands.one_number("young_modulus_Pa"),
            shear_modulus=strands.one_number("shear_modulus_Pa"),
        )
        rod.velocity_collection[2] = _WAVE_M_PER_S * np.sin(2.0 * np.pi * np.linspace(0.0, 1.0, ELEMENTS + 1))
        system.append(rod)
        rods.append(rod)
    system.finalize()
    stepper = elastica.PositionVerlet()
    time: Any = 0.0
    with np.errstate(all="ignore"):
        began = perf_counter()
        for _ in range(n_steps):
            time = stepper.step(system, time, step_s)
        wall_s = perf_counter() - began
        fastest = max(float(np.abs(rod.velocity_collection).max()) for rod in rods)
    return wall_s, fastest < _MOST_GROWTH * _WAVE_M_PER_S
