"""The published numbers that a run of the same worm is laid beside."""

from __future__ import annotations

from dataclasses import dataclass

from annelid.analysis.robot import ROBOT_ELONGATION_M
from annelid.config import PlanarBody, RunConfig, SnsController

PAPER_2023 = "Riddle et al. 2023"
PAPER_2022 = "Riddle et al. 2022"


@dataclass(frozen=True, slots=True)
class Published:
    """One published number.

    Attributes:
        value: In the unit of the summary's field: one number, one number a segment, or words.
        paper: Where it was published.
        place: Where in it.
    """

    value: float | tuple[float, ...] | str
    paper: str
    place: str


def published(config: RunConfig) -> dict[str, Published]:
    """Returns what has been published of the configured worm, keyed by the fields of `Summary`.

    Numbers are given for the configurations named after a paper, whatever else was overridden but the kind of
    controller: the three-segment worm of ``riddle2023`` and its rods, the four-segment robot ``wang``, and the planar
    worms of ``riddle2022`` with the gate time constants and gains that go together. For all others the result is
    empty.
    """
    if not isinstance(config.controller, SnsController):
        return {}
    if config.name.startswith("riddle2023") and config.body.n_segments == 3:
        return dict(_RIDDLE_2023)
    if config.name == "wang" and config.body.n_segments == len(ROBOT_ELONGATION_M):
        return dict(_ROBOT)
    if config.name.startswith("riddle2022") and isinstance(config.body, PlanarBody):
        key = (
            config.body.n_segments,
            config.controller.gate_time_constant_ms,
            config.body.gain,
        )
        period_s = _PLANAR_PERIODS_S.get(key)
        if period_s is not None:
            return {
                "period_s": Published(period_s, PAPER_2022, "the authors' code"),
                "order": Published("1-2-3..", PAPER_2022, "Fig. 4"),
            }
    return {}


_RIDDLE_2023 = {
    "order": Published("1-2-3", PAPER_2023, "Fig. 7"),
    "elongation_first_helix_pp_m": Published((0.0420, 0.0255, 0.0402), PAPER_2023, "section 3"),
    # Segment 2 below segment 1, and segment 1 versus 3.
    "middle_deficit": Published(0.394, PAPER_2023, "section 3"),
    "end_difference": Published(0.0445, PAPER_2023, "section 3"),
    "contraction_force_median_N": Published("up to 2.5 N", PAPER_2023, "section 2.2"),
    "travel_m": Published("negligible", PAPER_2023, "section 5"),
    # 5000 steps of 1 ms in 3.5 min.
    "real_time_factor": Published(5.0 / 210.0, PAPER_2023, "section 3"),
}

_ROBOT = {
    "order": Published("1-2-3-4", PAPER_2023, "Fig. 9"),
    "elongation_mean_max_m": Published(ROBOT_ELONGATION_M, PAPER_2023, "section 4"),
}

# (segments, tau_h,max in ms, gain): period in s.
_PLANAR_PERIODS_S = {
    (3, 300.0, 1.3): 2.625,
    (6, 300.0, 1.3): 5.250,
    (3, 200.0, 1.9): 1.867,
    (6, 200.0, 1.9): 3.734,
    (3, 100.0, 3.6): 1.124,
    (6, 100.0, 3.6): 2.248,
}
