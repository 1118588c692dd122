"""The C99 of networks beside annelid's own steps, and on Cortex-M cores under QEMU: errors, instructions, memory.

Prints the numbers of docs/firmware.md. Needs a C compiler, and without --host-only Debian's gcc-arm-none-eabi,
libnewlib-arm-none-eabi and qemu-system-arm. Takes ten minutes.

    python benchmarks/firmware.py --csv docs/results/firmware.csv
    python benchmarks/firmware.py --random 59 --steps 2000 --csv docs/results/firmware_random.csv
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import annelid
from annelid.control import SENSED
from annelid.nervous import (
    Channel,
    GapJunction,
    Gate,
    Network,
    Neuron,
    Stepper,
    Synapse,
    persistent_sodium,
)
from annelid.output import write_csv
from annelid.protocols import Controller, Sensation
from annelid_lab.firmware import Firmware, HostFirmware, controller_firmware, network_firmware
from annelid_studies.standard_cases import PAPERS_RODS

ARM = Path(__file__).parent / "arm"
CORES = {
    "Cortex-M4": ("mps2-an386", ["-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16"]),
    "Cortex-M7": ("mps2-an500", ["-mcpu=cortex-m7", "-mfpu=fpv5-d16"]),
}
WORMS: dict[str, dict[str, Any]] = {
    "peristalsis": {"controller": {"kind": "sns"}},
    "robust": {"controller": {"kind": "sns-robust"}},
    "pressure": {"controller": {"kind": "sns-pressure"}},
    "adaptive": {"controller": {"kind": "adaptive", "drive": 0.5}, "clock.physics_timestep_s": 0.005},
}
"""What differs from riddle2023-rods."""
SAME_STEPS = 10
"""Steps under one sensation of a record."""
RECORDED_S, REPLAYED_S = 8.0, 60.0
HALF_RANGE_MV = 10.0


def random_network(seed: int) -> Network:
    """A network of two to seven neurons with all that a network can have, in random numbers."""
    rng = np.random.default_rng(seed)
    network, n = Network(f"random {seed}"), int(rng.integers(2, 8))

    def gate(slow: bool) -> Gate:
        power = float(rng.choice([1.0, 1.0, 2.0, 3.0]) if seed % 2 else rng.choice([1.0, 1.5]))
        numbers = rng.uniform(-0.1, 0.1), rng.uniform(-10.0, 30.0), rng.uniform(0.2, 2.0), power
        return Gate(*map(float, numbers), time_constant_ms=rng.uniform(20.0, 300.0) if slow else None)

    def channels() -> tuple[Channel, ...]:
        if seed % 3 == 0:
            return (persistent_sodium(rng.uniform(0.2, 1.5)),) * int(rng.integers(0, 2))
        made = (
            Channel(rng.uniform(0.0, 0.5), rng.uniform(-60.0, 110.0), tuple(gate(rng.random() < 0.5) for _ in range(k)))
            for k in rng.integers(0, 4, rng.integers(0, 3))
        )
        return tuple(made)

    for i in range(n):
        neuron = Neuron(
            capacitance_nF=rng.uniform(3.0, 20.0),
            leak_conductance_uS=rng.uniform(0.5, 1.5),
            rest_mV=rng.uniform(-2.0, 2.0),
            bias_nA=rng.uniform(0.0, 18.0),
            channels=channels(),
        )
        network.add_neuron(f"n{i}", neuron, rng.uniform(-5.0, 4.0))
    for _ in range(int(rng.integers(1, 4 * n))):
        source, target = (f"n{i}" for i in rng.integers(0, n, 2))
        opening = float(rng.uniform(-5.0, 5.0)), float(rng.uniform(6.0, 25.0))
        if rng.random() < 0.7:
            network.add_synapse(source, target, Synapse(rng.uniform(0.0, 0.6), rng.uniform(-60.0, 100.0), *opening))
        else:
            network.add_gap_junction(source, target, GapJunction(rng.uniform(0.0, 0.3), bool(rng.random() < 0.5)))
    for i in range(int(rng.integers(0, 3))):
        network.add_input(f"in{i}", [f"n{int(rng.integers(n))}"])
    network.add_output("out", "n0")
    return network


class InOrder(np.ndarray):
    """An array whose sums of products go from the first to the last, and whose whole powers are products, as in C."""

    def dot(self, weights: Any, out: Any = None) -> Any:
        out[...] = np.cumsum(np.asarray(self).T * weights, axis=0)[-1]
        return out

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, out: Any = None, **options: Any) -> Any:
        plain = [np.asarray(each) for each in inputs]
        if ufunc is np.matmul:
            return np.cumsum(plain[0][0].T * plain[1], axis=0)[np.newaxis, -1:]
        if ufunc is np.power and np.isin(plain[1], np.arange(9)).all():
            product = np.ones(plain[0].shape)
            for done in range(int(plain[1].max())):
                product = np.where(done < plain[1], product * plain[0], product)
            out[0][...] = product
            return out[0]
        into = None if out is None else tuple(np.asarray(each) for each in out)
        result = getattr(ufunc, method)(*plain, out=into, **options)
        return result if out is None else out[0]


def in_order(stepper: Stepper) -> Stepper:
    """Has a stepper of one network sum in the order of the C code, and changes nothing else in it."""
    for name in ("_drive", "_open", "_power"):
        if (array := getattr(stepper, name)) is not None:
            setattr(stepper, name, array.view(InOrder))
    return stepper


def largest_difference(network: Network, folder: Path, n_steps: int, scheme: Any = "euler", *, ordered: bool) -> float:
    """Largest difference of a potential, mV, of C in double and our steps; looked at 100 times."""
    timestep_ms = min(1.0, 0.2 * network.stable_timestep_ms())
    code = HostFirmware(network_firmware(network, timestep_ms, scheme), folder)
    stepper = network.compile(timestep_ms, scheme)
    stepper = in_order(stepper) if ordered else stepper
    state, rng, largest = stepper.initial_state(), np.random.default_rng(7), 0.0
    for _ in range(100):
        inputs = rng.uniform(-5.0, 20.0, len(network.inputs))
        code.sensors["input_nA"][: len(inputs)] = inputs
        code.advance(n_steps // 100)
        stepper.advance(state, inputs, n_steps // 100)
        difference = np.abs(code.potential_mV - state.potential[0]).max()
        largest = max(largest, float(difference) if np.isfinite(difference) else np.inf)
    return largest


class Recorder:
    """A controller that keeps what it is given."""

    def __init__(self, inner: Controller, firmware: Firmware) -> None:
        self.inner, self.firmware = inner, firmware
        self.record: list[np.ndarray] = []

    def reset(self, seed: int) -> None:
        self.inner.reset(seed)

    def step(self, sensation: Sensation) -> Any:
        values = [SENSED[name].read(sensation).ravel() for name in self.firmware.sensors]
        self.record.append(np.concatenate(values))
        return self.inner.step(sensation)


def size_of(program: Path) -> tuple[int, int]:
    """Bytes of flash and of RAM, without the stack."""
    lines = subprocess.run(["arm-none-eabi-size", str(program)], check=True, capture_output=True, text=True).stdout
    text, data, bss = map(int, lines.splitlines()[1].split()[:3])
    return text + data, data + bss


def on_arm(firmware: Firmware, record: np.ndarray, core: str, folder: Path) -> dict[str, Any]:
    """Compiles for a core and steps through a record under QEMU; potentials after every block, instructions a step."""
    machine, options = CORES[core]
    _, source, _ = firmware.write(folder, overwrite=True)
    name, suffix = firmware.name, "f" if firmware.real == "float" else ""
    kind = np.float32 if suffix else np.float64
    rows = ",\n".join("{" + ", ".join(f"{float(kind(v))!r}{suffix}" for v in row) + "}" for row in record)
    calls = f"#define INIT {name}_init\n#define STEP {name}_step\n#define NOW {name}_now\n"
    types = f"typedef {name}_sensors sensors_type;\ntypedef {name}_activation activation_type;\n"
    counts = f"#define N_BLOCKS {len(record)}\n#define STEPS {SAME_STEPS}\n#define N_NEURONS {len(firmware.neurons)}\n"
    table = f"static const {name}_real record[N_BLOCKS][{record.shape[1]}] = {{\n{rows}\n}};\n"
    (folder / "record.h").write_text(f'#include "{name}.h"\n{calls}{types}{counts}{table}')
    bare = f'#include "{name}.h"\nint main(void)\n{{\n    static {name}_sensors s;\n    static {name}_activation a;\n'
    (folder / "bare.c").write_text(f"{bare}    {name}_init();\n    for (;;) {name}_step(&s, &a);\n}}\n")
    warnings = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-ffunction-sections", "-fdata-sections"]
    code, elf = str(folder / "code.o"), {"bare": folder / "bare.elf", "run": folder / "run.elf"}
    target = [*options, "-mthumb", "-mfloat-abi=hard"]
    subprocess.run(["arm-none-eabi-gcc", *warnings, *target, "-c", str(source), "-o", code], check=True)
    for what, main, specs in (
        ("bare", folder / "bare.c", ["--specs=nosys.specs"]),
        ("run", ARM / "run.c", ["--specs=rdimon.specs", "-DSEMIHOSTING"]),
    ):
        # The harness has assembly, which C99 alone does not know.
        flags = ["-std=gnu99", "-O2", *target, "-nostartfiles", "-Wl,--gc-sections", "-T", str(ARM / "mps2.ld"), *specs]
        parts = ["-I", str(folder), str(main), code, str(ARM / "start.c"), "-o", str(elf[what]), "-lm"]
        subprocess.run(["arm-none-eabi-gcc", *flags, *parts], check=True)
    flash, ram = size_of(elf["bare"])
    command = ["qemu-system-arm", "-M", machine, "-icount", "shift=0", "-kernel", str(elf["run"])]
    command += ["-nographic", "-monitor", "none", "-serial", "none", "-semihosting-config", "enable=on,target=native"]
    lines = subprocess.run(command, check=True, capture_output=True, text=True, timeout=900).stdout.split()
    words = np.array([int(line, 16) for line in lines[1:-1]], dtype=np.uint64)
    potential = (words.astype(np.uint32).view(np.float32) if suffix else words.view(np.float64)).astype(float)
    instructions = 2e6 / int(lines[0]) * int(lines[-1]) / (len(record) * SAME_STEPS)
    return {"flash": flash, "ram": ram, "instructions": instructions, "potential": potential.reshape(len(record), -1)}


def replayed(firmware: Firmware, record: np.ndarray, folder: Path) -> np.ndarray:
    """Potentials on this machine after every block of a record."""
    host, rows = HostFirmware(firmware, folder), []
    for row in record:
        host.given[:] = row
        host.advance(SAME_STEPS)
        rows.append(host.potential_mV.astype(float))
    return np.array(rows)


def largest_shift_ms(ours: np.ndarray, theirs: np.ndarray, timestep_ms: float) -> float:
    """Largest shift of the times at which potentials rise through half the range; inf where one does not."""

    def rises(trace: np.ndarray) -> np.ndarray:
        at = np.flatnonzero((trace[:-1] < HALF_RANGE_MV) & (trace[1:] >= HALF_RANGE_MV))
        return at + (HALF_RANGE_MV - trace[at]) / (trace[at + 1] - trace[at])

    largest = 0.0
    for a, b in zip(ours.T, theirs.T, strict=True):
        first, second = rises(a), rises(b)
        if len(first) != len(second):
            return np.inf
        largest = max(largest, float(np.abs(first - second).max(initial=0.0)))
    return largest * SAME_STEPS * timestep_ms


def rows(folder: Path, n_steps: int, *, arm: bool) -> Iterator[dict[str, Any]]:
    """Rows of the result file, one after the other."""
    for name, changes in WORMS.items():
        config = annelid.load_config("riddle2023-rods", {**PAPERS_RODS, **changes, "duration_s": RECORDED_S})
        plant = annelid.build_plant(config)
        controller: Any = annelid.build_controller(config, plant)
        double, single = (controller_firmware(controller, name, real=real) for real in ("double", "float"))
        row: dict[str, Any] = {"name": name, "neurons": len(double.neurons)}
        for ordered in (True, False):
            found = largest_difference(controller.network, folder, n_steps, ordered=ordered)
            row["ordered_mV" if ordered else "blas_mV"] = found
        if arm:
            recorder = Recorder(controller, double)
            annelid.simulate(config, folder / name, controller=recorder, progress=False, overwrite=True)
            kept = np.array(recorder.record)[::SAME_STEPS].astype(np.float32)
            whole = np.resize(kept, (round(REPLAYED_S * 1e3 / SAME_STEPS), kept.shape[1]))
            truth = replayed(double, whole, folder)
            for key, firmware, core, record in (
                ("m4", single, "Cortex-M4", whole),
                ("m4_double", double, "Cortex-M4", whole[:100]),
                ("m7_double", double, "Cortex-M7", whole[:1000]),
            ):
                found = on_arm(firmware, record, core, folder)
                row |= {f"{key}_{what}": found[what] for what in ("flash", "ram", "instructions")}
                row[f"{key}_mV"] = float(np.abs(found["potential"] - truth[: len(record)]).max())
                if key == "m4":
                    row["m4_shift_ms"] = largest_shift_ms(found["potential"], truth, 1.0)
        yield row


def random_row(folder: Path, n_steps: int, n_networks: int) -> dict[str, Any]:
    """What the random networks have in common; each of the three schemes steps a third of them."""
    found = []
    for seed in range(n_networks):
        network, scheme = random_network(seed), ("euler", "toolbox", "heun")[seed % 3]
        pair = (largest_difference(network, folder, n_steps, scheme, ordered=ordered) for ordered in (True, False))
        found.append(tuple(pair))
        print(f"random network {seed}: {found[-1]}", file=sys.stderr, flush=True)
    ordered, blas = np.array(found).T
    return {
        "name": "random",
        "networks": n_networks,
        "steps": n_steps,
        "equal": int((ordered == 0.0).sum()),
        "ordered_mV": ordered.max(),
        "blas_mV": blas.max(),
        "blas_median_mV": float(np.median(blas)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--csv", type=Path, help="file to write")
    parser.add_argument("--steps", type=int, default=100_000, help="steps of each comparison with our stepper")
    parser.add_argument("--random", type=int, default=0, help="so many random networks instead of the controllers")
    parser.add_argument("--host-only", action="store_true", help="nothing under QEMU")
    chosen = parser.parse_args()
    found = []
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        made = rows(folder, chosen.steps, arm=not chosen.host_only)
        for row in [random_row(folder, chosen.steps, chosen.random)] if chosen.random else made:
            print("  ".join(f"{key} {value}" for key, value in row.items()), flush=True)
            found.append(row)
    if chosen.csv is not None:
        write_csv(chosen.csv, found[0], (row.values() for row in found))


if __name__ == "__main__":
    main()
