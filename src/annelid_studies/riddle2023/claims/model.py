"""Claims about the model: mesh, strands, pins and springs; muscles, their function and forces; the network."""

from __future__ import annotations

from math import isnan, nan, pi, sqrt

import numpy as np

from annelid.analysis import CONTRACTED
from annelid.body import worm_of
from annelid.config import field_value
from annelid.simulation import Run
from annelid_studies.papers.judging import EXACT, Judgement, judged, near
from annelid_studies.papers.words import span
from annelid_studies.riddle2023.claims.evidence import (
    GATES,
    MAIN,
    PLANAR_CASES,
    POLYETHYLENE_KG_PER_M3,
    SHORT_MINIMUM,
    TENSION_ONLY,
    TUBE_AREA_M2,
    Evidence,
    gated,
    judges,
    readings_m,
)
from annelid_studies.riddle2023.examinations.design import WORMS
from annelid_studies.riddle2023.examinations.discretization import HELD, QUANTITIES
from annelid_studies.riddle2023.figures.muscle_surface import largest_difference
from annelid_studies.standard_cases import fast, one_after_the_other, rods

PIN_RADIUS_M = 0.005


@judges
def planar_rhombus(evidence: Evidence) -> Judgement:
    """Its sides keep their length at every sample of a run of the planar worm."""
    run = evidence.store.run(PLANAR_CASES[300])
    whole = (2 * field_value(run.config, "body.side_m")) ** 2
    length, height = run.data["stretch_length"].values[..., 0], run.data["ring_length"].values
    residual = float(np.abs(length**2 + height**2 - whole).max() / whole)
    return judged([residual < 1e-9]), {"residual": residual}


@judges
def mesh(evidence: Evidence) -> Judgement:
    """The mesh has as many strands and crossings."""
    geometry = worm_of(MAIN.config).geometry()
    holds = geometry.n_strands == 12 and geometry.n_crossings == 90
    return judged([holds]), {"geometry": geometry, "n_planes": len(geometry.plane_x_m)}


@judges
def strand_radius(evidence: Evidence) -> Judgement:
    """The strand's radius is that of a solid rod of the tube's cross-section."""
    radius_m, equal_area_m = worm_of(MAIN.config).strands.radius_m, sqrt(TUBE_AREA_M2 / pi)
    return near([radius_m], equal_area_m, ""), {
        "equal_area_mm": 1e3 * equal_area_m,
        "more": 100 * (equal_area_m / radius_m - 1),
        "area": 100 * pi * radius_m**2 / TUBE_AREA_M2,
        "stiffness": 100 * (radius_m / equal_area_m) ** 4,
    }


@judges
def strand_mass(evidence: Evidence) -> Judgement:
    """The strand weighs what the tube does."""
    tube, strand = (
        TUBE_AREA_M2 * POLYETHYLENE_KG_PER_M3,
        worm_of(MAIN.config).strands.one_number("linear_density_kg_per_m"),
    )
    return near([strand], tube, ""), {"tube_g_per_m": 1e3 * tube, "strand_g_per_m": 1e3 * strand}


@judges
def pins(evidence: Evidence) -> Judgement:
    """Strands stay within the radius of a pin."""
    gaps = [outcome.summary.pin_gap_max_m or nan for outcome, _ in evidence.runs]
    return judged(gap < PIN_RADIUS_M for gap in gaps), {
        "gaps": gaps,
        "radius_mm": 1e3 * PIN_RADIUS_M,
        "rigid": evidence.number("pins", "elongation_tight_first_m"),
    }


@judges
def elements(evidence: Evidence) -> Judgement:
    """Held contractions are those of the finest mesh."""
    differences, orders = (
        {
            worm.label: [
                evidence.number("discretization", f"{which}_{name.replace(' ', '_')}_{worm.name}")
                for name in QUANTITIES
            ]
            for worm in HELD[evidence.effort]
        }
        for which in ("difference", "order")
    )
    # NaN where the differences fit no order.
    fitted = [one for each in orders.values() for one in each if not isnan(one)]
    listed = "; ".join(
        f"{label}: {', '.join(f'{name} {100 * one:.1f} %' for name, one in zip(QUANTITIES, each, strict=True))}"
        for label, each in differences.items()
    )
    verdict = near((1.0 + one for each in differences.values() for one in each), 1.0, "the quantity")
    return verdict, {"differences": listed, "orders": span(fitted, digits=1) if fitted else "nowhere"}


@judges
def springs(evidence: Evidence) -> Judgement:
    """Such springs make the paper's number, in the worm nearest to the paper's that was run so."""
    worms = WORMS if evidence.effort == "full" else WORMS[1:]
    pulling, both = (readings_m(evidence.store.run(worms[0].case(changes)))[0] for changes in (TENSION_ONLY, {}))
    return near(pulling, 0.042, "how the elongation is read"), {
        "pulling": pulling,
        "both": both,
        "worm": worms[0].label,
        "walks": sum(evidence.store[worm.case(TENSION_ONLY)].rhythm.is_one_wave for worm in worms),
        "worms": len(worms),
    }


