"""Hashes of what annelid computes, to show that a change of structure changes no number.

    python benchmarks/goldens.py before.json                     on the code before
    python benchmarks/goldens.py after.json --against before.json    on the code after, same machine

The first two seconds of every preset, each with every recorded variable, and so of a resumed run and a sweep; an
episode of the environment. With ``--paper`` also the page of claims of `annelid paper --quick`. Hashes hold for one
machine and one set of libraries: another processor adds in another order.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import gymnasium
import numpy as np

from annelid import Run, load_config, preset_names, simulate, sweep

WALL_TIME = "wall_time"
RODS = "riddle2023-rods"
NOISY = {"sensor.noise_m": 0.002}


def digest(*arrays: np.ndarray) -> str:
    """Hash of the bytes of some arrays."""
    found = hashlib.sha256()
    for array in arrays:
        found.update(f"{array.dtype} {array.shape}".encode())
        found.update(str(array.tolist()).encode() if array.dtype.hasobject else np.ascontiguousarray(array).tobytes())
    return found.hexdigest()[:16]


def hashes(name: str, run: Run) -> Iterator[tuple[str, str]]:
    """A hash of every variable of a run but the time that it took."""
    for variable in sorted({*run.data.variables} - {WALL_TIME}, key=str):
        yield f"{name}: {variable}", digest(run.data[variable].values)


def computed(folder: Path, duration_s: float) -> Iterator[tuple[str, str]]:
    """Runs everything and yields the hashes."""
    short = {"duration_s": duration_s}
    for preset in preset_names():
        yield from hashes(preset, simulate(load_config(preset, short), folder / preset, progress=False))
    half = simulate(load_config(RODS, {**NOISY, "duration_s": duration_s / 2}), folder / "half", progress=False)
    whole = load_config(RODS, {**NOISY, **short})
    yield from hashes("resumed", simulate(whole, folder / "resumed", resume=half, progress=False))
    study = {
        "name": "goldens",
        "preset": RODS,
        "set": short,
        "vary": [{"field": "arena.friction", "values": [0.3, 1.0]}],
        "outputs": ["elongation_mean_max_m", "travel_m", "muscle_work_J", "energy_numerical_share"],
    }
    table = sweep(study, folder / "sweep", jobs=1)
    for variable in study["outputs"]:
        yield f"sweep: {variable}", digest(table[variable].values)
    env = gymnasium.make("annelid.environments:annelid/Worm-v0", episode_s=2.4)
    seen, _ = env.reset(seed=0)
    env.action_space.seed(0)
    steps, over = [np.asarray(seen)], False
    while not over:
        seen, reward, ended, late, _ = env.step(env.action_space.sample())
        steps.append(np.append(seen, float(reward)))
        over = ended or late
    yield "environment", digest(*steps)


def main() -> None:
    """Writes the hashes, and tells which differ from those of another file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path)
    parser.add_argument("--against", type=Path, help="hashes of the code before")
    parser.add_argument("--paper", action="store_true", help="also annelid paper --quick, minutes")
    parser.add_argument("--duration", type=float, default=2.0, help="of each run, s")
    given = parser.parse_args()
    with TemporaryDirectory() as temporary:
        found, runs = {}, []
        for name, value in computed(Path(temporary), given.duration):
            if (run := name.partition(":")[0]) not in runs:
                runs.append(run)
                print(run, file=sys.stderr)
            found[name] = value
        if given.paper:
            page = Path(temporary) / "claims.md"
            words = ["paper", "--quick", "-o", str(page.with_name("report")), "--claims", str(page), "-q"]
            subprocess.run([sys.executable, "-m", "annelid", *words], check=True)
            lines = [line for line in page.read_text().splitlines() if "processor time" not in line]
            found |= {f"paper: {line[:60]}": digest(np.frombuffer(line.encode(), np.uint8)) for line in lines if line}
    given.output.write_text(json.dumps(found, indent=1) + "\n")
    if given.against:
        before = json.loads(given.against.read_text())
        names = sorted(before.keys() | found.keys())
        differ = [name for name in names if before.get(name) != found.get(name)]
        print("\n".join([*differ, f"{len(differ)} of {len(names)} differ"]))
        sys.exit(bool(differ))


if __name__ == "__main__":
    main()
