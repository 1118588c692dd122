"""Connections between neurons: graded, spiking and modulatory synapses, and gap junctions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from annelid.errors import ConfigError, suggest
from annelid.nervous.neurons import check_numbers

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
        check_numbers("a synapse's", self)
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
        check_numbers("a gap junction's", self)


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
        check_numbers("a spiking synapse's", self, positive=("time_constant_ms",))
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
        check_numbers("a modulatory synapse's", self, positive=("factor",))
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
