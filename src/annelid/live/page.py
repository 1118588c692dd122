"""A run as one HTML page that opens from disk, with nothing loaded from anywhere, and plays."""

from __future__ import annotations

import html
import math
from pathlib import Path

from annelid.config import RunConfig
from annelid.draw.render import Progress
from annelid.errors import RunFileError
from annelid.live.panel import legend_html
from annelid.live.player import player_of
from annelid.live.scene_nodes import Stage
from annelid.live.server import Server, content_policy, with_extras
from annelid.output import whole_file, with_suffix
from annelid.simulation.runfile import Run

FRAMES_A_SECOND = 25.0  # of a page, in simulated time; a run has as many as it has recorded, if those are fewer
GRAIN_M = 2.0**-13  # places are rounded to an eighth of a millimetre, which halves the page
PAGE_SUFFIXES = (".html", ".htm")


def export_page(
    source: RunConfig | Run, path: str | Path, *, speed: float = 1.0, progress: Progress | None = None
) -> Path:
    """Writes a page that shows a worm from all sides and plays, pauses and scrubs.

    The file appears under its name only when it is complete.

    Args:
        source: A run, or a configuration, which is run for its duration.
        path: The page to write (``.html``).
        speed: Simulated seconds per second: 1 is real time.
        progress: Called after every frame.

    Returns:
        The path written.

    Raises:
        ConfigError: The body cannot be viewed, or not be built.
        RunFileError: The run holds no postures, or the file has another suffix or cannot be written.
        SimulationStopped: A guard stopped the worm.
    """
    path = page_path(path)
    if not 0 < speed < math.inf:
        raise RunFileError(f"speed = {speed:g}: the speed of a page must be positive and finite")
    config = source.config if isinstance(source, Run) else source
    player, painter = player_of(source, grain_m=GRAIN_M)
    history, worm = player.history, player.worm
    first_s, last_s = history.span_s if worm is None else (0.0, config.duration_s)
    n_frames = math.floor((last_s - first_s) * FRAMES_A_SECOND + 1e-6) + 1
    shown = history.at(first_s)
    # A server that nobody visits records what it would send.
    server = Server()
    try:
        stage = Stage(server, config, painter, shown)
        recording = server.get_scene_serializer()
        for frame in range(n_frames):
            time_s = first_s + frame / FRAMES_A_SECOND
            if worm is not None:
                worm.advance(time_s, math.inf)
            moment = history.at(time_s + 0.5 / FRAMES_A_SECOND)
            if moment is not shown:
                stage.show(moment)
                shown = moment
            recording.insert_sleep(1.0 / FRAMES_A_SECOND / speed)
            if progress is not None:
                progress(frame + 1, n_frames)
        page = recording.as_html()
    finally:
        server.stop()
    page = _with_caption(page, config, legend_html(painter.arrow_N, painter.radius_m, painter.colored), speed)
    with whole_file(path) as draft:
        draft.write_text(page, encoding="utf-8")
    return path


def page_path(path: str | Path) -> Path:
    """Returns the file that `export_page` writes for a name: one without a suffix becomes an ``.html``."""
    return with_suffix(path, PAGE_SUFFIXES, "a page", default=".html")


def _with_caption(page: str, config: RunConfig, legend: str, speed: float) -> str:
    """Adds the worm's name and what the colours mean, over the scene; viser's own title gives way."""
    name, summary = html.escape(config.name), html.escape(config.summary)
    pace = "" if speed == 1.0 else f", {speed:g} &times; real time"
    caption = (
        f'<div class="annelid-caption"><b>{name}</b>{pace}<div style="font-size:0.8em;margin:2px 0 6px">{summary}</div>'
        f"{legend}</div>"
    )
    policy = f'<meta http-equiv="Content-Security-Policy" content="{content_policy()}" />'
    page = with_extras(page).replace("<head>", f"<head>{policy}", 1)
    page = page.replace("<title>Viser</title>", f"<title>{name} - annelid</title>", 1)
    end = page.rindex("</body>")
    return page[:end] + caption + page[end:]
