"""From a design to runs to numbers: sweeps, searches, calibration, error bars, and the store of runs.

A study of your own lays out its runs as `Case`, has a `Store` compute them, and reads their `Outcome` or their run::

    store = Store(Path("runs"))
    cases = [Case("riddle2023-rods", {"arena.friction": friction}) for friction in (0.1, 0.5, 1.0)]
    store.compute(cases)
    periods_s = [store[case].rhythm.period_s for case in cases]

The names below are loaded on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from annelid.lazy import lazy

if TYPE_CHECKING:
    from annelid.experiment.case import SHEAR_OVER_YOUNG, Case, write_worm
    from annelid.experiment.convergence import Check, check
    from annelid.experiment.executors import Processes, answers, end_after
    from annelid.experiment.finer_runs import finer_steps, more_elements
    from annelid.experiment.fingerprint import code_fingerprint, physics_fingerprint, room_of
    from annelid.experiment.gait_criteria import Judged, judge, numerical_problem
    from annelid.experiment.outcome import Hold, Outcome
    from annelid.experiment.progress import StudyProgress, study_progress
    from annelid.experiment.store import Store, case_key
    from annelid.experiment.tune import load_optuna, parzen_study

__all__ = [
    "SHEAR_OVER_YOUNG",
    "Case",
    "Check",
    "Hold",
    "Judged",
    "Outcome",
    "Processes",
    "Store",
    "StudyProgress",
    "answers",
    "case_key",
    "check",
    "code_fingerprint",
    "end_after",
    "finer_steps",
    "judge",
    "load_optuna",
    "more_elements",
    "numerical_problem",
    "parzen_study",
    "physics_fingerprint",
    "room_of",
    "study_progress",
    "write_worm",
]

__getattr__, __dir__ = lazy(__name__, {"START": "the first trial of a search is the start"})
