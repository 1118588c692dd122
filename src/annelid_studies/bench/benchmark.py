"""The benchmark as a whole: measures what is missing, judges it, and writes one JSON."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from importlib.resources import files
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from annelid.errors import AnnelidError
from annelid.experiment import Processes, StudyProgress, case_key, code_fingerprint
from annelid.output import write_json, write_text
from annelid.simulation import locks
from annelid.textfiles import parse_toml, read_json
from annelid_studies.bench.cases import BenchCase, as_it_is, bench_cases, converged
from annelid_studies.bench.measure import measure_alone
from annelid_studies.standard_cases import CHAIN, RODS, Effort

JSON_NAME = "bench.json"
CASES_FOLDER = "cases"
SCHEMA = "schema.toml"
"""What its entries are."""

QUANTITIES = ("elongation", "period", "travel", "work", "slip")
"""What a run is judged by."""

SCALED_SEGMENTS = (12, 96)
"""Beside the whole range of segments, the exponent of the cost is taken over this one."""

MEASURING = "annelid_studies.bench.measure"
"""The code that a measurement depends on beside the physics."""

# Importing, compiling, and the pass with the engine's timers.
_OVERHEAD_S = 5.0
# Exponents by which the cost of a step grows with the number of segments, beyond proportion.
_CHAIN_GROWTH, _ROD_GROWTH = 2.0, 0.5


@locks("folder")
def bench(
    folder: Path, effort: Effort = "full", *, lines: Sequence[str] | None = None, progress: StudyProgress | None = None
) -> Path:
    """Times closed loops one after the other, as far as they have not been timed into the folder before.

    Args:
        folder: Where ``bench.json`` goes, and each case as soon as it is measured.
        effort: ``"quick"`` for fewer points on each line, ``"full"`` for all.
        lines: Which lines of `annelid_studies.bench.cases.LINES`; None for all.
        progress: Called as the work goes on.

    Returns:
        Path of ``bench.json``. A case that could not be measured is in it with the reason, and tried again next time.

    Raises:
        ConfigError: There is no such line.
        RunFileError: A file cannot be written.
        KeyboardInterrupt: The case in progress is dropped, all others kept.
    """
    cases = bench_cases(effort, lines)
    wanted = {case.name: case for case in cases}
    store = Measurements(folder / CASES_FOLDER)
    measured = {name: kept for name, case in wanted.items() if (kept := store.find(case)) is not None}
    costs_s = {name: _cost_s(case) for name, case in wanted.items() if name not in measured}
    total_s, done_s = sum(costs_s.values()) or 1.0, 0.0
    for name, cost_s in costs_s.items():
        if progress is not None:
            progress("timing worms", len(measured), len(wanted), done_s / total_s)
        try:
            measured[name] = store.measure(wanted[name])
        except AnnelidError as failure:
            measured[name] = {"failed": str(failure)}
        done_s += cost_s
    content = {
        "effort": effort,
        "machine": f"{os.cpu_count()} cores, one of them used",
        "versions": {name: version(name) for name in ("annelid", "mujoco-core", "numpy")}
        | {"python": platform.python_version()},
        "schema": parse_toml((files("annelid_studies.bench") / SCHEMA).read_text(encoding="utf-8"), SCHEMA),
        **judge(cases, measured),
    }
    return write_json(folder / JSON_NAME, content)


def judge(cases: Sequence[BenchCase], measured: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Compares measurements: errors, processor times, exponents, levels.

    Args:
        cases: The cases.
        measured: What was measured of each, by its name; ``{"failed": reason}`` where nothing was.
    """
    finest, papers = (measured.get(case.name, {}) for case in (converged(), as_it_is(CHAIN)))
    entries = [_entry(case, measured[case.name], finest, papers) for case in cases]
    usable = [entry for entry in entries if "failed" not in entry]
    return {
        "cases": entries,
        "cost_exponents": {preset: _exponents(usable, line) for preset, line in ((RODS, "segments"), (CHAIN, "chain"))},
        "levels": {case.level: case.name for case in cases if case.level},
    }


def _cost_s(case: BenchCase) -> float:
    growth = _CHAIN_GROWTH if case.body.is_papers else _ROD_GROWTH
    n_runs = 1 + len(case.perturbed)
    return n_runs * case.case.cost_s * (case.body.n_segments / 3) ** growth + _OVERHEAD_S


