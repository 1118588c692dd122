"""Neurons, with or without gated channels, and what joins them: synapses and gap junctions.

Potentials in mV (relative to rest unless a neuron says otherwise), conductances in uS, currents in nA,
capacitances in nF, times in ms: a consistent set, since uS mV = nA and nF mV / ms = nA.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from annelid.errors import ConfigError, require_finite, require_positive

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
class Neuron:
    """A leaky integrator, ``C dU/dt = -Gm (U - rest) + bias + synapses + channels + inputs``.

    Attributes:
        capacitance_nF: Membrane capacitance C.
        leak_conductance_uS: Leak conductance Gm.
        rest_mV: Potential that the leak pulls to.
        bias_nA: Constant current.
        channels: Gated ion channels.

    Raises:
        ConfigError: A number that is not finite, a capacitance that is not positive, or a negative leak.
    """

    capacitance_nF: float = 5.0
    leak_conductance_uS: float = 1.0
    rest_mV: float = 0.0
    bias_nA: float = 0.0
    channels: tuple[Channel, ...] = ()

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
        if self.saturation_mV == self.threshold_mV:
            raise ConfigError(
                f"a synapse's saturation_mV must differ from its threshold_mV, both are {self.threshold_mV}"
            )


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


ConnectionKind = Synapse | GapJunction
"""Everything that can join two neurons."""
