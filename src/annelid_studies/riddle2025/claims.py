"""The claims of Riddle et al. 2025 and of the authors' scripts, each judged by runs at the points that it is about.

The claims are words in ``claims.toml``. A function of a claim's name, marked by `judges`, measures what the words leave
open and judges it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import isfinite, pi

from annelid.analysis import mean_and_interval
from annelid_studies.papers.judging import Judgement, Judges, claim_of, judged, near
from annelid_studies.papers.report_parts import Claim
from annelid_studies.papers.words import CM, PERCENT, filled, in_unit, texts
from annelid_studies.riddle2025.runs import (
    DRAWS,
    NARROW_M,
    SOFT,
    STIFF,
    STRAIGHT_M,
    TIGHT_M,
    WIDE_M,
    Point,
    Reading,
    cases,
)
from annelid_studies.standard_cases import Effort
from annelid_studies.tables import grouped

CLAIMS_TOML = "riddle2025/claims.toml"
FLAT_M_PER_S = (0.029, 0.048)
"""Speeds on flat ground, of 2 GPa and the wave 3x1; from a secondary source."""
AXIS_M_PER_S = (0.020, 0.044)
"""Vertical axis of the authors' figure of the speed in bends (`Feedback_Control_Model/Turning_Speed_Figures.py`)."""
STRAIGHT_LABEL_M_PER_S = 0.0415
"""Where the label of the straight pipe's speed stands on that axis, its lower edge above the line that it names."""
SMALLEST_DRAWN_M: Mapping[str, float] = {"3x1": 0.7, "3x1, touch": 0.5}
"""Smallest radius, of 0.5 to 1.3 m, whose speed that figure has; smaller ones are taken out in the script."""
CROSSING_M = 0.45
"""Radius above which the paper has stiff bodies faster."""
FRAME_N: Mapping[float, float] = {2.0: 16.05, 1.0: 9.34, 0.3: 4.71}
"""Largest force of the authors' simulated load frame, by Young's modulus, GPa (`Seg3_no_pipe_0.0f_*.csv`)."""
LOOSE_N, TIGHT_N = 15.97, 22.5
"""Of the measured one (`Load_Frame_c.csv`, `Compiled_Instron_164703.xlsx`)."""
PIN_FRICTIONS_NM = (0.0, 0.02, 0.04, 0.08)
"""Of a crossing in our load frame; that of the loose joints is 0.0048 N m (docs/evidence/validation.md)."""
DEPENDS = {
    "rings": "the actuators",
    "modulus_GPa": "the stiffness",
    "friction": "the friction",
    "radius_m": "the radius",
    "half_step": "the step",
}
"""Fields of a point that a verdict may depend on."""
Estimate = tuple[float, float, float]


@dataclass(frozen=True)
class Evidence:
    """What the claims are judged by."""

    readings: Sequence[Reading]
    peaks_N: Mapping[tuple[float, float], float]  # Of our load frame, by Young's modulus, GPa, and friction of a pin

    @cached_property
    def runs(self) -> Mapping[Point, Sequence[Reading]]:
        """The runs of every point, in the order of their draws."""
        return grouped(self.readings, lambda one: one.point)

    def points(self, **fields: object) -> list[Point]:
        """Returns the points at the preset's step whose fields have these values."""
        wanted = {"half_step": False, **fields}
        return [point for point in self.runs if all(getattr(point, name) == of for name, of in wanted.items())]

    def pairs(self, points: Iterable[Point], **fields: object) -> list[tuple[Point, Point]]:
        """Returns each of some points beside that with these fields in place of its own, where both were run."""
        both = ((point, point._replace(**fields)) for point in points)  # type: ignore[arg-type]
        return [(point, other) for point, other in both if other in self.runs]

    def speed(self, point: Point) -> Estimate:
        """Mean and interval of a point's speed, m/s."""
        return mean_and_interval([one.speed_m_per_s for one in self.runs[point]])

    def gain(self, point: Point, other: Point) -> Estimate:
        """Mean and interval of how much faster a point is than another on the same draws, m/s."""
        both = zip(self.runs[point], self.runs[other], strict=False)
        return mean_and_interval([one.speed_m_per_s - its.speed_m_per_s for one, its in both])


JUDGES = Judges[Evidence]()
judges = JUDGES.judge


def claims(evidence: Evidence) -> list[Claim]:
    """Judges every claim."""
    words = texts(CLAIMS_TOML)["claims"]
    return [claim_of(text, JUDGES.get(name), evidence, {}) for name, text in words.items()]


