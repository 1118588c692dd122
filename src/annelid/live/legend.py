"""What the panel and exported pages say as pieces of HTML: the state of things, and what colours and arrows mean."""

from __future__ import annotations

import html
from collections.abc import Sequence

from annelid.draw.style import CONTRACTED, RELAXED
from annelid.live.picture import CONTACT_COLOR, SPRING_COLORS, SPRING_RANGE, STRAND_COLORS


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


def status_html(name: str, parts: Sequence[str], below: str) -> str:
    """Returns the state of things, every word as it was written.

    Args:
        name: Of the worm.
        parts: What stands beside it.
        below: A sentence under it, or none.
    """
    line = "&emsp;".join([f"<b>{html.escape(name)}</b>", *map(html.escape, parts)])
    rest = f'<div style="margin-top:0.5em">{html.escape(below)}</div>' if below else ""
    return f'<div style="font-size:0.9em;margin:0 0.6em;overflow-wrap:anywhere">{line}{rest}</div>'


def _bar(colors: Sequence[Sequence[float]], *, smooth: bool = True) -> str:
    stops = ",".join(_css(color) for color in colors)
    if not smooth:
        stops = f"{_css(colors[0])} 50%,{_css(colors[1])} 50%"
    style = f"display:inline-block;width:4em;height:0.8em;background:linear-gradient(90deg,{stops})"
    return f'<span style="{style}"></span>'


def _css(color: Sequence[float]) -> str:
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in color)
