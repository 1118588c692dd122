"""How wide the range is in which a controller walks: a sample of worms, each walked by every controller.

The sample is a Latin hypercube over sensor noise, friction and stiffness. The worms are the paper's of rods with rigid
crossings. A worm *walks* if the rhythm is ordered, in one wave from front to rear, and *in time* if its period is also
within 10 % of design. The robust controller's network starts from its design, from silence, and from random states in
turn; the paper's from its own start, its best case. The first two turns are not judged. A run that a guard stops is
taken at half the step instead, and every fourth worm is run at half the step as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from pathlib import Path

import numpy as np
from rich.table import Table as TerminalTable
from scipy.stats import binomtest, qmc

from annelid.analysis import DESIGN_INTERVAL_S, RhythmScore, lengthening_score, rhythm_score
from annelid.body import worm_of
from annelid.experiment import SHEAR_OVER_YOUNG, Case, Store, finer_steps
from annelid_studies.standard_cases import RODS, Effort
from annelid_studies.tables import Results, grouped, tabulated, terminal_table, write_fields

PAPERS, BY_RULE, ROBUST, TIMED = "sns", "sns-tolerance", "sns-robust", "timed"
CONTROLLERS = (PAPERS, BY_RULE, ROBUST, TIMED)
"""The paper's with the preset's tolerance, and with the tolerance that the body needs; ours; a wave without sensing."""
WORMS: Mapping[Effort, int] = {"quick": 8, "full": 64}
HALVED_EVERY = 4
"""One worm of so many is run at half the step as well."""
SETTLING_S = 2.0 * DESIGN_INTERVAL_S
"""Not judged at the start of a run: within two turns the robust network has found its rhythm from any state, s."""
CYCLES = 2.3
"""How long a run is judged, in design periods: the score needs two cycles of every segment."""
STARTS = ("design", "silent", "random")
"""How the robust network starts, in turn."""
PERIOD_TOLERANCE = 0.1
WAVE = {"kind": "timed", "rise_s": 0.0, "hold_s": DESIGN_INTERVAL_S, "fall_s": 0.0, "interval_s": DESIGN_INTERVAL_S}
"""A wave of the paper's turns: its muscles' rhythm is in time by construction, its segments' lengthening is not."""
N_SEGMENTS = 3
DESIGN_PERIOD_S = N_SEGMENTS * DESIGN_INTERVAL_S


@dataclass(frozen=True, slots=True)
class Worm:
    """One worm of the sample."""

    number: int  # From 0; the seed of the noise, and how the robust network starts
    noise_m: float  # Standard deviation of the noise on every reading of a stretch sensor, m
    friction: float  # Friction of the floor
    young_modulus_Pa: float  # Of the strands, Pa

    def case(self, controller: str, half_step: bool = False) -> Case:
        """Returns the run of this worm by one of `CONTROLLERS`."""
        case = Case(
            RODS,
            {
                "sensor.noise_m": self.noise_m,
                "arena.friction": self.friction,
                "body.strands.young_modulus_Pa": self.young_modulus_Pa,
                "body.strands.shear_modulus_Pa": SHEAR_OVER_YOUNG * self.young_modulus_Pa,
                "seed": self.number,
                "duration_s": round(SETTLING_S + CYCLES * DESIGN_PERIOD_S, 1),
            },
        )
        if half_step:
            case = case.but(finer_steps(case.config)[0])
        if controller == ROBUST:
            return case.but({"controller": {"kind": "sns-robust", "start": STARTS[self.number % len(STARTS)]}})
        if controller == TIMED:
            return case.but({"controller": WAVE})
        if controller == BY_RULE:
            return case.but({"sensor.tolerance_m": tolerance_m(case)})
        return case


@dataclass(frozen=True, slots=True)
class Judged:
    """How one worm walked by one controller."""

    worm: int  # As the worm's number
    noise_m: float  # As the worm's
    friction: float  # As the worm's
    young_modulus_Pa: float  # As the worm's
    controller: str  # One of `CONTROLLERS`
    step_s: float  # Physics step
    stopped: bool  # Whether a guard ended the run before its time
    reason: str  # Why, or what the score says
    period_s: float  # Mean period; NaN if no segment repeats
    walked: bool  # Ordered, in one wave from front to rear, to the end
    in_time: bool  # Walked, with a period within 10 % of design
    lengthened: bool  # In time, and the segments lengthened in one wave from front to rear as well


@dataclass(frozen=True, slots=True)
class Share:
    """How many worms walk by one controller."""

    controller: str  # One of `CONTROLLERS`
    worms: int
    walked: int
    in_time: int
    lengthened: int
    share: float  # That is in time and so lengthened
    low: float  # Ends of its 95 % interval, after Wilson 1927
    high: float
    stopped: int  # Worms that a guard stopped at the preset's step, and that count as at half of it
    halved: int  # Worms that were run at both steps to their end
    same: int  # Of those, worms with the same verdict at both


