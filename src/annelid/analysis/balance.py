"""Where the work of a run's muscles went."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, slots=True)
class EnergyBalance:
    """The muscles' work from the first sample of a run to its last, and what became of it, J.

    ``muscle_work = kinetic + elastic + potential + slip + constraints + damping + numerical``. What a worm does not
    have (a planar one no weight) is None and counts as nothing.

    Attributes:
        muscle_work_J: Net work that the ring muscles did on the body.
        kinetic_J: Gain of kinetic energy.
        elastic_J: Gain of the energy of strands and springs.
        potential_J: Gain of the energy of the weight.
        slip_J: Lost to friction of what slides.
        constraints_J: Lost to contacts along their normal and to other constraints; soft contacts may give back.
        damping_J: Lost to dampers.
        numerical_J: What is left: lost to the integrator.
        numerical_share: That over the muscles' work; None without any.
    """

    muscle_work_J: float
    kinetic_J: float
    elastic_J: float
    potential_J: float | None
    slip_J: float | None
    constraints_J: float | None
    damping_J: float
    numerical_J: float
    numerical_share: float | None


def energy_balance(data: xr.Dataset) -> EnergyBalance | None:
    """Reads the balance from a run's signals.

    Args:
        data: The run's variables.

    Returns:
        The balance; None where the worm keeps no books, or there are no two samples.
    """
    booked = ("muscle_work", "kinetic_energy", "elastic_energy", "damping_loss")
    if any(name not in data for name in booked) or data.sizes.get("time", 0) < 2:
        return None
    work, kinetic, elastic, damping = (_gain(data, name) for name in booked)
    optional = ("potential_energy", "slip_loss", "constraint_loss")
    potential, slip, constraint = (_gain(data, name) if name in data else None for name in optional)
    other = None if constraint is None else constraint - (slip or 0.0)
    explained = (kinetic, elastic, damping, potential or 0.0, slip or 0.0, other or 0.0)
    left = work - sum(explained)
    return EnergyBalance(
        muscle_work_J=work,
        kinetic_J=kinetic,
        elastic_J=elastic,
        potential_J=potential,
        slip_J=slip,
        constraints_J=other,
        damping_J=damping,
        numerical_J=left,
        numerical_share=left / work if work else None,
    )


def _gain(data: xr.Dataset, name: str) -> float:
    """What a signal, summed over whatever it is told for, has gained from the first sample to the last."""
    ends = data[name].values[[0, -1]]
    return float(np.sum(ends[1]) - np.sum(ends[0]))
