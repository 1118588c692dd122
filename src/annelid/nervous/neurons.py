"""Neurons, spiking or not, with or without gated channels, and what joins them: synapses and gap junctions.

Potentials in mV (relative to rest unless a neuron says otherwise), conductances in uS, currents in nA,
capacitances in nF, times in ms: a consistent set, since uS mV = nA and nF mV / ms = nA.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from annelid.errors import ConfigError, require_finite, require_positive, suggest

Array = NDArray[np.float64]


def _check_numbers(
    owner: str, item: Any, *, positive: tuple[str, ...] = (), not_negative: tuple[str, ...] = ("conductance_uS",)
) -> None:
    """Refuses a dataclass for the first number that is infinite, not a number, or of the wrong sign.

    Fields of ``positive`` may be None, those of ``not_negative`` may be absent.
    """
    numbers = {field.name: getattr(item, field.name) for field in fields(item)}
    require_finite(**{f"{owner} {name}": value for name, value in numbers.items()})
    for name in not_negative:
        if numbers.get(name, 0.0) < 0:
            raise ConfigError(f"{owner} {name} must not be negative, not {numbers[name]}")
    require_positive(**{f"{owner} {name}": numbers[name] for name in positive if numbers[name] is not None})


@dataclass(frozen=True, slots=True)
class Gate:
    """One gate of an ion channel: a sigmoid of the potential, instantaneous or with a time constant.

    The steady state is ``z_inf(U) = 1 / (1 + factor exp(slope (midpoint - U)))``; a positive slope opens with
    depolarisation, a negative one closes. A slow gate relaxes by ``dz/dt = (z_inf - z) / tau(U)`` with
    ``tau = time_constant_ms z_inf sqrt(factor exp(slope (midpoint - U)))``. Szczecinski et al. 2017, eq. 4-6.

    Attributes:
        slope_per_mV: Slope of the sigmoid.
        midpoint_mV: Potential at which the exponential is 1.
        factor: Weight of the exponential; 1 makes the midpoint the half-open potential.
        power: Exponent of the gate in the channel's conductance.
        time_constant_ms: Scale of the time constant, which is at most half of it; None for a gate that follows
            its steady state at once.

    Raises:
        ConfigError: A number that is not finite, a negative factor, a slow gate with factor 0, or a time constant that
            is not positive.
    """

    slope_per_mV: float
    midpoint_mV: float = 0.0
    factor: float = 1.0
    power: float = 1.0
    time_constant_ms: float | None = None

    def __post_init__(self) -> None:
        _check_numbers("a gate's", self, positive=("time_constant_ms",))
        if self.factor < 0 or (self.time_constant_ms is not None and self.factor == 0):
            raise ConfigError(f"a gate's factor must be positive (0 only without time constant), not {self.factor}")

    def steady(self, potential_mV: Array | float) -> Array:
        """Returns the steady state at a potential, in [0, 1], same shape."""
        return 1.0 / (1.0 + self.factor * np.exp(self.slope_per_mV * (self.midpoint_mV - potential_mV)))

    def toolbox_start(self, potential_mV: Array | float) -> Array:
        """Returns the value at which SNS-Toolbox 1.5.2 starts a gate: with the slope's sign reversed."""
        return 1.0 / (1.0 + self.factor * np.exp(self.slope_per_mV * (potential_mV - self.midpoint_mV)))


@dataclass(frozen=True, slots=True)
class Channel:
    """A voltage-gated ion channel, whose current is ``conductance prod(gate ** power) (reversal - U)``.

    Attributes:
        conductance_uS: Conductance with every gate open.
        reversal_mV: Reversal potential.
        gates: Its gates.

    Raises:
        ConfigError: A number that is not finite, a negative conductance.
    """

    conductance_uS: float
    reversal_mV: float
    gates: tuple[Gate, ...] = ()

    def __post_init__(self) -> None:
        _check_numbers("a channel's", self)

    def unit_current_mV(self, potential_mV: float) -> float:
        """Current (nA) per uS of conductance at a potential, with every gate at its steady state."""
        open_fraction = 1.0
        for gate in self.gates:
            open_fraction *= float(gate.steady(potential_mV)) ** gate.power
        return open_fraction * (self.reversal_mV - potential_mV)

    @property
    def slow_gates(self) -> tuple[Gate, ...]:
        """The gates that carry a state of their own."""
        return tuple(gate for gate in self.gates if gate.time_constant_ms is not None)

    @property
    def instant_gates(self) -> tuple[Gate, ...]:
        """The gates that follow the potential at once."""
        return tuple(gate for gate in self.gates if gate.time_constant_ms is None)


