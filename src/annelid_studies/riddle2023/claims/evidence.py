"""What the claims are judged by: one rule, the runs that they need, and every reading of them.

The claims themselves are words in ``claims.toml``. A function of a claim's name, marked by `judges`, measures what the
words leave open and judges it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import nan

import numpy as np

from annelid.experiment import Case, Outcome, Store
from annelid.morphology import Array
from annelid.simulation import Run
from annelid_studies import slip
from annelid_studies.papers.judging import EXACT, NEAR, Judges, claim_of
from annelid_studies.papers.report_parts import Claim, Findings
from annelid_studies.papers.words import filled, texts
from annelid_studies.riddle2023.examinations.design import PAPERS, RIGID, SOFT, WORMS, Worm
from annelid_studies.standard_cases import CHAIN, FAST, PLANAR, Effort, chain, fast, one_after_the_other, rods

CLAIMS_TOML = "riddle2023/claims/claims.toml"
MAIN = Case(CHAIN)
EQUAL_RANGES = {"body.rings.length_range_m": [0.566, 1.067]}
SHORT_MINIMUM = {"body.rings.minimum_length": 0.5, **one_after_the_other()}
TENSION_ONLY = {"body.springs.tension_only": True}
PERTURBATIONS = (
    *({"arena.friction": friction} for friction in (0.99, 1.01)),
    *({"sensor.noise_m": 1e-4, "seed": seed} for seed in (1, 2, 3, 4, 5, 6)),
)
"""Differences too small to measure on a robot: the runs are not random, so these give the spread."""
PLANAR_CASES = {
    300: Case(PLANAR),
    200: Case(PLANAR, {"controller.gate_time_constant_ms": 200, "body.gain": 1.9}),
    100: Case(PLANAR, {"controller.gate_time_constant_ms": 100, "body.gain": 3.6}),
}
"""The planar worm with the gate time constants (ms) and gains that go together."""
FLAT = Worm("planar", "planar worm, kinematic", lambda changes: Case(PLANAR, changes or {}))
_ORDERS = tuple(product(("toolbox", "steady"), ("euler", "toolbox", "heun")))
GATES: Mapping[Effort, Mapping[Worm, Sequence[tuple[str, str]]]] = {
    "quick": {
        PAPERS: (("toolbox", "euler"),),
        SOFT: (("toolbox", "euler"), ("steady", "euler")),
        RIGID: (("toolbox", "euler"), ("toolbox", "toolbox"), ("steady", "euler")),
        FLAT: _ORDERS,
    },
    "full": {
        PAPERS: tuple(product(("toolbox", "steady"), ("euler", "toolbox"))),
        **dict.fromkeys((SOFT, RIGID, FLAT), _ORDERS),
    },
}
"""How the sodium gates of each worm start, and the order in which its network is advanced."""
LABELS = {worm.name: worm.label for worm in WORMS}
"""What the worms are called, nearest to the paper's first."""
NEGLIGIBLE = 0.01
"""Travel in a cycle, in lengths of the body, below which we call it negligible."""
PAPER_STEPS, PAPER_WALL_S = 5000, 210.0
TUBE_AREA_M2, POLYETHYLENE_KG_PER_M3 = 1.7e-5, 940.0


@dataclass(frozen=True)
class Evidence:
    """What the claims are judged by."""

    store: Store  # The runs and their outcomes
    effort: Effort  # Quick or full
    findings: dict[str, Findings]  # What each examination found, by its name

    def number(self, examination: str, name: str) -> float:
        """Returns a single result of an examination; NaN where a run did not come that far."""
        value = self.findings[examination].numbers[name]
        return nan if value is None else float(value)

    def words(self, examination: str, name: str) -> str:
        """Returns a single result of an examination that is a text, as `number` does."""
        return str(self.findings[examination].numbers[name])

    @cached_property
    def runs(self) -> Sequence[tuple[Outcome, Run]]:
        """The runs of the paper's own worm, as it is first."""
        cases = [MAIN, *(spread_cases(self.effort) if self.effort == "full" else ())]
        return [(self.store[case], self.store.run(case)) for case in cases]


JUDGES = Judges[Evidence]()
judges = JUDGES.judge


