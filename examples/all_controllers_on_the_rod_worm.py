"""Every kind of controller on the same worm of rods: order, period, elongation and travel of a short run.

python examples/all_controllers_on_the_rod_worm.py [seconds]
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import annelid
from annelid.analysis import rhythm_score

TURNS = [{"segment": 1 + k % 3, "start_s": 0.9 * k, "stop_s": 0.9 * (k + 1)} for k in range(40)]
CONTROLLERS: dict[str, dict[str, object]] = {
    "synthetic nervous system": {"kind": "sns"},
    "the same, half driven": {"kind": "adaptive", "drive": 0.5},
    "heteroclinic channel": {"kind": "shc"},
    "phase chain, slowed": {"kind": "phase-chain", "slowing": 2.5},
    "sine wave": {"kind": "sine"},
    "timed wave": {"kind": "timed", "rise_s": 0.3, "hold_s": 0.6, "fall_s": 0.3, "interval_s": 0.9},
    "program": {"kind": "program", "contractions": TURNS},
}


def main(duration_s: float) -> None:
    """Runs and prints one line a controller."""
    print(f"{'controller':26}{'rhythm':12}{'order':13}{'period':>8}{'elongation':>18}{'travel':>10}")
    with TemporaryDirectory() as folder:
        for name, controller in CONTROLLERS.items():
            config = annelid.load_config("riddle2023-rods", {"controller": controller, "duration_s": duration_s})
            run = annelid.simulate(config, Path(folder) / name, progress=False)
            numbers, score = annelid.summary(run), rhythm_score(run)
            order = "-".join(map(str, numbers.order[:6]))
            period = f"{numbers.period_s:.2f} s" if numbers.period_s else "-"
            elongation = " ".join(f"{100 * (length or 0):.1f}" for length in numbers.elongation_mean_max_m or [])
            travel = f"{100 * (numbers.travel_m or 0):.1f} cm"
            print(f"{name:26}{score.verdict or 'too short':12}{order:13}{period:>8}{elongation:>15} cm{travel:>10}")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 6.0)