@dataclass(frozen=True, slots=True)
class Firing:
    """What makes a leaky integrator fire: a threshold, a reset, and a threshold that may adapt.

    At the end of a step with ``U >= theta`` the neuron fires and U becomes the reset potential. The threshold follows
    ``tau dtheta/dt = theta_0 - theta + adaptation (U - rest)``: a positive adaptation raises it with depolarisation,
    so that a constant current fires ever more slowly, down to a steady rate. This is the spiking neuron of
    SNS-Toolbox (Nourse et al. 2023), which resets to rest.

    Under a constant current I without adaptation, ``U_inf = rest + I / Gm`` and the time between spikes is
    ``C / Gm ln((U_inf - reset) / (U_inf - theta_0))``; below ``U_inf = theta_0`` the neuron is silent.

    Attributes:
        threshold_mV: theta_0, where the threshold starts and returns to.
        reset_mV: Potential after a spike.
        adaptation: Threshold gained per mV of lasting depolarisation; 0 for a fixed threshold.
        adaptation_time_constant_ms: tau, time constant of the threshold.

    Raises:
        ConfigError: A number that is not finite, a reset at or above the threshold, or a time constant that is not
            positive.
    """

    threshold_mV: float = 1.0
    reset_mV: float = 0.0
    adaptation: float = 0.0
    adaptation_time_constant_ms: float = 5.0

    def __post_init__(self) -> None:
        _check_numbers("a firing neuron's", self, positive=("adaptation_time_constant_ms",))
        if not self.reset_mV < self.threshold_mV:
            raise ConfigError(
                f"a firing neuron's reset_mV must be below its threshold_mV = {self.threshold_mV}, not {self.reset_mV}"
            )


@dataclass(frozen=True, slots=True)
class Neuron:
    """A leaky integrator, ``C dU/dt = -Gm (U - rest) + bias + synapses + channels + inputs``.

    Attributes:
        capacitance_nF: Membrane capacitance C.
        leak_conductance_uS: Leak conductance Gm.
        rest_mV: Potential that the leak pulls to.
        bias_nA: Constant current.
        channels: Gated ion channels.
        firing: Threshold and reset of a spiking neuron; None for a non-spiking one.

    Raises:
        ConfigError: A number that is not finite, a capacitance that is not positive, or a negative leak.
    """

    capacitance_nF: float = 5.0
    leak_conductance_uS: float = 1.0
    rest_mV: float = 0.0
    bias_nA: float = 0.0
    channels: tuple[Channel, ...] = ()
    firing: Firing | None = None

    def __post_init__(self) -> None:
        _check_numbers("a neuron's", self, positive=("capacitance_nF",), not_negative=("leak_conductance_uS",))


def persistent_sodium(
    conductance_uS: float,
    reversal_mV: float = 110.0,
    range_mV: float = 20.0,
    slope_per_mV: float = 0.05,
    time_constant_ms: float = 300.0,
) -> Channel:
    """Builds the persistent sodium channel: a fast gate m that opens and a slow gate h that closes.

    ``m_inf = 1 / (1 + exp(S (R - U)))`` at once; ``h_inf = 1 / (1 + 0.5 exp(S U))`` with
    ``tau_h = tau_max h_inf sqrt(0.5 exp(S U))``. Riddle et al. 2022; Szczecinski et al. 2017, eq. 3-6.

    Args:
        conductance_uS: G_Na; `annelid.nervous.HalfCentre.sodium_uS` derives it.
        reversal_mV: Reversal potential.
        range_mV: Operating range R, the midpoint of m.
        slope_per_mV: Slope S of both gates.
        time_constant_ms: tau_h,max.

    Returns:
        The channel; its only slow gate is h.
    """
    opening = Gate(slope_per_mV=slope_per_mV, midpoint_mV=range_mV)
    closing = Gate(slope_per_mV=-slope_per_mV, factor=0.5, time_constant_ms=time_constant_ms)
    return Channel(conductance_uS, reversal_mV, (opening, closing))


Modulated = Literal["leak", "channels", "membrane", "gates"]