def _entry(
    case: BenchCase, measured: Mapping[str, Any], finest: Mapping[str, Any], papers: Mapping[str, Any]
) -> dict[str, Any]:
    config = case.case.config
    entry = {
        "name": case.name,
        "kind": case.kind,
        "lines": list(case.lines),
        "level": case.level,
        "preset": case.case.preset,
        "formulation": case.body.formulation.kind,
        "n_segments": config.body.n_segments,
        "elements_per_side": case.body.mesh.elements_per_side,
        "physics_step_ms": round(1e3 * config.clock.physics_timestep_s, 9),
        "duration_s": config.duration_s,
        "command": case.case.command,
        **{name: value for name, value in measured.items() if name != "perturbed"},
    }
    if "levels" in case.lines:
        cpu, papers_cpu = _cpu_of_a_second(measured), _cpu_of_a_second(papers)
        entry["times_less_cpu"] = papers_cpu / cpu if cpu and papers_cpu else None
    if case.kind == "judged" and "summary" in measured and "summary" in finest:
        entry["errors"] = errors(_summaries(measured), _summaries(finest))
    return entry


def _cpu_of_a_second(measured: Mapping[str, Any]) -> float | None:
    """Processor time of a simulated second, s; None where nothing was measured."""
    return measured["cpu_s"] / measured["simulated_s"] if measured.get("simulated_s") else None


def _exponents(entries: Sequence[Mapping[str, Any]], line: str) -> dict[str, float | None]:
    points = {
        entry["n_segments"]: entry["step_median_ms"]
        for entry in entries
        if line in entry["lines"] and entry["step_median_ms"]
    }
    if len(points) < 2:
        return {}
    found = {}
    for low, high in dict.fromkeys([(min(points), max(points)), SCALED_SEGMENTS]):
        within = [n for n in sorted(points) if low <= n <= high]
        if within and (within[0], within[-1]) == (low, high):
            found[f"{low}-{high}"] = exponent(within, [points[n] for n in within])
    return found


def _summaries(measured: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [measured["summary"], *measured["perturbed"]]


def errors(
    measured: Sequence[Mapping[str, Any]], reference: Sequence[Mapping[str, Any]]
) -> dict[str, list[float | None]]:
    """Compares runs with converged ones, in pairs.

    Args:
        measured: Of each run a `annelid.analysis.Summary` as a mapping.
        reference: The same of the converged run of the same perturbation.

    Returns:
        By `QUANTITIES` and ``largest``, the larger of elongation's and period's, the relative errors of each pair, as
        fractions. One is None where a run of the pair lacks the quantity, or the reference's is zero.
    """
    pairs = [(_quantities(one), _quantities(other)) for one, other in zip(measured, reference, strict=True)]
    found = {
        name: [_largest([_relative(*values) for values in zip_longest(one[name], other[name])]) for one, other in pairs]
        for name in QUANTITIES
    }
    both = zip(found["elongation"], found["period"], strict=True)
    return found | {"largest": [_largest(pair) for pair in both]}


def _quantities(summary: Mapping[str, Any]) -> dict[str, list[float | None]]:
    """The `QUANTITIES` of a run; the elongation has a number for each segment."""
    works: list[Any] = summary["muscle_work_J"] or [None]
    travel, path = summary["travel_m"], summary["travel_path_m"]
    return {
        "elongation": list(summary["elongation_mean_max_m"] or [None]),
        "period": [summary["period_s"]],
        "travel": [travel],
        "work": [None if None in works else float(np.sum(works))],
        "slip": [path / abs(travel) if path is not None and travel else None],
    }


def exponent(sizes: Sequence[float], costs: Sequence[float]) -> float | None:
    """Slope of log(cost) against log(size) by least squares; None for fewer than two sizes."""
    if len(set(sizes)) < 2:
        return None
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def _relative(value: float | None, reference: float | None) -> float | None:
    return None if value is None or not reference else abs(value - reference) / abs(reference)


def _largest(values: Sequence[float | None]) -> float | None:
    """The largest, or None where one is missing: an error that is not known is not small."""
    known = [value for value in values if value is not None]
    return max(known) if known and len(known) == len(values) else None


class Measurements:
    """A folder of measurements of cases; it is made with the first."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def find(self, case: BenchCase) -> dict[str, Any] | None:
        """Returns what was measured before with the same configuration, code and engine, or None."""
        try:
            return read_json(self._path(case))
        except (OSError, ValueError):
            return None

    def measure(self, case: BenchCase) -> dict[str, Any]:
        """Measures a case in a process of its own, and keeps the numbers.

        Raises:
            AnnelidError: The process died, or the case cannot be built.
        """
        config, *perturbed = (one.model_dump(mode="json") for one in (case.case.config, *case.perturbed))
        with Processes(1) as process:
            measured = json.dumps(process.submit(measure_alone, config, perturbed).result(), indent=1, allow_nan=False)
        self.folder.mkdir(parents=True, exist_ok=True)
        write_text(self._path(case), measured)
        return json.loads(measured)

    def _path(self, case: BenchCase) -> Path:
        code = case_key(case.case) + code_fingerprint("annelid.analysis", MEASURING)
        stem = case.name.replace(", ", "-").replace(" ", "-")
        return self.folder / f"{stem}-{hashlib.sha256(code.encode()).hexdigest()[:12]}.json"
