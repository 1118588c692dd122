"""A network, or a controller with its network, as C99 for a microcontroller: header, source and self-test."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from annelid.control import SENSED, Circuit, CircuitController, TurningController
from annelid.errors import ConfigError, shown
from annelid.nervous import Network, Scheme
from annelid.protocols import Controller, Sensation
from annelid_lab.firmware.c_source import N_BLOCKS, STEPS, Vectors, Writer
from annelid_lab.firmware.files import Firmware, Real, filled
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
    state = stepper.initial_state()
    start, vectors = state.copy(), Vectors()
    for row in np.random.default_rng(0).uniform(-5.0, 20.0, (N_BLOCKS, max(len(network.inputs), 1))):
        trace = stepper.run(np.tile(row[: len(network.inputs)], (STEPS, 1)), state)[1:, 0]
        vectors.add(
            {"input_nA": row}, trace, trace[:, stepper.arrays.output_neuron] if n_outputs else np.zeros((STEPS, 1))
        )
    writer = Writer(network, stepper, start, real, network.name, vectors)
    return writer.firmware("output_mV", max(n_outputs, 1))


def controller_firmware(controller: Controller, name: str = "controller", *, real: Real = "double") -> Firmware:
    """Writes a circuit as C99: what it senses, its network and its readout.

    Args:
        controller: A controller that is a circuit; it is reset.
        name: What to call it.
        real: Type of all numbers.

    Raises:
        ConfigError: The controller cannot be written as C, or a number is too large for the type.
    """
    if isinstance(controller, TurningController):
        raise ConfigError(
            "turning is not written as C: leave out the section [turning], and scale the activation of the two sides "
            "in your own program"
        )
    circuit = _circuit_of(controller)
    if circuit.table.functions:
        place, _ = circuit.table.functions[0]
        name = list(circuit.circuit.network.inputs)[place]
        raise ConfigError(f"input {shown(name)} is set by a function of Python, which is not written as C")
    circuit.reset(0)
    start, senses = circuit.network_state.copy(), circuit.senses
    vectors = _controller_vectors(circuit)
    circuit.reset(0)
    network, n_muscles = circuit.circuit.network, circuit.n_segments * circuit.muscles_per_segment
    writer = Writer(network, circuit.stepper, start, real, name, vectors, circuit)
    firmware = writer.firmware("activation", n_muscles)
    # A very long worm has more numbers than a frame holds, and goes without.
    with suppress(ConfigError):
        interface = Interface(senses, circuit.n_segments, n_muscles, round(1e3 * circuit.stepper.timestep_ms))
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


def controller_circuit(controller: Controller) -> Circuit:
    """Returns the circuit of a controller, turned or not.

    Raises:
        ConfigError: The controller steps none.
    """
    return _circuit_of(controller).circuit


def _circuit_of(controller: Controller) -> CircuitController:
    """The circuit of a controller, turned or not."""
    inner = controller.inner if isinstance(controller, TurningController) else controller
    if not isinstance(inner, CircuitController):
        raise ConfigError(
            f"{getattr(controller, 'name', type(controller).__name__)} cannot be exported: only controllers that step "
            "a network can (sns, adaptive, sns-pressure, sns-robust, and every other circuit)"
        )
    return inner


def _controller_vectors(circuit: CircuitController) -> Vectors:
    rng, n, vectors = np.random.default_rng(0), circuit.n_segments, Vectors()
    timestep_s, n_muscles = circuit.timestep_s, n * circuit.muscles_per_segment
    for block in range(N_BLOCKS):
        angle = rng.uniform(-np.pi, np.pi)
        sensation = Sensation(
            time_s=0.0,
            stretch_m=np.where(rng.random((n, 1)) < 0.4, 0.0, rng.uniform(0.0, 0.08, (n, 1))),
            rest_stretch_m=np.zeros((n, 1)),
            ring_length_m=np.zeros(n_muscles),
            muscle_force_N=np.zeros(n_muscles),
            contact_force_N=np.zeros((n, 3)),
            center_of_mass_m=np.zeros(3),
            touch_N=rng.uniform(0.0, 8.0, (n, 4)),
            front_m=np.append(rng.uniform(-1.0, 1.0, 2), 0.0),
            heading=np.array([np.cos(angle), np.sin(angle), 0.0]),
        )
        potentials, activations = [], []
        for step in range(block * STEPS, (block + 1) * STEPS):
            activations.append(circuit.step(replace(sensation, time_s=step * timestep_s)))
            potentials.append(circuit.potential_mV.copy())
        vectors.add({name: SENSED[name].read(sensation) for name in circuit.senses}, potentials, activations)
    return vectors
