"""From a run to numbers: rhythm, elongation, forces, travel, gait."""

from annelid.analysis.gait import Gait, gait
from annelid.analysis.rhythm import RhythmScore, lengthening_score, rhythm_score
from annelid.analysis.summary import Summary, summary

__all__ = ["Gait", "RhythmScore", "Summary", "gait", "lengthening_score", "rhythm_score", "summary"]
