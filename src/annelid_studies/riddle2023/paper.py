"""The paper, reproduced: runs everything, draws everything, and gathers the report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path

from annelid.analysis import PAPER_ELONGATION_M, PAPER_END_DIFFERENCE, PAPER_MIDDLE_DEFICIT, middle_deficit
from annelid.body import worm_of
from annelid.draw import figure7, network_figure
from annelid.errors import ConfigError, suggest
from annelid.experiment import Case, Outcome, Store, StudyProgress
from annelid.markdown import Table
from annelid.nervous import PeristalsisParameters, peristalsis_network
from annelid.simulation import Run, locks
from annelid_studies.papers import words
from annelid_studies.papers.report_parts import Claim, Examined, Figure, Paper, Report, provenance
from annelid_studies.papers.words import CM, MM, PERCENT, texts
from annelid_studies.riddle2023.claims import Evidence, claim_cases, paper_claims, rule
from annelid_studies.riddle2023.claims.evidence import order_of, readings_m
from annelid_studies.riddle2023.examinations import EXAMINATIONS
from annelid_studies.riddle2023.examinations.design import walked_elongation
from annelid_studies.riddle2023.figures import (
    FIGURES_TOML,
    caption,
    muscle_surface,
    propagation,
    renderings,
    robot_lengths,
)
from annelid_studies.standard_cases import CHAIN, FAST, RODS, RODS_STEP_S, Effort, rods

PAPER = Paper(
    name="A Dynamic Simulation of a Compliant Worm Robot Amenable to Neural Control",
    authors="Riddle et al. 2023",
    title="The paper, reproduced and examined",
    heading="The paper's claims",
    command="annelid study paper -o report --claims docs/evidence/paper.md",
    leading=(4, 7, 9),  # The model, what it does, and its elongations beside the robot's
)
MAIN = Case(CHAIN)
VARIANTS = {
    "riddle2023": MAIN,
    "contacts as in the authors' file": Case(
        CHAIN, {"arena.contact_time_constant_s": 0.01, "arena.contact_impedance": [0.95, 0.99, 0.0001]}
    ),
    "riddle2023-fast": Case(FAST),
    "riddle2023-rods": rods(),
}
"""The worms of the table of variants."""
PAPER_PERIOD_S = 2.6
"""Read off the paper's figure 7."""
_QUICK = ("riddle2023", "riddle2023-fast", "riddle2023-rods")


@locks("folder")
def reproduce(
    folder: Path,
    effort: Effort = "full",
    *,
    only: Sequence[str] | None = None,
    executor: Executor | None = None,
    progress: StudyProgress | None = None,
) -> Report:
    """Reruns everything the paper shows or claims, as far as it has not been run into the folder before.

    Args:
        folder: The report's folder: runs go to ``runs``, pictures to ``figures``.
        effort: ``"quick"`` for coarser maps and fewer runs, ``"full"`` for all.
        only: Names of the examinations wanted, with the main numbers but without figures and claims; None for the
            whole.
        executor: Who computes the runs; None for a process of this machine on every core.
        progress: Called as the work goes on.

    Returns:
        The report, whose pictures are drawn.

    Raises:
        ConfigError: An examination has no such name.
    """
    names = [examination.name for examination in EXAMINATIONS]
    for name in only or ():
        if name not in names:
            raise ConfigError(f"there is no examination {name!r}: {suggest(name, names)}")
    chosen = [examination for examination in EXAMINATIONS if only is None or examination.name in only]
    variants = {label: case for label, case in VARIANTS.items() if effort == "full" or label in _QUICK}
    cases = [*variants.values(), *(case for examination in chosen for case in examination.cases(effort))]
    if only is None:
        cases += claim_cases(effort)
    store = Store(folder / "runs", executor, progress=progress)
    outcomes = store.compute(cases, "running worms")
    examined = [Examined(asked, asked.examine(store, effort)) for asked in chosen]
    figures: list[Figure] = []
    main, claims, judging = store.run(MAIN), list[Claim](), list[str]()
    summary = _summary(main)
    if only is None:
        series = {f"{CHAIN}, first helix": walked_elongation(store[MAIN], first_helix=True).tolist()}
        series |= {f"{label}, mean of six": walked_elongation(store[variants[label]]).tolist() for label in _QUICK}
        pictures = folder / "figures"
        pictures.mkdir(parents=True, exist_ok=True)
        for i, number in enumerate(FIGURES):
            if progress is not None:
                progress("drawing", i, len(FIGURES), i / len(FIGURES))
            stem, title = pictures / f"figure_{number}", texts(FIGURES_TOML)[str(number)]["title"]
            figures.append(Figure(number, title, stem.with_suffix(".png"), FIGURES[number](main, series, stem)))
        if progress is not None:
            progress("drawing", len(FIGURES), len(FIGURES), 1.0)
        evidence = Evidence(store, effort, {one.examination.name: one.findings for one in examined})
        claims, judging = paper_claims(evidence), rule(evidence)
    return Report(
        PAPER,
        effort=effort,
        summary=summary,
        main_table=_beside_the_paper(store[MAIN]),
        variants=_variants_table({label: store[case] for label, case in variants.items()}),
        figures=figures,
        claims=claims,
        examinations=examined,
        provenance=provenance(outcomes.values()),
        rule=judging,
    )


Series = Mapping[str, Sequence[float]]
"""Elongation of each segment, m, by the label of a simulation."""


def _figure_5(run: Run, series: Series, stem: Path) -> str:
    body = worm_of(run.config)
    return muscle_surface.figure_5_muscle_surface(body.muscles, stem, body.n_segments)


