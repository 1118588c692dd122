"""The structure: mesh, strands, pins and springs."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from annelid.body import mesh_of
from annelid.config import PlanarBody, WormBody
from annelid.simulation.runfile import Run
from annelid.studies.claims.evidence import (
    MAIN,
    PLANAR_CASES,
    POLYETHYLENE_KG_PER_M3,
    TUBE_AREA_M2,
    Evidence,
    holds_if,
    nearness,
)
from annelid.studies.contents import Claim


def structure_claims(evidence: Evidence, main: Run) -> list[Claim]:
    """Judges the claims about mesh, strands, pins and springs."""
    body = main.config.body
    assert isinstance(body, WormBody)
    geometry = mesh_of(body.mesh)
    equal_area = sqrt(TUBE_AREA_M2 / pi)
    density = TUBE_AREA_M2 * POLYETHYLENE_KG_PER_M3
    planar = evidence.store.run(PLANAR_CASES[300])
    planar_body = planar.config.body
    assert isinstance(planar_body, PlanarBody)
    length = planar.data["stretch_length"].values[..., 0]
    height = planar.data["ring_length"].values
    residual = float(np.abs(length**2 + height**2 - 4 * planar_body.side_m**2).max() / (4 * planar_body.side_m**2))
    error = evidence.number("discretization", "difference_elongation_rods")
    accuracy, margin = ("not testable here", "") if error is None else nearness(1.0 + error, 1.0)
    by_stiffness = evidence.number("pins", "elongation_tight_first_m")
    soft = evidence.results[MAIN]
    gap = soft.summary.pin_gap_max_m or 0.0
    tension = evidence.first_number("springs", "verdict_tension_only_{}")
    return [
        Claim(
            "Structure",
            "A rhombus of the planar model keeps l^2 + w^2 = 4 l_s^2 while it contracts.",
            "section 2.1",
            holds_if(residual < 1e-9),
            "l^2 + w^2 = 4 l_s^2",
            f"largest relative deviation {residual:.1e}",
            "Checked at every sample of a run of the planar worm.",
            PLANAR_CASES[300].command,
        ),
        Claim(
            "Structure",
            "Twelve tubes, half of each handedness, pinned where they cross, form a cylindrical mesh of rhombi.",
            "section 2.2",
            holds_if(geometry.n_strands == 12 and geometry.n_crossings == 90),
            "12 strands",
            f"{geometry.n_strands} strands, {geometry.n_crossings} crossings in {len(geometry.plane_x_m)} planes",
            "The crossings follow from the helices alone. Other even numbers of strands from 6, other dimensions and "
            "other numbers of elements a side are built from the same formulae.",
            "annelid build riddle2023",
        ),
        Claim(
            "Structure",
            "A solid strand of 2 mm radius has the cross-section of the tube.",
            "section 2.2",
            holds_if(abs(equal_area / body.strands.radius_m - 1) < 0.02),
            "1.7e-5 m2, about 0.002 m",
            f"equal area needs {1e3 * equal_area:.2f} mm",
            f"A radius of 2 mm has {100 * pi * body.strands.radius_m**2 / TUBE_AREA_M2:.0f} % of the tube's area and "
            f"{100 * (body.strands.radius_m / equal_area) ** 4:.0f} % of the bending stiffness of a solid strand of "
            "equal area. What the radius does to the gait is examined under strand radius.",
            "annelid paper --only radius",
        ),
        Claim(
            "Structure",
            "Density and thickness give the model the mass of the robot's tubes.",
            "section 2.2",
            holds_if(abs(body.strands.linear_density_kg_per_m / density - 1) < 0.02),
            f"{1e3 * density:.1f} g/m",
            f"{1e3 * body.strands.linear_density_kg_per_m:.1f} g/m in the authors' files",
            "The thinner strand is lighter than the tube by the same share as its area, even with the capsules' "
            "overlapping caps. Motors and cables, most of the robot's weight, are not in the model.",
            "annelid presets riddle2023",
        ),
        Claim(
            "Structure",
            "The strands are joined at their crossings as the robot's are, by rotating pins.",
            "section 2.2",
            holds_if(gap < 0.005),
            "joints at the crossings",
            f"pins part by up to {1e3 * gap:.0f} mm",
            "The engine's default constraints are soft springs for such light pins. The paper's elongations rest on "
            "them"
            + (
                f": with pins that hold, segment 1 elongates by {100 * by_stiffness:.1f} cm in open loop."
                if by_stiffness is not None
                else "."
            ),
            "annelid paper --only pins",
        ),
        Claim(
            "Structure",
            "Capsules, three to a side, approximate the compliant structure well enough.",
            "section 2.2",
            accuracy,
            "3 elements a side",
            "-" if error is None else f"elongation {100 * error:.1f} % from the finest mesh",
            "Held open-loop contractions of the tight rods, three elements a side against the finest mesh tried.",
            "annelid paper --only discretization",
            margin,
        ),
        Claim(
            "Structure",
            "The axial springs act in tension only.",
            "section 2.2",
            holds_if(tension.value.startswith("1-2-3")),
            "tension only",
            f"with such springs: {tension.value} ({tension.worm})",
            "The authors' files have springs that push as well, and so has our preset. The verdict says whether the "
            "rhythm survives the text's version.",
            "annelid run riddle2023 --set body.springs.tension_only=true",
        ),
    ]
