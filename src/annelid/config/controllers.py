"""The controllers, and how the nervous system reads its segments' lengths."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from annelid.config.sections import NonNegative, Positive, Section, kind_or


class StretchSensor(Section):
    """How the nervous system reads its segments' lengths."""

    tolerance_m: NonNegative = Field(default=0.010, description="on while a segment is within this of its rest length")
    hysteresis_m: NonNegative = Field(default=0.0, description="once on, stays on until this much beyond the tolerance")
    startup_hold_s: NonNegative = Field(
        default=0.2, description="sensor of segment 1 held off for this long at the start"
    )
    noise_m: NonNegative = Field(default=0.0, description="standard deviation of the noise on every reading")


class SnsController(Section):
    """The paper's synthetic nervous system: one half-centre a segment, gated by its neighbour's stretch."""

    kind: Literal["sns"] = "sns"
    capacitance_nF: Positive = Field(default=5.0, description="membrane capacitance C")
    leak_conductance_uS: Positive = Field(default=1.0, description="leak conductance Gm")
    range_mV: Positive = Field(default=20.0, description="operating range R")
    bifurcation_mV: Positive = Field(
        default=0.01, description="delta: how far past the bifurcation the half-centre sits"
    )
    offset_mV: Positive = Field(default=0.1, description="how far below rest an inhibited neuron is held")
    inhibitory_reversal_mV: Annotated[float, Field(lt=0)] = Field(default=-40.0, description="relative to rest")
    excitatory_reversal_mV: Positive = Field(default=194.0, description="relative to rest")
    sodium_reversal_mV: Positive = Field(default=110.0, description="relative to rest")
    gate_slope_per_mV: Annotated[float, Field(gt=0, le=10)] = Field(
        default=0.05, description="slope S of the sodium gates"
    )
    gate_time_constant_ms: Positive = Field(default=300.0, description="tau_h,max; sets the period: 300, 200 or 100")
    sensor_current_nA: NonNegative = Field(default=20.0, description="current of a stretch sensor that is on")
    kick_nA: NonNegative = Field(default=1.0, description="current into the first contraction neuron at the first step")
    activation: Literal["sigmoid", "linear"] = Field(
        default="sigmoid", description="Eq. 2, or the planar worm's clipped difference of the half-centre"
    )
    activation_slope_per_mV: Positive = Field(default=0.35, description="slope of the sigmoid")
    scheme: Literal["euler", "toolbox", "heun"] = Field(
        default="euler",
        description="forward Euler, SNS-Toolbox's order (gates before potentials), or second order",
    )
    gate_start: Literal["steady", "toolbox"] = Field(
        default="steady", description="gates start at h_inf(U), or as SNS-Toolbox starts them"
    )


class Contraction(Section):
    """One contraction of one segment's ring."""

    segment: Annotated[int, Field(ge=1, le=200)] = Field(description="counted from 1 at the front")
    start_s: NonNegative = Field(description="when the activation begins to rise")
    stop_s: Positive = Field(description="when it begins to fall")
    activation: Annotated[float, Field(gt=0, le=1)] = Field(default=1.0, description="level that it rises to")

    @model_validator(mode="after")
    def _starts_before_it_stops(self) -> Self:
        if self.start_s >= self.stop_s:
            raise ValueError(
                f"controller.contractions: stop_s = {self.stop_s:g} of a contraction of segment {self.segment} must be "
                f"greater than its start_s = {self.start_s:g}"
            )
        return self


class Program(Section):
    """Open loop: contractions at times laid down beforehand, whatever the sensors read.

    Where contractions of one segment overlap, the larger activation wins.
    """

    kind: Literal["program"] = "program"
    contractions: tuple[Contraction, ...] = Field(description="segment, start_s, stop_s and activation of each")
    ramp_s: NonNegative = Field(default=0.0, description="time that a rise or fall between 0 and the full level takes")


class SineWave(Section):
    """Open loop: a sinusoidal wave from front to rear, segment 1 contracted at the start."""

    kind: Literal["sine"] = "sine"
    period_s: Positive = Field(default=2.625, description="time of one cycle; the paper's three segments take 2.625")
    waves: Annotated[float, Field(ge=-100, le=100)] = Field(
        default=1.0, description="waves on the body at once; negative ones run forwards, 0 is no wave"
    )
    level: Annotated[float, Field(gt=0, le=1)] = Field(default=1.0, description="largest activation")


