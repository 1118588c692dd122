"""What an identification leaves: numbers as JSON, a picture, tables, and the fitted worm as a file to run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from annelid.experiment import write_worm
from annelid.output import write_json
from annelid_lab.calibration.base import shown_in
from annelid_lab.calibration.doubts import doubts
from annelid_lab.calibration.figure import identify_figure
from annelid_lab.calibration.fit import Fit, fitted
from annelid_lab.calibration.intervals import LEVEL, Intervals, band, intervals
from annelid_lab.calibration.simulations import Simulations
from annelid_lab.calibration.study import IdentifyStudy

REPORT, WORM = "calibration.json", "calibrated.toml"


@dataclass(frozen=True)
class Identified:
    """A study that is fitted.

    Attributes:
        study: The study.
        folder: Where its data lie.
        fit: The fit.
        intervals: What it says of the parameters.
    """

    study: IdentifyStudy
    folder: Path
    fit: Fit
    intervals: Intervals

    @cached_property
    def overrides(self) -> dict[str, Any]:
        """Fields of the fitted worm that differ from the preset, by dotted path."""
        changes = dict(self.study.set)
        for name, one in self.study.parameters.items():
            for field, share in one.fields.items():
                paths = [path for path in self.study.paths(field) if not path.startswith("experiments.")]
                changes |= {path: float(f"{share * self.fit.values[name]:.4g}") for path in paths}
        return changes

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What the fit cannot know, a sentence each."""
        return doubts(self.fit, self.intervals)

    def to_dict(self) -> dict[str, Any]:
        """Returns all numbers, ready for JSON."""
        fit, known = self.fit, self.intervals
        return {
            "study": self.study.model_dump(mode="json", exclude_none=True),
            "parameters": {
                name: {
                    "value": value,
                    "unit": self.study.parameters[name].unit,
                    "relative_error": float(known.relative_error[i]),
                    "low": float(known.profile[i, 0]),
                    "high": float(known.profile[i, 1]),
                    "at_bound": name in fit.at_bound,
                }
                for i, (name, value) in enumerate(fit.values.items())
            },
            "correlation": known.correlation.tolist(),
            "combinations": {"relative_error": known.errors.tolist(), "directions": known.directions.tolist()},
            "warnings": list(self.warnings),
            "experiments": {
                part.experiment.name: {
                    "unit": part.data.unit,
                    "points": len(part.data.at),
                    "effective_points": part.noise.effective_points(part.data),
                    "rms": part.rms,
                    "rms_share": part.rms
                    / max(float(np.abs(of.values).max()) for of in (part.data, part.held) if len(of.at)),
                    "noise_sd": part.noise.noise,
                    "discrepancy_sd": part.noise.discrepancy,
                    "discrepancy_length": part.noise.length,
                    "held_out": known.held_out.get(part.experiment.name, (0, 0))[0],
                    "held_out_inside": known.held_out.get(part.experiment.name, (0, 0))[1],
                    **part.numbers,
                    "at": part.data.at.tolist(),
                    "measured": part.data.values.tolist(),
                    "fitted": part.fitted.tolist(),
                    "held_out_at": part.held.at.tolist(),
                    "held_out_measured": part.held.values.tolist(),
                    "held_out_predicted": part.held_fitted.tolist(),
                    "held_out_half_interval": band(
                        fit, part, part.held, part.held_jacobian, part.held_scatter
                    ).tolist(),
                    "notes": list(part.data.notes),
                }
                for part in fit.parts
            },
            "level": LEVEL,
            "n_tests": fit.n_tests,
        }


def identify(
    study: IdentifyStudy,
    folder: Path,
    simulations: Simulations | None = None,
    note: Callable[[str], object] = lambda _: None,
) -> Identified:
    """Identifies a worm from the experiments of a study.

    Args:
        study: The study.
        folder: Where the files lie that it names.
        simulations: Where tests of worms are computed and kept; None for in this process and in memory.
        note: Called with what was handled in the data, a sentence each.

    Raises:
        ConfigError: A file lies elsewhere, or data do not fit their experiment.
        UnreadableText: A file cannot be read.
        SimulationStopped: The worm that the fit starts from gives way.
    """
    fit, model = fitted(study, folder, Simulations() if simulations is None else simulations)
    for part in fit.parts:
        for sentence in part.data.notes:
            note(f"{part.experiment.name}: {sentence}")
    return Identified(study, folder, fit, intervals(fit, model))


def tables(found: Identified) -> list[Table]:
    """Tabulates parameters with their intervals, and experiments with their errors."""
    fit, known = found.fit, found.intervals
    many = len(found.warnings)
    caption = f"warnings: {many}" if many else "the data tell all parameters apart"
    first = Table("parameter", title=f"{found.study.name}: {fit.n_tests} tests of worms", caption=caption)
    for heading in ("value", "95 % interval", "correlation"):
        first.add_column(heading, justify="right")
    for i, (name, value) in enumerate(fit.values.items()):
        others = np.delete(np.arange(len(fit.names)), i)
        worst = others[np.abs(known.correlation[i, others]).argmax()] if len(others) else i
        factor, unit = shown_in(found.study.parameters[name].unit, value)
        first.add_row(
            name,
            f"{value / factor:.4g}{unit}",
            f"{known.profile[i, 0] / factor:.4g} to {known.profile[i, 1] / factor:.4g}",
            f"{known.correlation[i, worst]:+.2f} {fit.names[worst]}" if len(others) else "",
        )
    second = Table("experiment", title="errors of the experiments, standard deviations of a point")
    for heading in ("rms", "noise", "discrepancy", "points count as", "held out"):
        second.add_column(heading, justify="right")
    for part in fit.parts:
        n, inside = known.held_out.get(part.experiment.name, (0, 0))
        factor, unit = shown_in(part.data.unit, part.rms)
        second.add_row(
            part.experiment.name,
            f"{part.rms / factor:.3g}{unit}",
            f"{part.noise.noise / factor:.3g}{unit}" if part.is_fitted else "",
            f"{part.noise.discrepancy / factor:.3g}{unit}" if part.is_fitted else "",
            f"{part.noise.effective_points(part.data):.1f} of {len(part.data.at)}" if part.is_fitted else "not fitted",
            f"{inside} of {n} inside" if n else "",
        )
    return [first, second]


def write_identified(found: Identified, output: Path) -> list[Path]:
    """Writes the numbers, the fitted worm and the picture into a folder."""
    fit, known = found.fit, found.intervals
    lines = [f"Identified by the study {found.study.name}: value, 95 % interval."]
    for i, (name, value) in enumerate(fit.values.items()):
        factor, unit = shown_in(found.study.parameters[name].unit, value)
        low, high = known.profile[i] / factor
        lines.append(f"  {name}: {value / factor:.4g}{unit}, {low:.4g} to {high:.4g}")
    lines.append(f"Errors for `annelid run --uncertainty-from {REPORT}`.")
    write_worm(output / WORM, found.study.source(found.folder), {"name": found.study.name, **found.overrides}, lines)
    return [
        write_json(output / REPORT, found.to_dict()),
        output / WORM,
        identify_figure(fit, known, output / "calibration"),
    ]
