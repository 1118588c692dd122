"""The structure: mesh, strands, pins and springs."""

from __future__ import annotations

from math import isnan, nan, pi, sqrt

import numpy as np

from annelid.body import mesh_of
from annelid.body.worm import WormBody
from annelid.planar.riddle2022 import PlanarBody
from annelid.simulation.runfile import Run
from annelid_studies.riddle2023.claims.evidence import (
    PLANAR_CASES,
    POLYETHYLENE_KG_PER_M3,
    TENSION_ONLY,
    TUBE_AREA_M2,
    Evidence,
    between,
    judged,
    near,
    readings_m,
)
from annelid_studies.riddle2023.contents import Claim
from annelid_studies.riddle2023.examinations.discretization import HELD, QUANTITIES
from annelid_studies.riddle2023.examinations.side_by_side import WORMS

PIN_RADIUS_M = 0.005


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
    return [
        Claim(
            "Structure",
            "A rhombus of the planar model keeps l^2 + w^2 = 4 l_s^2 while it contracts.",
            "section 2.1",
            judged([residual < 1e-9])[0],
            "l^2 + w^2 = 4 l_s^2",
            f"largest relative deviation {residual:.1e}",
            "Checked at every sample of a run of the planar worm.",
            PLANAR_CASES[300].command,
        ),
        Claim(
            "Structure",
            "Twelve tubes, half of each handedness, pinned where they cross, form a cylindrical mesh of rhombi.",
            "section 2.2",
            judged([geometry.n_strands == 12 and geometry.n_crossings == 90])[0],
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
            near([body.strands.radius_m], equal_area, "")[0],
            "1.7e-5 m2, about 0.002 m",
            f"equal area needs {1e3 * equal_area:.2f} mm, {100 * (equal_area / body.strands.radius_m - 1):.0f} % more",
            f"A radius of 2 mm has {100 * pi * body.strands.radius_m**2 / TUBE_AREA_M2:.0f} % of the tube's area and "
            f"{100 * (body.strands.radius_m / equal_area) ** 4:.0f} % of the bending stiffness of a solid strand of "
            "equal area. What the radius does to the gait is examined under strand radius.",
            "annelid paper --only radius",
        ),
        Claim(
            "Structure",
            "Density and thickness give the model the mass of the robot's tubes.",
            "section 2.2",
            near([body.strands.linear_density_kg_per_m], density, "")[0],
            f"{1e3 * density:.1f} g/m",
            f"{1e3 * body.strands.linear_density_kg_per_m:.1f} g/m in the authors' files",
            "The thinner strand is lighter than the tube by the same share as its area, even with the capsules' "
            "overlapping caps. Motors and cables, most of the robot's weight, are not in the model.",
            "annelid presets riddle2023",
        ),
        pins_claim(evidence),
        elements_claim(evidence),
        _springs_claim(evidence),
    ]


def pins_claim(evidence: Evidence) -> Claim:
    """Judges the claim about the pins."""
    by_stiffness = evidence.number("pins", "elongation_tight_first_m")
    gaps = [outcome.summary.pin_gap_max_m or nan for outcome, _ in evidence.runs]
    return Claim(
        "Structure",
        "The strands are joined at their crossings as the robot's are, by rotating pins.",
        "section 2.2",
        judged(gap < PIN_RADIUS_M for gap in gaps)[0],
        "joints at the crossings",
        f"strands part by up to {between(gaps, 1e3, 0)} mm at a pin of {1e3 * PIN_RADIUS_M:.0f} mm radius",
        "It would hold if strands stayed within the pin. The engine's default constraints are soft springs for "
        "such light pins. The paper's elongations rest on them: with rigid crossings, segment 1 elongates by "
        f"{100 * by_stiffness:.1f} cm in open loop.",
        "annelid paper --only pins",
    )


def elements_claim(evidence: Evidence) -> Claim:
    """Judges the claim about the number of elements a side."""
    differences, orders = (
        {
            worm.label: [
                evidence.number("discretization", f"{which}_{name.replace(' ', '_')}_{worm.name}")
                for name in QUANTITIES
            ]
            for worm, _, _ in HELD[evidence.effort]
        }
        for which in ("difference", "order")
    )
    # None, told as NaN, where the differences fit no order.
    fitted = [one for each in orders.values() for one in each if not isnan(one)]
    verdict, within = near((1.0 + one for each in differences.values() for one in each), 1.0, "the quantity")
    return Claim(
        "Structure",
        "Capsules, three to a side, approximate the compliant structure well enough.",
        "section 2.2",
        verdict,
        "3 elements a side",
        "; ".join(
            f"{label}: {', '.join(f'{name} {100 * one:.1f} %' for name, one in zip(QUANTITIES, each, strict=True))}"
            for label, each in differences.items()
        ),
        "Differences from the finest mesh tried, in held open-loop contractions of all three segments (root mean "
        f"square). The order of convergence is {between(fitted, digits=1) if fitted else 'nowhere'} where one can be "
        "fitted; where it is below one, the finest mesh is itself far from the limit.",
        "annelid paper --only discretization",
        within,
    )


def _springs_claim(evidence: Evidence) -> Claim:
    """Judged by what such springs make of the paper's number, in the worm nearest to the paper's that was run so."""
    worm = next(worm for worm in WORMS if worm.name in evidence.worms)
    pulling, both = (100 * readings_m(evidence.store.run(worm.case(changes)))[0] for changes in (TENSION_ONLY, {}))
    walks = [
        evidence.results[each.case(TENSION_ONLY)].rhythm.is_one_wave for each in WORMS if each.name in evidence.worms
    ]
    verdict, within = near(pulling, 4.20, "how the elongation is read")
    return Claim(
        "Structure",
        "The axial springs act in tension only.",
        "section 2.2",
        verdict,
        "tension only; segment 1 elongates by 4.20 cm",
        f"with such springs segment 1 elongates by {between(pulling)} cm over the six springs and their mean "
        f"({pulling[0]:.2f} on the first); with springs that push as well, by {between(both)} cm ({both[0]:.2f}; "
        f"{worm.label})",
        "The authors' files have springs that push as well, and so has our preset. What is compared is the elongation "
        "of segment 1 with the springs of the text: where it is far from the paper's, the paper's numbers do not come "
        "from such springs. "
        f"{sum(walks)} of the {len(walks)} worms that were run with them keep the order 1-2-3.",
        "annelid run riddle2023 --set body.springs.tension_only=true",
        within,
    )
