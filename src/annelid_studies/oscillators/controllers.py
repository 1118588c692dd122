"""Oscillators as controllers: a stable heteroclinic channel, and a phase chain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from annelid.config import ControllerKind, Knob, NonNegative, Positive, Share
from annelid.control import DRIVE_HINT, SegmentController, Slope, lengthening_m
from annelid.errors import ConfigError
from annelid.protocols import Array, Plant, Sensation, Values
from annelid_studies.oscillators.phase_chain import HIGHEST_DRIVE, PhaseStepper, amplitude, frequency_Hz
from annelid_studies.oscillators.shc import HeteroclinicRing, handover_input

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
    feedback_gain_per_s: Gain = Field(
        default=0.1, description="input to the successor of an active node whose segment has its shape; 0: none"
    )
    stretch_cue_m: NonNegative = Field(default=0.02, description="lengthening at which a segment has its shape")

    @model_validator(mode="after")
    def _it_leaves_its_first_node(self) -> Self:
        if self.noise == 0 and self.bias_per_s == 0 and self.feedback_gain_per_s == 0:
            raise ValueError(
                "controller.noise, controller.bias_per_s and the feedback are all 0: the ring would rest at its first "
                "node for ever"
            )
        return self

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
    contracts. The cue of a node lets its successor grow: its segment has become as long as ``stretch_cue_m`` beyond
    rest, hence has its contracted shape (Daltorio et al. 2013: waves that wait for the body slip less). Noise of a step
    is a function of seed and step number.

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
        self.ring = HeteroclinicRing(n_segments, config.growth_rate_per_s, config.saddle_value, control_timestep_s)
        largest = self.ring.largest_gain_per_s()
        if config.feedback_gain_per_s >= largest:
            raise ConfigError(
                f"controller.feedback_gain_per_s = {config.feedback_gain_per_s:g}: must be less than {largest:g}, "
                "or the channel can come to rest with all segments half contracted"
            )
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to node 1: segment 1 contracted, all others at rest."""
        self._now = {
            "activity": self.ring.initial_state(),
            "cue": np.zeros(self.n_segments),
            "seed": np.array(seed, dtype=np.uint64),
            "n_steps": np.array(0),
        }

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `SegmentController.step`; lengths are sensed."""
        config, now = self._config, self._now
        longer_m = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
        now["cue"] = (longer_m >= config.stretch_cue_m).astype(float)
        pushed = config.bias_per_s + handover_input(now["activity"], now["cue"], config.feedback_gain_per_s)
        kick = 0.0
        if config.noise:
            place = np.random.Philox(key=int(now["seed"]), counter=[0, 0, 0, int(now["n_steps"])])
            kick = config.noise * np.random.Generator(place).standard_normal(now["activity"].shape)
        now["activity"] = self.ring.advance(now["activity"], pushed, kick)
        now["n_steps"] += 1
        return np.minimum(now["activity"][0], 1.0).repeat(self.muscles_per_segment)

    def _values(self) -> Values:
        return {"node_activity": self._now["activity"][0].copy(), "cue_on": self._now["cue"].copy()}

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"segment": list(range(1, self.n_segments + 1))}

    def _attrs(self) -> dict[str, float | int | str]:
        return {"leaving_rate_per_s": self.ring.leaving_rate_per_s}


_STATE = ("phase_rad", "amplitude", "amplitude_rate_per_s")


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
        # A slower animal is the same one in shorter steps.
        self._stepper = PhaseStepper(n_segments, self._lag, control_timestep_s / config.slowing)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to the initial wave; nothing here is random."""
        phase = -self._lag * np.arange(self.n_segments)[np.newaxis]
        sizes = np.full(phase.shape, amplitude(self._drive))
        self._now = dict(zip(_STATE, (phase, sizes, np.zeros(phase.shape)), strict=True))

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `SegmentController.step`; nothing is sensed."""
        state = np.stack([self._now[name] for name in _STATE])
        state = self._stepper.advance(state, frequency_Hz(self._drive), amplitude(self._drive))
        self._now = dict(zip(_STATE, state, strict=True))
        (phase,), (size,), _ = state
        output, most = size * (1.0 + np.cos(phase)), 2.0 * amplitude(HIGHEST_DRIVE)
        return np.clip(output / most, 0.0, 1.0).repeat(self.muscles_per_segment)

    def _values(self) -> Values:
        return {
            "oscillator_phase": self._now["phase_rad"][0].copy(),
            "oscillator_amplitude": self._now["amplitude"][0].copy(),
            "drive": self._drive,
        }

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"oscillator": [f"body_{segment}" for segment in range(1, self.n_segments + 1)]}
