"""Elements per rhombus side: what is converged in a held contraction and in the walk."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.draw.canvas import canvas, save_both
from annelid.draw.markdown import Table
from annelid.draw.style import panel_title
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations.side_by_side import (
    CM,
    PAPERS,
    TIGHT,
    Worm,
    all_in_cm,
    draw_segments,
    held_elongation,
    in_percent,
    in_unit,
    kept,
    legend_below,
    listed,
    look_handle,
    rhythm_words,
    segment_handles,
    span,
    walked_elongation,
)
from annelid_studies.worms import one_after_the_other

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

EULER = {"body.formulation.integrator": "Euler", "clock.physics_timestep_s": 0.001}
"""At 2 ms the rings shoot to a few millimetres when a contraction sets in, and a guard ends the run."""
PRESETS_ELEMENTS = 3
"""Elements a side in the presets, and in the paper."""

HELD: Mapping[Effort, Sequence[tuple[Worm, Mapping[str, Any], Sequence[int]]]] = {
    "quick": ((TIGHT, {}, (1, 2, 3, 6)),),
    "full": ((TIGHT, {}, (1, 2, 3, 4, 6)), (PAPERS, EULER, (1, 2, 3, 4))),
}
WALKED: Mapping[Effort, Sequence[int]] = {"quick": (1, 2, 3), "full": (1, 2, 3, 4, 6)}


def held(worm: Worm, changes: Mapping[str, Any], elements: int) -> Case:
    """Returns the open-loop run of one segment after the other."""
    return worm.case({"body.mesh.elements_per_side": elements, **changes, **one_after_the_other()})


def walked(elements: int) -> Case:
    """Returns the closed-loop run of the tight rods."""
    return TIGHT.case({"body.mesh.elements_per_side": elements})


def cases(effort: Effort) -> list[Case]:
    """Returns the open-loop and the closed-loop runs; at full effort also the chain's own integrator."""
    runs = [held(worm, changes, n) for worm, changes, elements in HELD[effort] for n in elements]
    check = [held(PAPERS, {}, PRESETS_ELEMENTS)] if effort == "full" else []
    return [*runs, *check, *(walked(n) for n in WALKED[effort])]


def convergence_order(elements: ArrayLike, difference: ArrayLike, finest: float) -> float | None:
    """Fits the order of convergence to differences from the finest mesh.

    An error ``c n**-p`` makes a difference ``c (n**-p - N**-p)`` from the finest mesh of N elements. The order p, in
    0.1 .. 8, is the one whose logarithm fits best in the mean square.

    Args:
        elements: Numbers of elements n below the finest, shape ``(n_meshes,)``.
        difference: Magnitudes of the differences from the finest, same shape.
        finest: N.

    Returns:
        The order; None with fewer than two differences, with one that is zero or no number, or if none within
        the range fits best.
    """
    n, e = np.asarray(elements, dtype=float), np.asarray(difference, dtype=float)
    if n.size < 2 or not (np.isfinite(e) & (e > 0)).all():
        return None
    orders = np.arange(0.1, 8.005, 0.01)
    shape = np.log(n[None, :] ** -orders[:, None] - finest ** -orders[:, None])
    best = int(np.argmin((np.log(e)[None, :] - shape).var(axis=1)))
    return float(orders[best]) if 0 < best < orders.size - 1 else None


def _rings(outcome: Outcome) -> Array:
    return np.array([hold.ring_length_m for hold in outcome.holds])


def _forces(outcome: Outcome) -> Array:
    return np.array([hold.force_N for hold in outcome.holds])


QUANTITIES: Mapping[str, Callable[[Outcome], Array]] = {
    "elongation": held_elongation,
    "ring length": _rings,
    "force": _forces,
}
_LOOKS: Mapping[str, dict[str, Any]] = {
    "elongation": {"marker": "o", "color": "#1b2a6b"},
    "ring length": {"marker": "s", "color": "#c2410c"},
    "force": {"marker": "^", "color": "#35b5a0"},
}


@dataclass(frozen=True)
class Convergence:
    """How held contractions converge.

    Attributes:
        worm: The worm.
        elements: Numbers of elements, the finest last.
        outcomes: Its runs, one for each.
        difference: For each quantity its relative difference from the finest, root mean square over the segments, shape
            ``(n_elements - 1,)``.
        order: For each quantity the fitted order of convergence.
    """

    worm: Worm
    elements: Sequence[int]
    outcomes: Sequence[Outcome]
    difference: Mapping[str, Array]
    order: Mapping[str, float | None]


