"""Sensing and control: the network and how it is wired to the body."""

from __future__ import annotations

from math import nan

from annelid.analysis.rhythm import CONTRACTED
from annelid.control.sns import Sns
from annelid.simulation.runfile import Run
from annelid_studies.riddle2023.claims.evidence import (
    MAIN,
    PLANAR_CASES,
    Evidence,
    between,
    judged,
)
from annelid_studies.riddle2023.contents import Claim
from annelid_studies.riddle2023.examinations.gate import VARIANTS, variant
from annelid_studies.worms import fast, rods

GATES = "the worm and how its gates start"


def control_claims(evidence: Evidence) -> list[Claim]:
    """Judges the claims about sensing and the network."""
    own = [outcome for outcome, _ in evidence.runs]
    others = [evidence.results[case] for case in (PLANAR_CASES[300], fast(), rods())]
    rhythms = [outcome.rhythm for outcome in (*own, *others)]
    gates = {
        start: [
            evidence.results[variant(worm, *pair)].rhythm.is_one_wave
            for worm, pairs in VARIANTS[evidence.effort].items()
            for pair in pairs
            if pair[0] == start
        ]
        for start in ("toolbox", "steady")
    }
    walks, on = judged([rhythm.is_one_wave for rhythm in rhythms] + gates["toolbox"] + gates["steady"], GATES)
    shares = [_half_centres(run) for _, run in evidence.runs]
    flip = judged((both < 0.05 and following > 0.95 for both, following in shares), "the run")
    return [
        Claim(
            "Sensing and control",
            "The network of the 2D worm drives the 3D worm with little to no change.",
            "sections 2.3, 5",
            walks,
            "little to no change",
            f"in the order 1-2-3: {sum(rhythm.is_one_wave for rhythm in rhythms)} of {len(rhythms)} runs on four "
            f"bodies, periods {between([rhythm.period_s or nan for rhythm in rhythms], digits=3)} s; with either "
            f"update order of the network {sum(gates['toolbox'])} of {len(gates['toolbox'])}, with gates that start at "
            f"rest {sum(gates['steady'])} of {len(gates['steady'])}",
            "Neurons, synapses and conductances are the same on the planar worm, the paper's chain, its fast form and "
            "the tight rods. What had to change lies around the network: the map from potentials to activation (Eq. "
            "2), the sensors' tolerance (0.1 mm to 10 mm), and a hold of the first sensor for 0.2 s. The gates of the "
            "sodium current start as in SNS-Toolbox; where they start at rest, all that differs is told above.",
            f"{PLANAR_CASES[300].command}; {MAIN.command}",
            on,
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
            flip[0],
            "Fig. 7",
            f"both of a segment's neurons above R/2 in {between((both for both, _ in shares), 100, 1)} % of samples",
            "It holds if both are excited in less than 5 % of the samples and activation follows in more than 95 %. "
            "Activation above one half goes with the contraction neuron being the higher one in "
            f"{between((following for _, following in shares), 100, 1)} % of the samples; figure 7 shows both.",
            MAIN.command,
            flip[1],
        ),
    ]


def _half_centres(run: Run) -> tuple[float, float]:
    """Share of samples in which both neurons of a half-centre are excited, and in which activation follows them."""
    data, controller = run.data, run.config.controller
    assert isinstance(controller, Sns)
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