class TimedWave(Section):
    """Open loop: each segment contracts by a ramp, holds, and lets go by a ramp, one after another.

    The authors' patterns: "3x1" is 1 s up, 1 s hold, 1 s down, the next segment 1 s later (the defaults); "2x2" is the
    same with the next segment 2 s later and two waves at once (``interval_s = 2``, ``waves = 2``). Six segments repeat
    either every 6 s.
    """

    kind: Literal["timed"] = "timed"
    rise_s: NonNegative = Field(default=1.0, description="time to contract; 0 for a step")
    hold_s: NonNegative = Field(default=1.0, description="time contracted")
    fall_s: NonNegative = Field(default=1.0, description="time to let go; 0 for a step")
    interval_s: Positive = Field(default=1.0, description="the next segment begins this much later")
    waves: Annotated[int, Field(ge=1, le=100)] = Field(
        default=1, description="waves on the body at once: the cycle is n_segments times interval_s over this"
    )
    level: Annotated[float, Field(gt=0, le=1)] = Field(default=1.0, description="activation while contracted")

    @model_validator(mode="after")
    def _it_contracts(self) -> Self:
        if self.rise_s + self.hold_s + self.fall_s == 0:
            raise ValueError("controller.rise_s, hold_s and fall_s are all 0: the segments would never contract")
        return self


class HeteroclinicChannel(Section):
    """A stable heteroclinic channel (Horchler 2015, Daltorio 2013): one saddle a segment, visited in order.

    A segment's activation is its node's activity. Alone it dwells at a node for about ``ln(1 / noise)`` or
    ``ln(1 / bias)`` over the leaving rate ``growth_rate_per_s / saddle_value``; feedback from the body ends the dwell.
    The literature gives no constants for this worm: with ours the bias alone makes a dwell of 0.88 s, the paper's
    interval from segment to segment.
    """

    kind: Literal["shc"] = "shc"
    growth_rate_per_s: Annotated[float, Field(gt=0, le=500)] = Field(
        default=20.0, description="rate at which activities settle and decay; at most 0.5 over the control timestep"
    )
    saddle_value: Annotated[float, Field(gt=1, le=100)] = Field(
        default=2.0, description="that rate over the rate at which a node is left"
    )
    noise: Annotated[float, Field(ge=0, le=1)] = Field(
        default=1e-6, description="standard deviation of the noise, per square root of a second"
    )
    bias_per_s: Annotated[float, Field(ge=0, le=100)] = Field(
        default=5e-4, description="constant input to every node; a larger one shortens the dwell"
    )
    feedback: Literal["none", "stretch", "contact"] = Field(
        default="stretch",
        description="what excites a node's successor: nothing, the present segment having lengthened by "
        "stretch_cue_m, or the segment before it bearing contact_cue_N",
    )
    feedback_gain_per_s: Annotated[float, Field(ge=0, le=100)] = Field(
        default=0.1, description="input to the successor of an active node whose cue is on"
    )
    stretch_cue_m: NonNegative = Field(default=0.02, description="lengthening at which a segment has its shape")
    contact_cue_N: NonNegative = Field(
        default=0.2, description="size of the force of the ground with which a segment holds fast"
    )

    @model_validator(mode="after")
    def _it_leaves_its_first_node(self) -> Self:
        if self.noise == 0 and self.bias_per_s == 0 and (self.feedback == "none" or self.feedback_gain_per_s == 0):
            raise ValueError(
                "controller.noise, controller.bias_per_s and the feedback are all 0: the ring would rest at its first "
                "node for ever"
            )
        return self


