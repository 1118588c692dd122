"""The paper's controller: its section, and the circuit of any network that extends the paper's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import Literal

from pydantic import Field

from annelid.config.run import ControllerKind, RunConfig
from annelid.config.sections import NonNegative, Positive
from annelid.control.circuit import Circuit, Readout
from annelid.control.circuit_controller import CircuitKind
from annelid.control.senses import Pulse, Source, Switch
from annelid.nervous import Network, PeristalsisParameters, peristalsis

NAME = "synthetic nervous system"
"""What the run file calls the paper's controller."""
DRIVE_HINT = "Descending drive: more of it makes the wave faster."


class Sns(CircuitKind):
    """The paper's synthetic nervous system: one half-centre per segment, gated by its neighbour's stretch.

    A segment's activation goes by its contraction minus its expansion neuron: ``"sigmoid"`` as in Riddle et al. 2023,
    Eq. 2, whose printed exponent has the other sign, ``"linear"`` as in Riddle et al. 2022.
    """

    sensor_fields = frozenset({"tolerance_m", "noise_m"})
    tuned = (
        "controller.gate_time_constant_ms=80:900:log",
        "controller.activation_slope_per_mV=0.1:2:log",
        "sensor.tolerance_m=0.001:0.03:log",
        "sensor.hysteresis_m=0:0.02",
    )
    kind: Literal["sns"] = "sns"
    capacitance_nF: Positive = Field(default=5.0, description="membrane capacitance C of the fast neurons")
    leak_conductance_uS: Positive = Field(default=1.0, description="leak conductance Gm")
    range_mV: Positive = Field(default=20.0, description="operating range R")
    bifurcation_mV: Positive = Field(
        default=0.01, description="delta: how far past the bifurcation the half-centre sits"
    )
    offset_mV: Positive = Field(default=0.1, description="how far beyond the range a suppressed half-centre lies")
    inhibitory_reversal_mV: float = Field(default=-40.0, lt=0, description="relative to rest")
    excitatory_reversal_mV: Positive = Field(default=194.0, description="relative to rest")
    sodium_reversal_mV: Positive = Field(default=110.0, description="relative to rest")
    gate_slope_per_mV: float = Field(default=0.05, gt=0, le=10, description="slope S of the sodium gates")
    gate_time_constant_ms: Positive = Field(
        default=300.0, description="tau_h,max; sets the period of the paper's network: 300, 200 or 100"
    )
    sensor_current_nA: NonNegative = Field(default=20.0, description="current of a stretch sensor that is on")
    kick_nA: NonNegative = Field(default=1.0, description="current into the first contraction neuron at the first step")
    activation: Literal["sigmoid", "linear"] = Field(
        default="sigmoid", description="Eq. 2, or the planar worm's clipped difference of the half-centre"
    )
    activation_slope_per_mV: Positive = Field(default=0.35, description="slope of the sigmoid")
    scheme: Literal["euler", "toolbox", "heun"] = Field(
        default="euler", description="forward Euler, SNS-Toolbox's order (gates before potentials), or second order"
    )
    gate_start: Literal["steady", "toolbox"] = Field(
        default="steady", description="gates start at h_inf(U), or as SNS-Toolbox starts them"
    )

    @property
    def design(self) -> PeristalsisParameters:
        """What the network is designed from: fields of the section by the same names."""
        return PeristalsisParameters(
            **{field.name: getattr(self, field.name) for field in fields(PeristalsisParameters)}
        )

    def circuit(self, config: RunConfig, n_segments: int) -> Circuit:
        """Returns the circuit, as `CircuitKind.circuit`."""
        design = self.design
        network = peristalsis.peristalsis_network(n_segments, design)
        constants = {f"conductance_{name}_uS": value for name, value in asdict(design.conductances).items()}
        return self.gated(network, config, n_segments, NAME, constants=constants)

    def gated(
        self,
        network: Network,
        config: RunConfig,
        n_segments: int,
        name: str,
        inputs: Mapping[str, Source] | None = None,
        activities: Mapping[str, Sequence[str]] | None = None,
        constants: Mapping[str, float] | None = None,
    ) -> Circuit:
        """Returns the circuit of a network that extends the paper's, gated by stretch sensors.

        A sensor is on while its segment's mean length is at most the tolerance beyond rest, and with hysteresis that
        much longer still. Segment 1's sensor is kept off at the start: its network starts contracted, and its body does
        not. The kick acts during the first step only. Riddle et al. 2023.

        Args:
            network: The network.
            config: The configuration, whose sensors and clock matter.
            n_segments: Segments.
            name: What the run file calls the controller.
            inputs: What sets the inputs that the paper's network has not.
            activities: As of `Circuit`.
            constants: As of `Circuit`.
        """
        sensor, segments = config.sensor, range(1, n_segments + 1)
        stretch: dict[str, Source] = {
            f"stretch_{segment}": Switch(
                "lengthening_m",
                segment - 1,
                sensor.tolerance_m,
                self.sensor_current_nA,
                sensor.hysteresis_m,
                sensor.startup_hold_s if segment == 1 else 0.0,
            )
            for segment in segments
        }
        kick = Pulse(self.kick_nA, config.clock.control_timestep_s)
        reach = self.range_mV
        slope = self.activation_slope_per_mV if self.activation == "sigmoid" else None
        halves = ([f"{half}_{segment}" for segment in segments] for half in ("contraction", "expansion"))
        return Circuit(
            network,
            {**stretch, "kick": kick, **(inputs or {})},
            Readout(*halves, from_mV=-reach, to_mV=reach, slope_per_mV=slope),
            self.scheme,
            self.gate_start,
            name,
            activities=activities or {},
            range_mV=reach,
            constants=constants or {},
        )

    @property
    def full_nA(self) -> float:
        """The current that keeps a neuron without other currents at R."""
        return self.leak_conductance_uS * self.range_mV

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns the network, and SNS-Toolbox where the steps are in its order."""
        network = ("riddle2022", "the network"), ("szczecinski2017", "the rules by which synapses are designed")
        toolbox = ("nourse2023", "how the gates start, or the order of their steps")
        return (*network, toolbox) if "toolbox" in (self.scheme, self.gate_start) else network


def paper_controller(controller: ControllerKind) -> Sns | None:
    """Returns a controller's section if it is the paper's network and nothing else, else None."""
    return controller if isinstance(controller, Sns) else None
