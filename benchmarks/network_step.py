"""Cost of one step of the peristalsis network, side by side in one process: one copy, a batch, and SNS-Toolbox.

Run it on an otherwise idle machine, pinned to one core: ``taskset -c 1 python benchmarks/network_step.py``. All cases
take turns round by round and the best round of each counts, so that their ratios hold where absolute times do not.
SNS-Toolbox's numpy backend is measured where ``pip install "annelid[sns]"`` has been done.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np

from annelid.errors import MissingDependency
from annelid.nervous import export_network, peristalsis_network

ROUNDS = 15
TARGET_US, TARGET_RATIO = 30.0, 60.0

Case = tuple[Callable[[], None], int]


def ours(n_segments: int, n_worms: int, n_steps: int) -> Case:
    """Our stepper under the Euler scheme, with the segments' sensors on."""
    network = peristalsis_network(n_segments)
    stepper = network.compile(1.0, "euler", n_worms)
    state = stepper.initial_state()
    inputs = np.zeros((n_worms, len(network.inputs)))
    inputs[:, :n_segments] = 20.0

    def steps() -> None:
        for _ in range(n_steps):
            stepper.advance(state, inputs)

    return steps, n_steps


def toolbox(n_segments: int, n_steps: int) -> Case:
    """The same network on SNS-Toolbox's numpy backend; it steps one copy."""
    network = peristalsis_network(n_segments)
    model = export_network(network).compile(dt=1.0, backend="numpy")
    inputs = np.zeros(len(network.inputs))
    inputs[:n_segments] = 20.0

    def steps() -> None:
        for _ in range(n_steps):
            model(inputs)

    return steps, n_steps


def main() -> None:
    cases = {
        "one network, 3 segments, 12 neurons": ours(3, 1, 1000),
        "one network, 6 segments, 24 neurons": ours(6, 1, 1000),
        "1,000 networks, 6 segments": ours(6, 1000, 20),
    }
    try:
        for n_segments in (3, 6):
            cases[f"SNS-Toolbox numpy, one network, {n_segments} segments"] = toolbox(n_segments, 300)
    except MissingDependency as error:
        print(f"SNS-Toolbox left out: {error}")
    best = dict.fromkeys(cases, np.inf)
    for _ in range(ROUNDS):
        for name, (steps, n_steps) in cases.items():
            began = perf_counter()
            steps()
            best[name] = min(best[name], 1e6 * (perf_counter() - began) / n_steps)
    for name, cost in best.items():
        print(f"{name:45} {cost:9.1f} us a step")
    small, single, batch = list(best.values())[:3]
    for what, measured, target in (
        ("12 neurons, us", small, TARGET_US),
        ("1,000 against one, times", batch / single, TARGET_RATIO),
    ):
        print(f"{what:45} {measured:9.1f}, target {target:.0f}: {'met' if measured <= target else 'missed'}")


if __name__ == "__main__":
    main()
