"""Half-centres whose rate follows a drive: a descending neuron that shortens the time to escape.

The half-centre is that of the peristalsis network: two neurons with a persistent sodium channel inhibit each other, and
the inhibited one escapes once its sodium gate h has recovered. A descending neuron with activity
a = clip(U_d / R, 0, 1), the drive, excites both alike, with a conductance D = a g_D and the reversal potential E_ex.
Its input current sets the rate: a constant (manual drive), other neurons' synapses (neural), or a sensor (sensory).
This is our own derivation.

**Slow motion.** Potentials are fast (C / Gm = 5 ms) beside the gates (up to 150 ms), so the currents always balance,
and each potential follows its gate. While the active neuron (2) is above R it inhibits the other (1) in full, which
gives the gate at which neuron 1 is at U,

    h_low(U) = (Gm U - g (E_inh - U) - D (E_ex - U)) / (G_Na m(U) (E_Na - U)),

and neuron 2 is where, with the inhibition b = clip(U_1 / R, 0, 1) that neuron 1 may already return,

    Gm U_2 = b g (E_inh - U_2) + D (E_ex - U_2) + G_Na m(U_2) h_2 (E_Na - U_2).

Both gates move by dh/dt = (h_inf(U) - h) / tau_h(U): h_1 recovers, h_2 inactivates.

**Escape.** Once neuron 1 has risen above 0 it inhibits neuron 2, at first without consequence. When that one has fallen
to R, inhibition yields on either side and each gives way to the other: they change roles. The balance of neuron 2 at R
makes this the line

    U_1 = R (G_Na m(R) (E_Na - R) (h_2 - h_inf(R)) + D (E_ex - R)) / (g (R - E_inh))

(G_Na is designed so that sodium alone holds R with a steady gate). A half period takes (h_1, h_2) to this line, and
roles are exchanged: the fixed point of this map of the plane, and the time T that it takes, are the rhythm in the limit
of no capacitance. `half_period_ms` finds them. There is no closed form of T, as tau_h and h_inf are functions of U.

**What the drive does.** The gate at which neuron 1 reaches 0 is closed:

    h_low(0) = (g |E_inh| - D E_ex) / (G_Na m(0) E_Na).

Without drive it lies just below h_inf(0), by the bifurcation parameter delta: neuron 1 creeps up to an almost resting
state, and T is long, with a logarithm of delta. The drive takes over a share of the current that has to balance the
inhibition, D E_ex / (g |E_inh|), and lowers h_low(0) by that share: the approach is cut off ever earlier, and 1 / T
rises. The line of escape moves up with D too, but less: by R (E_ex - R) / (g (R - E_inh)) mV per uS.

**Range.** g_D is chosen by the share of the current at 0 that drive 1 takes over, `DRIVE_SHARE` = 0.3. The documented
range is drive 0 .. 1. In it the frequency of a half-centre with the papers' constants rises monotonically from 0.62 to
1.86 Hz, threefold. The whole peristalsis network keeps its order and goes 2.6 times as fast at drive 1, provided that
the body follows: a segment must be back at rest length before the next one has contracted and let go. A slower body
falls out of order, as it does with a shorter gate time constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from annelid.errors import ConfigError
from annelid.nervous.half_centre import add_half_centre
from annelid.nervous.network import Network
from annelid.nervous.neurons import Neuron
from annelid.nervous.peristalsis import PeristalsisParameters, peristalsis_network

Array = NDArray[np.float64]

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


@dataclass(frozen=True)
class _SlowHalfCentre:
    """Gates of a half-centre whose potentials balance at every instant, under a drive conductance D."""

    p: PeristalsisParameters
    drive_uS: float

    def steady(self, u: Array) -> Array:
        """h_inf."""
        return self.p.sodium_channel.slow_gates[0].steady(u)

    def time_constant(self, u: Array) -> Array:
        """tau_h, ms; sqrt(0.5 exp(S U)) is sqrt(1 / h_inf - 1)."""
        steady = self.steady(u)
        return self.p.gate_time_constant_ms * np.sqrt(steady * (1.0 - steady))

    def inhibited(self, u: Array) -> Array:
        """h_low."""
        p, channel = self.p, self.p.sodium_channel
        outward = p.leak_conductance_uS * u - p.conductances.half_centre * (p.inhibitory_reversal_mV - u)
        outward -= self.drive_uS * (p.excitatory_reversal_mV - u)
        return outward / (channel.conductance_uS * channel.instant_gates[0].steady(u) * (channel.reversal_mV - u))

    def recovery(self) -> tuple[Array, Array, Array]:
        """Potential (mV) of the inhibited neuron, its gate, and the time (ms) along the way up to its rest, or to R."""
        reach = self.p.range_mV
        above = np.linspace(0.0, reach, 2001)
        at_rest = np.flatnonzero(self.inhibited(above) >= self.steady(above))
        rest = above[at_rest[0]] if at_rest.size else reach
        low, high = max(rest - above[1], 0.0), rest
        for _ in range(60 if at_rest.size else 0):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.inhibited(middle) >= self.steady(middle) else (middle, high)
        # Even in the logarithm of the distance to rest, where the motion is exponential.
        u = high - np.geomspace(high + 1.5 * reach, 1e-7 * reach, 1500)
        h = self.inhibited(u)
        u, h = u[h > 0], h[h > 0]
        pace = self.time_constant(u) / (self.steady(u) - h)
        time = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * np.diff(h))])
        return u, h, time

    def active(self, gate: float, inhibition: float, guess: float) -> float:
        """U_2 (mV) at a gate and an inhibition b, by Newton's method from a guess."""
        p, channel = self.p, self.p.sodium_channel
        opening = channel.instant_gates[0]
        g, u = inhibition * p.conductances.half_centre, guess
        for _ in range(50):
            m = 1.0 / (1.0 + opening.factor * math.exp(opening.slope_per_mV * (opening.midpoint_mV - u)))
            sodium = channel.conductance_uS * m * gate
            surplus = sodium * (channel.reversal_mV - u) - p.leak_conductance_uS * u
            surplus += self.drive_uS * (p.excitatory_reversal_mV - u) + g * (p.inhibitory_reversal_mV - u)
            slope = sodium * (opening.slope_per_mV * (1.0 - m) * (channel.reversal_mV - u) - 1.0)
            step = surplus / (p.leak_conductance_uS + self.drive_uS + g - slope)
            u += step
            if abs(step) < 1e-10:
                break
        return u


