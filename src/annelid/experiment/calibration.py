"""Fits the rod worm's material, springs and friction to a measured load-frame loop.

What a load frame sees of them: Young's modulus E (with the shear modulus at a fixed ratio) and the axial springs' rate
and rest length give the part that is the same on both branches; dry friction of the crossings a difference that does
not grow with the load; friction of the cable round the ring (`wrap_factors`) a difference in proportion to
the load. Pins pressed harder by a greater load would do the same: one loop cannot distinguish them from the cable,
which is taken because it needs no law of its own. Viscous and dry friction differ in how they grow with speed, of which
one loop has just one: viscous friction is fitted only where it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from annelid.config import RunConfig, load_config
from annelid.errors import ConfigError, suggest
from annelid.experiment.case import SHEAR_OVER_YOUNG, absolute, write_worm
from annelid.experiment.load_frame import Loop, cable_force, frame_table, load_frame
from annelid.morphology import Array
from annelid.output import write_json

SPACINGS, N_FORCES = 22, 20
"""The measured displacement is divided evenly; forces are compared at so many of the divisions, on each branch."""
STEP = 0.04
"""Relative step of the derivatives, above the scatter of a mesh that buckles a little differently each time."""
MOST_EVALUATIONS = 12
"""Evaluations of the optimiser beside those for derivatives."""
EQUAL_STIFFNESS: dict[str, Any] = {
    "body.strands.radius_m": 0.00299,
    "body.strands.linear_density_kg_per_m": 571.6 * pi * 0.00299**2,
}
"""The authors' solid strand that bends like their tube, and weighs as much."""


@dataclass(frozen=True)
class Parameter:
    """One thing that the fit may change: from a first guess, between two bounds."""

    name: str
    unit: str
    start: float
    low: float
    high: float
    fields: Mapping[str, float]
    """The fields that it sets, by dotted path, and what each is of its value; the cable's friction sets none."""


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
"""What one loop can distinguish; springs and strands resist alike: their stiffnesses only shift between them."""


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
    def fitted(self) -> dict[str, float]:
        """The fitted values by their parameters' names."""
        return dict(zip(self.names, self.values.tolist(), strict=True))

    @property
    def rms_N(self) -> Array:
        """Root mean square error on loading, on unloading, and on both, ``(3,)``."""
        square = (self.fitted_N - self.measured_N) ** 2
        return np.sqrt([*square.mean(axis=1), square.mean()])

    @property
    def bounded(self) -> tuple[str, ...]:
        """Parameters that the fit left at a bound of theirs, so that their value is the bound's and not the data's."""
        bounds = {name: (1.01 * PARAMETERS[name].low, 0.99 * PARAMETERS[name].high) for name in self.names}
        return tuple(name for name, value in self.fitted.items() if not bounds[name][0] <= value <= bounds[name][1])

    @cached_property
    def identifiability(self) -> Identifiability:
        """How well the data determine the parameters."""
        return identifiability(self.jacobian_N, float(self.rms_N[2]))

    @property
    def overrides(self) -> dict[str, float]:
        """The configuration's fields by dotted path."""
        return _changes(self.fitted)


@dataclass(frozen=True)
class Identifiability:
    """How well data determine parameters, to first order about a fit.

    Attributes:
        singular_values_N: Of the Jacobian in relative parameters, greatest first, ``(p,)``: a small one is a
            combination of the parameters that hardly changes the force.
        directions: Those combinations, a row each, ``(p, p)``.
        relative_error: Standard error of each parameter relative to its value if residuals were independent, ``(p,)``;
            infinite where the data say nothing.
        correlation: Of the errors, ``(p, p)``: +1 or -1 for two that cannot be distinguished.
    """

    singular_values_N: Array
    directions: Array
    relative_error: Array
    correlation: Array


def identifiability(jacobian_N: Array, rms_N: float) -> Identifiability:
    """Analyses a Jacobian, ``(n, p)``, the change of each force for a relative change of each parameter.

    ``rms_N`` is the error of one force.
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
    progress: Callable[[int, float], object] | None = None,
) -> Calibration:
    """Fits parameters by bounded least squares (`scipy.optimize.least_squares`, trust region reflective).

    Args:
        base: The worm; what is not fitted stays as it is here, and the cable slides freely unless it is fitted.
        measured: The loop to fit.
        free: Names of parameters (`PARAMETERS`).
        progress: Called with the number of loops simulated and the root mean square error, N, after each.

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
    from scipy.optimize import least_squares

    at_m = places(measured)
    wanted = measured.branches(at_m)
    reach_m = float(measured.displacement_m.max())
    kept: dict[tuple[tuple[str, float], ...], Loop] = {}

    def loop_of(values: Array) -> Loop:
        """Simulates each set of fields once: the cable's friction needs no engine."""
        fitted = dict(zip(names, values.tolist(), strict=True))
        changes = _changes(fitted)
        key = tuple(changes.items())
        if key not in kept:
            worm = load_config(base.model_dump(exclude_none=True), changes)
            kept[key] = load_frame(worm, displacement_m=reach_m)
        return cable_force(kept[key], fitted.get("cable_friction", 0.0))

    def residual(log_values: Array) -> Array:
        error = (loop_of(np.exp(log_values)).branches(at_m) - wanted).ravel()
        if progress is not None:
            progress(len(kept), float(np.sqrt((error**2).mean())))
        return error

    def derivatives(log_values: Array) -> Array:
        """Forward differences with one step for all, which scipy's own would take relative to a logarithm."""
        here = residual(log_values)
        return np.stack([(residual(log_values + step) - here) / STEP for step in STEP * np.eye(len(names))], axis=-1)

    chosen = [PARAMETERS[name] for name in names]
    result = least_squares(
        residual,
        np.log([parameter.start for parameter in chosen]),
        bounds=np.log([[parameter.low for parameter in chosen], [parameter.high for parameter in chosen]]),
        method="trf",
        jac=derivatives,  # pyright: ignore[reportArgumentType]
        max_nfev=MOST_EVALUATIONS,
        xtol=1e-3,
        ftol=1e-4,
    )
    values = np.exp(result.x)
    simulated = loop_of(values)
    fitted, jacobian = simulated.branches(at_m), np.asarray(result.jac)
    return Calibration(names, values, at_m, wanted, fitted, jacobian, measured, simulated, len(kept))


