"""The controller made to keep its rhythm under wrong sensor signals: the robust peristalsis network on a body."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from annelid.config.kinds import Knob
from annelid.config.run import RunConfig
from annelid.config.sections import Positive, Section, Share
from annelid.control.base import TimeConstant
from annelid.control.circuit import Circuit, Readout
from annelid.control.circuit_controller import CircuitKind
from annelid.control.senses import Sense, Source
from annelid.control.sns import DRIVE_HINT
from annelid.errors import ConfigError
from annelid.nervous import robust
from annelid.nervous.peristalsis import DRIVE_NEURON
from annelid.protocols import SIDES

FULL_STRETCH_M = 0.08
"""Mean lengthening that drives a stretch neuron to R."""


class DescendingDrive(Section):
    """A descending neuron that makes the robust network's wave faster where backs are pressed, as in a narrow pipe.

    With a ``lift`` of 0.45 full drive makes six segments' wave 3.9 times as fast.
    """

    lift: float = Field(
        default=0.0, ge=0, lt=0.5, description="share of R to which full drive lifts resting relays; 0: no drive"
    )
    drive: Share = Field(default=0.0, description="manual drive, to which pressure adds")
    per_segment: Share = Field(default=0.5, description="drive that one segment gives whose back is pressed fully")
    full_pressure_N: Positive = Field(
        default=3.0, description="force that presses a back fully; about a segment's weight"
    )
    pressure_time_constant_s: TimeConstant = Field(default=0.2, description="of the pressure neurons")
    time_constant_s: TimeConstant = Field(default=0.2, description="of the descending neuron")


class RobustSns(CircuitKind):
    """A peristalsis network made to keep its rhythm under wrong sensor signals: `annelid.nervous.robust`.

    All contraction neurons suppress each other, a slow relay counts each turn, and the stretch sensors entrain it
    within bounds. The `sensor` section's noise acts; its other fields are not used. With ``descending.lift`` the wave
    adapts to narrow pipes. Motor neurons relax slowly, so that several segments share the wave; without them
    contraction and expansion neurons drive the muscles.
    """

    sensor_fields = frozenset({"noise_m"})
    cites = (("riddle2022", "the neurons"), ("szczecinski2017", "the rules by which synapses are designed"))
    tuned = ("controller.turn_ms=150:1500:log", "controller.activation_slope_per_mV=0.1:2:log")
    kind: Literal["sns-robust"] = "sns-robust"
    turn_ms: Positive = Field(default=875.0, description="time from one segment's contraction to the next one's")
    activation_slope_per_mV: Positive = Field(default=0.35, description="slope of the sigmoid, as in the paper")
    start: Literal["design", "silent", "random"] = Field(
        default="design",
        description="state of the network at the start: segment 1 contracted, all neurons at rest, or drawn by seed",
    )
    motor_time_constant_s: float = Field(
        default=0.0, ge=0, le=100, description="time constant of the motor neurons; 0: there are none"
    )
    descending: DescendingDrive = DescendingDrive()

    def circuit(self, config: RunConfig, n_segments: int) -> Circuit:
        """Returns the circuit, as `CircuitKind.circuit`.

        Raises:
            ConfigError: Fewer than 3 segments, a turn for which a design rule has no solution, or a control step at
                which the network would not be stable.
        """
        design, drive, segments = robust.RobustParameters(turn_ms=self.turn_ms), self.descending, range(n_segments)
        full_nA, reach = design.leak_conductance_uS * design.range_mV, design.range_mV
        inputs: dict[str, Source] = {
            f"stretch_{i + 1}": Sense.between("lengthening_m", i, 0.0, FULL_STRETCH_M, full_nA) for i in segments
        }
        activities = {"stretch_activity": [f"stretch_{i + 1}" for i in segments]}
        if drive.lift:
            network = robust.driven_robust_network(
                n_segments,
                design,
                lift=drive.lift,
                per_segment=drive.per_segment,
                drive_ms=1e3 * drive.time_constant_s,
                pressure_ms=1e3 * drive.pressure_time_constant_s,
            )
            inputs["drive"] = full_nA * drive.drive
            activities["drive"] = [DRIVE_NEURON]
            for i in segments if config.body.has_skin else ():
                place = i, SIDES.index("back")
                inputs[f"pressure_{i + 1}"] = Sense.between("touch_N", place, 0.0, drive.full_pressure_N, full_nA)
        else:
            network = robust.robust_network(n_segments, design)
        halves = [[f"{half}_{i + 1}" for i in segments] for half in ("contraction", "expansion")]
        readout = Readout(halves[0], halves[1], slope_per_mV=self.activation_slope_per_mV)
        if self.motor_time_constant_s:
            robust.add_motor_neurons(network, n_segments, design, 1e3 * self.motor_time_constant_s)
            readout = Readout([f"motor_{i + 1}" for i in segments], to_mV=robust.MOTOR_SHARE * reach)
        longest_s = network.stable_timestep_ms() / 1e3
        if config.clock.control_timestep_s > longest_s:
            raise ConfigError(
                f"clock.control_timestep_s = {config.clock.control_timestep_s:g} must be at most {longest_s:.3g}, "
                f"beyond which the network of {n_segments} segments may be unstable"
            )
        if self.start == "silent":
            network.initial_mV = dict.fromkeys(network.initial_mV, 0.0)
        return Circuit(
            network,
            inputs,
            readout,
            name="robust synthetic nervous system",
            random_start_mV=(design.inhibitory_reversal_mV, 3.0 * reach) if self.start == "random" else None,
            activities=activities,
            range_mV=reach,
            constants={"turn_ms": self.turn_ms},
        )

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the manual drive, if there is a descending neuron."""
        if not self.descending.lift:
            return ()
        return (Knob("controller.descending.drive", "drive", 1.0, 0.0, 1.0, 0.01, DRIVE_HINT),)
