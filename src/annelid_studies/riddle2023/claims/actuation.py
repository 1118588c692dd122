"""Actuation: the muscles, their function, their forces."""

from __future__ import annotations

from math import nan

import numpy as np

from annelid.body.worm import WormBody
from annelid.control.sns import Sns
from annelid.simulation.runfile import Run
from annelid_studies.riddle2023.claims.evidence import (
    EXACT,
    MAIN,
    SHORT_MINIMUM,
    Evidence,
    between,
    judged,
    near,
)
from annelid_studies.riddle2023.contents import Claim
from annelid_studies.worms import fast, one_after_the_other, rods


def actuation_claims(evidence: Evidence, main: Run) -> list[Claim]:
    """Judges the claims about the muscles."""
    from annelid_studies.riddle2023.figures.muscle_surface import largest_difference

    body, controller = main.config.body, main.config.controller
    assert isinstance(body, WormBody)
    assert isinstance(controller, Sns)
    difference = largest_difference(body.muscles)
    summaries = [one.summary for one, _ in evidence.runs]
    medians = [summary.contraction_force_median_N or nan for summary in summaries]
    peaks = [summary.contraction_force_peak_N or nan for summary in summaries]
    verdict, within = near(peaks, 2.5, "the run")
    spring_force = [6 * body.springs.stiffness_N_per_m * stretch for stretch in (0.02, 0.03)]
    slope, reach = controller.activation_slope_per_mV, controller.range_mV
    printed, meant = (1 / (1 + np.exp(sign * slope * reach)) for sign in (1, -1))
    usual, short = (
        [hold.ring_length_m for worm in (fast, rods) for hold in evidence.results[worm(changes)].holds]
        for changes in (one_after_the_other(), SHORT_MINIMUM)
    )
    shorter, avoids = judged((ours < theirs for ours, theirs in zip(short, usual, strict=True)), "the segment")
    return [
        Claim(
            "Actuation",
            "Muscle force follows the engine's force-length-velocity function (Eq. 1, Fig. 5).",
            "section 2.2",
            judged([difference < 1e-9])[0],
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
            judged([printed > 0.5])[0],
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
            f"largest {between(peaks, digits=1)} N; median while contracted {between(medians)} N",
            "The largest force of each run is compared, as the claim is about a largest one. Of RK4 the "
            "engine tells the force of the last of its four stages, which alternates from step to step: the largest is "
            "one of these, and depends on the time step. The muscle settles near its shortest length, where "
            "little is left of the "
            f"{max(body.muscles.forces(body.n_segments)):.0f} N that it could pull with: it limits length rather "
            "than force. The paper's number is nearer to that settled force.",
            MAIN.command,
            within,
        ),
        Claim(
            "Actuation",
            "2.5 N is the force that stretches six springs of 19.9 N/m by about 2 to 3 cm.",
            "section 2.2",
            judged([spring_force[0] <= 2.5 <= spring_force[1]])[0],
            "2.5 N",
            f"{spring_force[0]:.1f} to {spring_force[1]:.1f} N",
            "Arithmetic; the bending of the strands is not in it.",
            "python -c 'print(6 * 19.9 * 0.02, 6 * 19.9 * 0.03)'",
        ),
        Claim(
            "Actuation",
            "A minimum muscle length of 0.58 in place of 0.5 avoids over-contraction.",
            "section 2.2",
            shorter,
            "0.58",
            f"rings held at {between(usual, 100, 1)} cm with 0.58, at {between(short, 100, 1)} cm with 0.5",
            f"Every ring of sprung and tight rods, {len(usual)} contractions in open loop with each value. The paper "
            "does not say from what length on a mesh is over-contracted; what is compared is whether 0.58 keeps rings "
            "longer, which the law of the force all but says: a weak test.",
            rods(SHORT_MINIMUM).command,
            avoids,
        ),
        Claim(
            "Actuation",
            "The automatic peak force is too small, so that a scaling factor of 550,000 is needed.",
            "section 2.2",
            "not testable here",
            "550,000",
            "-",
            "Not tested by decision: what the compiler makes of the factor depends on the version of the engine, and "
            "on numerical inertia. The "
            "compiler of the paper's time made a peak force of 117.57 N of it, which our presets state.",
            "annelid presets riddle2023",
        ),
        velocity_claim(evidence),
    ]


def velocity_claim(evidence: Evidence) -> Claim:
    """Judges the claim about how fast a contraction begins."""
    overshoot = evidence.number("timestep", "times_velocity_limit_chain_rk4_1ms")
    finer = evidence.number("timestep", "times_velocity_limit_chain_rk4_0.5ms")
    return Claim(
        "Actuation",
        "The muscles' maximum shortening velocity bounds the contraction (Eq. 1 at steps of 1 ms).",
        "sections 2.2, 3",
        judged([overshoot <= 1.0 + EXACT])[0],
        "1.5 L0/s",
        f"{overshoot:.1f} times the limit in the first 20 ms; {finer:.1f} times at steps of 0.5 ms",
        "Explicit steps of 1 ms do not resolve the muscle's own velocity limit: the ring gains more speed in one "
        "step than the muscle allows. Shorter steps come nearer to the limit, and the implicit rods keep to it "
        "at any step. The paper's start of a contraction is a matter of its time step.",
        "annelid paper --only timestep",
    )
