"""Runs beside animals that crawl by peristalsis and published robots: numbers of the gait, a table and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib import resources
from itertools import cycle
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from annelid.analysis import summary
from annelid.draw import UNKNOWN, aligned, canvas, panel_title, plain, save_both, segment_colors
from annelid.morphology import Array
from annelid.simulation import Run
from annelid.text import LINE
from annelid.textfiles import parse_toml

QUANTITIES: Mapping[str, str] = {
    "speed": "speed (lengths/s)",
    "frequency": "frequency (1/s)",
    "stride": "stride (lengths)",
    "touching": "on the ground",
    "anchored": "anchored",
    "delay": "neighbours' delay",
    "stretch": "longest/shortest",
    "short": "shortened",
}
"""What each number is called; those from the stride on have no unit."""
AT_REST = 0.5
"""Share of the worm's own speed below which a segment on the ground counts as anchored."""
_N_PER_SECOND, _MARKERS = 2, "os^Dv"


@dataclass(frozen=True, slots=True)
class Subject:
    """An animal, a robot or a run.

    Attributes:
        name: Its name.
        numbers: By the names in `QUANTITIES`: the ends of a range, alike for a single number.
        secondary: Numbers that were not read in the publication itself.
        source: Where they are from.
    """

    name: str
    numbers: Mapping[str, tuple[float, float]]
    secondary: Sequence[str] = ()
    source: str = ""


@cache
def published() -> tuple[Subject, ...]:
    """Returns the animals and robots of ``data/animals.toml``."""
    file = resources.files("annelid_lab") / "data" / "animals.toml"
    return tuple(map(_subject, parse_toml(file.read_text(encoding="utf-8"), file.name)["subject"]))


def _subject(entry: dict[str, Any]) -> Subject:
    ranges = {name: entry[name] for name in QUANTITIES if name in entry}
    for name, (at_1_g, exponent) in entry.get("laws", {}).items():
        ranges[name] = sorted(at_1_g * mass**exponent for mass in entry["mass_g"])
    numbers = {name: (ends[0], ends[-1]) for name, ends in ranges.items()}
    return Subject(entry["name"], numbers, entry.get("secondary", ()), entry["source"])


def delay_of(order: Sequence[int], onsets_s: Sequence[float], period_s: float) -> float:
    """Returns by which share of a cycle, up to a half, neighbours contract one after the other, in either direction.

    Args:
        order: Segments, from 1, in the order of their contractions.
        onsets_s: Times of these, s.
        period_s: Duration of a cycle, s.
    """
    turns, segments = np.exp(2j * np.pi * np.array(onsets_s) / period_s), np.array(order)
    mean = np.array([turns[segments == segment].sum() for segment in range(1, segments.max() + 1)])
    return float(abs(np.angle((mean[1:] * mean[:-1].conj()).sum())) / (2 * np.pi))


def subject_of(run: Run, name: str) -> Subject:
    """Reads the numbers of a run, over its complete cycles behind the first one; those that it lacks are left out.

    Args:
        run: The run.
        name: What it is called.
    """
    found, data = summary(run), run.variables
    if found.start_s is None or found.end_s is None or not found.gait_period_s:
        return Subject(name, {})
    inside = (data["time"].values >= found.start_s) & (data["time"].values <= found.end_s)
    numbers = {"speed": found.speed_body_lengths_per_s, "stride": found.stride_body_lengths}
    numbers["frequency"] = 1.0 / found.gait_period_s
    numbers["delay"] = delay_of(found.order, found.onsets_s, found.gait_period_s)
    if found.contact_duty and found.speed_m_per_s is not None and "slip_speed" in data:
        touches = (data["contact_force"].values[inside] != 0.0).any(axis=2)
        rests = np.abs(data["slip_speed"].values[inside]) < AT_REST * abs(found.speed_m_per_s)
        numbers |= {"touching": float(touches.mean()), "anchored": float((touches & rests).mean())}
    if "stretch_length" in data:
        numbers |= _shape(data["stretch_length"].values[inside])
    return Subject(name, {key: (one, one) for key, one in numbers.items() if one is not None})


