"""What controllers share: what they record, how they drive the muscles; and a user's own function as a controller."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from annelid.config.run import ControllerKind
from annelid.config.sections import Positive, Section
from annelid.control.stretch_sensor import lengthening_m
from annelid.errors import ConfigError
from annelid.nervous import Network, NetworkState, Scheme, Stepper
from annelid.nervous.half_centre import HalfCentre
from annelid.protocols import (
    Array,
    Controller,
    Recordable,
    Records,
    SavedAndRecorded,
    Sensation,
    State,
    Stateful,
    Values,
    Watched,
)

Slope = Annotated[float, Field(ge=-100, le=100)]
TimeConstant = Annotated[float, Field(ge=1e-3, le=1e4)]
Pattern = TypeVar("Pattern", bound=Section)
Design = TypeVar("Design", bound=HalfCentre)


class Sensed(NamedTuple):
    """A quantity that a network may sense, and a microcontroller is given."""

    meaning: str
    read: Callable[[Sensation], Array]


def heading_angle(heading: Array) -> float:
    """Returns the direction of a heading on the floor, rad: 0 towards -x, positive to the worm's left, towards -y."""
    return math.atan2(-float(heading[1]), -float(heading[0]))


SENSED: dict[str, Sensed] = {
    "lengthening_m": Sensed(
        "mean length of each segment's stretch sensors beyond that at rest, m",
        lambda s: lengthening_m(s.stretch_m, s.rest_stretch_m),
    ),
    "touch_N": Sensed("force of the ground on belly, left, back and right of each segment, N", lambda s: s.touch_N),
    "heading_rad": Sensed(
        "direction from the last ring to the first, 0 towards -x, positive to the left",
        lambda s: np.array([heading_angle(s.heading)]),
    ),
    "front_m": Sensed("x and y of the first ring, m", lambda s: s.front_m[:2]),
}
"""What the C code of controllers is given, by the names of its fields."""


@dataclass(frozen=True, slots=True)
class ControllerCode:
    """A controller as `annelid_lab.firmware.controllers` writes it: its network, and C99 for what it does beside it.

    The statements may use the type ``real``, the integers ``i`` and ``j``, the counts ``N_SEGMENTS``, ``N_MUSCLES`` and
    ``N_INPUTS``, ``sensors->NAME`` of what is sensed, ``now.NAME`` of the state (``now.potential_mV``, ``now.n_steps``
    and those below), the constants, ``clipped(value, low, high)`` and ``EXP``, ``FMOD`` and ``ATAN2``.

    Attributes:
        network: The network.
        stepper: What advances it.
        network_state: Its present state.
        n_segments: Segments.
        n_muscles: Muscles.
        senses: What it is given, names in `SENSED`.
        inputs: Statements that set ``input_nA[]`` before the network's step.
        activation: Statements that set ``activation->activation[]`` after it.
        constants: Numbers and arrays by name; whole ones are counts of steps.
        state: Initial values of further variables of the state.
        helpers: Functions that the statements call.
    """

    network: Network
    stepper: Stepper
    network_state: NetworkState
    n_segments: int = 0
    n_muscles: int = 0
    senses: tuple[str, ...] = ()
    inputs: str = ""
    activation: str = ""
    constants: Mapping[str, ArrayLike] = field(default_factory=dict)
    state: Mapping[str, ArrayLike] = field(default_factory=dict)
    helpers: str = ""


@runtime_checkable
class Coded(Controller, Protocol):
    """The capability of a controller of being written as C99."""

    def code(self) -> ControllerCode:
        """Returns what it does as C.

        Raises:
            ConfigError: It cannot be written as C with its present settings.
        """
        ...


