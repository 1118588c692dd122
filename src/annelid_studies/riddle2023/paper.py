"""The paper, reproduced: runs everything, draws everything, and gathers the report."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

from annelid.analysis.elongation import middle_deficit
from annelid.analysis.paper import published
from annelid.body.worm import WormBody
from annelid.draw.markdown import Table
from annelid.errors import ConfigError, suggest
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid.experiment.store import Store, case_key
from annelid.experiment.workers import Workers
from annelid.nervous import PeristalsisParameters, peristalsis_network
from annelid.simulation.lock import locks
from annelid.simulation.runfile import Run
from annelid_studies.riddle2023.claims import Evidence, claim_cases, paper_claims, rule
from annelid_studies.riddle2023.claims.evidence import between, readings_m
from annelid_studies.riddle2023.contents import Claim, Examined, Figure, Report, tally
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations import EXAMINATIONS
from annelid_studies.riddle2023.kept import kept
from annelid_studies.worms import CHAIN, FAST, RODS, RODS_STEP_S, rods

Progress = Callable[[str, int, int, float], object]
"""Called with what is being done, the number of runs (or pictures) done, their total, and the share of the work."""

MAIN = Case(CHAIN)
VARIANTS = {
    "riddle2023": MAIN,
    "one ball joint an element": Case(CHAIN, {"body.formulation.joint": "ball"}),
    "contacts as in the authors' file": Case(
        CHAIN, {"arena.contact_time_constant_s": 0.01, "arena.contact_impedance": [0.95, 0.99, 0.0001]}
    ),
    "riddle2023-fast": Case(FAST),
    "riddle2023-rods": rods(),
}
"""The worms of the main table."""
_QUICK = ("riddle2023", "riddle2023-fast", "riddle2023-rods")


@locks("folder")
def reproduce(
    folder: Path,
    effort: Effort = "full",
    *,
    only: Sequence[str] | None = None,
    jobs: int | None = None,
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> Report:
    """Reruns everything the paper shows or claims, as far as it has not been run into the folder before.

    Args:
        folder: The report's folder: runs go to ``runs``, pictures to ``figures``.
        effort: ``"quick"`` for coarser maps and fewer runs, ``"full"`` for all.
        only: Names of the examinations wanted, with the main numbers but without figures and claims; None for the
            whole.
        jobs: Processes, by default one a core.
        workers: Who computes the runs instead of processes of this machine.
        progress: Called as the work goes on.

    Returns:
        The report, whose pictures are drawn.

    Raises:
        ConfigError: An examination has no such name.
    """
    chosen = _chosen(only)
    variants = {label: case for label, case in VARIANTS.items() if effort == "full" or label in _QUICK}
    cases = [*variants.values(), *(case for examination in chosen for case in examination.cases(effort))]
    if only is None:
        cases += claim_cases(effort)
    store = Store(folder / "runs", workers)
    outcomes = store.compute(cases, jobs=jobs, progress=progress and _stage(progress, "running worms"))
    results = Results(outcomes, case_key)
    pictures = folder / "figures"
    pictures.mkdir(parents=True, exist_ok=True)
    n_pictures = len(chosen) + (0 if only else len(FIGURES))
    drawing = _stage(progress or (lambda *_: None), "drawing")

    examined = []
    for index, examination in enumerate(chosen):
        drawing(index, n_pictures, index / n_pictures)
        examined.append(_examined(examination, effort, results, pictures))
    figures: list[Figure] = []
    claims: list[Claim] = []
    judging: list[str] = []
    if only is None:
        main = store.run(MAIN)
        for index, number in enumerate(FIGURES, start=len(chosen)):
            drawing(index, n_pictures, index / n_pictures)
            figures.append(_figure(number, main, variants, results, pictures))
        evidence = Evidence(store, results, effort, {e.examination.name: e.findings for e in examined})
        claims, judging = paper_claims(evidence), rule(evidence)
    drawing(n_pictures, n_pictures, 1.0)
    return Report(
        effort=effort,
        summary=_summary({label: results[case] for label, case in variants.items()}, store.run(MAIN), claims),
        main_table=_main_table(variants, results),
        figures=figures,
        claims=claims,
        examinations=examined,
        provenance=_provenance(outcomes),
        rule=judging,
    )


def _chosen(only: Sequence[str] | None) -> list[Examination]:
    by_name = {examination.name: examination for examination in EXAMINATIONS}
    for name in only or ():
        if name not in by_name:
            raise ConfigError(f"there is no examination {name!r}: {suggest(name, by_name)}")
    return [examination for examination in EXAMINATIONS if only is None or examination.name in only]


def _stage(progress: Progress, stage: str) -> Callable[[int, int, float], object]:
    return lambda done, total, share: progress(stage, done, total, share)


def _figure_1(run: Run, stem: Path, series: Mapping[str, Sequence[float]]) -> str:
    from annelid_studies.riddle2023.figures.planar_models import CAPTION, figure_1_planar_models

    figure_1_planar_models(stem)
    return CAPTION


def _figure_2(run: Run, stem: Path, series: Mapping[str, Sequence[float]]) -> str:
    from annelid_studies.riddle2023.figures.propagation import figure_2_caption, figure_2_propagation

    figure_2_propagation(run, stem)
    return figure_2_caption(run)


def _figure_4(run: Run, stem: Path, series: Mapping[str, Sequence[float]]) -> str:
    from annelid_studies.riddle2023.figures.renderings import figure_4_caption, figure_4_model

    figure_4_model(run.config, stem)
    return figure_4_caption(run.config)


def _figure_5(run: Run, stem: Path, series: Mapping[str, Sequence[float]]) -> str:
    from annelid_studies.riddle2023.figures.muscle_surface import caption, figure_5_muscle_surface

    assert isinstance(run.config.body, WormBody)
    figure_5_muscle_surface(run.config.body.muscles, stem, run.config.body.n_segments)
    return caption(run.config.body.muscles, run.config.body.n_segments)


def _figure_6(run: Run, stem: Path, series: Mapping[str, Sequence[float]]) -> str:
    from annelid.draw.figures.network_diagram import CAPTION, figure_6_network_diagram

    figure_6_network_diagram(peristalsis_network(run.config.body.n_segments, PeristalsisParameters()), stem)
    return CAPTION


def _figure_7(run: Run, stem: Path, series: Mapping[str, Sequence[float]]) -> str:
    from annelid.draw.plots import figure7

    figure7(run, stem.with_suffix(".svg"))
    figure7(run, stem.with_suffix(".png"))
    return (
        "The paper's run, reproduced: membrane potentials of the half-centres, the phases in which each segment's "
        "muscle is active, and the lengths of the stretch sensors. The wave runs 1-2-3. A segment lengthens while "
        "its contraction neuron is excited; its neighbours lengthen slightly at the same time. The thick lines are "
        "the means of a segment's six springs, which the controller reads; the thin ones are the springs on the first "
        "helix, whose peak to peak comes nearest to the paper's numbers."
    )


def _figure_8(run: Run, stem: Path, series: Mapping[str, Sequence[float]]) -> str:
    from annelid_studies.riddle2023.figures.propagation import figure_8_caption, figure_8_propagation

    figure_8_propagation(run, stem)
    return figure_8_caption(run)


def _figure_9(run: Run, stem: Path, series: Mapping[str, Sequence[float]]) -> str:
    from annelid_studies.riddle2023.figures.robot_lengths import CAPTION, figure_9_robot_lengths

    figure_9_robot_lengths(series, stem)
    return CAPTION


FIGURES: Mapping[int, tuple[str, Callable[[Run, Path, Mapping[str, Sequence[float]]], str]]] = {
    1: ("The planar models", _figure_1),
    2: ("Contraction with and without propagation of deformation", _figure_2),
    4: ("The model", _figure_4),
    5: ("Force, length and velocity of the muscle", _figure_5),
    6: ("The control network", _figure_6),
    7: ("Potentials and stretch lengths", _figure_7),
    8: ("Propagation of deformation at 1500 ms", _figure_8),
    9: ("The robot's elongations beside ours", _figure_9),
}
"""Number: title, and what draws it and returns its caption. Figure 3 is a photograph of the robot."""


def _examined(examination: Examination, effort: Effort, results: Results, folder: Path) -> Examined:
    stem = folder / examination.name
    keys = sorted({case_key(case) for case in examination.cases(effort)})
    found = kept(stem, [effort, keys], lambda: asdict(examination.examine(results, effort, stem)))
    findings = Findings(**{**found, "table": Table(**found["table"])})
    return Examined(examination, findings, stem.with_suffix(".png"))


def _figure(number: int, main: Run, variants: Mapping[str, Case], results: Results, folder: Path) -> Figure:
    title, draw = FIGURES[number]
    stem = folder / f"figure_{number}"
    first_helix = results[MAIN].summary.elongation_first_helix_pp_m
    series = {f"{CHAIN}, first helix": _measured(first_helix)} | {
        f"{label}, mean of six": _measured(results[variants[label]].summary.elongation_mean_max_m) for label in _QUICK
    }
    found = kept(stem, [case_key(MAIN), series], lambda: {"caption": draw(main, stem, series)})
    return Figure(number, title, stem.with_suffix(".png"), found["caption"])


def _measured(values: Sequence[float | None] | None) -> tuple[float, ...]:
    return tuple(float("nan") if value is None else value for value in values or ())


def _centimetres(values: Sequence[float | None] | None) -> str:
    return " / ".join(f"{100 * value:.2f}" for value in _measured(values))


def _main_table(variants: Mapping[str, Case], results: Results) -> Table:
    theirs = published(MAIN.config)

    def row(label: str, paper: str, ours: Callable[[Outcome], str]) -> list[str]:
        return [label, paper, *(ours(results[case]) for case in variants.values())]

    def percent(value: float | None) -> str:
        return "-" if value is None else f"{100 * value:.1f}"

    def order(outcome: Outcome) -> str:
        return "-".join(str(segment) for segment in outcome.rhythm.order)

    def optional(value: float | None, digits: int, factor: float = 1.0) -> str:
        return "-" if value is None else f"{factor * value:.{digits}f}"

    elongation = theirs["elongation_first_helix_pp_m"].value
    deficit, difference = theirs["middle_deficit"].value, theirs["end_difference"].value
    assert isinstance(elongation, tuple)
    assert isinstance(deficit, float)
    assert isinstance(difference, float)
    return Table(
        ["quantity", "paper", *variants],
        [
            row("order of onsets", "1-2-3", order),
            row("period (s)", "about 2.6 (Fig. 7)", lambda o: optional(o.rhythm.period_s, 3)),
            row(
                "elongation, first helix, peak to peak (cm)",
                _centimetres(elongation),
                lambda o: _centimetres(o.summary.elongation_first_helix_pp_m),
            ),
            row("elongation, mean of six, maximum (cm)", "", lambda o: _centimetres(o.summary.elongation_mean_max_m)),
            row("segment 2 below segment 1 (%)", percent(deficit), lambda o: percent(o.summary.middle_deficit)),
            row("the same, mean of six (%)", "", lambda o: percent(o.summary.middle_deficit_mean)),
            row("segment 3 below segment 1 (%)", percent(difference), lambda o: percent(o.summary.end_difference)),
            row(
                "force while contracted, median (N)",
                "up to 2.5",
                lambda o: optional(o.summary.contraction_force_median_N, 2),
            ),
            row("largest pin gap (mm)", "", lambda o: optional(o.summary.pin_gap_max_m, 1, 1e3)),
            row("travel forwards in 5 s (mm)", "negligible", lambda o: optional(o.summary.travel_m, 0, 1e3)),
            row("processor time (s)", "210 (of a clock)", _seconds),
        ],
    )


def _seconds(outcome: Outcome) -> str:
    return f"{outcome.cpu_time_s:.0f}" if outcome.cpu_time_s else "-"


def _summary(variants: Mapping[str, Outcome], run: Run, claims: Sequence[Claim]) -> list[str]:
    main = variants[MAIN.config.name]
    elongation = _measured(main.summary.elongation_first_helix_pp_m)
    deficit = 100 * (main.summary.middle_deficit or float("nan"))
    read = readings_m(run)
    every = " / ".join(between(of_segment, 100) for of_segment in read)
    deficits = between((middle_deficit(of_reading) for of_reading in read.T), 100, 0)
    period = main.rhythm.period_s
    theirs = published(MAIN.config)["elongation_first_helix_pp_m"].value
    assert isinstance(theirs, tuple)
    paragraphs = [
        f"The paper's worm, rebuilt in its own formulation and driven by its own network, has a rhythm that is "
        f"{main.rhythm.verdict or 'not settled'}: segments begin in the order {'-'.join(map(str, main.rhythm.order))}"
        + (f", one cycle every {period:.3f} s" if period else "")
        + f". They elongate by {_centimetres(elongation)} cm (paper: {_centimetres(theirs)} cm; spring on the first "
        f"helix, peak to peak), segment 2 by {deficit:.1f} % less than segment 1 (paper: 39.4 %). That "
        f"reading comes nearest. By all six springs, and their mean, the segments elongate by {every} cm, and "
        f"segment 2 by {deficits} % less than segment 1; the claims are judged by all of these readings.",
        _what_still_differs(variants, theirs),
    ]
    if claims:
        paragraphs.append(f"Of the {len(claims)} claims of the paper that are examined here, {tally(claims)}.")
    paragraphs.append(
        f"Three worms stand side by side in what follows: the paper's chain (preset {CHAIN}, in the examinations at "
        f"steps of 2 ms), whose pins give; sprung rods ({FAST}), the same robot in seconds with pins of the same "
        f"stiffness; and tight rods ({RODS}, with the paper's three elements a side and steps of "
        f"{1e3 * RODS_STEP_S:g} ms), whose pins hold."
    )
    return paragraphs


def _what_still_differs(variants: Mapping[str, Outcome], theirs: Sequence[float]) -> str:
    """Names the segment farthest from the paper, and what the variants of the paper's own formulation make of it."""
    read = {
        label: _measured(outcome.summary.elongation_first_helix_pp_m)
        for label, outcome in variants.items()
        if label not in (FAST, RODS)
    }
    errors = [ours / paper - 1 for ours, paper in zip(read[MAIN.config.name], theirs, strict=True)]
    worst = max(range(len(errors)), key=lambda segment: abs(errors[segment]))
    text = (
        f"On the first helix, segment {worst + 1} differs most, {100 * errors[worst]:+.1f} % from the paper; the "
        f"others are within {100 * max(abs(error) for i, error in enumerate(errors) if i != worst):.1f} %."
    )
    others = [
        f"{100 * values[worst]:.2f} cm with {label}" for label, values in read.items() if label != MAIN.config.name
    ]
    return text + (f" It is {' and '.join(others)}." if others else "")


def _provenance(outcomes: Mapping[str, Outcome]) -> dict[str, str]:
    return {
        "annelid": version("annelid"),
        "MuJoCo (mujoco-core)": version("mujoco-core"),
        "numpy": version("numpy"),
        "Python": platform.python_version(),
        "runs": str(len(outcomes)),
        "processor time of the runs": f"{sum(outcome.cpu_time_s for outcome in outcomes.values()) / 60:.0f} min",
    }
