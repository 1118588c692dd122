"""Start of the sodium gates and update order of the network: what the rhythm owes to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import nan
from typing import Any, NamedTuple

import numpy as np

from annelid.analysis import DESIGN_INTERVAL_S, SHORTEST_S, RhythmScore, contractions, segment_activation
from annelid.experiment import Case, Outcome, Store
from annelid.morphology import Array
from annelid.simulation import open_run
from annelid_studies.riddle2023 import words
from annelid_studies.riddle2023.contents import Findings, examination, findings
from annelid_studies.riddle2023.examinations.design import PAPERS, RIGID, SOFT, Worm
from annelid_studies.riddle2023.words import MS
from annelid_studies.tables import grouped, tabulated
from annelid_studies.worms import PLANAR, Effort

FLAT = Worm("planar", "planar worm, kinematic", lambda changes: Case(PLANAR, changes or {}))
STARTS = ("toolbox", "steady")
SCHEMES = ("euler", "toolbox", "heun")
ALL = tuple((start, scheme) for start in STARTS for scheme in SCHEMES)
"""Every start of the gates with every scheme."""
VARIANTS: Mapping[Effort, Mapping[Worm, Sequence[tuple[str, str]]]] = {
    "quick": {
        PAPERS: (("toolbox", "euler"),),
        SOFT: (("toolbox", "euler"), ("steady", "euler")),
        RIGID: (("toolbox", "euler"), ("toolbox", "toolbox"), ("steady", "euler")),
        FLAT: ALL,
    },
    "full": {
        PAPERS: (("toolbox", "euler"), ("toolbox", "toolbox"), ("steady", "euler"), ("steady", "toolbox")),
        SOFT: ALL,
        RIGID: ALL,
        FLAT: ALL,
    },
}


def variant(worm: Worm, start: str, scheme: str) -> Case:
    """Returns the closed-loop run of a worm with a start of the gates and a scheme."""
    return worm.case({"controller.gate_start": start, "controller.scheme": scheme})


class Beat(NamedTuple):
    """The contractions of a run, with a start of the gates and an update order of the network."""

    worm: Worm
    start: str  # How its gates started
    scheme: str  # Update order of its network
    rhythm: RhythmScore  # Its score
    onsets_s: Sequence[float]  # Onsets of all contractions, s
    # Onset and release of each contraction of each segment, s; infinite where it does not end
    contractions_s: tuple[Array, ...]

    @property
    def first_s(self) -> float:
        """How long segment 1 is contracted at first, s; infinite if it never relaxes, NaN if it never contracts."""
        first = self.contractions_s[0]
        return float(first[0, 1] - first[0, 0]) if len(first) else float("nan")


def read_beat(worm: Worm, start: str, scheme: str, outcome: Outcome) -> Beat:
    """Reads the contractions of a run."""
    run = open_run(outcome.path)
    times = run.data["time"].values
    active = segment_activation(run.data["activation"].values, run.config.body.n_segments)
    found = tuple(contractions(times, column, shortest_s=SHORTEST_S) for column in active.T)
    return Beat(worm, start, scheme, outcome.rhythm, outcome.summary.onsets_s, found)


def _examine(store: Store, effort: Effort) -> Findings:
    pairs = [(worm, pair) for worm, pairs in VARIANTS[effort].items() for pair in pairs]
    beats = [read_beat(worm, *pair, store[variant(worm, *pair)]) for worm, pair in pairs]
    flat = words.listed(
        f"{words.in_unit(beat.rhythm.period_s, MS, 1)} ms ({beat.start} start, {beat.scheme})"
        for beat in beats
        if beat.worm is FLAT
    )
    columns: Mapping[str, Callable[[Beat], str]] = {
        "worm": lambda beat: beat.worm.label,
        "gate start": lambda beat: beat.start,
        "update order": lambda beat: beat.scheme,
        "rhythm": lambda beat: words.rhythm(beat.rhythm),
        "period (s)": lambda beat: words.in_unit(beat.rhythm.period_s, digits=4),
        "first onsets (s)": lambda beat: " ".join(map(words.in_unit, beat.onsets_s[:6])) or words.DASH,
        "first contraction (s)": lambda beat: (
            words.in_unit(beat.first_s) if np.isfinite(beat.first_s) else "to the end"
        ),
    }
    found = {
        **_answer(beats),
        "flat": flat,
        "design_ms": 3000.0 * DESIGN_INTERVAL_S,
    }
    return findings("gate", found, tabulated(beats, columns), ["design"])


def _answer(beats: Sequence[Beat]) -> dict[str, Any]:
    groups = grouped(beats, lambda beat: (beat.start, beat.worm))
    walking, lasting = [], []
    for start in STARTS:
        own = {worm: group for (of, worm), group in groups.items() if of == start}
        failing = []
        for worm, group in own.items():
            if kinds := sorted({words.kind(beat.rhythm) for beat in group if not beat.rhythm.is_one_wave}):
                failing.append(f"{worm.label} ({words.listed(kinds)})")
        walking.append(
            f"with the {start} start of the gates {len(own) - len(failing)} of {len(own)} "
            f"(others: {words.listed(failing)})"
        )
        lasting.append(f"{words.span(beat.first_s for beat in beats if beat.start == start)} s with the {start} start")
    changed = sum(len({words.kind(beat.rhythm) for beat in group}) > 1 for group in groups.values())
    periods = [[b.rhythm.period_s or nan for b in group if b.rhythm.is_one_wave] for group in groups.values()]
    spread = max((np.ptp(group) for group in periods if group), default=None)
    return {
        "walking": "; ".join(walking),
        "lasting": words.listed(lasting),
        "changed": changed,
        "groups": len(groups),
        "spread_ms": None if spread is None else MS * spread,
    }


def _cases(effort: Effort) -> list[Case]:
    return [variant(worm, *pair) for worm, pairs in VARIANTS[effort].items() for pair in pairs]


GATE = examination("gate", _cases, _examine)