def places(measured: Loop) -> Array:
    """Displacements at which loops are compared, m, ``(N_FORCES,)``: even, and clear of both ends of the measured ones.

    At the start a cable is slack, and where it turns its force falls while cable and joints still stick: over 20 mm on
    the robot, which `cable_force` leaves out.
    """
    return np.arange(1, N_FORCES + 1) / SPACINGS * float(measured.displacement_m.max())


def _changes(fitted: Mapping[str, float]) -> dict[str, float]:
    return {path: share * value for name, value in fitted.items() for path, share in PARAMETERS[name].fields.items()}


def fit_tables(fit: Calibration) -> list[Table]:
    """Tabulates a fit: its parameters with their errors and correlations, and its forces beside the measured ones."""
    known = fit.identifiability
    table = Table("parameter", "unit", title=f"fit to {fit.measured_N.size} forces from {fit.n_loops} loops")
    for heading in ("value", "error", "largest correlation"):
        table.add_column(heading, justify="right")
    for i, (name, value) in enumerate(fit.fitted.items()):
        others = np.delete(np.arange(len(fit.names)), i)
        worst = others[np.abs(known.correlation[i, others]).argmax()] if len(others) else i
        table.add_row(
            name,
            PARAMETERS[name].unit,
            f"{value:.4g}" + (" (bound)" if name in fit.bounded else ""),
            f"{known.relative_error[i]:.1%}",
            f"{known.correlation[i, worst]:+.2f} {fit.names[worst]}" if len(others) else "",
        )
    table.add_row("singular values", "N", "  ".join(f"{value:.3g}" for value in known.singular_values_N), "", "")
    loading, unloading, both = fit.rms_N
    peak = float(fit.measured_N.max())
    table.add_row("rms in / out / both", "N", f"{loading:.2f} / {unloading:.2f} / {both:.2f}", f"{both / peak:.1%}", "")
    return [table, frame_table({"fitted": fit.simulated, "measured": fit.measured})]


def write_calibration(fit: Calibration, source: str, changes: Mapping[str, Any], path: Path) -> tuple[Path, Path]:
    """Writes all numbers of a fit as JSON, and beside it ``calibrated.toml``, the fitted worm as a file to run.

    The fit started from the preset or file ``source``, with ``changes`` by dotted path.
    """
    known = fit.identifiability
    report = {
        "base": absolute(source),
        "changes": dict(changes),
        "parameters": {
            name: {"value": value, "unit": PARAMETERS[name].unit, "relative_error": _finite(error)}
            for (name, value), error in zip(fit.fitted.items(), known.relative_error.tolist(), strict=True)
        },
        "at_bound": list(fit.bounded),
        "singular_values_N": known.singular_values_N.tolist(),
        "directions": known.directions.tolist(),
        "correlation": [[_finite(value) for value in row] for row in known.correlation.tolist()],
        "rms_N": dict(zip(("loading", "unloading", "both"), fit.rms_N.tolist(), strict=True)),
        "lost_share": {"fitted": fit.simulated.lost_share(), "measured": fit.measured.lost_share()},
        "displacement_m": fit.at_m.tolist(),
        "measured_N": fit.measured_N.tolist(),
        "fitted_N": fit.fitted_N.tolist(),
        "n_loops": fit.n_loops,
    }
    write_json(path, report)
    lines = [f"Fitted to a load frame's loop, {fit.rms_N[2]:.2f} N off (root mean square)."]
    if "cable_friction" in fit.fitted:
        friction = fit.fitted["cable_friction"]
        lines.append(f"Friction of the cable: coefficient times angle {friction:.3g}, no field of the body.")
    fields = dict(changes) | fit.overrides
    rounded = {field: float(f"{value:.4g}") if isinstance(value, float) else value for field, value in fields.items()}
    written = path.with_name("calibrated.toml")
    write_worm(written, source, rounded, lines)
    return path, written


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
