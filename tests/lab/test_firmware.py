"""Networks and controllers as C99, against the stepper and the controllers that they are written from."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

import annelid
from annelid.errors import ConfigError, RunFileError
from annelid.nervous import Network, Neuron, Synapse, peristalsis_network
from annelid_lab.firmware import Firmware, HostFirmware, controller_firmware, network_firmware
from annelid_lab.firmware.files import comment, identifier

ROOT = Path(__file__).parents[2]
COMPILER = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler called cc")
ARM = pytest.mark.skipif(
    not (shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm")),
    reason="gcc-arm-none-eabi or qemu-system-arm is not installed",
)
WORMS: dict[str, tuple[str, dict[str, Any]]] = {
    "sns": ("riddle2023-rods", {"controller": {"kind": "sns"}}),
    "linear": ("riddle2022-planar", {}),
    "adaptive": ("riddle2023-rods", {"controller": {"kind": "adaptive", "drive": 0.2}}),
    "pressure": ("riddle2023-rods", {"controller": {"kind": "sns-pressure"}}),
    "robust": ("riddle2023-rods", {"controller": {"kind": "sns-robust"}}),
    "driven": ("riddle2025-adaptive", {}),
    "halves": ("riddle2025-muscles", {"body.rings.layout": "halves"}),
    "own": ("riddle2023-rods", {"controller": {"kind": "baton"}}),
}
OWN = ROOT / "examples" / "extend" / "own_circuit.py"
"""A kind that only says which circuit it is."""


def load_module(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def load_benchmark() -> ModuleType:
    return load_module("firmware_benchmark", ROOT / "benchmarks" / "firmware.py")


@pytest.fixture(scope="module", autouse=True)
def own_kind() -> None:
    load_module("own_circuit", OWN)


@pytest.fixture(scope="module")
def benchmark() -> Iterator[ModuleType]:
    module = load_benchmark()
    yield module
    del sys.modules[module.__name__]


def ordered_difference(network: Network, folder: Path, n_steps: int, scheme: str = "euler") -> float:
    return load_benchmark().largest_difference(network, folder, n_steps, scheme, ordered=True)


@pytest.fixture(scope="module")
def exactly() -> Iterator[Callable[..., float]]:
    """Differences as of a process whose numpy has no AVX-512: there its exponential is its own, and not C's."""
    own = [name for name in __cpu_dispatch__ if name.startswith(("AVX512", "X86_V4")) and __cpu_features__[name]]
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("NPY_DISABLE_CPU_FEATURES", " ".join(own))
        with ProcessPoolExecutor(1, get_context("spawn")) as process:
            yield lambda *arguments: process.submit(ordered_difference, *arguments).result()


def compiled_self_test(firmware: Firmware, folder: Path) -> subprocess.CompletedProcess[str]:
    _, source, test = firmware.write(folder)
    options = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2"]
    subprocess.run(["cc", *options, "-o", str(folder / "test"), str(source), str(test), "-lm"], check=True)
    return subprocess.run([str(folder / "test")], capture_output=True, text=True, check=False)


def controller_of(worm: str) -> Any:
    preset, changes = WORMS[worm]
    config = annelid.load_config(preset, changes)
    return annelid.build_controller(config, annelid.build_plant(config))


@COMPILER
@pytest.mark.parametrize("seed", [pytest.param(seed, marks=[pytest.mark.slow] * (seed > 2)) for seed in range(100)])
def test_a_network_gives_the_same_bits_where_sums_are_in_the_same_order(
    seed: int, benchmark: ModuleType, exactly: Callable[..., float], tmp_path: Path
) -> None:
    network, scheme = benchmark.random_network(seed), ("euler", "toolbox", "heun")[seed % 3]
    steps = 500 if seed < 3 else 100_000
    assert exactly(network, tmp_path, steps, scheme) == 0.0
    # With the sums of BLAS only last digits differ, so the order is the only difference.
    assert benchmark.largest_difference(network, tmp_path, 500, scheme, ordered=False) < 1e-9


FAST = (("linear", "double"), ("pressure", "float"), ("halves", "float"))


@COMPILER
@pytest.mark.parametrize(
    ("worm", "real"),
    [
        pytest.param(*case, marks=[] if case in FAST else [pytest.mark.slow])
        for case in product(WORMS, ("double", "float"))
    ],
)
def test_a_controller_passes_its_self_test(worm: str, real: Any, tmp_path: Path) -> None:
    done = compiled_self_test(controller_firmware(controller_of(worm), worm, real=real), tmp_path)
    assert done.returncode == 0, done.stdout


@COMPILER
def test_a_self_test_fails_for_a_wrong_network(tmp_path: Path) -> None:
    right = network_firmware(peristalsis_network(3))
    wrong = Firmware(**{**vars(right), "source": right.source.replace("drive[i] = open > 0", "drive[i] = open > 0.5")})
    assert right.source != wrong.source
    assert compiled_self_test(wrong, tmp_path).returncode == 1


