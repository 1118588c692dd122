"""Connections between non-spiking neurons: graded chemical synapses and gap junctions."""

from __future__ import annotations

from dataclasses import dataclass

from annelid.errors import ConfigError


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
        ConfigError: A negative conductance, or a saturation equal to the threshold.
    """

    conductance_uS: float
    reversal_mV: float
    threshold_mV: float = 0.0
    saturation_mV: float = 20.0

    def __post_init__(self) -> None:
        if not self.conductance_uS >= 0:
            raise ConfigError(f"a synapse's conductance_uS must not be negative, not {self.conductance_uS}")
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
        ConfigError: A negative conductance.
    """

    conductance_uS: float
    rectified: bool = False

    def __post_init__(self) -> None:
        if not self.conductance_uS >= 0:
            raise ConfigError(f"a gap junction's conductance_uS must not be negative, not {self.conductance_uS}")
