"""A run as WCON, the JSON of worm trackers: the centre line of the body over time, seen from above.

The Worm tracker Commons Object Notation is described at https://github.com/openworm/tracker-commons.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.analysis.track import track_of
from annelid.draw.render import Progress
from annelid.export.formats import FORMATS, SELECTION, Format
from annelid.export.tables import about
from annelid.output import write_text

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run


def wcon(run: Run) -> dict[str, Any]:
    """Returns a run of a 3D worm as WCON: mm and s, from the head (``L``) to the tail, what it is under ``@annelid``.

    Raises:
        RunFileError: The run is of a body without a mesh, or has fewer than two recorded postures.
    """
    track = track_of(run)
    planes = track.crossing_m.reshape(len(track.time_s), -1, track.n_per_plane, 3)
    line_mm = np.round(1e3 * planes.mean(axis=2), 6)
    version = str(run.data.attrs.get("annelid_version", "unknown"))
    return {
        "units": {"t": "s", "x": "mm", "y": "mm"},
        "metadata": {"software": {"tracker": {"name": "annelid", "version": version}}},
        "data": [
            {
                "id": run.config.name,
                "t": track.time_s.tolist(),
                "x": line_mm[..., 0].tolist(),
                "y": line_mm[..., 1].tolist(),
                "head": "L",
            }
        ],
        "@annelid": about(run),
    }


def write_wcon(run: Run, path: Path, progress: Progress) -> list[Path]:
    """Writes a run as `wcon` gives it; raises as that does, and where the file cannot be written."""
    return [write_text(path, json.dumps(wcon(run)))]


FORMATS.add("wcon", Format("wcon", "run.wcon", ".wcon", SELECTION - {"--signals"}, write_wcon))