class PhaseChain(Section):
    """Phase oscillators under a descending drive (Ijspeert 2007): the salamander's constants, one segment each.

    Activation is an oscillator's output over its largest, ``r (1 + cos theta) / (2 R(5))``.
    """

    kind: Literal["phase-chain"] = "phase-chain"
    drive: Annotated[float, Field(ge=0, le=10)] = Field(
        default=4.0, description="descending drive at the start: the body swims in 3 .. 5, is silent outside 1 .. 5"
    )
    drive_slope_per_s: Annotated[float, Field(ge=-100, le=100)] = Field(
        default=0.0, description="change of the drive, which stays in 0 .. 10"
    )
    limbs: bool = Field(
        default=False, description="true: limb oscillators force a standing wave below drive 3 (walking)"
    )
    waves: Annotated[float, Field(ge=-100, le=100)] = Field(
        default=1.0, description="waves on the body at once, by the phase bias; the salamander's swimming has 1"
    )
    coupling_per_s: Positive = Field(default=10.0, description="coupling of neighbours")
    slowing: Positive = Field(default=1.0, description="times slower than the salamander, in all of its rates")


class AdaptiveSns(Section):
    """The synthetic nervous system with a descending neuron, whose activity sets the rate of all half-centres.

    The activity that is asked for is ``drive + drive_slope_per_s time + stretch_gain_per_m stretch``, kept in 0 .. 1,
    with the mean lengthening of all segments as stretch: a manual, a timed and a sensory drive. The descending neuron
    follows it with its time constant.
    """

    kind: Literal["adaptive"] = "adaptive"
    network: SnsController = SnsController()
    drive: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0, description="0: the slow rhythm of the half-centres alone; 1: about three times as fast"
    )
    drive_slope_per_s: Annotated[float, Field(ge=-100, le=100)] = Field(
        default=0.0, description="change of the manual drive"
    )
    stretch_gain_per_m: Annotated[float, Field(ge=-1000, le=1000)] = Field(
        default=0.0, description="drive per mean lengthening of the segments"
    )
    drive_time_constant_s: Annotated[float, Field(ge=1e-3, le=1e4)] = Field(
        default=0.05, description="time constant of the descending neuron"
    )


class DescendingDrive(Section):
    """A descending neuron that makes the robust network's wave faster where backs are pressed, as in a narrow pipe."""

    lift: Annotated[float, Field(ge=0, lt=0.5)] = Field(
        default=0.0,
        description="share of the range to which full drive lifts resting relays; 0: there is no such neuron; 0.45: "
        "full drive makes six segments' wave 3.9 times as fast",
    )
    drive: Annotated[float, Field(ge=0, le=1)] = Field(default=0.0, description="manual drive, to which pressure adds")
    per_segment: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.5, description="drive that one segment gives whose back is pressed fully"
    )
    full_pressure_N: Positive = Field(
        default=3.0, description="force on a segment's back that presses it fully; about a segment's weight"
    )
    pressure_time_constant_s: Annotated[float, Field(ge=1e-3, le=1e4)] = Field(
        default=0.2, description="time constant of the pressure neurons"
    )
    time_constant_s: Annotated[float, Field(ge=1e-3, le=1e4)] = Field(
        default=0.2, description="time constant of the descending neuron"
    )


class PressureSns(Section):
    """The synthetic nervous system with pressure feedback against slip: `annelid.nervous.pressure`.

    A segment that bears load holds itself expanded until the one before it is extended, and one that begins to contract
    ends the contraction two segments before. Lengths and loads are those of the six-segment robot, of 0.16 m radius and
    19 N.
    """

    kind: Literal["sns-pressure"] = "sns-pressure"
    network: SnsController = SnsController()
    light_N: NonNegative = Field(default=2.5, description="load of a segment up to which its pressure neuron rests")
    full_N: Positive = Field(default=9.0, description="load that drives it to R")
    extending_m: NonNegative = Field(default=0.045, description="lengthening from which a segment lets the next one go")
    extended_m: Positive = Field(default=0.055, description="lengthening at which it does so in full")
    hold: Annotated[float, Field(ge=0, le=5)] = Field(
        default=1.0, description="potential, over R, that full pressure alone gives the sensory neuron; 0 for none"
    )
    release: Annotated[float, Field(ge=0, le=20)] = Field(
        default=1.8, description="stretch sensors' currents that a full extension neuron cancels; 0 for none"
    )
    landing: Annotated[float, Field(ge=0, le=5)] = Field(
        default=0.1,
        description="potential, over R, that full pressure alone gives the sensory neuron of the segment before; 0 for "
        "none",
    )
    exchange: Annotated[float, Field(ge=0, le=5)] = Field(
        default=0.8,
        description="potential, over R, that a full contraction neuron alone gives the sensory neuron two segments "
        "before; 0 for none, which three segments have in any case",
    )
    pressure_time_constant_s: Annotated[float, Field(ge=1e-3, le=10)] = Field(
        default=0.03, description="time constant of the pressure neurons"
    )

    @model_validator(mode="after")
    def _scales_rise(self) -> Self:
        for low, high in (("light_N", "full_N"), ("extending_m", "extended_m")):
            if not getattr(self, low) < getattr(self, high):
                raise ValueError(
                    f"controller.{low} = {getattr(self, low):g} must be less than controller.{high} = "
                    f"{getattr(self, high):g}"
                )
        return self


