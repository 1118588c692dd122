"""Half-centres whose rate follows a drive: a descending neuron that shortens the time to escape.

The half-centre is that of the peristalsis network: two neurons with a persistent sodium channel inhibit each other, and
the inhibited one escapes once its sodium gate h has recovered. A descending neuron with activity
a = clip(U_d / R, 0, 1), the drive, excites both alike, with a conductance D = a g_D and the reversal potential E_ex.
Its input current sets the rate: a constant (manual drive), other neurons' synapses (neural), or a sensor (sensory).
This is our own derivation.

**What the drive does.** The gate at which the inhibited neuron reaches 0, all currents balanced, is closed:

    h_low(0) = (g |E_inh| - D E_ex) / (G_Na m(0) E_Na).

Without drive it lies just below h_inf(0), by the bifurcation parameter delta: it creeps up to an almost resting
state, and T is long, with a logarithm of delta. The drive takes over a share of the current that has to balance the
inhibition, D E_ex / (g |E_inh|), and lowers h_low(0) by that share: the approach is cut off ever earlier, and 1 / T
rises. (`tests/nervous/slow_half_centre.py` has the period in the limit of no capacitance.)

**Range.** g_D is chosen by the share of the current at 0 that drive 1 takes over, `DRIVE_SHARE` = 0.3. The documented
range is drive 0 .. 1. In it the frequency of a half-centre with the papers' constants rises monotonically from 0.62 to
1.86 Hz, threefold. The whole peristalsis network keeps its order and goes 2.6 times as fast at drive 1, provided that
the body follows: a segment must be back at rest length before the next one has contracted and let go. A slower body
falls out of order, as it does with a shorter gate time constant.
"""

from __future__ import annotations

from annelid.nervous.half_centre import add_half_centre
from annelid.nervous.network import Network
from annelid.nervous.neurons import Neuron
from annelid.nervous.peristalsis import PeristalsisParameters, peristalsis_network

DRIVE_NEURON = "descending"
"""Name of the descending neuron; its input is called ``drive``."""
DRIVE_SHARE = 0.3
"""Share of the current that balances inhibition at U = 0 which drive 1 takes over; chosen by us."""


def drive_conductance_uS(parameters: PeristalsisParameters | None = None, share: float = DRIVE_SHARE) -> float:
    """g_D with which drive 1 takes over a share of the current that balances the inhibition of a neuron at 0.

    Args:
        parameters: Of the half-centre; default: those of the papers.
        share: ``g_D E_ex / (g_CPG |E_inh|)``.

    Returns:
        g_D, uS.
    """
    p = PeristalsisParameters() if parameters is None else parameters
    return -share * p.conductances.half_centre * p.inhibitory_reversal_mV / p.excitatory_reversal_mV


def adaptive_half_centre(parameters: PeristalsisParameters | None = None) -> Network:
    """Builds a half-centre under a descending drive.

    Args:
        parameters: Of the half-centre; default: those of the papers.

    Returns:
        A network of ``contraction``, ``expansion`` and ``descending``. Its input ``drive`` is a current into the last
        one: ``drive Gm R`` nA holds it at the drive. Outputs are the first two.
    """
    p = PeristalsisParameters() if parameters is None else parameters
    network = Network("half-centre under a drive")
    add_half_centre(network, "contraction", "expansion", p)
    _add_drive(network, p, ["contraction", "expansion"], p.capacitance_nF / p.leak_conductance_uS)
    network.add_output("contraction", "contraction")
    network.add_output("expansion", "expansion")
    return network


def adaptive_peristalsis_network(
    n_segments: int, parameters: PeristalsisParameters | None = None, drive_time_constant_ms: float = 5.0
) -> Network:
    """Builds the peristalsis network with a descending neuron that excites both neurons of every half-centre.

    Args:
        n_segments: Number of segments, at least 3.
        parameters: What to design it from; default: those of the papers.
        drive_time_constant_ms: Time constant of the descending neuron, ms.

    Returns:
        `annelid.nervous.peristalsis_network` with one more neuron, ``descending``, and one more input, ``drive``, both
        last.

    Raises:
        ConfigError: As `peristalsis_network`, or a time constant that is not positive.
    """
    p = PeristalsisParameters() if parameters is None else parameters
    network = peristalsis_network(n_segments, p)
    halves = [f"{half}_{s}" for s in range(1, n_segments + 1) for half in ("contraction", "expansion")]
    _add_drive(network, p, halves, drive_time_constant_ms)
    return network


def _add_drive(network: Network, p: PeristalsisParameters, targets: list[str], time_constant_ms: float) -> None:
    network.add_neuron(DRIVE_NEURON, Neuron(time_constant_ms * p.leak_conductance_uS, p.leak_conductance_uS))
    drive = p.excitatory(drive_conductance_uS(p))
    for target in targets:
        network.add_synapse(DRIVE_NEURON, target, drive)
    network.add_input("drive", DRIVE_NEURON)