class SegmentController(SavedAndRecorded, ABC):
    """A controller that makes one activation per segment; both halves of a ring take it alike.

    Its state is ``_now``, a dictionary of arrays, and what it records is listed in ``recorded``, with values from
    ``_values``, labels from ``_coords`` and constants from ``_attrs``.

    Attributes:
        name: What the run file calls it.
        recorded: Name, dimensions, unit and meaning of what it may record.

    Raises:
        ConfigError: Muscles that are neither one nor two per segment.
    """

    name: ClassVar[str]

    def __init__(self, n_segments: int, n_muscles: int) -> None:
        """Takes the size of the worm.

        Args:
            n_segments: Segments.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
        """
        if n_muscles not in (n_segments, 2 * n_segments):
            raise ConfigError(
                f"n_muscles = {n_muscles} does not fit {n_segments} segments: "
                f"give {n_segments} (rings) or {2 * n_segments} (half-rings)"
            )
        self._n_segments = n_segments
        self._muscles_per_segment = n_muscles // n_segments
        self._now = {}

    @abstractmethod
    def reset(self, seed: int) -> None:
        """Returns to the initial state; ``seed`` fixes every random draw that follows."""

    @abstractmethod
    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step.

        Args:
            sensation: What the body senses at the beginning of the step.

        Returns:
            Activation of every muscle in [0, 1], shape ``(n_muscles,)``.
        """

    def recordable(self) -> Recordable:
        """Names the signals that `read` returns."""
        own = super().recordable()
        return Recordable(own.signals, own.coords, {"controller": self.name, **own.attrs})


class OpenLoopController(SegmentController, Generic[Pattern]):
    """Contracts segments by the clock: during the step from t to t + dt as its pattern says for t; has no state."""

    def __init__(self, pattern: Pattern, n_segments: int, n_muscles: int) -> None:
        """Takes a pattern and the size of the worm.

        Args:
            pattern: Its section of the configuration.
            n_segments: Segments.
            n_muscles: As `SegmentController`.
        """
        self._pattern = pattern
        super().__init__(n_segments, n_muscles)

    @abstractmethod
    def activation(self, time_s: float) -> Array:
        """Returns the activation of every segment at a time, in [0, 1], ``(n_segments,)``."""

    def reset(self, seed: int) -> None:
        """Does nothing: there is no state, and nothing is random."""

    def step(self, sensation: Sensation) -> Array:
        """Returns the activation of the step that begins now; nothing but the time is sensed."""
        return self.activation(sensation.time_s).repeat(self._muscles_per_segment)


class HalfCentreKind(ControllerKind):
    """The fields of a network's half-centres, `annelid.nervous.HalfCentre`; the defaults are those of the papers."""

    capacitance_nF: Positive = Field(default=5.0, description="membrane capacitance C of the fast neurons")
    leak_conductance_uS: Positive = Field(default=1.0, description="leak conductance Gm")
    range_mV: Positive = Field(default=20.0, description="operating range R")
    bifurcation_mV: float = Field(default=0.01, description="delta: how far past the bifurcation the half-centre sits")
    offset_mV: Positive = Field(default=0.1, description="how far beyond the range a suppressed half-centre lies")
    inhibitory_reversal_mV: float = Field(default=-40.0, lt=0, description="relative to rest")
    excitatory_reversal_mV: Positive = Field(default=194.0, description="relative to rest")
    sodium_reversal_mV: Positive = Field(default=110.0, description="relative to rest")
    gate_slope_per_mV: float = Field(default=0.05, gt=0, le=10, description="slope S of the sodium gates")
    gate_time_constant_ms: Positive = Field(
        default=300.0, description="tau_h,max; sets the period of the paper's network: 300, 200 or 100"
    )


def design_of(kind: type[Design], section: Section) -> Design:
    """Returns the design whose parameters a section of the configuration has under the same names."""
    return kind(**{field.name: getattr(section, field.name) for field in fields(kind)})


_ANTAGONISTS = ("contraction", "expansion")