def rule(evidence: Evidence, effort: Effort) -> list[str]:
    """Says how all claims are judged."""
    halved = [
        (evidence.speed(one)[0], evidence.gain(one, one._replace(half_step=False))[0])
        for one in evidence.runs
        if one.half_step
    ]
    problems = [one for one in evidence.readings if one.problem]
    found = {
        "draws": DRAWS[effort],
        "halved": len(halved),
        "apart": max((abs(change / speed) for speed, change in halved if speed), default=None),
        "doubtful": f"{len(problems)} of {len(evidence.readings)}",
    }
    text = texts(CLAIMS_TOML)["rule"]
    return [filled(paragraph, found) for paragraph in (text[effort], *text["paragraphs"])]


def ends(estimate: Estimate) -> tuple[float, float]:
    """The ends of an interval; of a single run its value, twice."""
    mean, low, high = estimate
    return (low, high) if isfinite(low) else (mean, mean)


def shown(estimate: Estimate, scale: float = CM, sign: str = "") -> str:
    """Formats a mean with its interval, in cm or cm/s."""
    mean, *interval = (in_unit(value, scale, sign=sign) for value in estimate)
    return f"{mean} ({' to '.join(interval)})" if isfinite(estimate[1]) else mean


def judgement(found: Sequence[tuple[Point, bool, str]]) -> Judgement:
    """Judges whether points have a property, and joins what is said of each.

    A verdict that rests on something names the field of the point that alone decides it, if one does.
    """
    if not found:
        return ("not testable here", ""), {"found": "not run", "having": 0, "points": 0, "command": ""}
    on = "the point"
    for field, words in reversed(DEPENDS.items()):
        groups = grouped(found, lambda one, field=field: getattr(one[0], field)).values()
        if all(len({has for _, has, _ in group}) == 1 for group in groups):
            on = words
    has = [has for _, has, _ in found]
    said = "; ".join(said for *_, said in found)
    command = cases(found[0][0], 1)[0].command
    return judged(has, on), {"found": said, "having": sum(has), "points": len(has), "command": command}


def compared(evidence: Evidence, pairs: Sequence[tuple[Point, Point]], sign: float = 1.0) -> Judgement:
    """Judges whether the first point of every pair is the faster, or with a sign of -1 the slower."""
    gains = [(pair, evidence.gain(*pair)) for pair in pairs]
    return judgement(
        [
            (pair[0], min(sign * end for end in ends(gain)) > 0, f"{beside(*pair)}: {shown(gain, sign='+')}")
            for pair, gain in gains
        ]
    )


def beside(point: Point, other: Point) -> str:
    """Names a pair of points by what both have, and their friction or radius."""
    words = [point.rings, *([f"{point.modulus_GPa:g} GPa"] if point.modulus_GPa == other.modulus_GPa else [])]
    if point.radius_m:
        return ", ".join([*words, f"{point.radius_m:g} m"])
    both = sorted({point.friction, other.friction})
    return ", ".join([*words, f"friction {' to '.join(f'{one:g}' for one in both)}"])


def within(evidence: Evidence, points: Sequence[Point], limits: tuple[float, float]) -> Judgement:
    """Judges whether the whole interval of every point's speed lies within limits, m/s."""
    speeds = [(point, evidence.speed(point)) for point in points]
    return judgement(
        [
            (
                point,
                limits[0] <= min(ends(speed)) and max(ends(speed)) <= limits[1],
                f"{beside(point, point)}: {shown(speed)}",
            )
            for point, speed in speeds
        ]
    )


def out_of_bends(evidence: Evidence, wanted: Mapping[Point, bool]) -> list[tuple[Point, bool, str]]:
    """Says of each point whether all of its runs come out of the bend, or none, as wanted, and how many do."""
    found = []
    for point, out in wanted.items():
        runs = evidence.runs[point]
        front = shown(mean_and_interval([one.front_m for one in runs]), 1.0)
        n, end_m = sum(one.came_out for one in runs), STRAIGHT_M + point.radius_m * pi / 2
        said = (
            f"{point.worm}, {point.radius_m:g} m: {n} of {len(runs)} out, front at {front} m, the end at {end_m:.2f} m"
        )
        found.append((point, all(isfinite(one.front_m) and one.came_out == out for one in runs), said))
    return found


