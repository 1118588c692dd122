"""What a load frame and a calibration leave behind: tables on the screen, CSV, JSON and TOML."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.experiment.calibration.fit import PARAMETERS, Calibration
from annelid.experiment.calibration.loop import MM, Loop
from annelid.experiment.case import absolute, extend
from annelid.output import write_csv, write_json

if TYPE_CHECKING:
    from rich.table import Table

EQUAL_STIFFNESS: dict[str, Any] = {
    "body.strands.radius_m": 0.00299,
    "body.strands.linear_density_kg_per_m": 571.6 * pi * 0.00299**2,
}
"""The authors' solid strand that bends like their tube, and weighs as much."""
DIAMETERS_M = np.arange(10.0, 101.0, 10.0) * MM
"""Changes of diameter at which loops are tabulated."""


def frame_table(loops: Mapping[str, Loop]) -> Table:
    """Tabulates loops side by side: force on both ways, peak, and the share of the work that is lost."""
    from rich.table import Table

    table = Table("diameter change (mm)", title="load frame: force of the cable, wound in / let out (N)")
    columns = []
    for name, loop in loops.items():
        table.add_column(name, justify="right")
        reached = np.arange(10 * MM, loop.displacement_m.max() - 5 * MM, 10 * MM)
        columns.append(loop.branches(reached)[:, 2::3] if len(reached) > 1 else np.empty((2, 0)))
    for row, diameter in enumerate(DIAMETERS_M):
        cells = [f"{c[0, row]:.2f} / {c[1, row]:.2f}" if row < c.shape[1] else "" for c in columns]
        table.add_row(f"{diameter / MM:.0f}", *cells)
    table.add_row("peak (N)", *(f"{loop.force_N.max():.2f}" for loop in loops.values()))
    table.add_row("work lost", *(f"{loop.lost_share():.1%}" for loop in loops.values()))
    return table


def fit_tables(fit: Calibration) -> list[Table]:
    """Tabulates a fit: its parameters with their errors and correlations, and its forces beside the measured ones."""
    from rich.table import Table

    known = fit.identifiability
    table = Table("parameter", "unit", title=f"fit to {fit.measured_N.size} forces from {fit.n_loops} loops")
    for heading in ("value", "error", "largest correlation"):
        table.add_column(heading, justify="right")
    for i, name in enumerate(fit.names):
        others = np.delete(np.arange(len(fit.names)), i)
        worst = others[np.abs(known.correlation[i, others]).argmax()] if len(others) else i
        table.add_row(
            name,
            PARAMETERS[name].unit,
            f"{fit.values[i]:.4g}" + (" (bound)" if name in fit.bounded else ""),
            f"{known.relative_error[i]:.1%}",
            f"{known.correlation[i, worst]:+.2f} {fit.names[worst]}" if len(others) else "",
        )
    singular = "  ".join(f"{value:.3g}" for value in known.singular_values_N)
    table.add_row("singular values", "N", singular, "", "")
    loading, unloading, both = fit.rms_N
    peak = float(fit.measured_N.max())
    table.add_row("rms in / out / both", "N", f"{loading:.2f} / {unloading:.2f} / {both:.2f}", f"{both / peak:.1%}", "")
    return [table, frame_table({"fitted": fit.simulated, "measured": fit.measured})]


def write_loop(loop: Loop, tension: Loop, path: Path) -> None:
    """Writes a simulated loop as CSV with a header.

    Args:
        loop: Displacement and force of the cable.
        tension: The mean tension round the ring at the same displacements.
        path: The file.

    Raises:
        RunFileError: The file cannot be written.
    """
    rows = zip(loop.displacement_m / MM, loop.force_N, tension.force_N, strict=True)
    columns = ["displacement_mm", "force_N", "tension_N"]
    write_csv(path, columns, ([f"{value:.6g}" for value in row] for row in rows))


def write_calibration(fit: Calibration, source: str, changes: Mapping[str, Any], path: Path) -> tuple[Path, Path]:
    """Writes all numbers of a fit as JSON, and beside it ``calibrated.toml``, the fitted worm as a file to run.

    Args:
        fit: The fit.
        source: Preset or TOML file that the fit started from.
        changes: What was changed in it before the fit, values by dotted path.
        path: The JSON file.

    Returns:
        The paths written.

    Raises:
        RunFileError: A file cannot be written.
    """
    known = fit.identifiability
    report = {
        "base": absolute(source),
        "changes": dict(changes),
        "parameters": {
            name: {"value": float(value), "unit": PARAMETERS[name].unit, "relative_error": _number(error)}
            for name, value, error in zip(fit.names, fit.values, known.relative_error, strict=True)
        },
        "at_bound": list(fit.bounded),
        "singular_values_N": known.singular_values_N.tolist(),
        "directions": known.directions.tolist(),
        "correlation": [[_number(value) for value in row] for row in known.correlation],
        "rms_N": dict(zip(("loading", "unloading", "both"), fit.rms_N.tolist(), strict=True)),
        "lost_share": {"fitted": fit.simulated.lost_share(), "measured": fit.measured.lost_share()},
        "displacement_m": fit.at_m.tolist(),
        "measured_N": fit.measured_N.tolist(),
        "fitted_N": fit.fitted_N.tolist(),
        "n_loops": fit.n_loops,
    }
    write_json(path, report)
    written = path.with_name("calibrated.toml")
    lines = [f"Fitted to a load frame's loop, {fit.rms_N[2]:.2f} N off (root mean square)."]
    if "cable_friction" in fit.names:
        friction = float(fit.values[fit.names.index("cable_friction")])
        lines.append(f"Friction of the cable: coefficient times angle {friction:.3g}, no field of the body.")
    fields = dict(changes) | fit.overrides
    rounded = {path: float(f"{value:.4g}") if isinstance(value, float) else value for path, value in fields.items()}
    extend(written, source, rounded, lines)
    return path, written


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
