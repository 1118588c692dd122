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
    from annelid.analysis.gait import SlipCost, slip_cost
    from annelid.analysis.interval import CONFIDENCE, Estimate, mean_and_interval
    from annelid.analysis.numbers import Number
    from annelid.analysis.paper import (
        PAPER_ELONGATION_M,
        PAPER_END_DIFFERENCE,
        PAPER_MIDDLE_DEFICIT,
        ROBOT_ELONGATION_M,
    )
    from annelid.analysis.passage import Passage, passage_of
    from annelid.analysis.rhombi import (
        Deformation,
        actuated,
        deformation,
        distance_from_ring_m,
        nearest_frame,
        nearest_time,
        plane_means,
        rhombus_diagonals,
        rhombus_plane,
    )
    from annelid.analysis.rhythm import (
        CONTRACTED,
        DESIGN_INTERVAL_S,
        SHORTEST_S,
        contractions,
        segment_activation,
        stretches,
    )
    from annelid.analysis.track import Track, forward_position, track_of, turn_of

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
    "Deformation",
    "Energy",
    "Estimate",
    "Gait",
    "Number",
    "Passage",
    "RhythmScore",
    "SlipCost",
    "Summary",
    "Track",
    "actuated",
    "compare",
    "contractions",
    "deformation",
    "distance_from_ring_m",
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
    "plane_means",
    "rhombus_diagonals",
    "rhombus_plane",
    "rhythm_score",
    "segment_activation",
    "slip_cost",
    "stretches",
    "summary",
    "track_of",
    "turn_of",
]

__getattr__, __dir__ = lazy(__name__, now=("annelid_studies.slip_detector",))
