"""What the tests ask of rods beyond what a plant shows."""

from __future__ import annotations

from annelid.body.formulations.rods.mechanics import RodMechanics
from annelid.simulation.worm import WormPlant


def rods_of(plant: WormPlant) -> RodMechanics:
    """What steps a worm of rods."""
    assert isinstance(plant.mechanics, RodMechanics)
    return plant.mechanics
