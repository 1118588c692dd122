"""Oscillators as controllers: a stable heteroclinic channel, and a phase chain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from annelid.config import ControllerKind, Knob, NonNegative, Positive, Share
from annelid.control import DRIVE_HINT, SegmentController, Slope, lengthening_m
from annelid.errors import ConfigError
from annelid.protocols import Array, Plant, Sensation, Values
from annelid_studies.oscillators.phase_chain import BODY, PhaseState, PhaseStepper, phase_chain
from annelid_studies.oscillators.shc import HeteroclinicRing, HeteroclinicStepper, handover_input, largest_gain_per_s

if TYPE_CHECKING:
    from annelid.config import RunConfig


Gain = Annotated[float, Field(ge=0, le=100)]


class HeteroclinicChannel(ControllerKind):
    """A stable heteroclinic channel (Horchler 2015, Daltorio 2013): one saddle per segment, visited in order.

    A segment's activation is its node's activity. Alone it dwells at a node for about ``ln(1 / noise)`` or
    ``ln(1 / bias)`` over the leaving rate ``growth_rate_per_s / saddle_value``; feedback from the body ends the dwell.
    The literature gives no constants for this worm: with ours the bias alone makes a dwell of 0.88 s, the paper's
    interval from segment to segment.
    """

    cites = (
        ("daltorio2013", "a channel that waits for the body"),
        ("horchler2015", "the stable heteroclinic channel"),
        ("shaw2012", "limit cycles near a heteroclinic orbit"),
        ("stone1990", "the dwell time under noise"),
    )
    tuned = (
        "controller.growth_rate_per_s=5:100:log",
        "controller.bias_per_s=1e-5:0.1:log",
        "controller.stretch_cue_m=0.005:0.08:log",
    )
    kind: Literal["shc"] = "shc"
    growth_rate_per_s: float = Field(
        default=20.0, gt=0, le=500, description="rate at which activities settle and decay"
    )
    saddle_value: float = Field(default=2.0, gt=1, le=100, description="that over the rate at which a node is left")
    noise: Share = Field(default=1e-6, description="standard deviation of the noise, per square root of a second")
    bias_per_s: Gain = Field(default=5e-4, description="constant input to every node; a larger one shortens the dwell")
    feedback: Literal["none", "stretch", "contact"] = Field(
        default="stretch",
        description="what excites a node's successor: nothing, the present segment having lengthened by "
        "stretch_cue_m, or the segment before it bearing contact_cue_N",
    )
    feedback_gain_per_s: Gain = Field(
        default=0.1, description="input to the successor of an active node with its cue on"
    )
    stretch_cue_m: NonNegative = Field(default=0.02, description="lengthening at which a segment has its shape")
    contact_cue_N: NonNegative = Field(default=0.2, description="size of the force of the ground on an anchor")

    @model_validator(mode="after")
    def _it_leaves_its_first_node(self) -> Self:
        if self.noise == 0 and self.bias_per_s == 0 and (self.feedback == "none" or self.feedback_gain_per_s == 0):
            raise ValueError(
                "controller.noise, controller.bias_per_s and the feedback are all 0: the ring would rest at its first "
                "node for ever"
            )
        return self

    def check_with(self, config: RunConfig) -> None:
        """Checks that a channel that waits for contact has a body with ground."""
        if self.feedback == "contact" and not config.body.touches_ground:
            raise ValueError(
                f"controller.feedback = 'contact' has no effect on body.kind = {config.body.kind!r}, which touches no "
                "ground: choose 'none' or 'stretch'"
            )

    def build(self, config: RunConfig, plant: Plant) -> HeteroclinicController:
        """Builds the controller, as `ControllerKind.build`."""
        return HeteroclinicController(self, plant.n_segments, plant.n_muscles, config.clock.control_timestep_s)


class PhaseChain(ControllerKind):
    """Phase oscillators under a descending drive (Ijspeert 2007): the salamander's constants, one segment each.

    Activation is an oscillator's output over its largest, ``r (1 + cos theta) / (2 R(5))``.
    """

    cites = (("ijspeert2007", "the phase oscillators under a drive"),)
    tuned = ("controller.slowing=0.3:10:log", "controller.waves=0.5:3", "controller.drive=3:5")
    kind: Literal["phase-chain"] = "phase-chain"
    drive: float = Field(
        default=4.0, ge=0, le=10, description="descending drive; the body swims in 3 .. 5, rests beyond 1 .. 5"
    )
    waves: Slope = Field(default=1.0, description="waves on the body at once; the salamander's swimming has 1")
    slowing: Positive = Field(default=1.0, description="times slower than the salamander, in all of its rates")

    def build(self, config: RunConfig, plant: Plant) -> PhaseChainController:
        """Builds the controller, as `ControllerKind.build`."""
        return PhaseChainController(self, plant.n_segments, plant.n_muscles, config.clock.control_timestep_s)

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the descending drive."""
        return (Knob("controller.drive", "drive", 1.0, 0.0, 6.0, 0.05, DRIVE_HINT),)


