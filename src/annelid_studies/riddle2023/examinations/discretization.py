"""Elements per rhombus side: what is converged in a held contraction."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from annelid.experiment import Store
from annelid.morphology import Array
from annelid_studies.papers import words
from annelid_studies.papers.report_parts import Findings, Number
from annelid_studies.riddle2023.examinations import design
from annelid_studies.riddle2023.examinations.design import PAPERS, RIGID, Columns, Point, Reading, Worm
from annelid_studies.standard_cases import Effort, one_after_the_other
from annelid_studies.tables import tabulated

PRESETS_ELEMENTS = 3
"""Elements a side in the presets, and in the paper."""
HELD: Mapping[Effort, Mapping[Worm, Sequence[int]]] = {
    "quick": {RIGID: (1, 2, 3, 6)},
    "full": {RIGID: (1, 2, 3, 4, 6), PAPERS: (1, 2, 3, 4)},
}
"""Elements a side with which each worm is held contracted, the finest last."""


def _points(effort: Effort) -> list[Point]:
    return [
        Point(worm, n, None, worm.case({"body.mesh.elements_per_side": n, **one_after_the_other()}))
        for worm, elements in HELD[effort].items()
        for n in elements
    ]


def convergence_order(elements: ArrayLike, difference: ArrayLike, finest: float) -> float | None:
    """Fits the order of convergence to the magnitudes of differences from the finest mesh.

    An error ``c n**-p`` makes a difference ``c (n**-p - N**-p)`` from the finest mesh of N elements. The order p, in
    0.1 .. 8, is the one whose logarithm fits best in the mean square; None with fewer than two differences, with one
    that is zero or no number, or if none within the range fits best.
    """
    n, e = np.asarray(elements, dtype=float), np.asarray(difference, dtype=float)
    if n.size < 2 or not (np.isfinite(e) & (e > 0)).all():
        return None
    orders = np.arange(0.1, 8.005, 0.01)
    shape = np.log(n[None, :] ** -orders[:, None] - finest ** -orders[:, None])
    best = int(np.argmin((np.log(e)[None, :] - shape).var(axis=1)))
    return float(orders[best]) if 0 < best < orders.size - 1 else None


QUANTITIES: Mapping[str, Callable[[Reading], Array]] = {
    "elongation": lambda one: one.held_m,
    "ring length": lambda one: one.at_holds("ring_length_m"),
    "force": lambda one: one.at_holds("force_N"),
}
"""What is read of each segment at the end of its own contraction."""


class Convergence(NamedTuple):
    """How held contractions of one worm converge."""

    worm: Worm
    elements: Sequence[int]  # Numbers of elements, the finest mesh last
    of_presets: Mapping[str, float]  # For each quantity the difference of the presets' mesh from the finest, relative
    order: Mapping[str, float | None]  # For each quantity the fitted order of convergence


def measure_convergence(readings: Sequence[Reading]) -> Convergence:
    """Measures how held contractions converge; the finest mesh is the last."""
    *coarser, finest = readings
    *n, most = elements = [int(one.value) for one in readings]
    difference = {name: np.array([_apart(name, one, finest) for one in coarser]) for name in QUANTITIES}
    of_presets = {name: float(apart[n.index(PRESETS_ELEMENTS)]) for name, apart in difference.items()}
    order = {name: convergence_order(n, apart, most) for name, apart in difference.items()}
    return Convergence(finest.worm, elements, of_presets, order)


def _apart(quantity: str, one: Reading, other: Reading) -> float:
    """Relative difference of a quantity, root mean square over the segments."""
    values, reference = QUANTITIES[quantity](one), QUANTITIES[quantity](other)
    return float(np.sqrt(np.mean((values / reference - 1.0) ** 2)))


def _examine(store: Store, effort: Effort) -> Findings:
    readings = design.read(_points(effort), store)
    held = [measure_convergence(own) for own in design.by_worm(readings).values()]
    numbers: dict[str, Number] = {}
    for found in held:
        for name, apart in found.of_presets.items():
            kind = f"{name.replace(' ', '_')}_{found.worm.name}"
            numbers |= {f"difference_{kind}": apart, f"order_{kind}": found.order[name]}
    columns: Columns = {
        "worm": lambda one: one.worm.label,
        "elements a side": lambda one: f"{one.value:g}",
        "ring held (m)": lambda one: words.each_in_unit(one.at_holds("ring_length_m"), digits=3),
        "elongation held (cm)": lambda one: words.all_in_cm(one.held_m),
        "force held (N)": lambda one: words.each_in_unit(one.at_holds("force_N")),
    }
    said = {"held": " ".join(map(_convergence_in_words, held))}
    return design.findings("discretization", said, tabulated(readings, columns), ["method"], numbers)


def _in_words(differences: Mapping[str, float]) -> str:
    return words.listed(f"{words.in_percent(value, 1)} % in {name}" for name, value in differences.items())


def _convergence_in_words(found: Convergence) -> str:
    orders = [order for order in found.order.values() if order is not None]
    slow = ", slower than first order" if orders and max(orders) < 1.0 else ""
    return (
        f"Held contractions of {found.worm.label} with {PRESETS_ELEMENTS} elements a side differ from those with "
        f"{found.elements[-1]} by {_in_words(found.of_presets)}; the fitted order "
        f"of convergence is {words.span(orders, digits=1)}{slow}."
    )


DISCRETIZATION = design.examination("discretization", lambda effort: design.cases_of(_points(effort)), _examine)
