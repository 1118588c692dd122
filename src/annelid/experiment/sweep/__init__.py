"""Sweeps: fields of a configuration varied over a grid or in samples, all runs told in one labelled dataset."""

from annelid.experiment.sweep.dataset import Sweep
from annelid.experiment.sweep.sweeping import sweep, swept

__all__ = ["Sweep", "sweep", "swept"]