class NeuralController(SegmentController):
    """A compiled network whose potentials drive the muscles.

    A segment's activation is a function of its contraction minus its expansion neuron, U1 - U2:
    ``1 / (1 + exp(-slope (U1 - U2)))`` (Riddle et al. 2023, Eq. 2, whose printed exponent has the other sign), or
    ``0.5 + clip(U1 - U2, -R, R) / (2 R)`` (Riddle et al. 2022).

    Attributes:
        network: The network that is stepped.
    """

    _GATE = "inactivation gate h of the persistent sodium channel; NaN for neurons without one"
    recorded = (
        ("potential", ("neuron",), "mV", "membrane potential relative to rest"),
        ("sodium_gate", ("neuron",), "1", _GATE),
    )
    _range_mV: float

    def __init__(
        self,
        network: Network,
        roles: Sequence[str],
        n_segments: int,
        n_muscles: int,
        control_timestep_s: float,
        *,
        scheme: Scheme,
        slope_per_mV: float,
        linear_range_mV: float | None = None,
    ) -> None:
        """Compiles the network, whose neurons are those of one segment after another by ``roles``, then any others.

        ``linear_range_mV`` is the R of the linear activation, which then takes the sigmoid's place.
        """
        super().__init__(n_segments, n_muscles)
        self._timestep_s = control_timestep_s
        self.network = network
        self._stepper = network.compile(1e3 * control_timestep_s, scheme)
        self._of_role = {role: slice(place, n_segments * len(roles), len(roles)) for place, role in enumerate(roles)}
        self._slope_per_mV = slope_per_mV
        self._linear_range_mV = linear_range_mV
        self.reset(0)

    def _start_at(self, state: NetworkState, **others: NDArray) -> None:
        """Begins with a state of the network, and other arrays that the next step depends on."""
        self._state = state
        self._now = {"potential": state.potential, "gate": state.gate, **others}

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `stride`."""
        return self.stride(sensation, 1)[0]

    @abstractmethod
    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps, as `annelid.protocols.StridingController.stride`."""

    def _lengthening(self, sensation: Sensation, n_steps: int) -> Array:
        """How much longer than at rest segments are at every control step, m, ``(n_steps, .., n_segments)``."""
        longer = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
        if n_steps == 1:
            return longer[np.newaxis]
        rate = sensation.stretch_rate_m_per_s
        times = self._timestep_s * np.arange(n_steps).reshape(-1, *[1] * longer.ndim)
        return longer + times * (rate.mean(axis=-1) if rate.size else 0.0)

    def _advance(self, inputs_nA: Array, n_steps: int) -> Array:
        """Advances the network under the same currents; returns potentials of each step, ``(n_steps, n_neurons)``."""
        potentials = np.empty((n_steps, self._state.potential.shape[-1]))
        for step in range(n_steps):
            self._stepper.advance(self._state, inputs_nA)
            potentials[step] = self._state.potential[0]
        return potentials

    def _activation(self, potential: Array) -> Array:
        """Activation of every muscle, ``(.., n_muscles)``, from potentials, ``(.., n_neurons)``."""
        activation = self._shares(potential)
        return activation if self._muscles_per_segment == 1 else activation.repeat(self._muscles_per_segment, axis=-1)

    def _difference(self, potential: Array) -> Array:
        """The potentials that activation goes by, mV, ``(.., n_segments)``."""
        up, down = (potential[..., self._of_role[role]] for role in _ANTAGONISTS)
        return up - down

    def _shares(self, potential: Array) -> Array:
        """Activation of every segment, ``(.., n_segments)``."""
        difference, reach = self._difference(potential), self._linear_range_mV
        if reach is not None:
            return 0.5 + np.minimum(np.maximum(difference, -reach), reach) / (2.0 * reach)
        return 1.0 / (1.0 + np.exp(-self._slope_per_mV * difference))

    def _code(self, **parts: Any) -> ControllerCode:
        """The controller as C, with parts that depend on its kind: fields of `ControllerCode`."""
        share, constants = self._share_code()
        per_segment = self._muscles_per_segment
        activation = f"""
    for (i = 0; i < N_SEGMENTS; i++) {{
        const real share = {share};
        for (j = 0; j < {per_segment}; j++) activation->activation[{per_segment} * i + j] = share;
    }}"""
        return ControllerCode(
            self.network,
            self._stepper,
            self._state,
            self._n_segments,
            self._n_segments * per_segment,
            activation=activation,
            constants={**parts.pop("constants", {}), **constants},
            **parts,
        )

    def _difference_code(self) -> tuple[str, dict[str, Array]]:
        """`_difference` of segment i as an expression of C, and its constants."""
        n_roles = len(self._of_role)
        up, down = (f"now.potential_mV[{n_roles} * i + {self._of_role[role].start}]" for role in _ANTAGONISTS)
        return f"({up} - {down})", {}

    def _share_code(self) -> tuple[str, dict[str, float | Array]]:
        """`_shares` of segment i as an expression of C, and its constants."""
        difference, constants = self._difference_code()
        if self._linear_range_mV is not None:
            share = f"(real)0.5 + clipped({difference}, -linear_range_mV, linear_range_mV) / (2 * linear_range_mV)"
            return share, {**constants, "linear_range_mV": self._linear_range_mV}
        return f"1 / (1 + EXP(-slope_per_mV * {difference}))", {**constants, "slope_per_mV": self._slope_per_mV}

    def _activity(self, name: str) -> float:
        """Activity of a neuron: its potential over the range, in [0, 1]."""
        potential = self._state.potential[0, self._stepper.arrays.neurons.index(name)]
        return min(max(float(potential) / self._range_mV, 0.0), 1.0)

    def _values(self) -> Values:
        arrays = self._stepper.arrays
        gate = np.full(len(arrays.neurons), np.nan)
        gate[arrays.channel_neuron] = self._state.gate[0, 0]
        return {"potential": self._state.potential[0].copy(), "sodium_gate": gate}

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"neuron": list(self._stepper.arrays.neurons), "segment": list(range(1, self._n_segments + 1))}


