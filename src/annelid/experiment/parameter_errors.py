"""What is uncertain about a worm's body, by how much, and Monte Carlo samples of it.

Errors and their correlations are those of a fit as ``annelid calibrate`` writes it;
the one that comes with annelid is of the load frame alone. They are relative, about the run's own values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources
from math import exp, inf, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from annelid.body.actuators.servo import wrap_factors
from annelid.config import RunConfig, field_value, fields_of
from annelid.errors import ConfigError, UnreadableText, suggest
from annelid.experiment.search_space import unit_samples
from annelid.morphology import Array
from annelid.textfiles import parse_json, read_text

CABLE = "cable_friction"
FIELDS: Mapping[str, tuple[str, ...]] = {
    "young_modulus": ("body.strands.young_modulus_Pa", "body.strands.shear_modulus_Pa"),
    "dry_friction": ("body.joints.dry_friction_Nm",),
    CABLE: ("body.rings.peak_force_N", "body.rings.force_limit_N"),
    "softening_strain": (),
    "damping_time": ("body.strands.damping_time_s",),
    "spring_rate": ("body.springs.stiffness_N_per_m",),
    "spring_rest_length": ("body.springs.rest_length_m",),
    "viscous_friction": ("body.joints.viscous_friction_Nms_per_rad",),
    "floor_friction": ("arena.friction",),
}
"""What can be varied, and the fields that it scales: what a fit may change, and the floor. The shear modulus keeps its
ratio to Young's. The cable's friction scales the rings' force by the mean tension of a cable, ``(1 - exp(-m)) / m`` of
that at its pulled end. By default what the load frame can distinguish is varied: the first
three. The others have no error that anyone has measured."""
CALIBRATION = "calibration.json"
LEAST_EIGENVALUE = -1e-6
ABSENT, UNMEASURED, EXACT = "0 or not set in this worm", "its error is not known", "its error is 0"
"""Why a parameter is not varied."""


@dataclass(frozen=True, eq=False)
class Spread:
    """How uncertain parameters are.

    Attributes:
        names: The parameters, of `FIELDS`, ``(p,)``.
        relative_error: Standard deviation of the logarithm of each, ``(p,)``.
        correlation: Of those, ``(p, p)``.
        source: Where the errors come from.
        cable_exponent: m, friction of the cable times its wrap angle, where that is uncertain.
    """

    names: tuple[str, ...]
    relative_error: Array
    correlation: Array
    source: str
    cable_exponent: float | None = None

    def but(self, errors: Mapping[str, float]) -> Spread:
        """Returns the spread with other errors, by parameter; those that it lacks are correlated with none.

        Raises:
            ConfigError: An unknown parameter, an error out of range, or the cable's without its exponent.
        """
        for name, error in errors.items():
            if name not in FIELDS:
                raise ConfigError(f"unknown parameter {name!r}: {suggest(name, FIELDS)}")
            if not 0.0 <= error < 1.0:
                raise ConfigError(f"relative error of {name} = {error:g} must be at least 0 and below 1")
        if CABLE in errors and self.cable_exponent is None:
            raise ConfigError(f"{CABLE} cannot be varied: {self.source} has no value of it")
        known = dict(zip(self.names, self.relative_error.tolist(), strict=True)) | dict(errors)
        correlation = np.eye(len(known))
        correlation[: len(self.names), : len(self.names)] = self.correlation
        source = f"{self.source}; {', '.join(f'{name} as given' for name in errors)}" if errors else self.source
        return Spread(tuple(known), np.array(list(known.values())), correlation, source, self.cable_exponent)


class _Parameter(BaseModel):
    value: float
    relative_error: float | None


class _Fit(BaseModel):
    """What is read of a ``calibration.json``; None is what cannot be known from the fit."""

    parameters: dict[str, _Parameter]
    correlation: list[list[float | None]]


def read_spread(path: Path | None = None) -> Spread:
    """Reads the errors of a fit.

    Args:
        path: A ``calibration.json`` of ``annelid calibrate``; None for the one that comes with annelid.

    Returns:
        Its parameters with their errors and correlations.

    Raises:
        ConfigError: The file cannot be read, is no such file, or a parameter's error is not finite.
    """
    bundled = resources.files("annelid") / "data" / CALIBRATION
    text = bundled.read_text(encoding="utf-8") if path is None else read_text(path)
    try:
        fit = _Fit.model_validate(parse_json(text, str(path)))
        fitted, correlation = fit.parameters, np.array(fit.correlation, dtype=float)
        if correlation.shape != (len(fitted), len(fitted)):
            raise ValueError("shape")
    except UnreadableText:
        raise
    except (ValueError, OverflowError):
        raise ConfigError(f"{path} is no calibration.json of `annelid calibrate`") from None
    for name, parameter in fitted.items():
        if name not in FIELDS:
            raise ConfigError(f"{path} has an unknown parameter {name!r}: {suggest(name, FIELDS)}")
        if parameter.relative_error is None or not 0.0 <= parameter.relative_error < inf:
            raise ConfigError(
                f"{path} does not determine {name}: its relative error is not finite; fit fewer with --free"
            )
    if not (
        np.isfinite(correlation).all()
        and np.allclose(correlation, correlation.T)
        and np.allclose(np.diag(correlation), 1.0)
        and (np.linalg.eigvalsh(correlation) > LEAST_EIGENVALUE).all()
    ):
        raise ConfigError(f"{path}: correlation must be symmetric and positive, with ones on its diagonal")
    return Spread(
        tuple(fitted),
        np.array([parameter.relative_error for parameter in fitted.values()]),
        correlation,
        "annelid calibrate" if path is None else str(path),
        fitted[CABLE].value if CABLE in fitted else None,
    )


def applicable(config: RunConfig, spread: Spread) -> tuple[Spread, dict[str, str]]:
    """Returns the spread of those parameters that change a 3D worm, and the reason of every other one by its name."""
    if config.body.elements is None:
        raise ConfigError(
            f"body.kind = {config.body.kind!r} has no calibrated parameters and no elements, so no error bars; they "
            "are for the 3D worm (body.kind = 'worm'). --check shows what the step changes, a sweep what a field does"
        )
    left_out: dict[str, str] = {}
    errors = dict(zip(spread.names, spread.relative_error.tolist(), strict=True))
    for name in FIELDS:
        if not scaled_fields(config, name):
            left_out[name] = ABSENT
        elif not errors.get(name):
            left_out[name] = EXACT if name in errors else UNMEASURED
    kept = [i for i, name in enumerate(spread.names) if name not in left_out]
    chosen = replace(
        spread,
        names=tuple(spread.names[i] for i in kept),
        relative_error=spread.relative_error[kept],
        correlation=spread.correlation[np.ix_(kept, kept)],
    )
    return chosen, left_out


def draw(n: int, spread: Spread, seed: int) -> Array:
    """Draws relative changes in the logarithm: normal numbers with exactly the errors and correlations asked for.

    They are the numbers nearest to a Latin hypercube of independent normal ones whose sample has mean 0 and covariance
    1, then correlated and scaled. An answer that is linear in them scatters exactly as linear propagation says, where a
    few independent draws correlate by chance. Fewer than p + 1 worms cannot have such a sample: theirs lies in a
    subspace drawn at random and has the same total variance.

    Returns:
        The changes of p parameters in each of n >= 2 samples, ``(n, p)``.
    """
    from scipy.special import ndtri

    p = len(spread.names)
    if not p:
        return np.empty((n, 0))
    # Clear of 0 and 1, where the normal numbers are infinite.
    normal = ndtri(unit_samples("lhs", n, p, seed).clip(1e-9, 1.0 - 1e-9))
    left, _, right = np.linalg.svd(normal - normal.mean(axis=0), full_matrices=False)
    rank = min(n - 1, p)
    independent = sqrt((n - 1) * p / rank) * left[:, :rank] @ right[:rank]
    values, vectors = np.linalg.eigh(spread.correlation)
    root = vectors * np.sqrt(values.clip(min=0.0)) @ vectors.T
    return independent @ root * spread.relative_error


def changes(config: RunConfig, spread: Spread, relative: Array) -> dict[str, Any]:
    """Returns the fields of one Monte Carlo sample by dotted path, from changes of the logarithms, ``(p,)``."""
    changed: dict[str, Any] = {}
    for name, change in zip(spread.names, relative.tolist(), strict=True):
        factor = exp(change)
        if name == CABLE and spread.cable_exponent is not None:
            pulled, drawn = (wrap_factors(m)[0] for m in (spread.cable_exponent, spread.cable_exponent * factor))
            factor = pulled / drawn
        for path, value in scaled_fields(config, name).items():
            changed[path] = [factor * each for each in value] if isinstance(value, tuple) else factor * value
    return changed


def scaled_fields(config: RunConfig, name: str) -> dict[str, Any]:
    """Returns the fields that a parameter scales in this worm by dotted path, with their values."""
    own = fields_of(config)
    values = {path: field_value(config, path) for path in FIELDS[name] if path in own}
    return {path: value for path, value in values.items() if value}