class RobustSns(Section):
    """A peristalsis network made to keep its rhythm under wrong sensor signals: `annelid.nervous.robust`.

    All contraction neurons suppress each other, a slow relay counts each turn, and the stretch sensors entrain it
    within bounds. The `sensor` section's noise acts; its tolerance, hysteresis and hold are not used. With
    ``descending.lift`` the wave adapts to narrow pipes: `annelid.nervous.driven`.
    """

    kind: Literal["sns-robust"] = "sns-robust"
    capacitance_nF: Positive = Field(default=5.0, description="membrane capacitance C of the fast neurons")
    leak_conductance_uS: Positive = Field(default=1.0, description="leak conductance Gm")
    range_mV: Positive = Field(default=20.0, description="operating range R")
    bifurcation_mV: Annotated[float, Field(lt=0)] = Field(
        default=-1.0, description="delta: below 0, so that the half-centre stays in either state"
    )
    offset_mV: Positive = Field(default=0.1, description="how far beyond the range a held half-centre lies")
    inhibitory_reversal_mV: Annotated[float, Field(lt=0)] = Field(default=-40.0, description="relative to rest")
    excitatory_reversal_mV: Positive = Field(default=194.0, description="relative to rest")
    sodium_reversal_mV: Positive = Field(default=110.0, description="relative to rest")
    gate_slope_per_mV: Annotated[float, Field(gt=0, le=10)] = Field(
        default=0.05, description="slope S of the sodium gates"
    )
    gate_time_constant_ms: Positive = Field(default=300.0, description="tau_h,max; does not set the period here")
    turn_ms: Positive = Field(default=875.0, description="time from one segment's contraction to the next one's")
    push_nA: Positive = Field(
        default=6.0, description="current of a full relay into the next contraction neuron at rest"
    )
    entrainment: Annotated[float, Field(ge=0, le=0.03)] = Field(
        default=0.02, description="share of the relay's drive that the sensor may add or take; 0 for none"
    )
    habit_ms: Positive = Field(default=10000.0, description="time constant with which the sensor adapts")
    full_stretch_m: Positive = Field(default=0.08, description="mean lengthening that drives a stretch neuron to R")
    activation_slope_per_mV: Positive = Field(default=0.35, description="slope of the sigmoid, as in the paper")
    scheme: Literal["euler", "heun"] = Field(default="euler", description="forward Euler, or second order")
    start: Literal["design", "silent", "random"] = Field(
        default="design",
        description="state of the network at the start: segment 1 contracted, all neurons at rest, or drawn by seed",
    )
    let_go_s: Annotated[float, Field(ge=0, le=100)] = Field(
        default=0.0,
        description="time constant with which motor neurons let go, so that several segments share the wave; 0: there "
        "are none, and contraction and expansion neurons drive the muscles",
    )
    descending: DescendingDrive = DescendingDrive()


ControllerSection = Annotated[
    Annotated[SnsController, Tag("sns")]
    | Annotated[Program, Tag("program")]
    | Annotated[SineWave, Tag("sine")]
    | Annotated[TimedWave, Tag("timed")]
    | Annotated[HeteroclinicChannel, Tag("shc")]
    | Annotated[PhaseChain, Tag("phase-chain")]
    | Annotated[AdaptiveSns, Tag("adaptive")]
    | Annotated[RobustSns, Tag("sns-robust")]
    | Annotated[PressureSns, Tag("sns-pressure")],
    kind_or("sns"),
]
