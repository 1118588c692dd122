"""Oscillators as controllers: a stable heteroclinic channel, and a chain of phase oscillators."""

from annelid_studies.oscillators.controllers import HeteroclinicController, PhaseChainController
from annelid_studies.oscillators.phase_chain import PhaseStepper
from annelid_studies.oscillators.shc import HeteroclinicRing, handover_input

__all__ = ["HeteroclinicController", "HeteroclinicRing", "PhaseChainController", "PhaseStepper", "handover_input"]
