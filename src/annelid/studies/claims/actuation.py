"""Actuation: the muscles, their function, their forces."""

from __future__ import annotations

import numpy as np

from annelid.config import SnsController, WormBody
from annelid.simulation.runfile import Run
from annelid.studies.case import one_after_the_other, rods
from annelid.studies.claims.evidence import (
    MAIN,
    SHORT_MINIMUM,
    Evidence,
    holds_if,
    nearness,
)
from annelid.studies.contents import Claim
from annelid.studies.outcome import Outcome


def actuation_claims(evidence: Evidence, outcome: Outcome, main: Run) -> list[Claim]:
    """Judges the claims about the muscles."""
    from annelid.view.figures.muscle_surface import largest_difference

    body, controller = main.config.body, main.config.controller
    assert isinstance(body, WormBody)
    assert isinstance(controller, SnsController)
    difference = largest_difference(body.muscles)
    median = outcome.summary.contraction_force_median_N or float("nan")
    peak = outcome.summary.contraction_force_peak_N or float("nan")
    verdict, within = nearness(median, 2.5)
    spring_force = [6 * body.springs.stiffness_N_per_m * stretch for stretch in (0.02, 0.03)]
    slope, reach = controller.activation_slope_per_mV, controller.range_mV
    printed, meant = (1 / (1 + np.exp(sign * slope * reach)) for sign in (1, -1))
    held = evidence.results[rods(one_after_the_other())].holds
    short = evidence.results[SHORT_MINIMUM]
    shortest = min((hold.ring_length_m for hold in short.holds), default=float("nan"))
    usual = min(hold.ring_length_m for hold in held)
    overshoot = evidence.number("timestep", "times_velocity_limit_chain_rk4_1ms")
    return [
        Claim(
            "Actuation",
            "Muscle force follows the engine's force-length-velocity function (Eq. 1, Fig. 5).",
            "section 2.2",
            holds_if(difference < 1e-9),
            "Fig. 5",
            f"engine and documented formula differ by at most {difference:.0e} F0",
            "The engine's own gain and bias are called over the whole surface and compared with the closed form of its "
            "documentation.",
            "annelid paper",
        ),
        Claim(
            "Actuation",
            "Activation is 1/(1 + exp(-0.35 (U_exp - U_con))) (Eq. 2).",
            "section 2.3",
            holds_if(bool(printed > 0.5)),
            "sign as printed",
            f"as printed {printed:.4f} with the contraction neuron excited, {meant:.4f} with the sign reversed",
            "With the printed sign a muscle would relax while its contraction neuron is excited, against the text "
            "below the equation and against Fig. 7. We use the reversed sign.",
            "annelid presets riddle2023",
        ),
        Claim(
            "Actuation",
            "The actuators generate forces up to 2.5 N.",
            "section 2.2",
            verdict,
            "up to 2.5 N",
            f"median {median:.2f} N while contracted, peak {peak:.0f} N",
            "The muscle settles near its shortest length, where little force is left of its peak of "
            f"{max(body.muscles.peak_forces(body.n_segments)):.0f} N: it limits length rather than force. The peak "
            "lasts a few milliseconds at the start of a contraction and depends on the time step.",
            MAIN.command,
            within,
        ),
        Claim(
            "Actuation",
            "2.5 N is the force that stretches six springs of 19.9 N/m by about 2 to 3 cm.",
            "section 2.2",
            holds_if(spring_force[0] <= 2.5 <= spring_force[1]),
            "2.5 N",
            f"{spring_force[0]:.1f} to {spring_force[1]:.1f} N",
            "Arithmetic; the bending of the strands is not in it.",
            "python -c 'print(6 * 19.9 * 0.02, 6 * 19.9 * 0.03)'",
        ),
        Claim(
            "Actuation",
            "A minimum muscle length of 0.58 in place of 0.5 avoids over-contraction.",
            "section 2.2",
            holds_if(shortest < usual),
            "0.58",
            f"ring held at {100 * usual:.1f} cm with 0.58, at {100 * shortest:.1f} cm with 0.5",
            "Open loop, tight rods.",
            SHORT_MINIMUM.command,
        ),
        Claim(
            "Actuation",
            "The automatic peak force is too small, so that a scaling factor of 550,000 is needed.",
            "section 2.2",
            "not testable here",
            "550,000",
            "-",
            "What the compiler makes of the factor depends on the version of the engine, and on numerical inertia. The "
            "compiler of the paper's time made a peak force of 117.57 N of it, which our presets state.",
            "annelid presets riddle2023",
        ),
        Claim(
            "Actuation",
            "The muscles' maximum shortening velocity bounds the contraction (Eq. 1 at steps of 1 ms).",
            "sections 2.2, 3",
            "not testable here" if overshoot is None else holds_if(overshoot <= 1.05),
            "1.5 L0/s",
            "-" if overshoot is None else f"{overshoot:.1f} times the limit in the first 20 ms",
            "Explicit steps of 1 ms do not resolve the muscle's own velocity limit: the ring gains more speed in one "
            "step than the muscle allows. Shorter steps, and the implicit rods at any step, keep to the limit. The "
            "paper's start of a contraction is a matter of its time step.",
            "annelid paper --only timestep",
        ),
    ]
