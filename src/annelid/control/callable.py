"""A user's own function as a controller."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from annelid.errors import ConfigError
from annelid.protocols import Array, Sensation


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
        result, n, time = self._function(sensation), self._n_muscles, f"at {sensation.time_s:g} s; it must"
        returned = "the controller function returned"
        try:
            activation = np.array(result, dtype=np.float64)
        except (TypeError, ValueError):
            problem = f"{returned} {type(result).__name__} {time} return {n} numbers in [0, 1]"
            raise ConfigError(problem) from None
        if activation.ndim == 0:
            activation = np.full(n, activation)
        if activation.shape != (n,):
            raise ConfigError(f"{returned} shape {activation.shape} {time} return shape ({n},)")
        within = (activation >= 0.0) & (activation <= 1.0)
        if not within.all():
            worst = int(np.argmin(within))
            raise ConfigError(
                f"{returned} activation {activation[worst]:g} for muscle {worst + 1} {time} lie in [0, 1]"
            )
        return activation
