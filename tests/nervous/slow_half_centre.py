"""The period of a half-centre under a drive in the limit of no capacitance, to hold the simulated one to.

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
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from annelid.nervous import PeristalsisParameters, drive_conductance_uS
from annelid.nervous.neurons import Array


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
        ValueError: No rhythm with these parameters.
    """
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
    raise ValueError("these parameters give the half-centre no steady rhythm")


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
    raise ValueError("these parameters give the half-centre no rhythm: the inhibited neuron does not escape")
