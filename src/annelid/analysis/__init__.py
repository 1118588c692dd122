"""From a run to numbers: rhythm, elongation, forces, travel."""

from annelid.analysis.summary import Summary, summary

__all__ = ["Summary", "summary"]
