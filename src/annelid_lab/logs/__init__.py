"""Measured logs: read into series in SI units, aligned with a run, and what they agree in."""

from annelid_lab.logs.agreement import Agreement, compare_with_log, run_series
from annelid_lab.logs.maps import Column, LogMap, read_map
from annelid_lab.logs.measured import Measured, read_measured
from annelid_lab.logs.proposal import proposed_map

__all__ = [
    "Agreement",
    "Column",
    "LogMap",
    "Measured",
    "compare_with_log",
    "proposed_map",
    "read_map",
    "read_measured",
    "run_series",
]