def judge(name: str, evidence: Evidence) -> Claim:
    """Judges one claim of ``claims.toml``."""
    commands = {"main": MAIN.command, "planar": PLANAR_CASES[300].command}
    return claim_of(texts(CLAIMS_TOML)["claims"][name], JUDGES.get(name), evidence, commands)


def spread_cases(effort: Effort) -> list[Case]:
    """The perturbed runs: of the paper's own worm, or in a quick report fewer, of the one that takes seconds."""
    if effort == "quick":
        return [Case(FAST, changes) for changes in PERTURBATIONS[:3]]
    return [Case(CHAIN, changes) for changes in PERTURBATIONS]


def rule(evidence: Evidence) -> list[str]:
    """Says how all claims are judged."""
    perturbed = spread_cases(evidence.effort)
    n_seeds = sum("seed" in case.changes for case in perturbed)
    preset = perturbed[0].preset
    swings = [readings_m(evidence.store.run(case)) for case in (Case(preset), *perturbed)]
    periods = [evidence.store[case].rhythm.period_s or nan for case in perturbed]
    text = texts(CLAIMS_TOML)["rule"]
    found = {
        "which": filled(text[evidence.effort], {}),
        "n": len(perturbed),
        "all_runs": len(perturbed) + 1,
        "seeds": f"{n_seeds} seed{'s' if n_seeds > 1 else ''}",
        "preset": preset,
        "apart": float(np.max(np.ptp(swings, axis=0) / np.mean(swings, axis=0))),
        "periods_ms": 1e3 * float(np.ptp(periods)),
        "exact": 100 * EXACT,
        "near": 100 * NEAR,
    }
    return [filled(paragraph, found) for paragraph in text["paragraphs"]]


def readings_m(run: Run) -> Array:
    """Every reading of the elongation of every segment, m, shape ``(n_segments, n_sensors + 1)``; see `rule`."""
    stretch, rest = run.data["stretch_length"].values, run.data["stretch_rest_length"].values
    mean = (stretch - rest).mean(axis=2).max(axis=0)
    return np.column_stack([np.ptp(stretch, axis=0), mean])


def gated(worm: Worm, start: str, scheme: str) -> Case:
    """Returns the closed-loop run of a worm with a start of the gates and an update order."""
    return worm.case({"controller.gate_start": start, "controller.scheme": scheme})


def longer_worm(n_segments: int, worm: str) -> Case:
    """A worm of that many segments with equal muscles, each contracted in turn: the test of the interior segments."""
    changes = {"body.mesh.n_segments": n_segments, **EQUAL_RANGES, **one_after_the_other(n_segments)}
    return {"chain": chain, "fast": fast, "rods": rods}[worm](changes)


def longer_worms(effort: Effort) -> list[tuple[int, str]]:
    """Numbers of segments and worms of that test."""
    numbers = (4, 5, 6) if effort == "full" else (4, 6)
    pairs = [(n, worm) for worm in ("fast", "rods") for n in numbers]
    return [*pairs, (4, "chain")] if effort == "full" else pairs


def claim_cases(effort: Effort) -> Sequence[Case]:
    """The runs that the claims need beside those of the examinations."""
    return [
        MAIN,
        Case(FAST),
        rods(),
        *spread_cases(effort),
        *(worm(changes) for worm in (fast, rods) for changes in (SHORT_MINIMUM, one_after_the_other())),
        *(
            worm.case(changes)
            for worm in WORMS
            if effort == "full" or worm is not WORMS[0]
            for changes in ({}, TENSION_ONLY)
        ),
        *PLANAR_CASES.values(),
        *(gated(worm, *pair) for worm, pairs in GATES[effort].items() for pair in pairs),
        *(longer_worm(n, worm) for n, worm in longer_worms(effort)),
        *(slip.CASES[name] for name in slip_runs(effort)),
    ]


def slip_runs(effort: Effort) -> Sequence[str]:
    """Names of the runs that the slip detector is judged on."""
    return list(slip.CASES) if effort == "full" else slip.QUICK_CASES


def order_of(outcome: Outcome) -> str:
    """The order of onsets as ``1-2-3``."""
    return "-".join(str(segment) for segment in outcome.rhythm.order)
