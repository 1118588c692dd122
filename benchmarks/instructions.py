"""Which of the engine's functions grow with the worm's length, counted in instructions and calls a step.

Instructions do not depend on caches or on what else runs. Needs valgrind (its callgrind): ``python
benchmarks/instructions.py [--segments 12 47]`` takes some minutes. A wave contracts every third ring, as in
``benchmarks/growth.py``.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

STEPS = 11
SHOWN = 12


def step_a_worm(n_segments: int) -> None:
    """Steps a worm some times; the parent watches the engine meanwhile."""
    import mujoco
    import numpy as np

    from annelid import load_config
    from annelid.body import build_spec, compile_spec

    model = compile_spec(build_spec(load_config("riddle2023-rods", {"body.mesh.n_segments": n_segments})))
    data = mujoco.MjData(model)
    data.ctrl[:] = 0.5 * (np.arange(model.nu) % 3 == 0)
    for _ in range(STEPS):
        mujoco.mj_step(model, data)


def counted(n_segments: int) -> tuple[Counter[str], Counter[str]]:
    """Instructions of every function itself, and its calls, within all steps."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "callgrind.out"
        command = ["valgrind", "--tool=callgrind", "--toggle-collect=mj_step", f"--callgrind-out-file={out}"]
        child = [sys.executable, __file__, "--child", str(n_segments)]
        subprocess.run([*command, *child], check=True, capture_output=True)
        return parsed(out.read_text(encoding="utf-8", errors="replace").splitlines())


def parsed(lines: list[str]) -> tuple[Counter[str], Counter[str]]:
    """Reads callgrind's file: names are given once and then by number; the line after a call is its inclusive cost."""
    names: dict[str, str] = {}
    own: Counter[str] = Counter()
    calls: Counter[str] = Counter()
    function = called = ""
    inclusive = False
    for line in lines:
        if match := re.match(r"(c?fn)=\((\d+)\)(?: (.*))?", line):
            kind, number, name = match.groups()
            name = names.setdefault(number, re.split(r"[.']", name or "")[0])
            function, called = (function, name) if kind == "cfn" else (name, called)
        elif line.startswith("calls="):
            calls[called] += int(line[6:].split()[0])
            inclusive = True
        elif re.match(r"[+\-*\d]", line) and function:
            if not inclusive:
                own[function] += int(line.split()[1])
            inclusive = False
    return own, calls


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--segments", type=int, nargs=2, default=[12, 47])
    parser.add_argument("--child", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        step_a_worm(given.child)
        return
    if shutil.which("valgrind") is None:
        raise SystemExit("this needs valgrind: install it with your system's package manager")
    (short, short_calls), (long, long_calls) = (counted(n) for n in given.segments)
    low, high = given.segments
    print(f"{high / low:.1f} times the length; millions of instructions and calls a step")
    print(f"{'function':34} {f'N = {low}':>8} {f'N = {high}':>8} {'times':>6} {'calls':>8} {'calls':>8}")
    rows = [("all", sum(short.values()), sum(long.values()))]
    rows += [(name, short[name], instructions) for name, instructions in long.most_common(SHOWN)]
    for name, few, many in rows:
        times = many / few if few else float("inf")
        print(
            f"{name[:34]:34} {few / STEPS / 1e6:8.1f} {many / STEPS / 1e6:8.1f} {times:6.1f} "
            f"{short_calls[name] / STEPS:8.1f} {long_calls[name] / STEPS:8.1f}"
        )


if __name__ == "__main__":
    main()
