"""Functional subnetworks: small networks that add, subtract, multiply, divide, differentiate or integrate.

After Szczecinski, Hunt and Quinn 2017, "A functional subnetwork approach to designing synthetic nervous systems that
control legged robot locomotion". A signal is a potential between 0 and R. An input current I (nA) makes the potential
``I / Gm`` (mV) of its neuron. With ``a = clip(U_pre / R, 0, 1)`` a neuron comes to rest at

    U* = (sum_j g_j a_j E_j + I) / (Gm + sum_j g_j a_j),

and each rule solves this for the conductances at one corner of the range, where the operation is then exact; its
docstring gives U* everywhere else. Shunts bear a factor ``1 + g_1 / Gm``, often left out, that makes the corner exact,
and make membranes fast: `Network.stable_timestep_ms` is 0.4 ms for the default product. Every function adds neurons to
a given network, or makes one of its own, and returns it. Inputs and outputs have the names of their neurons.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from annelid.errors import ConfigError, require_negative, require_positive
from annelid.nervous.network import Network
from annelid.nervous.neurons import Neuron, Synapse

Link = tuple[str, str, Synapse]


@dataclass(frozen=True, slots=True)
class Signals:
    """How signals are carried: the membrane, the operating range and the reversal potentials, all relative to rest.

    Attributes:
        range_mV: Operating range R.
        leak_conductance_uS: Leak conductance Gm.
        capacitance_nF: Membrane capacitance C.
        excitatory_mV: E_ex, above R.
        inhibitory_mV: E_inh, below 0.

    Raises:
        ConfigError: A value with the wrong sign, or an excitatory reversal within the range.
    """

    range_mV: float = 20.0
    leak_conductance_uS: float = 1.0
    capacitance_nF: float = 5.0
    excitatory_mV: float = 194.0
    inhibitory_mV: float = -40.0

    def __post_init__(self) -> None:
        names = ("range_mV", "leak_conductance_uS", "capacitance_nF")
        require_positive(**{name: getattr(self, name) for name in names})
        if not self.excitatory_mV > self.range_mV:
            raise ConfigError(f"excitatory_mV must be above range_mV = {self.range_mV}, not {self.excitatory_mV}")
        require_negative(inhibitory_mV=self.inhibitory_mV)

    @property
    def neuron(self) -> Neuron:
        """A leaky neuron with this membrane."""
        return Neuron(self.capacitance_nF, self.leak_conductance_uS)

    def synapse(self, conductance_uS: float, reversal_mV: float) -> Synapse:
        """Returns a synapse that transmits between 0 and R.

        Args:
            conductance_uS: Largest conductance, uS.
            reversal_mV: Reversal potential, mV.
        """
        return Synapse(conductance_uS, reversal_mV, 0.0, self.range_mV)


def transmission(gain: float = 1.0, signals: Signals | None = None) -> Synapse:
    """Designs the synapse that transmits ``U_post = k U_pre``, which joins subnetworks to each other.

    ``g = Gm k R / (E_ex - k R)``: exact at U_pre = 0 and R. In between ``U* = k U E / (E - k (R - U))``, too
    much by ``k^2 U (R - U) / (E - k (R - U))``, at most about ``(k R)^2 / (4 E)``.

    Args:
        gain: k, so that k R stays below the excitatory reversal potential.
        signals: How signals are carried.

    Raises:
        ConfigError: A gain that is not positive, or too large for the reversal potential.
    """
    s = signals or Signals()
    greatest = s.excitatory_mV / s.range_mV
    if not 0 < gain < greatest:
        raise ConfigError(f"gain must be above 0 and below excitatory_mV / range_mV = {greatest:g}, not {gain}")
    reach = gain * s.range_mV
    return s.synapse(s.leak_conductance_uS * reach / (s.excitatory_mV - reach), s.excitatory_mV)


def addition(
    gains: Sequence[float] = (1.0, 1.0),
    signals: Signals | None = None,
    network: Network | None = None,
    prefix: str = "",
) -> Network:
    """Builds ``U_sum = k_1 U_1 + k_2 U_2 + ..``, for sums within the range, with neurons ``term_1`` .., ``sum``.

    Every synapse is a `transmission`. With equal gains and ``S = k sum U_j`` this gives ``U* = E S / (E - k R + S)``:
    exact at 0 and where ``S = k R``, elsewhere off by ``S (k R - S) / (E - k R + S)``.

    Args:
        gains: k_j, one for each term.
        signals: How signals are carried.
        network: Where to add it; default: a new network.
        prefix: Put before every name.

    Raises:
        ConfigError: No gains, a gain that `transmission` refuses, or a name that is taken.
    """
    s = signals or Signals()
    if not gains:
        raise ConfigError("gains must have one entry for each term, and there is none")
    links = [(f"term_{number}", "sum", transmission(gain, s)) for number, gain in enumerate(gains, start=1)]
    terms = [term for term, _, _ in links]
    return _add(network or Network("addition"), prefix, dict.fromkeys([*terms, "sum"], s.neuron), links, terms)


def subtraction(
    gain: float = 1.0, signals: Signals | None = None, network: Network | None = None, prefix: str = ""
) -> Network:
    """Builds ``U_difference = k (U_plus - U_minus)``, with neurons ``plus``, ``minus`` and ``difference``.

    ``g_plus`` is a `transmission`; ``g_minus = -g_plus E_ex / E_inh`` makes equal signals cancel exactly.
    ``U* = g_plus E_ex (a_plus - a_minus) / (Gm + g_plus a_plus + g_minus a_minus)``: exact also at U_plus = R,
    U_minus = 0, and else too small by up to the factor ``(1 + g_plus / Gm) / (1 + (g_plus + g_minus) / Gm)``.

    Args:
        gain: k.
        signals: How signals are carried.
        network: Where to add it; default: a new network.
        prefix: Put before every name.

    Raises:
        ConfigError: A gain that `transmission` refuses, or a name that is taken.
    """
    s, inputs = signals or Signals(), ("plus", "minus")
    neurons = dict.fromkeys([*inputs, "difference"], s.neuron)
    return _add(network or Network("subtraction"), prefix, neurons, _difference(gain, s, *inputs, "difference"), inputs)


def division(
    ratio: float = 0.1, signals: Signals | None = None, network: Network | None = None, prefix: str = ""
) -> Network:
    """Builds ``U_quotient = U_dividend / (1 + (1 / c - 1) U_divisor / R)``: a divisor at R leaves the share c.

    The dividend is transmitted with gain 1 (g_1). The divisor's synapse reverses at rest, so it only adds conductance:
    ``g_2 = (1 / c - 1) (Gm + g_1)``, from ``U* = c R`` with both at R. Then with ``gamma = g_1 / Gm``
    ``U* = U_dividend / ((1 + gamma a_1) / (1 + gamma) + (1 / c - 1) a_2)``: exact for a dividend at R, and too large by
    at most the share ``gamma`` for smaller ones. The neurons are ``dividend``, ``divisor`` and ``quotient``.

    Args:
        ratio: c, between 0 and 1.
        signals: How signals are carried.
        network: Where to add it; default: a new network.
        prefix: Put before every name.

    Raises:
        ConfigError: A ratio outside (0, 1), or a name that is taken.
    """
    s, inputs = signals or Signals(), ("dividend", "divisor")
    if not 0 < ratio < 1:
        raise ConfigError(f"ratio must be above 0 and below 1, not {ratio}")
    through = transmission(1.0, s)
    shunt = s.synapse((1.0 / ratio - 1.0) * (s.leak_conductance_uS + through.conductance_uS), 0.0)
    links = [("dividend", "quotient", through), ("divisor", "quotient", shunt)]
    return _add(network or Network("division"), prefix, dict.fromkeys([*inputs, "quotient"], s.neuron), links, inputs)


def multiplication(
    residue_mV: float = 1.0, signals: Signals | None = None, network: Network | None = None, prefix: str = ""
) -> Network:
    """Builds ``U_product = U_1 U_2 / R`` by taking a division away.

    An interneuron with a bias of ``Gm R`` shunts the product down to the residue r, where it would be 0; factor 2
    inhibits the interneuron. With ``gamma = R / r - 1`` the shunt is ``gamma (Gm + g_1)`` to rest, as in `division`,
    and the inhibition ``gamma Gm`` to ``-R / gamma``. The interneuron rests at ``R (1 - a_2) / (1 + gamma a_2)``, so
    ``U* = U_1 (1 + gamma a_2) / (1 + gamma)`` for factor 1 at R, off by ``r a_1 (1 - a_2)`` beside the error of the
    transmission of factor 1. The neurons are ``factor_1``, ``factor_2``, ``product`` and ``interneuron``.

    Args:
        residue_mV: r, what is left of R times 0.
        signals: How signals are carried.
        network: Where to add it; default: a new network.
        prefix: Put before every name.

    Raises:
        ConfigError: A residue that is not between 0 and R, or a name that is taken.
    """
    s, inputs = signals or Signals(), ("factor_1", "factor_2")
    if not 0 < residue_mV < s.range_mV:
        raise ConfigError(f"residue_mV must be above 0 and below range_mV = {s.range_mV}, not {residue_mV}")
    leak, reach = s.leak_conductance_uS, s.range_mV
    gamma = reach / residue_mV - 1.0
    through = transmission(1.0, s)
    neurons = dict.fromkeys([*inputs, "product"], s.neuron)
    neurons["interneuron"] = Neuron(s.capacitance_nF, leak, bias_nA=leak * reach)
    links = [
        ("factor_1", "product", through),
        ("factor_2", "interneuron", s.synapse(gamma * leak, -reach / gamma)),
        ("interneuron", "product", s.synapse(gamma * (leak + through.conductance_uS), 0.0)),
    ]
    return _add(network or Network("multiplication"), prefix, neurons, links, inputs, interneuron=reach)


def differentiation(
    gain_ms: float = 50.0,
    fast_ms: float = 1.0,
    amplification: float = 1.0,
    signals: Signals | None = None,
    network: Network | None = None,
    prefix: str = "",
) -> Network:
    """Builds ``U_rate = k_d dU/dt``: the difference of a fast and a slow copy of the signal.

    Both copies take the input current; their capacitances make them first-order lags of ``tau_fast`` and ``tau_slow =
    tau_fast + k_d / k``. On a ramp ``U_fast - U_slow = (tau_slow - tau_fast) dU/dt`` exactly; a `subtraction` of gain k
    follows, with its error. At the angular frequency w the difference is ``w (tau_slow - tau_fast) / sqrt((1 + w^2
    tau_fast^2) (1 + w^2 tau_slow^2))`` of the signal. The input ``signal`` drives ``fast`` and ``slow``; the output is
    that of ``rate``.

    Args:
        gain_ms: k_d.
        fast_ms: tau_fast.
        amplification: k, the gain of the subtraction; a larger one needs less delay for the same gain.
        signals: How signals are carried.
        network: Where to add it; default: a new network.
        prefix: Put before every name.

    Raises:
        ConfigError: A time that is not positive, a gain that `transmission` refuses, or a name that is taken.
    """
    s = signals or Signals()
    require_positive(gain_ms=gain_ms, fast_ms=fast_ms)
    links, leak = _difference(amplification, s, "fast", "slow", "rate"), s.leak_conductance_uS
    neurons = {
        "fast": Neuron(fast_ms * leak, leak),
        "slow": Neuron((fast_ms + gain_ms / amplification) * leak, leak),
        "rate": s.neuron,
    }
    return _add(network or Network("differentiation"), prefix, neurons, links, {"signal": ("fast", "slow")})


def integration(
    rate_mV_per_nA_ms: float = 0.001, signals: Signals | None = None, network: Network | None = None, prefix: str = ""
) -> Network:
    """Builds ``dU_integral/dt = k_i I``: two neurons that keep whatever balance they are brought to.

    Both have a bias ``Gm R`` and inhibit each other with ``g = -Gm R / E_inh``. Then, within the range,

        C dU_1/dt = Gm (R - U_1 - U_2) - g U_1 U_2 / R + I,  C dU_2/dt = Gm (R - U_1 - U_2) - g U_1 U_2 / R,

    so every point of the curve ``R - U_1 - U_2 = (g / Gm) U_1 U_2 / R`` is an equilibrium, and ``U_1 - U_2`` integrates
    ``I / C`` without error or leak, from -R to R. With ``C = 1 / (2 k_i)`` the rate of U_1 is k_i I on average, and
    ``2 (1 + eta U_1 / R) / (2 + eta (U_1 + U_2) / R)`` of that at a point, ``eta = g / Gm``. A current shifts both
    potentials by up to ``I / (2 Gm)``, so it must be small beside ``Gm R``. The input ``signal`` (nA, of either sign)
    drives the neuron ``integral``, which is 0 at first; the other one is ``opposite``.

    Args:
        rate_mV_per_nA_ms: k_i.
        signals: How signals are carried; its capacitance is not used.
        network: Where to add it; default: a new network.
        prefix: Put before every name.

    Raises:
        ConfigError: A rate that is not positive, or a name that is taken.
    """
    s = signals or Signals()
    require_positive(rate_mV_per_nA_ms=rate_mV_per_nA_ms)
    leak, reach = s.leak_conductance_uS, s.range_mV
    neurons = dict.fromkeys(["integral", "opposite"], Neuron(0.5 / rate_mV_per_nA_ms, leak, bias_nA=leak * reach))
    mutual = s.synapse(-leak * reach / s.inhibitory_mV, s.inhibitory_mV)
    links = [("integral", "opposite", mutual), ("opposite", "integral", mutual)]
    inputs = {"signal": ("integral",)}
    return _add(network or Network("integration"), prefix, neurons, links, inputs, opposite=reach)


def _difference(gain: float, signals: Signals, plus: str, minus: str, target: str) -> list[Link]:
    """The synapses of a subtraction of two neurons at a third."""
    excitation = transmission(gain, signals)
    inhibition_uS = -excitation.conductance_uS * signals.excitatory_mV / signals.inhibitory_mV
    return [(plus, target, excitation), (minus, target, signals.synapse(inhibition_uS, signals.inhibitory_mV))]


def _add(
    network: Network,
    prefix: str,
    neurons: Mapping[str, Neuron],
    links: Sequence[Link],
    inputs: Sequence[str] | Mapping[str, Sequence[str]],
    **initial_mV: float,
) -> Network:
    """Adds a subnetwork to a network; its output is the target of the last synapse."""
    for name, neuron in neurons.items():
        network.add_neuron(prefix + name, neuron, initial_mV.get(name))
    for pre, post, synapse in links:
        network.add_synapse(prefix + pre, prefix + post, synapse)
    for name, driven in (inputs if isinstance(inputs, Mapping) else {name: (name,) for name in inputs}).items():
        network.add_input(prefix + name, [prefix + neuron for neuron in driven])
    output = prefix + links[-1][1]
    network.add_output(output, output)
    return network
