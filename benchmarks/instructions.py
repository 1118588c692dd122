"""Counts the instructions of steps with valgrind's callgrind: they do not depend on caches or on what else runs.

``python benchmarks/instructions.py [--segments 12 47]`` says which of the engine's functions grow with the worm's
length, in instructions and calls a step, in some minutes. A wave contracts every third ring.

``python benchmarks/instructions.py --step`` says in half a minute what a step of the closed loop costs. Its parts are
counted in fixed work of the same process: the engine's in a step of a small model, ours in some Python with numpy. So
neither the processor nor the compilers of Python and the engine matter much. ``tests/studies/test_instructions.py``
compares it with the cost before.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import json
import mmap
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from importlib.metadata import version
from pathlib import Path
from typing import Any

STEPS = 11
STAGES = "mj_fwdPosition", "mj_fwdVelocity", "mj_step2"
"""What a step of rods calls of the engine."""
SHOWN = 12

WARM_STEPS, LOOP_STEPS, SMALL_STEPS = 3, 20, 50
"""Steps before the counted ones, in which Python fills its caches, and counted ones of the loop and the small model."""
PLANT, CONTROL, REST = "plant", "network and control", "recording and loop"
SMALL, PYTHON = "small model", "Python"
"""Parts of the loop, of which the plant's includes the engine's steps, and the fixed work."""
REQUEST = bytes.fromhex("4889f8 31d2 48c1c703 48c1c70d 48c1c73d 48c1c733 4887db 4889d0 c3")
"""A function that asks valgrind something, for x86-64: ``VALGRIND_DO_CLIENT_REQUEST_EXPR`` of its valgrind.h."""
CALLGRIND = ord("C") << 24 | ord("T") << 16
DUMP, START, STOP = CALLGRIND + 3, CALLGRIND + 4, CALLGRIND + 5
"""``CALLGRIND_DUMP_STATS_AT``, ``_START_INSTRUMENTATION`` and ``_STOP_INSTRUMENTATION`` of its callgrind.h."""
# The C library's copies by one long instruction would count once for every byte, and only where a processor has them.
STEADY = {"PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1", "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-ERMS"}
YARDSTICK = """
<mujoco>
  <option integrator="implicitfast"/>
  <worldbody>
    <body><freejoint/><geom size=".1" mass="1"/>
      <replicate count="40" euler="0 0 9"><body pos=".2 0 0"><joint axis="0 1 0" damping=".1"/><geom size=".05"/>
        <body pos=".2 0 0"><joint axis="0 0 1" damping=".1"/><geom size=".05"/></body></body></replicate>
    </body>
    <geom type="plane" size="1 1 1" pos="0 0 -.06"/>
  </worldbody>
</mujoco>
"""
"""A body of the engine's own with contacts, none of it annelid's."""


def step_a_worm(n_segments: int, *, own_order: bool) -> None:
    """Steps a worm some times, or one in the engine's own order of elimination; the parent watches it meanwhile."""
    import numpy as np

    from annelid import load_config
    from annelid.body.formulations.rods import net
    from annelid.simulation import WormPlant

    if own_order:
        net.elimination_order = lambda bodies, *_: bodies
    plant = WormPlant(load_config("riddle2023-rods", {"body.mesh.n_segments": n_segments}))
    plant.move(0.5 * (np.arange(plant.n_muscles) % 3 == 0), STEPS)


def step_the_loop(path: Path) -> None:
    """Runs and records a closed loop, then the fixed work, and says to callgrind where each part of it ends."""
    import mujoco
    import numpy as np

    from annelid import load_config
    from annelid.simulation import WormPlant, build_controller, start
    from annelid.simulation.loop import RecordedRun

    page = mmap.mmap(-1, mmap.PAGESIZE, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)
    page.write(REQUEST)
    code = ctypes.c_char.from_buffer(page)
    ask = ctypes.CFUNCTYPE(ctypes.c_uint64, ctypes.c_void_p)(ctypes.addressof(code))

    def tell(request: int, name: str = "") -> None:
        text = ctypes.create_string_buffer(name.encode())
        ask((ctypes.c_uint64 * 6)(request, ctypes.addressof(text)))

    def mark(owner: Any, method: str, name: str) -> None:
        unmarked = getattr(owner, method)

        def marked(*arguments: Any) -> Any:
            tell(DUMP, REST)
            result = unmarked(*arguments)
            tell(DUMP, name)
            return result

        setattr(owner, method, marked)

    config = load_config("riddle2023-rods")
    plant = WormPlant(config)
    controller = build_controller(config, plant)
    simulation = start(config, plant, controller, None)
    run = RecordedRun(config, simulation, path)
    small = mujoco.MjModel.from_xml_string(YARDSTICK)
    small_data = mujoco.MjData(small)

    def steps(n: int) -> None:
        for _ in range(n):
            simulation.advance()
            run.record(0.0)
        run.recorder.flush()

    def engine_work(n: int) -> None:
        for _ in range(n):
            mujoco.mj_step(small, small_data)

    def python_work() -> None:
        kept, values = {}, np.linspace(0.0, 1.0, 36)
        for number in range(200):
            values = (0.5 * values + values * values).clip(0.0, 1.0)
            kept[f"total {number % 7}"] = float(np.add.reduce(values))

    mark(plant, "stride", PLANT)
    mark(controller, "stride", CONTROL)
    steps(WARM_STEPS)
    engine_work(1)
    python_work()
    gc.collect()
    gc.disable()
    tell(START)
    for work, name in (
        (lambda: steps(LOOP_STEPS), REST),
        (lambda: engine_work(SMALL_STEPS), SMALL),
        (python_work, PYTHON),
    ):
        work()
        tell(DUMP, name)
    tell(STOP)
    run.finish(None)


