"""The paper's network and the robust one under sensor signals that do not come from a body, from random states.

Prints the two tables of docs/evidence/robust.md: how often the paper's network shows one wave 1-2-..-N all the same,
and the robust network's periods relative to design. Takes about two minutes.

    python benchmarks/robust_network.py --csv docs/results/robust_network.csv
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.rhythm import DESIGN_INTERVAL_S, RhythmScore, score
from annelid.nervous import Network, peristalsis_network
from annelid.nervous.robust import robust_network
from annelid.output import write_csv

SENSOR_NA = 20.0
HALF_RANGE_MV = 10.0
BLOCK_MS = 10
UNJUDGED, JUDGED = 2.0, 2.6
"""Design periods before and in what is judged."""
IN_TIME = 0.1

Array = NDArray[np.float64]
Signal = Callable[[float], Array]
"""Activity of the stretch sensors, ``(n_copies, n_segments)``, from the time, s."""


def signals(n_copies: int, n_segments: int, rng: np.random.Generator) -> dict[str, Signal]:
    """Signals by name; each copy has its own rate, from 0.05 to 20 a second."""
    shape = (n_copies, n_segments)
    rate = np.exp(rng.uniform(np.log(0.05), np.log(20.0), (n_copies, 1)))
    phase = rng.random(shape)
    on = rng.random(shape) < 0.5

    def telegraph(_: float) -> Array:
        on[rng.random(shape) < rate * BLOCK_MS / 1e3] ^= True
        return on.astype(float)

    return {
        "all sensors on": lambda _: np.ones(shape),
        "all sensors off": lambda _: np.zeros(shape),
        "random telegraph": telegraph,
        "noise": lambda _: rng.random(shape),
        "swing": lambda time_s: 0.5 + 0.5 * np.sin(2 * np.pi * (rate * time_s + phase)),
    }


def scores(
    network: Network, n_segments: int, signal: Signal, n_copies: int = 1, seed: int | None = None
) -> list[RhythmScore]:
    """Scores copies of a network after its first two periods.

    Args:
        network: The network.
        n_segments: Its number of segments.
        signal: What its sensors say.
        n_copies: How many copies run together.
        seed: Of random potentials and gates to start from; None for the network's own start.
    """
    contraction = [list(network.neurons).index(f"contraction_{i + 1}") for i in range(n_segments)]
    stepper = network.compile(1.0, "euler", n_copies)
    state = stepper.initial_state()
    if seed is not None:
        rng = np.random.default_rng(seed)
        state.potential[...] = rng.uniform(-40.0, 60.0, state.potential.shape)
        state.gate[...] = rng.random(state.gate.shape)
    inputs = np.zeros((n_copies, len(network.inputs)))
    skipped, kept = (round(periods * n_segments * DESIGN_INTERVAL_S * 1e3 / BLOCK_MS) for periods in (UNJUDGED, JUDGED))
    trace = np.empty((kept, n_copies, n_segments))
    for block in range(skipped + kept):
        inputs[:, :n_segments] = SENSOR_NA * signal(block * BLOCK_MS / 1e3)
        stepper.advance(state, inputs, BLOCK_MS)
        if block >= skipped:
            trace[block - skipped] = state.potential[:, contraction] > HALF_RANGE_MV
    time_s = np.arange(kept) * BLOCK_MS / 1e3
    return [score(time_s, trace[:, copy]) for copy in range(n_copies)]


def relative_period(found: RhythmScore, n_segments: int) -> float:
    """Period over the design's, nan without one."""
    return np.nan if found.period_s is None else found.period_s / (n_segments * DESIGN_INTERVAL_S)


def show(
    title: str, network_of: Callable[[int], Network], sizes: tuple[int, ...], n_copies: int
) -> list[dict[str, object]]:
    """Prints and returns, for every signal and size, how many copies are a wave, and in time, and their periods."""
    print(f"{title}, {n_copies} copies: waves 1-2-..-N, of those within 10 % of design, periods over design")
    rows = []
    for name in signals(1, 1, np.random.default_rng(0)):
        row: dict[str, object] = {"signal": name, "network": title, "copies": n_copies}
        for n in sizes:
            signal = signals(n_copies, n, np.random.default_rng(n))[name]
            found = scores(network_of(n), n, signal, n_copies, seed=n + 1)
            periods = np.array([relative_period(one, n) for one in found if one.is_one_wave])
            in_time = int((np.abs(periods - 1.0) <= IN_TIME).sum())
            silent = sum(one.verdict == "silent" for one in found)
            reach = (periods.min(), periods.max()) if len(periods) else (np.nan, np.nan)
            print(
                f"  {name:17} N = {n:2}  waves {len(periods):3}  in time {in_time:3}  silent {silent:3}"
                f"  {reach[0]:.3f} .. {reach[1]:.3f}"
            )
            counts = {"waves": len(periods), "in_time": in_time, "silent": silent, "least": reach[0], "most": reach[1]}
            row |= {f"{what}_{n}": value for what, value in counts.items()}
        rows.append(row)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--csv", type=Path, help="file for the numbers")
    path = parser.parse_args().csv
    for n in (3, 6):
        [alone] = scores(robust_network(n), n, lambda _, n=n: np.zeros((1, n)))
        print(f"robust network without sensor signals, N = {n}: {alone.period_s:.3f} s, design {n * DESIGN_INTERVAL_S}")
    papers = show("the paper's network", peristalsis_network, (3, 6, 12), 64)
    robust = show("the robust network", robust_network, (3, 4, 6, 12), 32)
    if path:
        columns = list(dict.fromkeys([*robust[0], *papers[0]]))
        write_csv(path, columns, ([row.get(name) for name in columns] for row in (*papers, *robust)))


if __name__ == "__main__":
    main()
