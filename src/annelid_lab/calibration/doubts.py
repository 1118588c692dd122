"""What a fit cannot know, in sentences that say what to measure next."""

from __future__ import annotations

from collections.abc import Sequence
from math import exp

import numpy as np

from annelid.protocols import Array
from annelid_lab.calibration.base import shown_in
from annelid_lab.calibration.fit import Fit, Part
from annelid_lab.calibration.intervals import Intervals

UNKNOWN = 0.3
"""Relative error of a combination of parameters above which the data do not determine it."""
ALIKE = 0.9
"""Correlation above which two parameters are not told apart."""
WRONG = 1.25
"""How many times as far as noise and scatter explain points lie from a model that lacks something. The rms of 180
independent points varies by 5 %, a noise estimated from 800 samples by 3 %; a walk's depend on each other."""
LEAST_WRONG = 0.01
"""Of the standard deviation of the points: what is less does not matter."""
LEAST_INSIDE = 0.5
"""Share of the points held out that must lie in their predicted intervals."""
UNLIKE = 0.5
"""Rms of a fit, of the standard deviation of the points, above which they are those of another robot."""


def doubts(fit: Fit, known: Intervals) -> tuple[str, ...]:
    """Says what the data do not determine, what the model lacks, and what is wrong with the data."""
    found = confused(fit.names, known.correlation, known.errors, known.directions)
    for name in fit.at_bound:
        found.append(f"{name} ends at a bound of the study: widen it if the robot may lie beyond")
    if fit.rival is not None:
        logs, ratio = fit.rival
        other = ", ".join(f"{name} = {value:.3g}" for name, value in zip(fit.names, np.exp(logs), strict=True))
        found.append(
            f"{other} fits {'as well' if ratio < 1.05 else f'nearly as well (rms {ratio:.2f} times as large)'}: "
            "a prior or another experiment must say which of the two it is"
        )
    for part in fit.parts:
        found += [f"{part.experiment.name}: {sentence}" for sentence in [*part.doubts, *_lacking(part)]]
    for name, (n, inside) in known.held_out.items():
        if inside < LEAST_INSIDE * n:
            found.append(
                f"{name}: {inside} of {n} points held out lie in their predicted intervals: the model lacks something "
                "that acts there, or a parameter of it is not fitted"
            )
    return tuple(found)


def confused(names: Sequence[str], correlation: Array, errors: Array, directions: Array) -> list[str]:
    """Says which parameters the data cannot tell apart.

    Args:
        names: Of the parameters, ``(p,)``.
        correlation: Of the errors of their logarithms, ``(p, p)``.
        errors: Relative errors of independent combinations, greatest first, ``(p,)``.
        directions: The combinations, ``(p, p)``.
    """
    found: list[str] = []
    for error, direction in zip(errors, directions, strict=True):
        if error <= UNKNOWN:
            continue
        direction = direction / direction[np.abs(direction).argmax()]
        shares = [(n, float(s)) for n, s in zip(names, direction, strict=True) if abs(s) > 0.1]
        up = [name for name, share in shares if share > 0]
        down = [name for name, share in shares if share < 0]
        if len(shares) == 1:
            found.append(
                f"the data do not determine {up[0]}: its relative error is {error:.3g}; fix it, or add an experiment "
                "that depends on it"
            )
        else:
            how = f"raising {' and '.join(up)}" + (f" while lowering {' and '.join(down)}" if down else "")
            by = f"by {exp(error) - 1:.0%}" if error < 1.0 else "by any factor"
            found.append(f"the data do not tell {' and '.join(n for n, _ in shares)} apart: {how} {by} changes nothing")
    pairs = [(names[k], names[i], correlation[i, k]) for i in range(len(names)) for k in range(i)]
    return found + [f"{one} and {other} are correlated by {by:+.2f}" for one, other, by in pairs if abs(by) > ALIKE]


def _lacking(part: Part) -> list[str]:
    """Says that the points are those of another robot, or lie farther from the model than noise and scatter explain."""
    if not part.is_fitted:
        return []
    means = np.bincount(part.data.series, part.data.values) / np.maximum(np.bincount(part.data.series), 1)
    changes = float(np.sqrt(((part.data.values - means[part.data.series]) ** 2).mean()))
    factor, unit = shown_in(part.data.unit, part.rms)
    if part.rms > UNLIKE * changes:
        return [
            f"the fitted worm lies {part.rms / factor:.2g}{unit} from the points (rms), which change by "
            f"{changes / factor:.2g}{unit} (standard deviation): are they of another robot or gait, or is a signal "
            "another one than the map says?"
        ]
    if part.floor is None:
        return []
    explained = float(np.sqrt((part.floor**2 + np.diag(part.scatter)).mean()))
    if part.rms <= max(WRONG * explained, LEAST_WRONG * changes):
        return []
    return [
        f"the fitted worm lies {part.rms / factor:.2g}{unit} from the points (rms), where noise and scatter explain "
        f"{explained / factor:.2g}{unit}. The model lacks something, or the sensors drift. Compare signal by signal "
        "with `annelid compare`, measure single segments in a load frame, or free a further parameter"
    ]
