"""Design rules: every conductance of the peristalsis network from a few quantities with a meaning.

The rules are those of functional subnetworks (Szczecinski, Hunt and Quinn 2017, "A functional subnetwork
approach to designing synthetic nervous systems that control legged robot locomotion"): say where a neuron
shall rest while its partners are in a given state, and solve the current balance there for the one unknown
conductance. The four conductances of a neuron at or near its offset treat transmission as linear,
``g U_pre / R``, without the clip at 0 and R, and leave out sodium current (Riddle et al. 2022).

Conductances in uS, potentials in mV relative to rest. The balance of a neuron at U with one unknown synapse is

    -Gm U + sum_j g_j a_j (E_j - U) + G_Na m_inf(U) h_inf(U) (E_Na - U) + I = 0.
"""

from __future__ import annotations

from annelid.nervous.neurons import Channel


def sodium_conductance(leak_uS: float, range_mV: float, channel_of_unit_conductance: Channel) -> float:
    """G_Na that lets an isolated neuron with steady gates hold U = R without any input.

    Balance at U = R: ``Gm R = G_Na m_inf(R) h_inf(R) (E_Na - R)``.

    Args:
        leak_uS: Leak conductance Gm.
        range_mV: Operating range R.
        channel_of_unit_conductance: The channel whose conductance is sought.

    Returns:
        G_Na, uS.
    """
    return leak_uS * range_mV / unit_channel_current(channel_of_unit_conductance, range_mV)


def unit_channel_current(channel: Channel, potential_mV: float) -> float:
    """Current (nA) of a channel per uS of its conductance, with every gate at its steady state."""
    open_fraction = 1.0
    for gate in channel.gates:
        open_fraction *= float(gate.steady(potential_mV)) ** gate.power
    return open_fraction * (channel.reversal_mV - potential_mV)


def half_centre_conductance(leak_uS: float, bifurcation_mV: float, inhibitory_mV: float, channel: Channel) -> float:
    """g_CPG that lets a fully inhibited half-centre neuron rest at delta, just above the synaptic threshold.

    Balance at U = delta with the partner at R or above and steady gates:
    ``-Gm delta + g (E_inh - delta) + G_Na m_inf(delta) h_inf(delta) (E_Na - delta) = 0``. With delta > 0 the
    inhibited neuron always escapes in the end, so the half-centre oscillates by itself; with delta < 0 both
    of its states would be stable. Delta is the distance from that bifurcation.

    Args:
        leak_uS: Leak conductance Gm.
        bifurcation_mV: delta.
        inhibitory_mV: Reversal potential of the inhibition, E_inh.
        channel: The sodium channel with its conductance.

    Returns:
        g_CPG, uS.
    """
    sodium = channel.conductance_uS * unit_channel_current(channel, bifurcation_mV)
    return (sodium - leak_uS * bifurcation_mV) / (bifurcation_mV - inhibitory_mV)


def expansion_drive_conductance(
    leak_uS: float,
    range_mV: float,
    offset_mV: float,
    half_centre_uS: float,
    inhibitory_mV: float,
    excitatory_mV: float,
) -> float:
    """g32 with which the sensory neuron U3 = R alone holds the expansion neuron at U2 = R + offset.

    Balance at U2 = R + offset, sodium inactivated, U3 = R, and U1 = -offset acting through unclipped, hence
    slightly negative, transmission:
    ``-Gm U2 + g_CPG (-offset / R) (E_inh - U2) + g32 (E_ex - U2) = 0``.

    Args:
        leak_uS: Leak conductance Gm.
        range_mV: Operating range R.
        offset_mV: How far beyond the range a held half-centre lies.
        half_centre_uS: g_CPG.
        inhibitory_mV: E_inh.
        excitatory_mV: E_ex.

    Returns:
        g32, uS.
    """
    held = range_mV + offset_mV
    inhibition = half_centre_uS * (-offset_mV / range_mV) * (inhibitory_mV - held)
    return (leak_uS * held - inhibition) / (excitatory_mV - held)


def contraction_hold_conductance(
    leak_uS: float, range_mV: float, offset_mV: float, half_centre_uS: float, inhibitory_mV: float
) -> float:
    """g31 with which the sensory neuron U3 = R inhibits the contraction neuron as firmly as its partner does.

    With the partner at U2 = R + offset (unclipped transmission) the contraction neuron at U1 = -offset
    receives the net current ``g_CPG (R + offset) / R (E_inh + offset) + Gm offset``; g31 gives the same
    current to a neuron that has risen to U1 = +offset: ``g31 (E_inh - offset)``.

    This is the rule that Riddle et al. 2022 applied, read back from their number. The plain balance at
    U1 = -offset has the driving force ``E_inh + offset`` with the opposite sign: there the partner alone
    already inhibits too much, and the balance would ask for a negative conductance (about -g_CPG).

    Args:
        leak_uS: Leak conductance Gm.
        range_mV: Operating range R.
        offset_mV: How far below rest a held contraction neuron lies.
        half_centre_uS: g_CPG.
        inhibitory_mV: E_inh.

    Returns:
        g31, uS.
    """
    partner = half_centre_uS * (range_mV + offset_mV) / range_mV * (inhibitory_mV + offset_mV)
    return (partner + leak_uS * offset_mV) / (inhibitory_mV - offset_mV)


def relay_drive_conductance(leak_uS: float, range_mV: float, offset_mV: float, excitatory_mV: float) -> float:
    """g24 with which the expansion neuron at U2 = R + offset drives its relay to U4 = R.

    Balance at U4 = R with unclipped transmission, U3 silent:
    ``-Gm R + g24 (R + offset) / R (E_ex - R) = 0``.

    Args:
        leak_uS: Leak conductance Gm.
        range_mV: Operating range R.
        offset_mV: offset.
        excitatory_mV: E_ex.

    Returns:
        g24, uS.
    """
    return leak_uS * range_mV * range_mV / ((range_mV + offset_mV) * (excitatory_mV - range_mV))


def relay_silencing_conductance(
    range_mV: float, offset_mV: float, relay_drive_uS: float, excitatory_mV: float, inhibitory_mV: float
) -> float:
    """g34 with which the sensory neuron U3 = R cancels the expansion neuron's drive: U4 = 0.

    Balance at U4 = 0 with U2 = R + offset, unclipped: ``g24 (R + offset) / R E_ex + g34 E_inh = 0``.

    Args:
        range_mV: Operating range R.
        offset_mV: offset.
        relay_drive_uS: g24.
        excitatory_mV: E_ex.
        inhibitory_mV: E_inh.

    Returns:
        g34, uS.
    """
    return -relay_drive_uS * (range_mV + offset_mV) / range_mV * excitatory_mV / inhibitory_mV


def sensory_silencing_conductance(sensor_current_nA: float, inhibitory_mV: float) -> float:
    """g43 with which the previous segment's relay U4 = R cancels the stretch sensor's current: U3 = 0.

    Balance at U3 = 0: ``I + g43 E_inh = 0`` with the design current ``I = Gm R`` that holds U3 = R.

    Args:
        sensor_current_nA: Design current I of a sensor that is on.
        inhibitory_mV: E_inh.

    Returns:
        g43, uS.
    """
    return -sensor_current_nA / inhibitory_mV
