"""From a run to numbers: rhythm, elongation, forces, travel, turns, slip, gait.

What reads a whole run is loaded at once; the names below it, parts of such readings, on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from annelid.analysis.gait import Gait, gait
from annelid.analysis.rhythm import RhythmScore, lengthening_score, rhythm_score
from annelid.analysis.summary import NUMBERS, Summary, summary
from annelid.lazy import lazy

if TYPE_CHECKING:
    from annelid.analysis.comparison import compare
    from annelid.analysis.elongation import end_difference, interior_deficit, middle_deficit
    from annelid.analysis.energy import Energy, energy_balance
    from annelid.analysis.interval import CONFIDENCE, Estimate, mean_and_interval
    from annelid.analysis.numbers import Number, three_digits
    from annelid.analysis.paper import (
        PAPER_ELONGATION_M,
        PAPER_END_DIFFERENCE,
        PAPER_MIDDLE_DEFICIT,
        ROBOT_ELONGATION_M,
    )
    from annelid.analysis.pipe_passage import Passage, passage_of
    from annelid.analysis.rhythm import (
        CONTRACTED,
        DESIGN_INTERVAL_S,
        SHORTEST_S,
        contractions,
        segment_activation,
        stretches,
    )
    from annelid.analysis.track import Track, forward_position, nearest_frame, nearest_time, track_of

__all__ = [
    "CONFIDENCE",
    "CONTRACTED",
    "DESIGN_INTERVAL_S",
    "NUMBERS",
    "PAPER_ELONGATION_M",
    "PAPER_END_DIFFERENCE",
    "PAPER_MIDDLE_DEFICIT",
    "ROBOT_ELONGATION_M",
    "SHORTEST_S",
    "Energy",
    "Estimate",
    "Gait",
    "Number",
    "Passage",
    "RhythmScore",
    "Summary",
    "Track",
    "compare",
    "contractions",
    "end_difference",
    "energy_balance",
    "forward_position",
    "gait",
    "interior_deficit",
    "lengthening_score",
    "mean_and_interval",
    "middle_deficit",
    "nearest_frame",
    "nearest_time",
    "passage_of",
    "rhythm_score",
    "segment_activation",
    "stretches",
    "summary",
    "three_digits",
    "track_of",
]

_MOVED = tuple(f"annelid_studies.{home}" for home in ("slip_detector", "slip", "turning", "riddle2023.figures.rhombi"))
_COST = "use annelid_studies.slip.speed_and_loss"
__getattr__, __dir__ = lazy(__name__, {"slip_cost": _COST, "SlipCost": _COST}, now=_MOVED)
