"""The worms of the sweeps: fields that differ from the base worm where one quantity does."""

from __future__ import annotations

from typing import Any

from annelid.body.assemble import mesh_of
from annelid.errors import ConfigError
from annelid_studies.weak_middle.pulls import base_body


def segment_changes(n_segments: float) -> dict[str, Any]:
    """Fields for a number of segments."""
    return {"body.mesh.n_segments": int(n_segments)}


def stiffness_changes(young_GPa: float) -> dict[str, Any]:
    """Fields for a Young's modulus, GPa.

    Shear modulus and damping keep their ratios to it, so that soft rods come to rest as soon as stiff ones.
    """
    strands = base_body().strands
    share = young_GPa * 1e9 / strands.young_modulus_Pa
    return {
        "body.strands.young_modulus_Pa": young_GPa * 1e9,
        "body.strands.shear_modulus_Pa": round(share * strands.shear_modulus_Pa),
        "body.strands.joint_damping_Nms_per_rad": round(share * strands.joint_damping_Nms_per_rad, 6),
    }


def weight_changes(mass_kg: float) -> dict[str, Any]:
    """Fields for a mass of the worm, kg, that its pins carry; 0 is a worm of the base worm's mass without weight.

    Raises:
        ConfigError: The strands alone weigh more.
    """
    if mass_kg == 0:
        return {"arena.gravity_m_per_s2": 0.0}
    pins, strands_kg = _pins_and_strands()
    if mass_kg <= strands_kg:
        raise ConfigError(f"mass_kg = {mass_kg:g} must be above {strands_kg:.3f}, which the strands weigh alone")
    return {"body.pins.mass_kg": round((mass_kg - strands_kg) / pins, 9)}


def base_mass_kg() -> float:
    """Mass of the base worm, kg."""
    pins, strands_kg = _pins_and_strands()
    return pins * base_body().pins.mass_kg + strands_kg


def _pins_and_strands() -> tuple[int, float]:
    """Number of pins of the base worm, and mass of its strands, kg."""
    body = base_body()
    mesh = mesh_of(body.mesh)
    return mesh.n_crossings, mesh.n_strands * mesh.strand_length_m * body.strands.linear_density_kg_per_m


def friction_changes(friction: float) -> dict[str, Any]:
    """Fields for a coefficient of friction."""
    return {"arena.friction": friction}
