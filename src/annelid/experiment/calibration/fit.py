"""Fits the rod worm's material, springs and friction to a measured load-frame loop.

What a load frame sees of them: Young's modulus E (with the shear modulus at a fixed ratio) and the axial springs' rate
and rest length give the part that is the same on both ways; dry friction of the crossings a difference that does not
grow with the load; friction of the cable round the ring (`loop.wrap_factors`) a difference in
proportion to the load. Pins pressed harder by a greater load would do the same: one loop cannot tell them from the
cable, which is taken because it needs no law of its own. Viscous and dry friction differ in how they grow with speed,
of which one loop has just one: viscous friction is fitted only where it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from importlib import import_module

import numpy as np

from annelid.config import RunConfig, load_config
from annelid.errors import ConfigError, suggest
from annelid.experiment.calibration.frame import load_frame
from annelid.experiment.calibration.loop import Loop, cable_force
from annelid.experiment.case import SHEAR_OVER_YOUNG
from annelid.morphology import Array

SPACINGS, N_FORCES = 22, 20
"""The measured way is divided evenly; forces are compared at so many of the divisions, on each way."""
STEP = 0.04
"""Relative step of the derivatives, above the scatter of a mesh that buckles a little differently each time."""
MOST_EVALUATIONS = 12
"""Evaluations of the optimiser beside those for derivatives."""


@dataclass(frozen=True)
class Parameter:
    """One thing that the fit may change.

    Attributes:
        name: What it is called.
        unit: Its unit.
        start: First guess.
        low: Smallest value tried.
        high: Greatest value tried.
        fields: The fields that it sets, by dotted path, and what each is of its value; the cable's friction sets none.
    """

    name: str
    unit: str
    start: float
    low: float
    high: float
    fields: Mapping[str, float]


_MODULUS = {"body.strands.young_modulus_Pa": 1.0, "body.strands.shear_modulus_Pa": SHEAR_OVER_YOUNG}
PARAMETERS = {
    parameter.name: parameter
    for parameter in (
        Parameter("young_modulus", "Pa", 6e8, 5e7, 5e9, _MODULUS),
        Parameter("dry_friction", "N m", 0.01, 1e-4, 0.2, {"body.joints.dry_friction_Nm": 1.0}),
        Parameter("cable_friction", "1", 1.4, 1e-3, 4.0, {}),
        Parameter("spring_rate", "N/m", 24.5, 2.0, 100.0, {"body.springs.stiffness_N_per_m": 1.0}),
        Parameter("spring_rest_length", "m", 0.065, 0.05, 0.0748, {"body.springs.rest_length_m": 1.0}),
        Parameter("viscous_friction", "N m s/rad", 0.02, 1e-4, 5.0, {"body.joints.viscous_friction_Nms_per_rad": 1.0}),
    )
}
"""What can be fitted."""
DEFAULT_FREE = ("young_modulus", "dry_friction", "cable_friction")
"""What one loop can tell apart; springs and strands resist alike, so that their stiffnesses only shift between them."""

Simulate = Callable[[RunConfig], Loop]
FitProgress = Callable[[int, float], object]
"""Called with the number of loops simulated and the root mean square error, N, after each."""


@dataclass(frozen=True)
class Calibration:
    """A fit.

    Attributes:
        names: The free parameters, ``(p,)``.
        values: Their fitted values in the units of `PARAMETERS`, ``(p,)``.
        at_m: Displacements compared, ``(k,)``.
        measured_N: Loading and unloading, ``(2, k)``.
        fitted_N: The same of the fitted worm, ``(2, k)``.
        jacobian_N: Change of force for a relative change of each parameter, ``(2 k, p)``.
        measured: The measured loop.
        simulated: The fitted worm's loop.
        n_loops: Loops simulated.
    """

    names: tuple[str, ...]
    values: Array
    at_m: Array
    measured_N: Array
    fitted_N: Array
    jacobian_N: Array
    measured: Loop
    simulated: Loop
    n_loops: int

    @property
    def residual_N(self) -> Array:
        """Fitted less measured force, ``(2, k)``."""
        return self.fitted_N - self.measured_N

    @property
    def rms_N(self) -> Array:
        """Root mean square error on loading, on unloading, and on both, ``(3,)``."""
        square = self.residual_N**2
        return np.sqrt([*square.mean(axis=1), square.mean()])

    @property
    def bounded(self) -> tuple[str, ...]:
        """Parameters that the fit left at a bound of theirs, so that their value is the bound's and not the data's."""
        chosen = zip(self.names, self.values.tolist(), strict=True)
        return tuple(
            name
            for name, value in chosen
            if value < 1.01 * PARAMETERS[name].low or value > 0.99 * PARAMETERS[name].high
        )

    @cached_property
    def identifiability(self) -> Identifiability:
        """What the data can tell of the parameters."""
        return identifiability(self.jacobian_N, float(self.rms_N[2]))

    @property
    def overrides(self) -> dict[str, float]:
        """The configuration's fields by dotted path."""
        return _changes(self.names, self.values)