def under_callgrind(child: list[str], *options: str, **variables: str) -> list[list[str]]:
    """Runs this file as a child under callgrind, and returns the lines of each file that came of it."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out", *options]
        command += [sys.executable, __file__, *child]
        answer = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | variables)
        if answer.returncode:
            raise SystemExit(f"{' '.join(command)} failed: {answer.stderr[-2000:]}")
        files = sorted(Path(folder).iterdir())
        return [file.read_text(encoding="utf-8", errors="replace").splitlines() for file in files]


def counted(n_segments: int, *, own_order: bool) -> tuple[Counter[str], Counter[str]]:
    """Instructions of every function itself, and its calls, within all steps."""
    child = ["--child", str(n_segments)] + ["--own-order"] * own_order
    (lines,) = under_callgrind(child, *(f"--toggle-collect={stage}" for stage in STAGES))
    own, calls, _ = parsed(lines)
    return own, calls


def counted_step() -> dict[str, float]:
    """Instructions of a step of the closed loop by part: the engine's in small steps, ours in the work of Python."""
    every, engine = Counter[str](), Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        child = ["--loop", f"{folder}/run.nc"]
        for lines in under_callgrind(child, "--instr-atstart=no", "--vgdb=no", **STEADY):
            name = next(line.rpartition(": ")[2] for line in lines if line.startswith("desc: Trigger: "))
            own, _, inclusive = parsed(lines)
            every[name] += sum(own.values())
            engine[name] += sum(inclusive[function] for function in (("mj_step",) if name == SMALL else STAGES))
    ours = {PLANT: every[PLANT] - engine[PLANT], CONTROL: every[CONTROL], REST: every[REST]}
    in_small_steps = engine[PLANT] / LOOP_STEPS / (engine[SMALL] / SMALL_STEPS)
    return {"engine": in_small_steps} | {name: n / LOOP_STEPS / every[PYTHON] for name, n in ours.items()}


def counted_with() -> dict[str, str]:
    """What counts are of, and can only be compared with."""
    versions = {name: version(name) for name in ("mujoco-core", "numpy")}
    return {"machine": platform.machine(), "python": ".".join(platform.python_version_tuple()[:2]), **versions}


def parsed(lines: list[str]) -> tuple[Counter[str], Counter[str], Counter[str]]:
    """Reads a file of callgrind: instructions of every function itself, its calls, and instructions with its callees.

    Names are given once and then by number; the line after a call is its inclusive cost.
    """
    names: dict[str, str] = {}
    own, calls, inclusive = Counter[str](), Counter[str](), Counter[str]()
    function = called = ""
    is_call = False
    for line in lines:
        if match := re.match(r"(c?fn)=\((\d+)\)(?: (.*))?", line):
            kind, number, name = match.groups()
            name = names.setdefault(number, re.split(r"[.']", name or "")[0])
            function, called = (function, name) if kind == "cfn" else (name, called)
        elif line.startswith("calls="):
            calls[called] += int(line[6:].split()[0])
            is_call = True
        elif re.match(r"[+\-*\d]", line) and function:
            (inclusive if is_call else own)[called if is_call else function] += int(line.split()[1])
            is_call = False
    return own, calls, inclusive


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--segments", type=int, nargs=2, default=[12, 47])
    parser.add_argument("--own-order", action="store_true", help="eliminate bodies in the engine's own order")
    parser.add_argument("--step", action="store_true")
    parser.add_argument("--child", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--loop", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        step_a_worm(given.child, own_order=given.own_order)
        return
    if given.loop:
        step_the_loop(given.loop)
        return
    if shutil.which("valgrind") is None:
        raise SystemExit("this needs valgrind: install it with your system's package manager")
    if given.step:
        if platform.machine() != "x86_64":
            raise SystemExit("steps of the loop are counted on x86-64 only")
        print(json.dumps({"counted_with": counted_with(), "step": counted_step()}, indent=2))
        return
    (short, short_calls), (long, long_calls) = (counted(n, own_order=given.own_order) for n in given.segments)
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
