"""A loop of force against displacement of a ring's cable, measured or simulated, and friction of that cable."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from math import expm1, inf
from pathlib import Path

import numpy as np

from annelid.errors import AnnelidError
from annelid.morphology import Array
from annelid.textfiles import read_text

MEASURED = "segment_load_frame.csv"
MM = 1e-3


@dataclass(frozen=True)
class Loop:
    """The cable is wound in and let out again.

    Attributes:
        displacement_m: How far the cable is wound, ``(n,)``; it rises to its greatest value and falls again.
        force_N: Force of the cable, ``(n,)``.
    """

    displacement_m: Array
    force_N: Array

    @property
    def turn(self) -> int:
        """Index of the turning point."""
        return int(self.displacement_m.argmax())

    def work_J(self) -> tuple[float, float]:
        """Work done by the cable on the way in, and work that it gets back on the way out, J."""
        x, force, turn = self.displacement_m, self.force_N, self.turn
        return (
            float(np.trapezoid(force[: turn + 1], x[: turn + 1])),
            -float(np.trapezoid(force[turn:], x[turn:])),
        )

    def lost_share(self) -> float:
        """Share of the work done that does not come back."""
        done, back = self.work_J()
        return 1.0 - back / done

    def branches(self, at_m: Array) -> Array:
        """Mean force round evenly spaced displacements on both ways.

        Args:
            at_m: Displacements, ``(k,)``, at least two, evenly spaced; a mean reaches half a spacing to both sides.

        Returns:
            Loading first, N, ``(2, k)``.

        Raises:
            AnnelidError: The loop has no sample near one of the displacements.
        """
        half = (at_m[1] - at_m[0]) / 2
        edges = np.append(at_m - half, at_m[-1] + half)
        turn = self.turn
        ways = (slice(None, turn + 1), slice(turn, None))
        force = np.empty((2, len(at_m)))
        for row, way in zip(force, ways, strict=True):
            x = self.displacement_m[way]
            count, _ = np.histogram(x, edges)
            if not count.all():
                raise AnnelidError(
                    f"the loop has no sample near {at_m[int(count.argmin())] / MM:g} mm: it covers "
                    f"{x.min() / MM:.0f} to {x.max() / MM:.0f} mm with {len(x)} samples"
                )
            row[:] = np.histogram(x, edges, weights=self.force_N[way])[0] / count
        return force


def read_loop(path: str | Path | None = None) -> Loop:
    """Reads a measured loop: columns displacement (mm), force (N) and perhaps more, comma-separated, no header.

    Args:
        path: The file; None is the load-frame test that comes with annelid (its source is in ``data/README.md``).

    Raises:
        AnnelidError: The file cannot be read as numbers, or does not go there and back.
    """
    source = resources.files("annelid") / "data" / MEASURED if path is None else Path(path)
    text = read_text(source) if isinstance(source, Path) else source.read_text(encoding="utf-8")
    try:
        table = np.loadtxt(text.splitlines(), delimiter=",", ndmin=2)
    except ValueError as error:
        raise AnnelidError(f"{source} is no table of numbers: {str(error).splitlines()[0]}") from None
    if table.shape[1] < 2:
        raise AnnelidError(f"{source} has {table.shape[1]} column: displacement (mm) and force (N) are needed")
    loop = Loop(table[:, 0] * MM, table[:, 1].copy())
    if not 0 < loop.turn < len(table) - 1:
        raise AnnelidError(f"{source} does not go there and back: its displacement is greatest at an end")
    return loop


def wrap_factors(friction: float) -> tuple[float, float]:
    """Force at the pulled end of a cable over its mean tension, while it is wound in and while it is let out.

    The tension of a cable that slides round a body falls as ``exp(-mu angle)`` from the end that moves first
    (Euler and Eytelwein). With ``m = mu * wrapped angle`` its mean is ``(1 - exp(-m)) / m`` of the force at that end
    when wound in and ``(exp(m) - 1) / m`` when let out, so that the two forces differ by ``exp(m)``.

    Args:
        friction: m, the exponent of the whole wrap; 0 for a cable that slides freely.
    """
    if friction == 0.0:
        return 1.0, 1.0
    return friction / -expm1(-friction), friction / expm1(friction)


def cable_force(loop: Loop, friction: float) -> Loop:
    """Turns the mean tension of a ring's cable into the force at the cable's pulled end.

    Where the cable turns it first sticks: its end keeps pulling less while nothing moves. That transition takes no
    displacement and is left out.

    Args:
        loop: Displacement and mean tension.
        friction: The exponent of the whole wrap, see `wrap_factors`; 0 .. infinity.

    Raises:
        AnnelidError: The exponent is negative or not finite.
    """
    if not 0.0 <= friction < inf:
        raise AnnelidError(f"cable friction = {friction:g} must be a finite number of at least 0")
    inwards, outwards = wrap_factors(friction)
    factor = np.where(np.arange(len(loop.force_N)) <= loop.turn, inwards, outwards)
    return Loop(loop.displacement_m, factor * loop.force_N)