@COMPILER
@pytest.mark.parametrize("worm", WORMS)
def test_a_controller_in_c_returns_what_it_returns_in_python(worm: str, tmp_path: Path) -> None:
    """With noisy lengths and touch that change at every step, over the hold of the start."""
    preset, changes = WORMS[worm]
    config = annelid.load_config(preset, changes)
    plant = annelid.build_plant(config)
    controller: Any = annelid.build_controller(config, plant)
    code = HostFirmware(controller_firmware(controller, worm), tmp_path)
    controller.reset(0)
    rng, sensed = np.random.default_rng(1), plant.reset(0)
    shape, largest, least, most = sensed.rest_stretch_m.shape, 0.0, 1.0, 0.0
    for step in range(2500):
        phase = 2.0 * np.pi * (step / 2500.0 - np.arange(shape[0])[:, np.newaxis] / shape[0])
        longer_m = np.clip(0.06 * np.sin(phase), 0.0, None) + rng.uniform(-0.001, 0.003, shape)
        angle = 0.4 * np.sin(step / 700.0)
        sensation = annelid.Sensation(
            time_s=step * config.clock.control_timestep_s,
            stretch_m=sensed.rest_stretch_m + longer_m,
            rest_stretch_m=sensed.rest_stretch_m,
            ring_length_m=sensed.ring_length_m,
            muscle_force_N=sensed.muscle_force_N,
            contact_force_N=sensed.contact_force_N,
            center_of_mass_m=sensed.center_of_mass_m,
            touch_N=rng.uniform(0.0, 6.0, (shape[0], 4)),
            front_m=np.array([-step / 1000.0, 0.3 * step / 1000.0, 0.2]),
            heading=np.array([-np.cos(angle), -np.sin(angle), 0.0]),
        )
        ours, theirs = controller.step(sensation), code.step(sensation)
        largest = max(largest, float(np.abs(ours - theirs).max()))
        least, most = min(least, float(ours.min())), max(most, float(ours.max()))
    assert most - least > 0.2
    assert largest < 1e-9


def test_files_that_exist_are_kept(tmp_path: Path) -> None:
    firmware = network_firmware(peristalsis_network(3))
    paths = firmware.write(tmp_path)
    paths[1].write_text("mine")
    with pytest.raises(RunFileError, match="exists"):
        firmware.write(tmp_path)
    assert paths[1].read_text() == "mine"
    firmware.write(tmp_path, overwrite=True)
    assert paths[1].read_text() == firmware.source


def test_numbers_too_large_for_float_and_controllers_without_a_network_are_refused() -> None:
    network = Network()
    network.add_neuron("a", Neuron(bias_nA=1e300))
    with pytest.raises(ConfigError, match="too large for float"):
        network_firmware(network, real="float")
    with pytest.raises(ConfigError, match="only controllers that step a network"):
        controller_firmware(annelid.build_controller(*_built("riddle2025-3x1")))
    with pytest.raises(ConfigError, match="turning is not written as C"):
        controller_firmware(annelid.build_controller(*_built("riddle2025-steered")))


def _built(preset: str) -> Any:
    config = annelid.load_config(preset)
    return config, annelid.build_plant(config)


NAMES = st.text(st.characters(codec="utf-8") | st.sampled_from("*/?\\\n\"'<>%:#$@"), max_size=60)
STRUCTURE = re.compile(r"/\*.*?\*/", re.DOTALL)


@given(NAMES)
def test_names_become_identifiers_and_harmless_comments(name: str) -> None:
    assert re.fullmatch(r"[A-Za-z0-9_]{1,40}", identifier(name))
    assert re.fullmatch(r"[A-Za-z0-9 _.,:;()+=-]*", comment(name))


@given(st.lists(NAMES, min_size=4, max_size=4, unique=True), NAMES)
@settings(max_examples=15, deadline=None)
def test_hostile_names_change_no_code(names: list[str], title: str) -> None:
    """Without comments, names and the title, the code is that of a network with plain names."""

    def code(title: str, labels: list[str]) -> Firmware:
        network = Network(title)
        for label in labels:
            network.add_neuron(label, Neuron())
        network.add_synapse(labels[0], labels[1], Synapse(0.5, -40.0))
        network.add_input(labels[2], labels[0])
        network.add_output(labels[3], labels[1])
        return network_firmware(network)

    def skeleton(firmware: Firmware) -> list[str]:
        texts = (STRUCTURE.sub("", text) for text in (firmware.header, firmware.source, firmware.self_test))
        name = re.compile(f"{firmware.name}|{firmware.name.upper()}")
        return [re.sub(r"N_(NEURON|INPUT|OUTPUT)_\w+", r"\1", name.sub("N", text)) for text in texts]

    assert re.fullmatch(r"[a-z][a-z0-9_]{0,23}", code(title, names).name)
    # So that what is replaced above stands for nothing else.
    hostile = code(f"zzz{title}", names)
    for text in (hostile.header, hostile.source, hostile.self_test):
        assert text.isascii()
        assert "??" not in text
        labels = re.findall(r"^    \w+_(?:NEURON|INPUT|OUTPUT)_\w+,", text, re.MULTILINE)
        assert len(labels) == len(set(labels))
    assert skeleton(hostile) == skeleton(code("zzzplain", list("abcd")))


@COMPILER
def test_a_hostile_network_compiles(tmp_path: Path) -> None:
    network = Network("*/ int main(void){} /* ??/\n#error")
    for label in ("*/", "/*", "int", "1", "", "a b", "a_b", "a_b_2", "ä\\\n", "x" * 300, "x" * 301):
        network.add_neuron(label, Neuron())
    assert compiled_self_test(network_firmware(network), tmp_path).returncode == 0


@pytest.mark.slow
@COMPILER
@pytest.mark.parametrize("worm", ["sns", "robust", "pressure", "adaptive"])
def test_the_papers_networks_give_the_same_bits_for_100_000_steps(
    worm: str, benchmark: ModuleType, exactly: Callable[..., float], tmp_path: Path
) -> None:
    network = controller_of(worm).circuit.network
    assert exactly(network, tmp_path, 100_000) == 0.0
    assert benchmark.largest_difference(network, tmp_path, 100_000, ordered=False) < 1e-8
