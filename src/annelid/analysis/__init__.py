"""From a run to numbers: rhythm, elongation, forces, travel."""

from annelid.analysis.score import RhythmScore, lengthening_score, rhythm_score
from annelid.analysis.summary import Summary, summary

__all__ = ["RhythmScore", "Summary", "lengthening_score", "rhythm_score", "summary"]
