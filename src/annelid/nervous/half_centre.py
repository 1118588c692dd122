"""Half-centres: two neurons that inhibit each other and take turns, designed for a wanted period.

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

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace

import numpy as np

from annelid.errors import ConfigError, require_negative, require_positive, suggest
from annelid.nervous.functional_subnetworks import Signals
from annelid.nervous.network import Network
from annelid.nervous.neurons import Array, Channel, Neuron, Synapse, persistent_sodium

_TIMESTEP_MS = 1.0
_CANDIDATES = 9
_MAX_ROUNDS = 12
# A neuron that has not escaped within this many gate time constants is taken never to escape.
_PATIENCE = 40.0


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
    def signals(self) -> Signals:
        """How neurons outside the half-centres carry signals."""
        membrane = self.range_mV, self.leak_conductance_uS, self.capacitance_nF
        return Signals(*membrane, self.excitatory_reversal_mV, self.inhibitory_reversal_mV)

    @property
    def sodium_channel(self) -> Channel:
        """The persistent sodium channel of both neurons."""
        return self._channel(self.sodium_uS)

    @property
    def neuron(self) -> Neuron:
        """Either of the two neurons."""
        return Neuron(self.capacitance_nF, self.leak_conductance_uS, channels=(self.sodium_channel,))

    def inhibitory(self, conductance_uS: float) -> Synapse:
        """Returns an inhibitory synapse that transmits between 0 and R."""
        return self.signals.synapse(conductance_uS, self.inhibitory_reversal_mV)

    def excitatory(self, conductance_uS: float) -> Synapse:
        """Returns an excitatory synapse that transmits between 0 and R."""
        return self.signals.synapse(conductance_uS, self.excitatory_reversal_mV)

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


def half_centre_network(half_centre: HalfCentre | None = None) -> Network:
    """Returns a network of one half-centre, neurons and outputs ``first`` and ``second``, each with an input."""
    network = Network("half-centre")
    add_half_centre(network, "first", "second", half_centre)
    for name in ("first", "second"):
        network.add_input(f"drive_{name}", name)
        network.add_output(name, name)
    return network


def oscillation_periods(half_centres: Sequence[HalfCentre], duration_ms: float | None = None) -> Array:
    """Measures the free-running periods of many half-centres at once, as one network in steps of 1 ms (Heun).

    A period is the time between the last two instants at which the first neuron overtakes the second, interpolated
    within the step; the first cycle is left out.

    Args:
        half_centres: The designs.
        duration_ms: How long to wait at most for three such instants; default: 40 times the largest gate time
            constant. The run ends as soon as all have had them.

    Returns:
        Periods, ms, ``(n,)``; infinite where there were fewer than three.

    Raises:
        ConfigError: A design gives a negative conductance, or there is none.
    """
    if not half_centres:
        raise ConfigError("oscillation_periods needs at least one half-centre")
    network = Network("half-centres")
    for i, half_centre in enumerate(half_centres):
        add_half_centre(network, f"first_{i}", f"second_{i}", half_centre)
    if duration_ms is None:
        duration_ms = _PATIENCE * max(p.gate_time_constant_ms for p in half_centres)
    stepper = network.compile(_TIMESTEP_MS, "heun")
    state = stepper.initial_state()
    first, second = state.potential[0, ::2], state.potential[0, 1::2]
    lead = first - second
    instants: list[list[float]] = [[] for _ in half_centres]
    for step in range(int(duration_ms / _TIMESTEP_MS)):
        stepper.advance(state)
        before, lead = lead, first - second
        overtaken = np.flatnonzero((before < 0.0) & (lead >= 0.0))
        for i in overtaken:
            instants[i].append(_TIMESTEP_MS * (step + before[i] / (before[i] - lead[i])))
        if overtaken.size and all(len(times) >= 3 for times in instants):
            break
    return np.array([times[-1] - times[-2] if len(times) >= 3 else np.inf for times in instants])


def half_centre_of_period(
    period_ms: float,
    half_centre: HalfCentre | None = None,
    parameter: str = "gate_time_constant_ms",
    bounds: tuple[float, float] | None = None,
    tolerance: float = 1e-3,
) -> HalfCentre:
    """Finds the value of one parameter with which a half-centre oscillates at a wanted period.

    Args:
        period_ms: The wanted period.
        half_centre: The design whose other parameters are kept; default: that of Riddle et al. 2022.
        parameter: Which field of `HalfCentre` to vary.
        bounds: Least and greatest value to try; default: a tenth and ten times the present one.
        tolerance: Relative error of the period at which to stop.

    Raises:
        ConfigError: An unknown parameter, bounds that are not in order or of one sign, or a period that cannot be had
            within them; the sentence has the range that can.
    """
    base = half_centre or HalfCentre()
    names = [field.name for field in fields(HalfCentre)]
    if parameter not in names:
        raise ConfigError(f"unknown parameter {parameter!r} of a half-centre: {suggest(parameter, names)}")
    low, high = bounds or sorted((0.1 * getattr(base, parameter), 10.0 * getattr(base, parameter)))

    def periods_of(values: Array, duration_ms: float | None) -> Array:
        periods, possible = np.full(values.size, np.inf), {}
        for i, value in enumerate(values):
            with suppress(ConfigError):
                candidate = replace(base, **{parameter: float(value)})
                half_centre_network(candidate)
                possible[i] = candidate
        if possible:
            periods[list(possible)] = oscillation_periods(list(possible.values()), duration_ms)
        return periods

    return replace(base, **{parameter: find_period(periods_of, period_ms, (low, high), tolerance, parameter)})


def find_period(
    periods_of: Callable[[Array, float | None], Array],
    period_ms: float,
    bounds: tuple[float, float],
    tolerance: float = 1e-3,
    parameter: str = "parameter",
) -> float:
    """Finds the value of a parameter at which something oscillates with a wanted period.

    Each round measures nine values at once, evenly spaced in the logarithm, and goes on between the two neighbours
    that have the wanted period between them: a bracket shrinks eightfold a round, and the period need not be monotone.

    Args:
        periods_of: Takes values ``(n,)`` and the longest time to simulate, ms (None: as long as it takes), and
            returns periods, ms, ``(n,)``, infinite where there is no oscillation within that time.
        period_ms: The wanted period.
        bounds: Least and greatest value, both positive or both negative.
        tolerance: Relative error of the period at which to stop.
        parameter: What to call the parameter in an error.

    Raises:
        ConfigError: Bounds that are not in order or of one sign, a period or tolerance that is not positive, or a
            period that is not attained; the sentence has the range that is.
    """
    low, high = bounds
    if not (low < high and low * high > 0):
        raise ConfigError(f"the bounds of {parameter} must be in ascending order and of one sign, not {bounds}")
    if not (period_ms > 0 and np.isfinite(period_ms) and tolerance > 0):
        raise ConfigError(f"period_ms and tolerance must be positive, not {period_ms} and {tolerance}")
    # Slower ones need not be waited for, unless nothing else distinguishes them from silent ones.
    patience: float | None = 5.0 * period_ms
    values = np.geomspace(low, high, _CANDIDATES)
    periods = periods_of(values, patience)
    if _bracket(periods, period_ms)[1]:
        patience = None
        periods = periods_of(values, patience)
    seen = np.empty(0)
    for _ in range(_MAX_ROUNDS):
        seen = np.append(seen, periods[np.isfinite(periods)])
        errors = np.abs(periods / period_ms - 1.0)
        best, (left, _) = int(np.argmin(errors)), _bracket(periods, period_ms)
        if errors[best] <= tolerance:
            return float(values[best])
        if left is None:
            break
        values = np.geomspace(values[left], values[left + 1], _CANDIDATES)
        periods = periods_of(values, patience)
    if not seen.size:
        raise ConfigError(f"nothing oscillates with {parameter} from {low:g} to {high:g}")
    raise ConfigError(
        f"a period of {period_ms:g} ms cannot be had with {parameter} from {low:g} to {high:g}: the periods found "
        f"there go from {seen.min():.4g} to {seen.max():.4g} ms"
    )


def _bracket(periods: Array, wanted: float) -> tuple[int | None, bool]:
    """Place i of the best pair i, i + 1 with the wanted period between them, and whether one of the pair is silent.

    Pairs of two finite periods come first, then those of lower i; None, and True, where there is no pair.
    """
    above, silent = periods > wanted, ~np.isfinite(periods)
    pairs = [(bool(silent[i] or silent[i + 1]), int(i)) for i in np.flatnonzero(above[:-1] != above[1:])]
    doubtful, place = min(pairs, default=(True, None))
    return place, doubtful