def measure_convergence(worm: Worm, elements: Sequence[int], outcomes: Sequence[Outcome]) -> Convergence:
    """Measures how held contractions converge; the finest mesh is the last."""
    difference = {}
    for name, read in QUANTITIES.items():
        finest = read(outcomes[-1])
        difference[name] = np.array([_relative_difference(read(outcome), finest) for outcome in outcomes[:-1]])
    order = {name: convergence_order(elements[:-1], e, elements[-1]) for name, e in difference.items()}
    return Convergence(worm, elements, outcomes, difference, order)


def _relative_difference(values: Array, reference: Array) -> float:
    if values.shape != reference.shape:
        return float("nan")
    return float(np.sqrt(np.mean((values / reference - 1.0) ** 2)))


def examine(results: Results, effort: Effort, stem: Path) -> Findings:
    """Draws the convergence of held contractions and the walk over the number of elements."""
    held_runs = [
        measure_convergence(worm, elements, [results[held(worm, changes, n)] for n in elements])
        for worm, changes, elements in HELD[effort]
    ]
    walks = [(n, results[walked(n)]) for n in WALKED[effort]]
    _draw(held_runs, walks, stem)
    remarks = [_comparability_in_words(held_runs)]
    numbers = _numbers(held_runs, walks)
    if effort == "full":
        own, euler = (results[held(PAPERS, changes, PRESETS_ELEMENTS)] for changes in ({}, EULER))
        apart = {name: _relative_difference(read(euler), read(own)) for name, read in QUANTITIES.items()}
        remarks.append(_integrators_in_words(own, apart))
        numbers |= {f"euler_from_rk4_{_key(name)}": kept(value) for name, value in apart.items()}
    return Findings(
        answer=" ".join([*map(_convergence_in_words, held_runs), _walks_in_words(walks)]),
        caption=_caption(held_runs, walks),
        table=_table(held_runs, walks),
        remarks=remarks,
        numbers=numbers,
    )


def _key(name: str) -> str:
    return name.replace(" ", "_")


def _of_presets(found: Convergence, name: str) -> float:
    return float(found.difference[name][list(found.elements).index(PRESETS_ELEMENTS)])


def _convergence_in_words(found: Convergence) -> str:
    parts = [f"{in_percent(_of_presets(found, name), 1)} % in {name}" for name in QUANTITIES]
    orders = [order for order in found.order.values() if order is not None]
    text = (
        f"Held contractions of {found.worm.label} with {PRESETS_ELEMENTS} elements a side differ from those with "
        f"{found.elements[-1]} by {listed(parts)}"
    )
    if not orders:
        return f"{text}; no order of convergence can be fitted."
    slow = ", slower than first order" if max(orders) < 1.0 else ""
    return f"{text}; the fitted order of convergence is {span(orders, digits=1)}{slow}."


def _walks_in_words(walks: Sequence[tuple[int, Outcome]]) -> str:
    good = [(n, outcome) for n, outcome in walks if outcome.rhythm.is_one_wave]
    bad = [f"{n} ({outcome.rhythm.verdict or 'too short to tell'})" for n, outcome in walks if (n, outcome) not in good]
    if not good:
        return f"In closed loop none of {listed([str(n) for n, _ in walks])} elements walks 1-2-3."
    text = f"In closed loop {TIGHT.label} walk 1-2-3 with {listed([str(n) for n, _ in good])} elements a side"
    if len(good) > 1:
        elongations = np.array([walked_elongation(outcome) for _, outcome in good])
        spread = float((np.ptp(elongations, axis=0) / elongations.mean(axis=0)).max())
        periods = [outcome.rhythm.period_s for _, outcome in good if outcome.rhythm.period_s is not None]
        text += f", elongations within {in_percent(spread)} % and periods of {span(periods, digits=3)} s"
    return f"{text}{f', but not with {listed(bad)}' if bad else ''}."


def _comparability_in_words(held_runs: Sequence[Convergence]) -> str:
    found = held_runs[0]
    coarse, fine = (span(list(_rings(found.outcomes[i])), CM, digits=1) for i in (0, -1))
    return (
        f"The differences are root mean squares over the three segments, each read at the end of its own contraction. "
        f"The rings of {found.worm.label} contract to {coarse} cm with {found.elements[0]} and to {fine} cm with "
        f"{found.elements[-1]} elements a side. Free ends keep their elements, so that only the sides change. The "
        "order is fitted with the finest mesh as the reference, whose own error the fit takes into account; it means "
        "little where the differences do not fall steadily."
    )


def _integrators_in_words(own: Outcome, apart: Mapping[str, float]) -> str:
    parts = [f"{in_percent(value, 1)} % in {name}" for name, value in apart.items()]
    return (
        "The chain is computed with Euler steps of 1 ms, at half the cost of RK4 at 2 ms. With "
        f"{PRESETS_ELEMENTS} elements the two differ by {listed(parts)}; RK4 elongates the segments by "
        f"{all_in_cm(held_elongation(own))} cm."
    )