@judges
def muscle_function(evidence: Evidence) -> Judgement:
    """The engine's muscle is the closed form."""
    difference = largest_difference(worm_of(MAIN.config).muscles)
    return judged([difference < 1e-9]), {"difference": difference}


@judges
def activation(evidence: Evidence) -> Judgement:
    """The printed sign activates the muscle of an excited contraction neuron."""
    slope, reach = (field_value(MAIN.config, f"controller.{name}") for name in ("activation_slope_per_mV", "range_mV"))
    printed, meant = (1 / (1 + np.exp(sign * slope * reach)) for sign in (1, -1))
    return judged([printed > 0.5]), {"printed": printed, "meant": meant}


@judges
def force(evidence: Evidence) -> Judgement:
    """The largest force of each run is the paper's."""
    summaries, body = [one.summary for one, _ in evidence.runs], worm_of(MAIN.config)
    peaks = [summary.contraction_force_peak_N or nan for summary in summaries]
    return near(peaks, 2.5, "the run"), {
        "peaks": peaks,
        "medians": [summary.contraction_force_median_N or nan for summary in summaries],
        "peak_N": max(body.muscles.forces(body.n_segments)),
    }


@judges
def force_of_springs(evidence: Evidence) -> Judgement:
    """The force lies between those of both elongations."""
    low_N, high_N = (
        6 * worm_of(MAIN.config).springs.one_number("stiffness_N_per_m") * stretch for stretch in (0.02, 0.03)
    )
    return judged([low_N <= 2.5 <= high_N]), {"low_N": low_N, "high_N": high_N}


@judges
def shortest_muscle(evidence: Evidence) -> Judgement:
    """Every ring stays longer with the greater minimum."""
    usual, short = (
        [hold.ring_length_m for worm in (fast, rods) for hold in evidence.store[worm(changes)].holds]
        for changes in (one_after_the_other(), SHORT_MINIMUM)
    )
    return judged((ours < theirs for ours, theirs in zip(short, usual, strict=True)), "the segment"), {
        "usual": usual,
        "short": short,
        "contractions": len(usual),
        "shorter": rods(SHORT_MINIMUM).command,
    }


@judges
def velocity(evidence: Evidence) -> Judgement:
    """A contraction begins no faster than the muscle's limit."""
    overshoot, finer = (evidence.number("timestep", f"times_velocity_limit_chain_{step}ms") for step in ("1", "0.5"))
    return judged([overshoot <= 1.0 + EXACT]), {"overshoot": overshoot, "finer": finer}


@judges
def same_network(evidence: Evidence) -> Judgement:
    """Every body walks by the network, however its gates start and it is updated."""
    others = [evidence.store[case].rhythm for case in (PLANAR_CASES[300], fast(), rods())]
    rhythms = [*(outcome.rhythm for outcome, _ in evidence.runs), *others]
    walks = [rhythm.is_one_wave for rhythm in rhythms]
    gates: dict[str, list[bool]] = {"toolbox": [], "steady": []}
    for worm, pairs in GATES[evidence.effort].items():
        for start, scheme in pairs:
            gates[start].append(evidence.store[gated(worm, start, scheme)].rhythm.is_one_wave)
    verdict = judged(walks + gates["toolbox"] + gates["steady"], "the worm and how its gates start")
    counts = {start: sum(own) for start, own in gates.items()}
    of_all = {f"of_{start}": len(own) for start, own in gates.items()}
    periods = [rhythm.period_s or nan for rhythm in rhythms]
    return verdict, {"walks": sum(walks), "runs": len(walks), "periods": periods, **counts, **of_all}


@judges
def half_centres(evidence: Evidence) -> Judgement:
    """One neuron of a half-centre is excited at a time, and activation follows it."""
    shares = [_half_centres(run) for _, run in evidence.runs]
    return judged((both < 0.05 and following > 0.95 for both, following in shares), "the run"), {
        "both": [both for both, _ in shares],
        "following": [following for _, following in shares],
    }


def _half_centres(run: Run) -> tuple[float, float]:
    """Share of samples in which both neurons of a half-centre are excited, and in which activation follows them."""
    segments = range(1, run.config.body.n_segments + 1)
    contraction, expansion = (
        run.data["potential"].sel(neuron=[f"{role}_{segment}" for segment in segments]).values
        for role in ("contraction", "expansion")
    )
    half = field_value(run.config, "controller.range_mV") / 2
    both = (contraction > half) & (expansion > half)
    following = (contraction > expansion) == (run.data["activation"].values > CONTRACTED)
    return float(both.mean()), float(following.mean())