@judges
def flat_speed(evidence: Evidence) -> Judgement:
    """Every interval of 3x1 at 2 GPa lies in the range."""
    return within(evidence, evidence.points(gait="3x1", modulus_GPa=STIFF, bore_m=0.0), FLAT_M_PER_S)


@judges
def gaits(evidence: Evidence) -> Judgement:
    """3x1 is faster than 2x1 wherever both were run."""
    return compared(evidence, evidence.pairs(evidence.points(gait="3x1", bore_m=0.0), gait="2x1"))


def _more_friction(evidence: Evidence, modulus_GPa: float, sign: float) -> Judgement:
    rings = grouped(evidence.points(gait="3x1", modulus_GPa=modulus_GPa, bore_m=0.0), lambda one: one.rings)
    pairs = [(more, less) for own in rings.values() for less, more in pairwise(own)]
    return compared(evidence, pairs, sign)


@judges
def friction_stiff(evidence: Evidence) -> Judgement:
    """Every step to more friction makes the stiff worm faster."""
    return _more_friction(evidence, STIFF, 1.0)


@judges
def friction_soft(evidence: Evidence) -> Judgement:
    """Every step to more friction makes the soft worm slower."""
    return _more_friction(evidence, SOFT, -1.0)


@judges
def wide_bends(evidence: Evidence) -> Judgement:
    """The stiff worm is faster in every bend above the radius."""
    stiff = [one for one in evidence.points(bore_m=NARROW_M, modulus_GPa=STIFF) if one.radius_m > CROSSING_M]
    return compared(evidence, evidence.pairs(stiff, modulus_GPa=SOFT))


@judges
def tight_bend(evidence: Evidence) -> Judgement:
    """The soft worm comes out of the tight bend, and no other does."""
    at = {"bore_m": NARROW_M, "radius_m": TIGHT_M}
    tight = [*evidence.points(**at), *evidence.points(**at, half_step=True)]
    found = out_of_bends(evidence, {point: point.modulus_GPa == SOFT for point in tight})
    worms = grouped(found, lambda one: (one[0].rings, one[0].half_step)).values()
    return judgement([(of[0][0], all(has for _, has, _ in of), "; ".join(said for *_, said in of)) for of in worms])


@judges
def frame_moduli(evidence: Evidence) -> Judgement:
    """Our load frame's largest forces are near the authors'."""
    ours = {modulus: evidence.peaks_N[modulus, 0.0] for modulus in FRAME_N}
    verdict_of = near((ours[modulus] / paper for modulus, paper in FRAME_N.items()), 1.0, "the stiffness")
    return verdict_of, {"peaks": " / ".join(f"{one:.2f}" for one in ours.values())}


@judges
def screws(evidence: Evidence) -> Judgement:
    """Some friction of the pins raises the force by as much as tighter screws did."""
    peaks = [evidence.peaks_N[STIFF, friction] for friction in PIN_FRICTIONS_NM]
    enough = [peak / peaks[0] >= TIGHT_N / LOOSE_N for peak in peaks]
    return judged(enough, "the friction of the pins"), {
        "peaks": " / ".join(f"{one:.1f}" for one in peaks),
        "frictions": " / ".join(f"{one:g}" for one in PIN_FRICTIONS_NM),
        "ratio": PERCENT * (TIGHT_N / LOOSE_N - 1.0),
    }


@judges
def axis(evidence: Evidence) -> Judgement:
    """Every speed that their figure of the wide pipe draws lies on its axis."""
    drawn = [one for one in evidence.points(gait="3x1", bore_m=WIDE_M) if one.radius_m >= SMALLEST_DRAWN_M["3x1"]]
    return within(evidence, drawn, AXIS_M_PER_S)


@judges
def straight(evidence: Evidence) -> Judgement:
    """The worm of 2026 is as fast in the straight pipe as the label stands high."""
    point = Point("3x1, as in 2026", bore_m=WIDE_M)
    speed = evidence.speed(point)
    found = {"found": shown(speed), "command": cases(point, 1)[0].command}
    return near(ends(speed), STRAIGHT_LABEL_M_PER_S, "the run"), found


@judges
def drawn_radii(evidence: Evidence) -> Judgement:
    """Worms come out of the bends that their figure draws, and of no other."""
    wide = [point for gait in SMALLEST_DRAWN_M for point in evidence.points(gait=gait, bore_m=WIDE_M) if point.radius_m]
    return judgement(out_of_bends(evidence, {one: one.radius_m >= SMALLEST_DRAWN_M[one.gait] for one in wide}))