class WrappedController(ABC):
    """A controller with something between it and the body, which has a state and signals of its own.

    Attributes:
        name: The controller's own.
    """

    def __init__(self, inner: Controller, between: SavedAndRecorded) -> None:
        """Wraps a controller."""
        self.name = getattr(inner, "name", type(inner).__name__)
        self._inner, self._between = inner, between

    @abstractmethod
    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `annelid.protocols.Controller.step`."""

    def recordable(self) -> Recordable:
        """Names the controller's signals, then those of what is between."""
        inner = self._inner.recordable() if isinstance(self._inner, Records) else Recordable()
        own = self._between.recordable()
        attrs = {**inner.attrs, **own.attrs}
        return Recordable((*inner.signals, *own.signals), {**inner.coords, **own.coords}, attrs)

    def read(self, frame: bool) -> Values:
        """Reads the signals that `recordable` names."""
        inner = self._inner.read(frame) if isinstance(self._inner, Records) else {}
        return {**inner, **self._between.read(frame)}

    def alarm(self) -> str | None:
        """Returns the controller's alarm."""
        return self._inner.alarm() if isinstance(self._inner, Watched) else None


class SavedWrapper(WrappedController):
    """A wrapped controller whose state can be saved, since the controller's can.

    Attributes:
        prefixes: What the names of the controller's state and of the state between begin with.
    """

    prefixes: ClassVar[tuple[str, str]]

    def _saved(self) -> dict[str, Stateful]:
        assert isinstance(self._inner, Stateful)
        return dict(zip(self.prefixes, (self._inner, self._between), strict=True))

    def get_state(self) -> State:
        """Returns copies of all that the next step depends on."""
        return {start + name: each for start, part in self._saved().items() for name, each in part.get_state().items()}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        for start, part in self._saved().items():
            part.set_state({name.removeprefix(start): each for name, each in state.items() if name.startswith(start)})


class CallableController:
    """Wraps a plain function from sensation to activation.

    Attributes:
        name: Name of the function, for the run file.

    Example::

        controller = CallableController(lambda s: 0.5 + 0.5 * np.sin(s.time_s - np.arange(3)), n_muscles=3)
    """

    def __init__(
        self, function: Callable[[Sensation], ArrayLike], n_muscles: int, on_reset: Callable[[int], None] | None = None
    ) -> None:
        """Wraps a function.

        Args:
            function: Takes the present `Sensation`; returns activation in [0, 1], shape ``(n_muscles,)``, or
                one number for all muscles. Called once per control step.
            n_muscles: Number of muscles of the worm.
            on_reset: Called with the seed at every reset, for functions that keep a state.
        """
        self.name = getattr(function, "__name__", type(function).__name__)
        self._function = function
        self._n_muscles = n_muscles
        self._on_reset = on_reset

    def reset(self, seed: int) -> None:
        """Passes the seed on to ``on_reset``."""
        if self._on_reset is not None:
            self._on_reset(seed)

    def step(self, sensation: Sensation) -> Array:
        """Calls the function and checks what it returns.

        Raises:
            ConfigError: The activation is no number, has another shape, or leaves [0, 1].
        """
        result, n, time_s = self._function(sensation), self._n_muscles, sensation.time_s
        try:
            activation = np.array(result, dtype=np.float64)
        except (TypeError, ValueError):
            raise ConfigError(
                f"the controller function returned {type(result).__name__} at {time_s:g} s; it must return {n} numbers "
                "in [0, 1]"
            ) from None
        if activation.ndim == 0:
            activation = np.full(n, activation)
        if activation.shape != (n,):
            raise ConfigError(
                f"the controller function returned shape {activation.shape} at {time_s:g} s; it must return shape "
                f"({n},)"
            )
        within = (activation >= 0.0) & (activation <= 1.0)
        if not within.all():
            worst = int(np.argmin(within))
            raise ConfigError(
                f"the controller function returned activation {activation[worst]:g} for muscle {worst + 1} at "
                f"{time_s:g} s; it must lie in [0, 1]"
            )
        return activation
