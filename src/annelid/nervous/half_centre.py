"""Half-centres: two neurons that inhibit each other and take turns, designed by where they rest.

Each neuron bears a persistent sodium channel that keeps it at the operating range R once it is up, until the partner
escapes from its inhibition. Whether it does is set by the bifurcation parameter delta, and how long it takes mostly by
the slow gate's time constant (Szczecinski et al. 2017; Riddle et al. 2022). Conductances follow from the design rules
of functional subnetworks (Szczecinski, Hunt and Quinn 2017): choose where a neuron rests while its partners are in a
given state, and solve the current balance there for the one unknown,

    -Gm U + sum_j g_j a_j (E_j - U) + G_Na m(U) h(U) (E_Na - U) + I = 0.

Those at or near the offset treat transmission as linear, ``g U_pre / R``, without the clip at 0 and R, and leave out
the sodium current (Riddle et al. 2022).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

from annelid.errors import ConfigError, require_negative, require_positive
from annelid.nervous.network import Network
from annelid.nervous.neurons import Channel, Neuron, Synapse, persistent_sodium


@dataclass(frozen=True)
class HalfCentre:
    """What a half-centre is designed from; the defaults are those of Riddle et al. 2022.

    Attributes:
        capacitance_nF: Membrane capacitance C.
        leak_conductance_uS: Leak conductance Gm.
        range_mV: Operating range R.
        bifurcation_mV: delta, where a fully inhibited neuron comes to rest: above 0 the half-centre oscillates by
            itself, below 0 both of its states are stable.
        offset_mV: How far below 0 and above R another neuron takes the half-centre (`add_hold`).
        inhibitory_reversal_mV: E_inh relative to rest.
        excitatory_reversal_mV: E_ex relative to rest.
        sodium_reversal_mV: E_Na relative to rest.
        gate_slope_per_mV: Slope S of the sodium gates.
        gate_time_constant_ms: tau_h,max, which sets the period.

    Raises:
        ConfigError: A parameter that is not positive (of any sign: delta), an inhibitory reversal that is not
            negative, or another reversal within the range that it has to drive a neuron through.
    """

    capacitance_nF: float = 5.0
    leak_conductance_uS: float = 1.0
    range_mV: float = 20.0
    bifurcation_mV: float = 0.01
    offset_mV: float = 0.1
    inhibitory_reversal_mV: float = -40.0
    excitatory_reversal_mV: float = 194.0
    sodium_reversal_mV: float = 110.0
    gate_slope_per_mV: float = 0.05
    gate_time_constant_ms: float = 300.0

    def __post_init__(self) -> None:
        signed = ("bifurcation_mV", "inhibitory_reversal_mV")
        names = [field.name for field in fields(HalfCentre) if field.name not in signed]
        require_positive(**{name: getattr(self, name) for name in names})
        require_negative(inhibitory_reversal_mV=self.inhibitory_reversal_mV)
        held = self.range_mV + self.offset_mV
        for name in ("excitatory_reversal_mV", "sodium_reversal_mV"):
            if not getattr(self, name) > held:
                raise ConfigError(f"{name} = {getattr(self, name)} must be above range_mV + offset_mV = {held:g}")
        if not self.bifurcation_mV > self.inhibitory_reversal_mV:
            raise ConfigError(
                f"bifurcation_mV = {self.bifurcation_mV} must be above inhibitory_reversal_mV = "
                f"{self.inhibitory_reversal_mV}"
            )

    @property
    def sodium_uS(self) -> float:
        """G_Na with which an isolated neuron with steady gates stays at R: ``Gm R = G_Na m(R) h(R) (E_Na - R)``."""
        return self.leak_conductance_uS * self.range_mV / self._channel(1.0).unit_current_mV(self.range_mV)

    @property
    def inhibition_uS(self) -> float:
        """g_CPG that lets a fully inhibited neuron rest at delta, the partner at R or above.

        ``-Gm delta + g_CPG (E_inh - delta) + G_Na m(delta) h(delta) (E_Na - delta) = 0``.
        """
        delta, channel = self.bifurcation_mV, self.sodium_channel
        sodium = channel.conductance_uS * channel.unit_current_mV(delta)
        return (sodium - self.leak_conductance_uS * delta) / (delta - self.inhibitory_reversal_mV)

    @property
    def hold_up_uS(self) -> float:
        """g32 with which another neuron at R alone keeps a neuron at ``U = R + offset``.

        ``-Gm U + g_CPG (-offset / R) (E_inh - U) + g32 (E_ex - U) = 0``, with the sodium inactivated, and the partner
        at -offset acting through unclipped, hence slightly negative, transmission.
        """
        held = self.range_mV + self.offset_mV
        share = -self.offset_mV / self.range_mV
        inhibition = self.inhibition_uS * share * (self.inhibitory_reversal_mV - held)
        return (self.leak_conductance_uS * held - inhibition) / (self.excitatory_reversal_mV - held)

    @property
    def hold_down_uS(self) -> float:
        """g31 with which another neuron at R inhibits a neuron as firmly as its partner at R + offset does.

        A neuron at -offset receives ``g_CPG (R + offset) / R (E_inh + offset) + Gm offset`` from it; g31 gives the same
        current to one that has risen to +offset, ``g31 (E_inh - offset)``. Riddle et al. 2022 applied this rule, read
        back from their number; the plain balance at -offset would ask for a negative conductance.
        """
        reach, offset, inhibitory = self.range_mV, self.offset_mV, self.inhibitory_reversal_mV
        partner = self.inhibition_uS * (reach + offset) / reach * (inhibitory + offset)
        return (partner + self.leak_conductance_uS * offset) / (inhibitory - offset)

    def cancelling_uS(self, drive_uS: float, driver_mV: float) -> float:
        """Conductance g with which a neuron at R cancels an excitation: ``a g_drive E_ex + g E_inh = 0``.

        Args:
            drive_uS: g_drive, the conductance that excites.
            driver_mV: Potential of the neuron that excites; its transmission ``a = U / R`` is not clipped.
        """
        return -drive_uS * driver_mV / self.range_mV * self.excitatory_reversal_mV / self.inhibitory_reversal_mV

    @property
    def sodium_channel(self) -> Channel:
        """The persistent sodium channel of both neurons."""
        return self._channel(self.sodium_uS)

    @property
    def neuron(self) -> Neuron:
        """Either of the two neurons."""
        return Neuron(self.capacitance_nF, self.leak_conductance_uS, channels=(self.sodium_channel,))

    @property
    def leaky_neuron(self) -> Neuron:
        """A neuron outside the half-centres."""
        return Neuron(self.capacitance_nF, self.leak_conductance_uS)

    def inhibitory(self, conductance_uS: float) -> Synapse:
        """Returns an inhibitory synapse that transmits between 0 and R."""
        return Synapse(conductance_uS, self.inhibitory_reversal_mV, 0.0, self.range_mV)

    def excitatory(self, conductance_uS: float) -> Synapse:
        """Returns an excitatory synapse that transmits between 0 and R."""
        return Synapse(conductance_uS, self.excitatory_reversal_mV, 0.0, self.range_mV)

    def transmission(self, gain: float = 1.0) -> Synapse:
        """Designs the synapse that transmits ``U_post = k U_pre`` (Szczecinski, Hunt and Quinn 2017).

        ``g = Gm k R / (E_ex - k R)``: exact at U_pre = 0 and R. In between ``U* = k U E / (E - k (R - U))``, too much
        by ``k^2 U (R - U) / (E - k (R - U))``, at most about ``(k R)^2 / (4 E)``.

        Args:
            gain: k, so that k R stays below the excitatory reversal potential.

        Raises:
            ConfigError: A gain that is not positive, or too large for the reversal potential.
        """
        reach, greatest = gain * self.range_mV, self.excitatory_reversal_mV / self.range_mV
        if not 0 < gain < greatest:
            raise ConfigError(
                f"gain must be above 0 and below excitatory_reversal_mV / range_mV = {greatest:g}, not {gain}"
            )
        return self.excitatory(self.leak_conductance_uS * reach / (self.excitatory_reversal_mV - reach))

    def _channel(self, conductance_uS: float) -> Channel:
        gate = self.gate_slope_per_mV, self.gate_time_constant_ms
        return persistent_sodium(conductance_uS, self.sodium_reversal_mV, self.range_mV, *gate)


def add_half_centre(
    network: Network,
    first: str,
    second: str,
    half_centre: HalfCentre | None = None,
    initial_mV: tuple[float, float] | None = None,
) -> None:
    """Adds two neurons that inhibit each other.

    Args:
        network: Where to add them.
        first: Name of the neuron that starts up.
        second: Name of the other.
        half_centre: The design; default: that of Riddle et al. 2022.
        initial_mV: Potentials at the start; default: R and 0.

    Raises:
        ConfigError: A name is taken, or the design gives a negative conductance.
    """
    p = half_centre or HalfCentre()
    for name, potential_mV in zip((first, second), initial_mV or (p.range_mV, 0.0), strict=True):
        network.add_neuron(name, p.neuron, potential_mV)
    for source, target in ((first, second), (second, first)):
        network.add_synapse(source, target, p.inhibitory(p.inhibition_uS))


def add_hold(network: Network, holder: str, down: str, up: str, half_centre: HalfCentre | None = None) -> None:
    """Lets a neuron keep a half-centre in one of its states: at R it brings one neuron down and the other up.

    Meanwhile they rest near ``-offset`` and ``R + offset``, beyond the reach of their oscillation, so that it always
    begins from the same state.

    Args:
        network: Where all three neurons are.
        holder: The neuron that keeps them there while it is up.
        down: The neuron that is inhibited.
        up: The neuron that is excited.
        half_centre: The design; default: that of Riddle et al. 2022.

    Raises:
        ConfigError: No neuron has one of the names, or the design gives a negative conductance.
    """
    p = half_centre or HalfCentre()
    network.add_synapse(holder, down, p.inhibitory(p.hold_down_uS))
    network.add_synapse(holder, up, p.excitatory(p.hold_up_uS))
