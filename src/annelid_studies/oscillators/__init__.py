"""Oscillators as controllers: a stable heteroclinic channel, and a chain of phase oscillators."""

from annelid_studies.oscillators.controllers import HeteroclinicController, PhaseChainController
from annelid_studies.oscillators.phase_chain import (
    DriveResponse,
    PhaseNetwork,
    PhaseState,
    PhaseStepper,
    phase_chain,
)
from annelid_studies.oscillators.shc import (
    HeteroclinicRing,
    HeteroclinicStepper,
    handover_input,
    largest_gain_per_s,
)

__all__ = [
    "DriveResponse",
    "HeteroclinicController",
    "HeteroclinicRing",
    "HeteroclinicStepper",
    "PhaseChainController",
    "PhaseNetwork",
    "PhaseState",
    "PhaseStepper",
    "handover_input",
    "largest_gain_per_s",
    "phase_chain",
]