@dataclass(frozen=True, slots=True)
class Synapse:
    """A graded chemical synapse, ``I = clip((U_pre - threshold) / (saturation - threshold), 0, 1) g (E - U)``.

    Szczecinski et al. 2017, eq. 2. With the threshold at rest and the saturation at R this is the
    transmission synapse of the paper.

    Attributes:
        conductance_uS: Largest conductance g.
        reversal_mV: Reversal potential E, on the scale of the postsynaptic potential; below rest it inhibits.
        threshold_mV: Presynaptic potential at which transmission begins.
        saturation_mV: Presynaptic potential at which it is largest.

    Raises:
        ConfigError: A number that is not finite, a negative conductance, or a saturation equal to the threshold.
    """

    conductance_uS: float
    reversal_mV: float
    threshold_mV: float = 0.0
    saturation_mV: float = 20.0

    def __post_init__(self) -> None:
        _check_numbers("a synapse's", self)
        _check_opening("a synapse's", self)


@dataclass(frozen=True, slots=True)
class GapJunction:
    """An electrical synapse: the same current out of one neuron and into the other.

    Attributes:
        conductance_uS: Conductance g of ``I = g (U_pre - U_post)``.
        rectified: Conducts only while the presynaptic potential is the higher one.

    Raises:
        ConfigError: A number that is not finite, a negative conductance.
    """

    conductance_uS: float
    rectified: bool = False

    def __post_init__(self) -> None:
        _check_numbers("a gap junction's", self)


@dataclass(frozen=True, slots=True)
class SpikingSynapse:
    """A synapse that conducts after each spike of its source: ``I = g s (E - U)``, the release s in [0, 1].

    A spike makes s jump to ``min(s + increment, 1)`` at the end of the step in which it falls; between spikes
    ``ds/dt = -s / tau``, of which every step takes the exact factor ``exp(-dt / tau)``. With increment 1 each spike
    opens the synapse fully, as in SNS-Toolbox (Nourse et al. 2023).

    Attributes:
        conductance_uS: Largest conductance g.
        reversal_mV: Reversal potential E.
        time_constant_ms: tau of the decay.
        increment: Jump of the release at a spike.

    Raises:
        ConfigError: A number that is not finite, a negative conductance, a time constant that is not positive, or an
            increment outside (0, 1].
    """

    conductance_uS: float
    reversal_mV: float
    time_constant_ms: float = 1.0
    increment: float = 1.0

    def __post_init__(self) -> None:
        _check_numbers("a spiking synapse's", self, positive=("time_constant_ms",))
        if not 0 < self.increment <= 1:
            raise ConfigError(f"a spiking synapse's increment must be above 0 and at most 1, not {self.increment}")


@dataclass(frozen=True, slots=True)
class ModulatorySynapse:
    """A synapse that carries no current: its source scales a conductance or a time constant of its target.

    The quantity is multiplied by ``factor ** a``, ``a = clip((U_pre - threshold) / (saturation - threshold), 0, 1)``:
    by 1 while the source is silent, by the factor while it is saturated, and geometrically in between. Factors of
    several modulatory synapses multiply in any order, and never change the quantity's sign. An own form, chosen for
    these properties.

    Attributes:
        quantity: ``"leak"``: the leak conductance; ``"channels"``: the conductance of all gated channels;
            ``"membrane"``: the capacitance, hence the membrane's time constant and nothing else; ``"gates"``: the
            time constants of all slow gates.
        factor: What a saturated source multiplies the quantity by.
        threshold_mV: Presynaptic potential at which modulation begins.
        saturation_mV: Presynaptic potential at which it is full.

    Raises:
        ConfigError: A number that is not finite, an unknown quantity, a factor that is not positive, or a saturation
            equal to the threshold.
    """

    quantity: Modulated
    factor: float
    threshold_mV: float = 0.0
    saturation_mV: float = 20.0

    def __post_init__(self) -> None:
        _check_numbers("a modulatory synapse's", self, positive=("factor",))
        if self.quantity not in get_args(Modulated):
            raise ConfigError(
                f"unknown modulated quantity {self.quantity!r}: {suggest(self.quantity, get_args(Modulated))}"
            )
        _check_opening("a modulatory synapse's", self)


ConnectionKind = Synapse | GapJunction | SpikingSynapse | ModulatorySynapse
"""Everything that can join two neurons."""


def _check_opening(owner: str, synapse: Synapse | ModulatorySynapse) -> None:
    if synapse.saturation_mV == synapse.threshold_mV:
        raise ConfigError(f"{owner} saturation_mV must differ from its threshold_mV, both are {synapse.threshold_mV}")
