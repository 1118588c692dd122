"""Sensing and control: the network and how it is wired to the body."""

from __future__ import annotations

from annelid.analysis.rhythm import CONTRACTED
from annelid.config import SnsController
from annelid.simulation.runfile import Run
from annelid.studies.case import fast, rods
from annelid.studies.claims.evidence import (
    MAIN,
    PLANAR_CASES,
    Evidence,
    holds_if,
)
from annelid.studies.contents import Claim
from annelid.studies.outcome import Outcome


def control_claims(evidence: Evidence, outcome: Outcome, main: Run) -> list[Claim]:
    """Judges the claims about sensing and the network."""
    planar = evidence.results[PLANAR_CASES[300]]
    tight, quick = evidence.results[rods()], evidence.results[fast()]
    periods = [o.rhythm.period_s or float("nan") for o in (planar, outcome, quick, tight)]
    ordered = all(o.rhythm.verdict == "ordered" and o.rhythm.direction == 1 for o in (planar, outcome, quick, tight))
    steady = evidence.first_number("gate", "verdict_{}_steady_euler")
    both, following = _half_centres(main)
    return [
        Claim(
            "Sensing and control",
            "The network of the 2D worm drives the 3D worm with little to no change.",
            "sections 2.3, 5",
            holds_if(ordered),
            "little to no change",
            f"ordered 1-2-3 on four bodies, periods {', '.join(f'{period:.3f}' for period in periods)} s",
            "Neurons, synapses and conductances are the same on the planar worm, the paper's chain, its fast form and "
            "the tight rods. What had to change lies around the network: the map from potentials to activation (Eq. "
            "2), the sensors' tolerance (0.1 mm to 10 mm), a hold of the first sensor for 0.2 s"
            f". With sodium gates that start at rest, not as in SNS-Toolbox: {steady.worm} {steady.value}.",
            f"{PLANAR_CASES[300].command}; {MAIN.command}",
        ),
        Claim(
            "Sensing and control",
            "The sodium current is Hodgkin and Huxley's fast transient current.",
            "section 2.3",
            "does not hold",
            "fast transient",
            "persistent sodium current with a slow gate",
            "The equations have instantaneous activation and a gate of up to 300 ms, which sets the period. The name "
            "changes nothing in the results.",
            "annelid presets riddle2023",
        ),
        Claim(
            "Sensing and control",
            "Half-centre neurons flip between excited and inhibited states, and the muscle follows the excited one.",
            "section 2.3, Fig. 7",
            holds_if(both < 0.05 and following > 0.95),
            "Fig. 7",
            f"both of a segment's neurons above R/2 in {100 * both:.1f} % of the samples",
            f"Activation above one half goes with the contraction neuron being the higher one in {100 * following:.1f} "
            "% of the samples; figure 7 shows both.",
            MAIN.command,
        ),
    ]


def _half_centres(run: Run) -> tuple[float, float]:
    """Share of samples in which both neurons of a half-centre are excited, and in which activation follows them."""
    data, controller = run.data, run.config.controller
    assert isinstance(controller, SnsController)
    names = [str(name) for name in data["neuron"].values]
    segments = range(1, run.config.body.n_segments + 1)
    contraction, expansion = (
        data["potential"].values[:, [names.index(f"{role}_{segment}") for segment in segments]]
        for role in ("contraction", "expansion")
    )
    half = controller.range_mV / 2
    both = (contraction > half) & (expansion > half)
    following = (contraction > expansion) == (data["activation"].values > CONTRACTED)
    return float(both.mean()), float(following.mean())
