"""Error bars of a run: from calibrated parameters, from the time step, and from the discretization."""

from annelid.experiment.uncertainty.parameters import Spread, read_spread
from annelid.experiment.uncertainty.quantities import Quantity
from annelid.experiment.uncertainty.report import uncertainty_table, write_uncertainty
from annelid.experiment.uncertainty.study import Uncertainty, VariantRun, uncertainty

__all__ = [
    "Quantity",
    "Spread",
    "Uncertainty",
    "VariantRun",
    "read_spread",
    "uncertainty",
    "uncertainty_table",
    "write_uncertainty",
]