def _figure_6(run: Run, series: Series, stem: Path) -> str:
    network = peristalsis_network(run.config.body.n_segments, PeristalsisParameters())
    for suffix in (".svg", ".png"):
        network_figure(network, stem.with_suffix(suffix))
    return caption(6)


def _figure_7(run: Run, series: Series, stem: Path) -> str:
    for suffix in (".svg", ".png"):
        figure7(run, stem.with_suffix(suffix))
    return caption(7)


FIGURES: Mapping[int, Callable[[Run, Series, Path], str]] = {
    4: lambda run, series, stem: renderings.figure_4_model(run.config, stem),
    5: _figure_5,
    6: _figure_6,
    7: _figure_7,
    8: lambda run, series, stem: propagation.figure_8_propagation(run, stem),
    9: lambda run, series, stem: robot_lengths.figure_9_robot_lengths(series, stem),
}
"""What draws each figure and returns its caption."""


def _variants_table(variants: Mapping[str, Outcome]) -> Table:
    rows: dict[tuple[str, str], Callable[[Outcome], str]] = {
        ("order of onsets", "1-2-3"): order_of,
        ("period (s)", f"about {PAPER_PERIOD_S:g} (Fig. 7)"): lambda o: words.in_unit(o.rhythm.period_s, digits=3),
        ("elongation, first helix, peak to peak (cm)", words.all_in_cm(PAPER_ELONGATION_M)): (
            lambda o: words.all_in_cm(walked_elongation(o, first_helix=True))
        ),
        ("elongation, mean of six, maximum (cm)", ""): lambda o: words.all_in_cm(walked_elongation(o)),
        ("segment 2 below segment 1 (%)", words.in_percent(PAPER_MIDDLE_DEFICIT, 1)): (
            lambda o: words.in_percent(o.summary.middle_deficit, 1)
        ),
        ("the same, mean of six (%)", ""): lambda o: words.in_percent(o.summary.middle_deficit_mean, 1),
        ("segment 3 below segment 1 (%)", words.in_percent(PAPER_END_DIFFERENCE, 1)): (
            lambda o: words.in_percent(o.summary.end_difference, 1)
        ),
        ("force while contracted, median (N)", "up to 2.5"): (
            lambda o: words.in_unit(o.summary.contraction_force_median_N)
        ),
        ("largest pin gap (mm)", ""): lambda o: words.in_unit(o.summary.pin_gap_max_m, MM, 1),
        ("travel forwards in 5 s (mm)", "negligible"): lambda o: words.in_unit(o.summary.travel_m, MM, 0),
        ("processor time (s)", "210 (of a clock)"): lambda o: words.in_unit(o.cpu_time_s or None, digits=0),
    }
    return Table(
        ["quantity", "paper", *variants], [[*head, *map(text, variants.values())] for head, text in rows.items()]
    )


def _beside_the_paper(main: Outcome) -> Table:
    """Our numbers beside the paper's: quantities with a unit deviate by a ratio, percentages by a difference."""
    rows = [["order of the segments", "1-2-3", order_of(main), "none" if main.rhythm.is_one_wave else "another order"]]
    elongations = zip(("1", "2", "3"), PAPER_ELONGATION_M, walked_elongation(main, first_helix=True), strict=True)
    below = "elongation of segment {} below segment 1 (%)"
    for quantity, paper, ours, scale, digits, unit in (
        ("period (s)", PAPER_PERIOD_S, main.rhythm.period_s, 1.0, 1, " %"),
        *((f"elongation of segment {n} (cm)", *lengths, CM, 2, " %") for n, *lengths in elongations),
        (below.format(2), PAPER_MIDDLE_DEFICIT, main.summary.middle_deficit, PERCENT, 1, " points"),
        (below.format(3), PAPER_END_DIFFERENCE, main.summary.end_difference, PERCENT, 1, " points"),
    ):
        difference = (words.number(ours) - paper) / (paper if unit == " %" else 1.0)
        deviation = words.in_unit(difference, PERCENT, 1, sign="+")
        printed = [words.in_unit(value, scale, digits) for value in (paper, ours)]
        rows.append([quantity, *printed, deviation if deviation == words.DASH else deviation + unit])
    return Table(["quantity", "paper", "ours", "deviation"], rows)


_SUMMARY = (
    "An elongation is read from the spring on the first helix of a segment, from its shortest to its longest. The "
    "paper does not say which reading it used; this one comes nearest. By all six springs, and by their mean, the "
    "segments elongate by {every} cm, and segment 2 by {deficits} % less than segment 1. The claims are judged by all "
    "of these readings. Deviations are computed before numbers are rounded.",
    "Three worms stand side by side in this report. The first is the paper's chain (preset {chain}, in the "
    "examinations at steps of 2 ms), whose crossings are soft. The second has rods and soft crossings of the same "
    "stiffness ({fast}) and takes seconds to compute. The third has rods and rigid crossings ({rods}, with the paper's "
    "three elements a side and steps of {step_ms:g} ms), so its strands cannot part.",
)


def _summary(run: Run) -> list[str]:
    read = readings_m(run)
    every = " / ".join(words.span(of_segment, CM) for of_segment in read)
    deficits = words.span((middle_deficit(of_reading) for of_reading in read.T), PERCENT, 0)
    presets = {"chain": CHAIN, "fast": FAST, "rods": RODS, "step_ms": MM * RODS_STEP_S}
    return [text.format(every=every, deficits=deficits, **presets) for text in _SUMMARY]
