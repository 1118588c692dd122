"""A network, or a controller with its network, as C99 for a microcontroller: header, source and self-test."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from annelid.control import SENSED, Coded, ControllerCode
from annelid.errors import ConfigError
from annelid.nervous import Network, Scheme
from annelid.protocols import Controller, Sensation
from annelid_lab.firmware.c_source import N_BLOCKS, STEPS, Firmware, Real, Vectors, Writer, filled
from annelid_lab.loop.frames import MOST_STEPS, VERSION, Interface, most_stuffed


def network_firmware(
    network: Network, timestep_ms: float = 1.0, scheme: Scheme = "euler", *, real: Real = "double"
) -> Firmware:
    """Writes a network as C99: a step takes the currents of its inputs and returns the potentials of its outputs.

    Args:
        network: The network, which starts in its initial state.
        timestep_ms: Step, ms.
        scheme: As of `annelid.nervous.Network.compile`.
        real: Type of all numbers.

    Raises:
        ConfigError: As of `Network.compile`, or a number is too large for the type.
    """
    stepper, n_outputs = network.compile(timestep_ms, scheme), len(network.outputs)
    lines = enumerate(stepper.arrays.output_neuron.tolist())
    returned = [f"    activation->output_mV[{place}] = now.potential_mV[{neuron}];" for place, neuron in lines]
    state = stepper.initial_state()
    code = ControllerCode(
        network, stepper, state, activation="\n".join(returned) or "    activation->output_mV[0] = 0;"
    )
    start, vectors = state.copy(), Vectors()
    for row in np.random.default_rng(0).uniform(-5.0, 20.0, (N_BLOCKS, max(len(network.inputs), 1))):
        trace = stepper.run(np.tile(row[: len(network.inputs)], (STEPS, 1)), state)[1:, 0]
        vectors.add(
            {"input_nA": row}, trace, trace[:, stepper.arrays.output_neuron] if n_outputs else np.zeros((STEPS, 1))
        )
    writer = Writer(code, start, real, network.name, vectors)
    return writer.firmware("output_mV", max(n_outputs, 1))


def controller_firmware(controller: Controller, name: str = "controller", *, real: Real = "double") -> Firmware:
    """Writes a controller as C99, with its network, its sensors, its start, its turning and its activation.

    Args:
        controller: A controller that steps a network; it is reset.
        name: What to call it.
        real: Type of all numbers.

    Raises:
        ConfigError: The controller cannot be written as C, or a number is too large for the type.
    """
    controller = _coded(controller)
    controller.reset(0)
    code = controller.code()
    start = code.network_state.copy()
    vectors = _controller_vectors(controller, code)
    controller.reset(0)
    firmware = Writer(code, start, real, name, vectors).firmware("activation", code.n_muscles)
    # A very long worm has more numbers than a frame holds, and goes without.
    with suppress(ConfigError):
        interface = Interface(code.senses, code.n_segments, code.n_muscles, round(1e3 * code.stepper.timestep_ms))
        firmware = replace(firmware, wire=_wire(firmware.name, interface))
    return firmware


def _wire(name: str, interface: Interface) -> tuple[str, ...]:
    words = {
        "name": name,
        "NAME": name.upper(),
        "version": VERSION,
        "n_segments": interface.n_segments,
        "n_muscles": interface.n_muscles,
        "n_sensed": interface.n_sensed,
        "digest": interface.digest,
        "most_steps": MOST_STEPS,
        "room": interface.most_bytes,
        # A zero stands before and behind.
        "most_answer": most_stuffed(interface.most_bytes) + 2,
    }
    return filled("wire.h.txt", words), filled("wire.c.txt", words)


def controller_network(controller: Controller) -> Network:
    """Returns the network of a controller.

    Raises:
        ConfigError: The controller steps none.
    """
    return _coded(controller).code().network


def _coded(controller: Controller) -> Coded:
    if not isinstance(controller, Coded):
        raise ConfigError(
            f"{getattr(controller, 'name', type(controller).__name__)} cannot be exported: only controllers that step "
            "a network can (sns, adaptive, sns-pressure, sns-waiting, sns-robust, NetworkController)"
        )
    return controller


def _controller_vectors(controller: Coded, code: ControllerCode) -> Vectors:
    rng, n, vectors = np.random.default_rng(0), code.n_segments, Vectors()
    timestep_s = code.stepper.timestep_ms / 1e3
    for block in range(N_BLOCKS):
        angle = rng.uniform(-np.pi, np.pi)
        sensation = Sensation(
            time_s=0.0,
            stretch_m=np.where(rng.random((n, 1)) < 0.4, 0.0, rng.uniform(0.0, 0.08, (n, 1))),
            rest_stretch_m=np.zeros((n, 1)),
            ring_length_m=np.zeros(code.n_muscles),
            muscle_force_N=np.zeros(code.n_muscles),
            contact_force_N=np.zeros((n, 3)),
            center_of_mass_m=np.zeros(3),
            touch_N=rng.uniform(0.0, 8.0, (n, 4)),
            front_m=np.append(rng.uniform(-1.0, 1.0, 2), 0.0),
            heading=np.array([np.cos(angle), np.sin(angle), 0.0]),
        )
        potentials, activations = [], []
        for step in range(block * STEPS, (block + 1) * STEPS):
            activations.append(controller.step(replace(sensation, time_s=step * timestep_s)))
            potentials.append(code.network_state.potential[0].copy())
        vectors.add({name: SENSED[name].read(sensation) for name in code.senses}, potentials, activations)
    return vectors