class HeteroclinicController(SegmentController):
    """Drives a worm by a stable heteroclinic channel, with feedback that ends the dwell at a node.

    Node i is segment i: its activity, cut off at 1, is the segment's activation, so one segment after another
    contracts. The cue of a node lets its successor grow. ``"stretch"``: the segment has become as long as
    ``stretch_cue_m`` beyond rest, hence has its contracted shape. ``"contact"``: the segment before it, which widens
    again behind the wave, bears ``contact_cue_N`` and so is an anchor (Daltorio et al. 2013: waves that wait for the
    ground slip less). Noise of a step is a function of seed and step number.

    Raises:
        ConfigError: Fewer than 3 segments, muscles that are neither one nor two per segment, a control step too long
            for the growth rate, or a feedback gain at which the channel can come to rest.
    """

    name = "stable heteroclinic channel"
    recorded = (
        ("node_activity", ("segment",), "1", "activity of the heteroclinic ring's nodes"),
        ("cue_on", ("segment",), "1", "during the last control step: 1 while feedback lets go"),
    )

    def __init__(self, config: HeteroclinicChannel, n_segments: int, n_muscles: int, control_timestep_s: float) -> None:
        """Builds the controller at node 1.

        Args:
            config: Its section of the configuration.
            n_segments: Segments, at least 3.
            n_muscles: As `SegmentController`.
            control_timestep_s: Step of the oscillator, s.
        """
        super().__init__(n_segments, n_muscles)
        self._config = config
        ring = HeteroclinicRing(n_segments, config.growth_rate_per_s, config.saddle_value)
        self._stepper = HeteroclinicStepper(ring, control_timestep_s)
        largest = largest_gain_per_s(ring)
        if config.feedback != "none" and config.feedback_gain_per_s >= largest:
            raise ConfigError(
                f"controller.feedback_gain_per_s = {config.feedback_gain_per_s:g}: must be less than {largest:g}, "
                "or the channel can come to rest with all segments half contracted"
            )
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to node 1: segment 1 contracted, all others at rest."""
        self._now = {
            "activity": self._stepper.initial_state(),
            "cue": np.zeros(self.n_segments),
            "seed": np.array(seed, dtype=np.uint64),
            "n_steps": np.array(0),
        }

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `SegmentController.step`; lengths or contact forces are sensed."""
        config, now = self._config, self._now
        now["cue"] = self._cues(sensation)
        pushed = config.bias_per_s + handover_input(now["activity"], now["cue"], config.feedback_gain_per_s)
        kick = 0.0
        if config.noise:
            place = np.random.Philox(key=int(now["seed"]), counter=[0, 0, 0, int(now["n_steps"])])
            kick = config.noise * np.random.Generator(place).standard_normal(now["activity"].shape)
        now["activity"] = self._stepper.advance(now["activity"], pushed, kick)
        now["n_steps"] += 1
        return np.minimum(now["activity"][0], 1.0).repeat(self.muscles_per_segment)

    def _cues(self, sensation: Sensation) -> Array:
        if self._config.feedback == "stretch":
            longer_m = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
            return (longer_m >= self._config.stretch_cue_m).astype(float)
        if self._config.feedback == "contact":
            load = np.linalg.norm(sensation.contact_force_N, axis=1)
            return np.roll(load >= self._config.contact_cue_N, 1).astype(float)
        return np.zeros(self.n_segments)

    def _values(self) -> Values:
        return {"node_activity": self._now["activity"][0].copy(), "cue_on": self._now["cue"].copy()}

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"segment": list(range(1, self.n_segments + 1))}

    def _attrs(self) -> dict[str, float | int | str]:
        return {"leaving_rate_per_s": self._stepper.ring.leaving_rate_per_s}


class PhaseChainController(SegmentController):
    """Drives a worm by a chain of phase oscillators under a descending drive, open loop.

    The chain starts as a wave with the phase lags of its couplings, the first oscillator at its largest output.

    Raises:
        ConfigError: Muscles that are neither one nor two per segment, or a control step too long for the oscillators.
    """

    name = "chain of phase oscillators"
    recorded = (
        ("oscillator_phase", ("oscillator",), "rad", "phase of the oscillators, not wrapped"),
        ("oscillator_amplitude", ("oscillator",), "1", "amplitude of the oscillators"),
        ("drive", (), "1", "descending drive"),
    )

    def __init__(self, config: PhaseChain, n_segments: int, n_muscles: int, control_timestep_s: float) -> None:
        """Builds the controller in its initial state.

        Args:
            config: Its section of the configuration.
            n_segments: Segments, each with a body oscillator.
            n_muscles: As `SegmentController`.
            control_timestep_s: Step of the oscillators, s.
        """
        super().__init__(n_segments, n_muscles)
        self._drive = config.drive
        self._lag = 2.0 * np.pi * config.waves / n_segments
        network = phase_chain(n_segments, self._lag)
        # A slower animal is the same one in shorter steps.
        self._stepper = PhaseStepper(network, control_timestep_s / config.slowing)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to the initial wave; nothing here is random."""
        phase = -self._lag * np.arange(self.n_segments)
        self._now = dict(vars(self._stepper.initial_state(self._drive, phase)))

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `SegmentController.step`; nothing is sensed."""
        now = self._now
        state = PhaseState(now["phase_rad"], now["amplitude"], now["amplitude_rate_per_s"])
        state = self._stepper.advance(state, self._drive)
        now |= vars(state)
        output = self._stepper.output(state)[0]
        most = 2.0 * float(BODY.amplitude(BODY.highest_drive))
        return np.clip(output / most, 0.0, 1.0).repeat(self.muscles_per_segment)

    def _values(self) -> Values:
        return {
            "oscillator_phase": self._now["phase_rad"][0].copy(),
            "oscillator_amplitude": self._now["amplitude"][0].copy(),
            "drive": self._drive,
        }

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"oscillator": [f"body_{segment}" for segment in range(1, self.n_segments + 1)]}