@dataclass(frozen=True)
class Identifiability:
    """What data can tell of parameters, to first order round a fit.

    Attributes:
        singular_values_N: Of the Jacobian in relative parameters, greatest first, ``(p,)``: a small one is a
            combination of the parameters that hardly changes the force.
        directions: Those combinations, a row each, ``(p, p)``.
        relative_error: Standard error of each parameter relative to its value if residuals were independent, ``(p,)``;
            infinite where the data say nothing.
        correlation: Of the errors, ``(p, p)``: +1 or -1 for two that cannot be told apart.
    """

    singular_values_N: Array
    directions: Array
    relative_error: Array
    correlation: Array


def identifiability(jacobian_N: Array, rms_N: float) -> Identifiability:
    """Analyses a Jacobian.

    Args:
        jacobian_N: Change of each force for a relative change of each parameter, ``(n, p)``.
        rms_N: Error of one force.
    """
    _, singular, directions = np.linalg.svd(jacobian_N, full_matrices=False)
    least = singular.max(initial=0.0) * 1e-10
    inverse = np.divide(1.0, singular, out=np.full_like(singular, np.inf), where=singular > least)
    if np.isfinite(inverse).all():
        covariance = rms_N**2 * (directions.T * inverse**2) @ directions
        error = np.sqrt(np.diag(covariance))
        return Identifiability(singular, directions, error, covariance / np.outer(error, error))
    blind = (np.abs(directions[~np.isfinite(inverse)]) > 1e-6).any(axis=0)
    error = np.where(blind, np.inf, np.nan)
    return Identifiability(singular, directions, error, np.full((len(error), len(error)), np.nan))


def calibrate(
    base: RunConfig,
    measured: Loop,
    *,
    free: Sequence[str] = DEFAULT_FREE,
    simulate: Simulate | None = None,
    progress: FitProgress | None = None,
) -> Calibration:
    """Fits parameters by bounded least squares (`scipy.optimize.least_squares`, trust region reflective).

    Args:
        base: The worm; what is not fitted stays as it is here, and the cable slides freely unless it is fitted.
        measured: The loop to fit.
        free: Names of parameters (`PARAMETERS`).
        simulate: Gives the tension's loop of a worm; by default `load_frame` as far as the measured loop goes.
        progress: Called after every simulated loop.

    Raises:
        ConfigError: A parameter is unknown or none is given.
    """
    names = tuple(dict.fromkeys(free))
    for name in names:
        if name not in PARAMETERS:
            raise ConfigError(f"unknown parameter {name!r}: {suggest(name, PARAMETERS)}")
    if not names:
        raise ConfigError(f"no parameter to fit: name at least one of {', '.join(PARAMETERS)}")
    # Loading it takes a second, which only a fit should pay.
    least_squares = import_module("scipy.optimize").least_squares
    at_m = places(measured)
    wanted = measured.branches(at_m)
    run = simulate or partial(load_frame, displacement_m=_reach(measured))
    kept: dict[tuple[tuple[str, float], ...], Loop] = {}

    def loop_of(values: Array) -> Loop:
        """Simulates each set of fields once: the cable's friction needs no engine."""
        changes = _changes(names, values)
        key = tuple(changes.items())
        if key not in kept:
            kept[key] = run(load_config(base.model_dump(exclude_none=True), changes))
        return cable_force(kept[key], dict(zip(names, values.tolist(), strict=True)).get("cable_friction", 0.0))

    def residual(log_values: Array) -> Array:
        error = (loop_of(np.exp(log_values)).branches(at_m) - wanted).ravel()
        if progress is not None:
            progress(len(kept), float(np.sqrt((error**2).mean())))
        return error

    chosen = [PARAMETERS[name] for name in names]
    result = least_squares(
        residual,
        np.log([parameter.start for parameter in chosen]),
        bounds=np.log([[parameter.low for parameter in chosen], [parameter.high for parameter in chosen]]),
        method="trf",
        jac=lambda log_values: _derivatives(residual, log_values),
        max_nfev=MOST_EVALUATIONS,
        xtol=1e-3,
        ftol=1e-4,
    )
    values = np.exp(result.x)
    simulated = loop_of(values)
    fitted, jacobian = simulated.branches(at_m), np.asarray(result.jac)
    return Calibration(names, values, at_m, wanted, fitted, jacobian, measured, simulated, len(kept))


def places(measured: Loop) -> Array:
    """Displacements at which loops are compared, m, ``(N_FORCES,)``: even, and clear of both ends of the measured way.

    At the start a cable is slack, and where it turns its force falls while cable and joints still stick: over 20 mm on
    the robot, which `cable_force` leaves out.
    """
    return np.arange(1, N_FORCES + 1) / SPACINGS * _reach(measured)


def _derivatives(residual: Callable[[Array], Array], log_values: Array) -> Array:
    """Forward differences with one step for all, which scipy's own would take relative to a logarithm."""
    here = residual(log_values)
    return np.stack([(residual(log_values + step) - here) / STEP for step in STEP * np.eye(len(log_values))], axis=-1)


def _reach(measured: Loop) -> float:
    return float(measured.displacement_m.max())


def _changes(names: Sequence[str], values: Array) -> dict[str, float]:
    chosen = zip(names, values.tolist(), strict=True)
    return {path: share * value for name, value in chosen for path, share in PARAMETERS[name].fields.items()}
