"""Controllers of circuits without a body, and what a body would feel."""

from __future__ import annotations

from typing import Any

import numpy as np

from annelid import load_config
from annelid.control import CircuitController
from annelid.protocols import SIDES, Array, Sensation

REST_M = 0.07


def controller(
    kind: str = "sns",
    n_segments: int = 3,
    n_muscles: int | None = None,
    timestep_s: float = 0.001,
    sensor: dict[str, float] | None = None,
    **fields: Any,
) -> CircuitController:
    """A controller of a kind; its first sensor is not kept off at the start unless ``sensor`` says so."""
    config = load_config(
        {"controller": {"kind": kind, **fields}, "sensor": {"startup_hold_s": 0.0, **(sensor or {})}},
        {"body.mesh.n_segments": n_segments},
    )
    config = config.model_copy(update={"clock": config.clock.model_copy(update={"control_timestep_s": timestep_s})})
    made: Any = config.controller
    return CircuitController(made.circuit(config, n_segments), n_muscles or n_segments, timestep_s)


def felt(
    longer_m: Any, time_s: float = 0.0, touch_N: Array | None = None, rate_m_per_s: Array | None = None
) -> Sensation:
    """What a worm feels whose segments are so much longer than at rest, by one or several sensors each."""
    longer = np.asarray(longer_m, dtype=float)
    longer = longer if longer.ndim > 1 else longer[:, np.newaxis]
    n = len(longer)
    return Sensation(
        time_s,
        REST_M + longer,
        np.full(longer.shape, REST_M),
        np.zeros(n),
        np.zeros(n),
        np.zeros((n, 3)),
        np.zeros(3),
        touch_N=np.zeros((n, len(SIDES))) if touch_N is None else touch_N,
        stretch_rate_m_per_s=np.zeros((0, 0)) if rate_m_per_s is None else rate_m_per_s,
    )


def potential(one: CircuitController) -> dict[str, float]:
    """Present potentials by the names of the neurons."""
    return dict(zip(one.stepper.arrays.neurons, one.potential_mV.tolist(), strict=True))