def half_period_ms(drive: float, parameters: PeristalsisParameters | None = None) -> float:
    """Half the period of a half-centre under a drive, in the limit of no capacitance.

    Args:
        drive: Activity of the descending neuron, in [0, 1].
        parameters: Of the half-centre; default: those of the papers.

    Returns:
        T, ms, the time of the fixed point of the map in the module's docstring.

    Raises:
        ConfigError: A drive outside [0, 1], or no rhythm with these parameters.
    """
    if not 0.0 <= drive <= 1.0:
        raise ConfigError(f"drive must be in 0 .. 1, not {drive:g}")
    p = PeristalsisParameters() if parameters is None else parameters
    slow = _SlowHalfCentre(p, drive * drive_conductance_uS(p))
    way = slow.recovery()
    recovering, inactivating = 0.5 * float(slow.inhibited(np.array(0.0))), float(slow.inhibited(np.array(0.0)))
    before = math.inf
    for _ in range(200):
        time, recovered, inactivated = _half_period(slow, way, recovering, inactivating)
        recovering, inactivating = inactivated, recovered
        if abs(time - before) < 1e-9 * time:
            return time
        before = time
    raise ConfigError("these parameters give the half-centre no steady rhythm")


def _half_period(
    slow: _SlowHalfCentre, way: tuple[Array, Array, Array], recovering: float, inactivating: float
) -> tuple[float, float, float]:
    """Time (ms) from two gates to the exchange of roles, and both gates there."""
    u, h, times = way
    reach, top = slow.p.range_mV, slow.p.gate_time_constant_ms
    gate = slow.p.sodium_channel.slow_gates[0]
    begin = float(np.interp(recovering, h, times))
    first = int(np.searchsorted(times, begin, side="right"))
    now, h2, b = begin, inactivating, 0.0
    u2 = slow.active(h2, b, slow.p.sodium_reversal_mV)
    h1 = recovering

    def rate(potential: float, h_now: float) -> float:
        exponential = gate.factor * math.exp(gate.slope_per_mV * (gate.midpoint_mV - potential))
        steady = 1.0 / (1.0 + exponential)
        return (steady - h_now) / (top * steady * math.sqrt(exponential))

    for u1_next, h1_next, then in zip(u[first:], h[first:], times[first:], strict=True):
        dt, b = float(then) - now, min(max(float(u1_next) / reach, 0.0), 1.0)
        slope = rate(u2, h2)
        ahead = h2 + dt * slope
        h2_next = h2 + 0.5 * dt * (slope + rate(slow.active(ahead, b, u2), ahead))
        u2_next = slow.active(h2_next, b, u2)
        if u2_next <= reach:
            part = (u2 - reach) / (u2 - u2_next)
            return now - begin + part * dt, h1 + part * (float(h1_next) - h1), h2 + part * (h2_next - h2)
        now, h1, h2, u2 = float(then), float(h1_next), h2_next, u2_next
    raise ConfigError("these parameters give the half-centre no rhythm: the inhibited neuron does not escape")


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
