"""Tunes entrants of the benchmark on training seeds, each with the same budget on each body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import tomlkit

from annelid.config import field_value
from annelid.errors import ConfigError
from annelid.experiment import Store, load_optuna, parzen_study
from annelid.output import write_text
from annelid_studies.challenge.scores import challenge
from annelid_studies.challenge.tasks import DIGITS, Entrant, Range, all_tasks, entries

SEARCHED, FINAL = "level", ("friction", "slope")
"""Task of the search, and tasks of the final round; for an entrant with ``each_task``, both are its task."""
SEEDS = (0, 1)
"""Training seeds: the search has the first, the final round all."""
SEARCH_DURATION_S = 8.0
"""Length of the runs of the search; those of the final round are as long as the task's."""
FINALISTS = 3
GENERATION = 8
"""Trials that are asked for at once."""
STARTS = (1 / 6, 1 / 2, 5 / 6)
"""Where in the other ranges every combination of whole numbers is tried first."""


def tune(
    entrants: Mapping[str, Entrant],
    n_trials: int,
    store: Store,
    *,
    bodies: Sequence[str] = (),
    tasks: Sequence[str] = (),
    duration_s: float | None = None,
) -> tuple[dict[str, Entrant], list[Trial]]:
    """Searches the fields that entrants vary, for speed.

    The search begins with the entrant's present setting, and with every combination of the whole numbers that it
    varies. Then Optuna's tree-structured Parzen estimator asks for trials, all on one training draw. The fastest of
    them run more draws, and the one with the largest mean speed there is taken. A refused run counts as speed 0. Called
    again, it finds the runs that are in the store.

    Args:
        entrants: By their names; those without ``vary`` stay as they are.
        n_trials: Trials of each search that the estimator asks for.
        store: Store of the runs.
        bodies: Names of the bodies; none for all.
        tasks: Tasks of the entrants that are tuned for each; none for all.
        duration_s: How long every run lasts; None for each task's own time.

    Returns:
        The entrants with what was found, and the trials of the searches.

    Raises:
        MissingDependency: Optuna is not installed.
        ConfigError: None of the entrants varies anything.
    """
    if not any(one.vary for one in entrants.values()):
        raise ConfigError(f"none of {', '.join(entrants)} says in `vary` what is searched")
    found, trials = {}, list[Trial]()
    for name, entrant in entrants.items():
        own = dict(entrant.on)
        for body in bodies or all_tasks().bodies if entrant.vary else ():
            places = [(f"{body}/{task}", task, (task,)) for task in tasks or all_tasks().tasks]
            for place, searched, final in places if entrant.each_task else [(body, SEARCHED, FINAL)]:
                search = _Search(entrant, body, searched, store, duration_s)
                tried = search.trials(n_trials)
                trials += [Trial(name, body, searched, speed, _listed(fields)) for speed, fields in tried]
                own[place] = {**entrant.on.get(place, {}), **search.best(tried, final)}
        found[name] = entrant.model_copy(update={"on": own, "tuned_on": SEEDS if entrant.vary else entrant.tuned_on})
    return found, trials


def _listed(fields: Mapping[str, Any]) -> str:
    return " ".join(f"{field}={value:g}" for field, value in fields.items())


@dataclass(frozen=True, slots=True)
class Trial:
    """One run of a search."""

    entrant: str
    body: str
    task: str
    speed_m_per_s: float  # 0 where the run was refused
    fields: str  # What was tried, as text


class _Search:
    """One search of one entrant on one body."""

    def __init__(self, entrant: Entrant, body: str, task: str, store: Store, duration_s: float | None) -> None:
        self._entrant, self._body, self._task, self._store, self._duration_s = entrant, body, task, store, duration_s
        first = entries({"": entrant}, [task], SEEDS[:1], bodies=[body])[0]
        self._n_segments = first.case.config.body.n_segments

    def trials(self, n_trials: int) -> list[tuple[float, dict[str, Any]]]:
        """Runs the search; speeds and fields of its trials, the fastest first."""
        study = parzen_study(["maximize"], GENERATION, seed=0)
        ranges = {field: self._range(among) for field, among in self._entrant.vary.items()}
        starts = self._starts(ranges)
        for start in starts:
            study.enqueue_trial(start)
        done: list[tuple[float, dict[str, Any]]] = []
        duration_s = SEARCH_DURATION_S if self._duration_s is None else self._duration_s
        while left := len(starts) + n_trials - len(done):
            asked = [study.ask(ranges) for _ in range(min(GENERATION, left))]
            tried = [{field: _rounded(value) for field, value in trial.params.items()} for trial in asked]
            speeds = self._speeds(tried, [self._task], SEEDS[:1], duration_s)
            for trial, speed in zip(asked, speeds, strict=True):
                study.tell(trial, speed)
            done += zip(speeds, tried, strict=True)
        return sorted(done, key=lambda one: -one[0])

    def _starts(self, ranges: Mapping[str, Any]) -> list[dict[str, Any]]:
        """The present setting, and every combination of the whole numbers at three places of the other ranges."""
        first = entries({"": self._entrant}, [self._task], SEEDS[:1], bodies=[self._body])[0].case.config
        present = {field: field_value(first, field) for field in ranges}
        inside = all(among.low <= present[field] <= among.high for field, among in ranges.items())
        starts = [present] if inside else []
        whole = {
            field: range(among.low, among.high + 1)
            for field, among in ranges.items()
            if self._entrant.vary[field].whole
        }
        if whole:
            for share in STARTS:
                others = {field: self._entrant.vary[field].at(share) for field in ranges if field not in whole}
                starts += [{**others, **dict(zip(whole, values, strict=True))} for values in product(*whole.values())]
        return starts

    def best(self, trials: Sequence[tuple[float, dict[str, Any]]], tasks: Sequence[str]) -> dict[str, Any]:
        """Returns the fields of the fastest trials that are fastest on all training draws."""
        finalists = [fields for _, fields in trials[:FINALISTS]]
        speeds = self._speeds(finalists, tasks, SEEDS, self._duration_s)
        return finalists[max(range(len(finalists)), key=lambda i: speeds[i])]

    def _speeds(
        self, tried: Sequence[dict[str, Any]], tasks: Sequence[str], seeds: Sequence[int], duration_s: float | None
    ) -> list[float]:
        """Mean speeds of settings, m/s."""
        named = {
            str(i): self._entrant.model_copy(update={"on": {self._body: fields}}) for i, fields in enumerate(tried)
        }
        wanted = entries(named, tasks, seeds, bodies=[self._body], duration_s=duration_s)
        scores = challenge(self._store, wanted)
        n = len(tasks) * len(seeds)
        return [sum(one.speed_m_per_s for one in scores if one.entrant == name) / n for name in named]

    def _range(self, among: Range) -> Any:
        kinds = load_optuna().distributions
        if among.whole:
            # A pattern has fewer segments than the body.
            return kinds.IntDistribution(int(among.low), min(int(among.high), self._n_segments - 1))
        return kinds.FloatDistribution(among.low, among.high, log=among.log)


def _rounded(value: float) -> float:
    return value if isinstance(value, int) else float(f"{value:.{DIGITS}g}")


def write_entrants(entrants: Mapping[str, Entrant], path: Path) -> Path:
    """Writes a file of entrants, which `tasks.read_entrants` reads."""
    tables = {name: one.model_dump(mode="json", exclude_defaults=True) for name, one in entrants.items()}
    return write_text(path, tomlkit.dumps(tables))
