"""What the tests ask of rods beyond what a plant shows."""

from __future__ import annotations

from annelid.body.formulations.rods.mechanics import RodMechanics
from annelid.body.worm import worm_of
from annelid.config import RunConfig
from annelid.simulation.worm import WormPlant


def rods_of(plant: WormPlant) -> RodMechanics:
    """What steps a worm of rods."""
    assert isinstance(plant.mechanics, RodMechanics)
    return plant.mechanics


def tolerance_window_m(config: RunConfig) -> tuple[float, float] | None:
    """The window of tolerances of a 3D worm on its ground."""
    assert config.arena is not None
    return worm_of(config).tolerance_window_m(config.arena.friction)