def _numbers(held_runs: Sequence[Convergence], walks: Sequence[tuple[int, Outcome]]) -> dict[str, float | str | None]:
    numbers: dict[str, float | str | None] = {}
    for found in held_runs:
        for name in QUANTITIES:
            numbers[f"difference_{_key(name)}_{found.worm.name}"] = kept(_of_presets(found, name))
            numbers[f"order_{_key(name)}_{found.worm.name}"] = found.order[name]
    for n, outcome in walks:
        numbers[f"verdict_rods_{n}"] = rhythm_words(outcome.rhythm)
        numbers[f"period_rods_{n}_s"] = outcome.rhythm.period_s
    return numbers


def _caption(held_runs: Sequence[Convergence], walks: Sequence[tuple[int, Outcome]]) -> str:
    worms = listed([f"{found.worm.label} against {found.elements[-1]}" for found in held_runs])
    lines = listed([f"{found.worm.label} {_LINE_WORDS[found.worm.line]}" for found in held_runs])
    return (
        "Left: relative difference of held contractions from the finest mesh over the number of elements a rhombus "
        f"side ({worms} elements; {lines}), root mean square over the three segments. Right: largest elongation of "
        f"each segment of {TIGHT.label} in closed loop (mean of its springs), {len(walks)} runs; a cross over a "
        "marker: the run does not walk 1-2-3."
    )


_LINE_WORDS = {"-": "solid", "--": "dashed", ":": "dotted"}


def _table(held_runs: Sequence[Convergence], walks: Sequence[tuple[int, Outcome]]) -> Table:
    by_elements = dict(walks)
    rows = []
    for found in held_runs:
        for n, outcome in zip(found.elements, found.outcomes, strict=True):
            walk = by_elements.get(n) if found.worm is TIGHT else None
            rows.append(
                [
                    found.worm.label,
                    str(n),
                    " / ".join(in_unit(length, digits=3) for length in _rings(outcome)),
                    all_in_cm(held_elongation(outcome)),
                    " / ".join(in_unit(force) for force in _forces(outcome)),
                    rhythm_words(walk.rhythm) if walk else "not run",
                    all_in_cm(walked_elongation(walk)) if walk else "not run",
                ]
            )
    return Table(
        (
            "worm",
            "elements a side",
            "ring held (m)",
            "elongation held (cm)",
            "force held (N)",
            "rhythm",
            "elongation walking (cm)",
        ),
        rows,
    )


def _draw(held_runs: Sequence[Convergence], walks: Sequence[tuple[int, Outcome]], stem: Path) -> None:
    with canvas(3.5) as figure:
        left, right = figure.subplots(1, 2)
        for found in held_runs:
            for name, difference in found.difference.items():
                hollow = {"markerfacecolor": "white"} if found.worm is PAPERS else {}
                look = {**_LOOKS[name], "linestyle": found.worm.line, "markersize": 5.0, **hollow}
                left.plot(found.elements[:-1], 100.0 * difference, **look)
        left.set(
            xscale="log", yscale="log", xlabel="elements per rhombus side", ylabel="difference from the finest (%)"
        )
        _ticks(left, sorted({n for found in held_runs for n in found.elements[:-1]}))
        left.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        panel_title(left, "Held contractions")
        elongations = np.array([walked_elongation(outcome) for _, outcome in walks])
        counts = [n for n, _ in walks]
        draw_segments(right, counts, CM * elongations, marker=TIGHT.marker, linestyle=TIGHT.line)
        for (n, outcome), values in zip(walks, elongations, strict=True):
            if not outcome.rhythm.is_one_wave:
                right.plot([n] * len(values), CM * values, linestyle="none", marker="x", color="black", markersize=8.0)
        right.set(xscale="log", xlabel="elements per rhombus side", ylabel="largest elongation (cm)")
        _ticks(right, counts)
        panel_title(right, f"Walking, {TIGHT.label}")
        handles = [look_handle(name, linestyle="none", **look) for name, look in _LOOKS.items()]
        crossed = look_handle("does not walk 1-2-3", linestyle="none", marker="x", color="black")
        legend_below(figure, [*handles, crossed, *segment_handles(3)], columns=4)
        save_both(figure, stem)


def _ticks(axes: Axes, counts: Sequence[int]) -> None:
    axes.set_xticks(counts, [str(n) for n in counts])
    axes.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)


DISCRETIZATION = Examination(
    name="discretization",
    title="Elements per rhombus side",
    question=(
        "The paper divides each rhombus side into three straight elements. Are held contractions and the walk "
        "converged there?"
    ),
    cases=cases,
    examine=examine,
)
