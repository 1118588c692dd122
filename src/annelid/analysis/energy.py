"""The balance of a run's energy: where the muscles' work went."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from annelid.analysis.numbers import number
from annelid.simulation.runfile import Recorded


@dataclass(frozen=True, kw_only=True)
class Energy:
    """The muscles' work from the first sample of a run to its last, and what became of it.

    ``muscle_work = kinetic + elastic + potential + slip + constraints + damping + numerical``. What a worm does not
    have (a planar one no weight) is None and counts as nothing; all is None where energies were not recorded.
    """

    energy_muscle_work_J: float | None = number("net work of all muscles in the whole run", "muscles' net work", "J")
    energy_kinetic_J: float | None = number("gain of kinetic energy")
    energy_elastic_J: float | None = number("gain of the energy of strands and springs")
    energy_potential_J: float | None = number("gain of the energy of the weight")
    energy_slip_J: float | None = number("lost to friction of what slides", "lost to slip", "J")
    energy_constraints_J: float | None = number(
        "lost to contacts along their normal, other constraints and outside forces; soft contacts may give back"
    )
    energy_damping_J: float | None = number("lost to dampers")
    energy_numerical_J: float | None = number("what is left: lost to the integrator")
    energy_numerical_share: float | None = number("that over the muscles' work")


def energy_balance(data: Mapping[str, Recorded]) -> Energy:
    """Reads the balance from a run's signals; all is None without energies, or without two samples."""
    recorded = ("muscle_work", "kinetic_energy", "elastic_energy", "damping_loss")
    optional = ("potential_energy", "slip_loss", "constraint_loss")
    if any(name not in data for name in recorded) or data["time"].values.size < 2:
        return Energy()
    work, kinetic, elastic, damping = (_summed_gain(data, name) for name in recorded)
    potential, slip, constraint = (_summed_gain(data, name) if name in data else None for name in optional)
    other = None if constraint is None else constraint - (slip or 0.0)
    left = work - sum((kinetic, elastic, damping, potential or 0.0, slip or 0.0, other or 0.0))
    return Energy(
        energy_muscle_work_J=work,
        energy_kinetic_J=kinetic,
        energy_elastic_J=elastic,
        energy_potential_J=potential,
        energy_slip_J=slip,
        energy_constraints_J=other,
        energy_damping_J=damping,
        energy_numerical_J=left,
        energy_numerical_share=left / work if work else None,
    )


def _summed_gain(data: Mapping[str, Recorded], name: str) -> float:
    """What a signal, summed over muscles or segments, has gained from the first sample to the last."""
    ends = data[name].values[[0, -1]]
    return float(np.sum(ends[1]) - np.sum(ends[0]))
