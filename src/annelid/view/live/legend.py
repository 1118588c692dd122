"""What the colours and arrows of a view mean, as a piece of HTML for the panel and for exported pages."""

from __future__ import annotations

from collections.abc import Sequence

from annelid.view.live.picture import CONTACT_COLOR, SPRING_COLORS, SPRING_RANGE, STRAND_COLORS
from annelid.view.style import CONTRACTED, RELAXED


def legend_html(arrow_N: float, radius_m: float) -> str:
    """Returns the legend.

    Args:
        arrow_N: Contact force whose arrow is as long as the worm's radius at rest, N.
        radius_m: That radius, m.
    """
    percent = f"{100 * SPRING_RANGE:.0f}&thinsp;%"
    rows = (
        (_bar(STRAND_COLORS, smooth=False), "strands, one colour for either handedness"),
        (_bar((RELAXED, CONTRACTED)), "ring muscles, activation 0 to 1"),
        (_bar(SPRING_COLORS), f"axial springs, {percent} shorter to {percent} longer than at rest"),
        (
            f'<span style="color:{_css(CONTACT_COLOR)};font-size:1.3em;line-height:0.8">&#8593;</span>',
            f"force of the ground on a segment: {100 * radius_m:.0f}&thinsp;cm are {arrow_N:g}&thinsp;N",
        ),
    )
    cells = "".join(
        f'<tr><td style="padding:2px 8px 2px 0;text-align:center">{mark}</td><td>{words}</td></tr>'
        for mark, words in rows
    )
    return f'<table style="font-size:0.8em;line-height:1.25;border-collapse:collapse;margin-left:0.6em">{cells}</table>'


def _bar(colors: Sequence[Sequence[float]], *, smooth: bool = True) -> str:
    stops = ",".join(_css(color) for color in colors)
    if not smooth:
        stops = f"{_css(colors[0])} 50%,{_css(colors[1])} 50%"
    style = f"display:inline-block;width:4em;height:0.8em;background:linear-gradient(90deg,{stops})"
    return f'<span style="{style}"></span>'


def _css(color: Sequence[float]) -> str:
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in color)