def sample(n: int) -> list[Worm]:
    """Draws worms: noise up to 5 mm, friction from 0.05 to 1.5 and 0.3 to 2 GPa in equal shares of its logarithm."""
    drawn = qmc.scale(qmc.LatinHypercube(3, rng=0).random(n), [0.0, *np.log([0.05, 0.3])], [5.0, *np.log([1.5, 2.0])])
    return [
        Worm(i, round(1e-3 * noise, 6), round(float(np.exp(friction)), 4), round(float(np.exp(modulus)), 4) * 1e9)
        for i, (noise, friction, modulus) in enumerate(drawn.tolist())
    ]


def tolerance_m(case: Case) -> float:
    """Returns the middle of the window that a body's stretch sensors need, m."""
    config = case.config
    assert config.arena is not None
    window = worm_of(config).tolerance_window_m(config.arena.friction)
    assert window is not None, "the rule is for this body"
    return round(sum(window) / 2.0, 4)


def judge(
    worm: Worm, controller: str, step_s: float, rhythm: RhythmScore, lengthening: RhythmScore, message: str = ""
) -> Judged:
    """Judges one run by the scores of its activation and of its segments' lengthening, and why it ended too early."""
    period = nan if rhythm.period_s is None else rhythm.period_s
    walked = not message and rhythm.is_one_wave
    in_time = walked and abs(period / DESIGN_PERIOD_S - 1.0) <= PERIOD_TOLERANCE
    stopped, reason = bool(message), message or rhythm.reason
    of = worm.number, worm.noise_m, worm.friction, worm.young_modulus_Pa
    return Judged(
        *of, controller, step_s, stopped, reason, period, walked, in_time, in_time and lengthening.is_one_wave
    )


def study(store: Store, output: Path, effort: Effort) -> Results:
    """The study `robustness`."""
    worms = sample(WORMS[effort])
    keys = [(worm, controller) for controller in CONTROLLERS for worm in worms]
    cases = {(*key, half): key[0].case(key[1], half) for key in keys for half in (False, True)}
    wanted = [case for (worm, _, half), case in cases.items() if not half or worm.number % HALVED_EVERY == 0]
    store.compute(wanted, "robustness")
    store.compute([cases[*key, True] for key in keys if store[cases[*key, False]].message], "again, at half the step")
    judged = []
    done = {key: case for key, case in cases.items() if case in store}
    for i, ((worm, controller, _), case) in enumerate(done.items()):
        if store.progress is not None:
            store.progress("judging", i, len(done), i / len(done))
        run = store.run(case)
        scores = rhythm_score(run, SETTLING_S), lengthening_score(run, SETTLING_S)
        step_s = case.config.clock.physics_timestep_s
        judged.append(judge(worm, controller, step_s, *scores, store[case].message))
    found = shares(judged)
    written = (
        write_fields(Share, found, output / "robustness.csv"),
        write_fields(Judged, judged, output / "robustness_runs.csv"),
    )
    return written, [shares_table(found)]


def shares(judged: Sequence[Judged]) -> list[Share]:
    """Counts by controller; of a worm that a guard stopped counts the run at half the step."""
    found = []
    for controller, own in grouped(judged, lambda one: one.controller).items():
        runs = [sorted(of, key=lambda one: -one.step_s) for of in grouped(own, lambda one: one.worm).values()]
        stopped = [of for of in runs if len(of) > 1 and of[0].stopped]
        both = [of for of in runs if len(of) > 1 and not of[0].stopped]
        counted = [of[-1] if of[0].stopped else of[0] for of in runs]
        good = sum(one.lengthened for one in counted)
        interval = binomtest(good, len(counted)).proportion_ci(method="wilson")
        found.append(
            Share(
                controller,
                len(counted),
                sum(one.walked for one in counted),
                sum(one.in_time for one in counted),
                good,
                good / len(counted),
                *map(float, interval),
                stopped=len(stopped),
                halved=len(both),
                same=sum(of[0].lengthened == of[-1].lengthened for of in both),
            )
        )
    return found


def shares_table(found: Sequence[Share]) -> TerminalTable:
    """Tabulates what `shares` counted."""
    columns: Mapping[str, Callable[[Share], str]] = {
        "controller": lambda one: one.controller,
        "worms": lambda one: str(one.worms),
        "in order": lambda one: str(one.walked),
        "in time": lambda one: str(one.in_time),
        "and so lengthened": lambda one: str(one.lengthened),
        "their share (%)": lambda one: f"{100 * one.share:.0f} ({100 * one.low:.0f} .. {100 * one.high:.0f})",
        "same at half the step": lambda one: f"{one.same} of {one.halved}",
    }
    caption = "in time: in one wave, with a period within 10 % of design"
    return terminal_table(tabulated(found, columns), f"worms of {RODS} that walk", caption=caption)