def _shape(lengths_m: Array) -> dict[str, float]:
    """How much longer segments get than at their shortest, and how long each is below the middle of both."""
    of_segment = lengths_m.reshape(*lengths_m.shape[:2], -1).mean(axis=2)
    longest, shortest = of_segment.max(axis=0), of_segment.min(axis=0)
    return {
        "stretch": float((longest / shortest).mean()),
        "short": float((of_segment < (longest + shortest) / 2).mean()),
    }


def limits(run: Run) -> str:
    """Says what a robot of the run's size can be compared in with animals, and what it cannot."""
    length_m, mass_kg = (run.attrs.get(name) for name in ("body_length_m", "total_mass_kg"))
    if length_m is None or mass_kg is None:
        return ""
    return fill(
        f"A worm of {length_m:.2f} m can be compared with animals in what has no unit, which hardly changes with an "
        "earthworm's mass: stride, anchored share, delay and strain. It cannot in frequency, speed or force: these "
        f"follow its motors and its {mass_kg:.2g} kg, where the largest earthworm measured has 8.5 g.",
        LINE,
    )


def animals_table(subjects: Sequence[Subject]) -> str:
    """Lays subjects side by side, a line for each number, and their sources below."""
    rows = [("", *(one.name for one in subjects))]
    rows += [(label, *(_cell(one, name) for one in subjects)) for name, label in QUANTITIES.items()]
    sources = [fill(f"{one.name}: {one.source}", LINE) for one in subjects if one.source]
    legend = (
        "lengths: body lengths; ground, anchored, delay, shortened: shares of a cycle; longest/shortest: of a segment"
    )
    notes = fill(f"{legend}; *: not read in the publication itself", LINE)
    return "\n".join([aligned(rows), "", notes, *sources])


def _cell(subject: Subject, name: str) -> str:
    if name not in subject.numbers:
        return UNKNOWN
    low, high = (f"{end:#.2g}" for end in subject.numbers[name])
    return (low if low == high else f"{low}..{high}") + "*" * (name in subject.secondary)


def animals_picture(subjects: Sequence[Subject], stem: Path) -> Path:
    """Draws the numbers of all subjects, those without a unit and those per second; returns the path of the PNG.

    Args:
        subjects: The subjects.
        stem: Path without suffix.
    """
    names = list(QUANTITIES)
    looks = list(zip(subjects, segment_colors(len(subjects)), cycle(_MARKERS), strict=False))
    panels_of = {"a) without a unit": names[_N_PER_SECOND:], "b) per second": names[:_N_PER_SECOND]}
    with canvas(3.8) as figure:
        panels = figure.subplots(1, 2, width_ratios=(3, 2))
        for axes, (title, own) in zip(panels, panels_of.items(), strict=True):
            panel_title(axes, title)
            for i, (one, color, marker) in enumerate(looks):
                for row, name in enumerate(own):
                    if name in one.numbers:
                        ends, y = one.numbers[name], row + 0.7 * ((i + 0.5) / len(looks) - 0.5)
                        face = "white" if name in one.secondary else color
                        axes.plot(ends, [y, y], color=color, linewidth=2.5, solid_capstyle="butt")
                        axes.plot(sum(ends) / 2, y, marker, color=color, markerfacecolor=face, markersize=5)
            axes.set_yticks(range(len(own)), [QUANTITIES[name].partition(" (")[0] for name in own])
            axes.set_ylim(len(own) - 0.5, -0.5)
            axes.margins(x=0.1)
        panels[0].set(xlabel="body lengths, share of a cycle, or ratio", xlim=(0.0, None))
        if all(one.numbers["speed"][0] > 0 for one in subjects if "speed" in one.numbers):
            panels[1].set_xscale("log")  # A worm that crawls backwards has no logarithm.
        panels[1].set_xlabel("body lengths/s, cycles/s")
        entries: list[Any] = [
            panels[0].plot([], [], marker, color=color, label=plain(one.name))[0] for one, color, marker in looks
        ]
        entries += panels[0].plot([], [], "o", color="0.4", markerfacecolor="white", label="not read in its source")
        figure.legend(handles=entries, loc="outside upper left", ncols=3)
        return save_both(figure, stem)


def animals_record(subjects: Sequence[Subject]) -> dict[str, Any]:
    """Returns subjects as plain lists, numbers and strings, ready for JSON."""
    return {"quantities": dict(QUANTITIES), "subjects": [asdict(one) for one in subjects]}
