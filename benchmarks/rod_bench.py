"""What `cosseratbench run` has found, as one table: a row for an experiment, its elements and a metric.

The folders hold results of any solvers. annelid needs another engine than the bench's own MuJoCo adapter, which is for
MuJoCo 3, so there are two environments:

    pip install -c constraints.txt ".[bench]"
    cosseratbench run catenary cantilever pendulum twist crossing -s annelid -s pyelastica --vary resolution -o ours
    pip install cosseratbench "mujoco<4"        # in an environment of its own
    cosseratbench run catenary cantilever pendulum twist crossing -s mujoco --vary resolution -o theirs
    python benchmarks/rod_bench.py ours theirs --csv docs/results/rod_bench.csv
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from annelid.output import write_csv

SOLVERS = "annelid", "pyelastica", "mujoco"
METRICS = {"cantilever": "tip_deflection_error", "catenary": "sag_error", "pendulum": "period_error"}
METRICS |= {"pendulum, amplitude": "amplitude_change", "twist": "critical_twist_error", "crossing": "lift_error"}
"""What is shown of an experiment."""


def rows(folders: list[Path]) -> list[dict[str, Any]]:
    """Returns a row for every experiment, resolution and metric, with a column for every solver."""
    found: dict[tuple[str, int], dict[str, Any]] = {}
    for path in sorted(path for folder in folders for path in folder.rglob("result.json")):
        result = json.loads(path.read_text(encoding="utf-8"))
        for name, metric in METRICS.items():
            if result["experiment"] == name.partition(",")[0] and result["solver"] in SOLVERS:
                row = {"experiment": name, "elements": result["n_elements"]} | dict.fromkeys(SOLVERS, "not run")
                value = result["metrics"].get(metric)
                shown = result["outcome"] if value is None else f"{abs(value):.3g}"
                found.setdefault((name, result["n_elements"]), row)[result["solver"]] = shown
    return [found[key] for key in sorted(found)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--csv", type=Path, help="file to write")
    chosen = parser.parse_args()
    table = rows(chosen.folders)
    for row in table:
        print("  ".join(f"{value:>12}" for value in row.values()))
    if chosen.csv is not None:
        write_csv(chosen.csv, table[0], (row.values() for row in table))


if __name__ == "__main__":
    main()
