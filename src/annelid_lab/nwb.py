"""A run as an NWB file: potentials as intracellular series of one electrode each, behaviour and positions beside.

Neurodata Without Borders 2 (Ruebel et al. 2022, doi:10.7554/eLife.78362), written by pynwb. Needs the optional extra:
``pip install "annelid[export]"``.
"""

from __future__ import annotations

import json
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np
from xarray import DataArray

from annelid.analysis import track_of
from annelid.errors import RunFileError, shown
from annelid.export import FORMATS, SELECTION, Format, Progress, about, signal_names
from annelid.output import whole_file
from annelid.protocols import Array
from annelid.references import entries, references_of
from annelid.text import numbered, printable

if TYPE_CHECKING:
    from annelid.simulation import Run

UNITS = {"mV": ("volts", 1e-3), "nA": ("amperes", 1e-9), "m": ("meters", 1.0), "s": ("seconds", 1.0)}
"""NWB's units of recorded ones, and what a recorded number is multiplied by; others are SI as they are."""
NEURAL = {"neuron", "channel", "connection"}
"""Dimensions of what is recorded of a network."""
_DOI = re.compile(r"doi = \{([^}]+)\}")


def write_nwb(run: Run, path: Path, progress: Progress) -> list[Path]:
    """Writes a run as one NWB file; every number is the recorded one, ``conversion`` takes it to the SI unit.

    Left out are what does not change (the sensors' rest lengths) and what is recorded with every frame, of which the
    centres of the segments' rings are computed: NWB has no type for a mesh, and one unit for a series, unlike ``qpos``.

    Raises:
        RunFileError: There is none of the other signals, the run does not say when it was made, or the file cannot be
            written.
    """
    from pynwb import NWBHDF5IO, TimeSeries
    from pynwb.behavior import BehavioralTimeSeries, Position, SpatialSeries
    from pynwb.icephys import CurrentClampSeries

    names = [name for name in signal_names(run.data) if run.data[name].dims[:1] == ("time",)]
    centres = _ring_centres(run)
    if not names and not centres:
        raise RunFileError(
            "an NWB file would be empty: signals of meshes and of the engine (qpos) have no NWB type; choose others"
        )
    file = _described(run)
    device = file.create_device(name="annelid", description=printable(str(run.data.attrs.get("source", "simulation"))))
    behaviour: Any = BehavioralTimeSeries()
    position: Any = Position()
    neural: list[TimeSeries] = []
    frame = "world axes x, y, z: z is up, and the worm heads towards -x at the start"
    clock = _clock(run.data["time"].values)
    electrodes: dict[str, Any] = {}
    for done, (recorded, name) in enumerate(zip(names, numbered(map(_key, names)), strict=True)):
        progress(done, len(names) + 1)
        signal = run.data[recorded]
        data, labels = _packed(signal.values), _labels(signal)
        units = printable(str(signal.attrs.get("units", "1")))
        unit, conversion = UNITS.get(units, (units, 1.0))
        common = {"conversion": conversion, "description": printable(str(signal.attrs.get("long_name", name))), **clock}
        if signal.dims == ("time", "neuron") and unit == "volts":
            cells = [printable(str(neuron)) for neuron in signal["neuron"].values]
            for column, (cell, key) in enumerate(zip(cells, numbered(map(_key, cells)), strict=True)):
                if key not in electrodes:
                    electrodes[key] = file.create_icephys_electrode(
                        name=f"electrode_{key}", cell_id=cell, device=device, description=f"model neuron {cell}"
                    )
                file.add_acquisition(
                    CurrentClampSeries(
                        name=f"{name}_{key}",
                        data=_packed(signal.values[:, column]),
                        electrode=electrodes[key],
                        stimulus_description="none: no current but those of the network itself",
                        **common,
                    )
                )
        elif signal.dims == ("time", "axis") and unit == "meters":
            position.add_spatial_series(
                SpatialSeries(name=name, data=data, unit=unit, reference_frame=frame, comments=labels, **common)
            )
        else:
            series = TimeSeries(name=name, data=data, unit=unit, comments=labels, **common)
            neural.append(series) if NEURAL & set(signal.dims) else behaviour.add_timeseries(series)
    for number, values in enumerate(centres, start=1):
        position.add_spatial_series(
            SpatialSeries(
                name=f"segment_{number}",
                data=_packed(values),
                unit="meters",
                reference_frame=frame,
                description=f"centre of the ring of segment {number}, the mean of its crossings",
                **_clock(run.data["frame_time"].values),
            )
        )
    observed = [*([behaviour] if behaviour.time_series else []), *([position] if position.spatial_series else [])]
    for module, what, series in (
        ("behavior", "lengths, forces, energies and positions of the robot", observed),
        ("icephys", "what is recorded of the network beside its potentials", neural),
    ):
        if series:
            file.create_processing_module(name=module, description=what).add(series)
    with whole_file(path) as draft, NWBHDF5IO(path=str(draft), mode="w") as io:
        io.write(container=file)
    return [path]


def _described(run: Run) -> Any:
    """An empty file that says what the run is."""
    from pynwb import NWBFile
    from pynwb.file import Subject

    created = str(run.data.attrs.get("created", ""))
    try:
        start = datetime.fromisoformat(created)
    except ValueError:
        raise RunFileError(
            f"{run.path}: created = {shown(created)} is no time, and NWB needs that of the start"
        ) from None
    bibliography = "\n".join(entries()[key] for key in references_of(run.config))
    version = printable(str(run.data.attrs.get("annelid_version", "unknown")))
    start = start if start.tzinfo else start.replace(tzinfo=UTC)
    return NWBFile(
        session_description=printable(f"{run.data.attrs.get('title', run.config.name)}, status {run.status}"),
        identifier=str(uuid4()),
        session_start_time=start,
        experiment_description=printable(run.config.summary) or "a soft robot",
        keywords=["soft robotics", "peristalsis", "synthetic nervous system"],
        notes=json.dumps(about(run)),
        related_publications=[f"doi:{doi}" for doi in _DOI.findall(bibliography)],
        was_generated_by=[["annelid", version]],
        # NWB's checks also ask for a species, which a robot has not.
        subject=Subject(
            subject_id=printable(run.config.name),
            description="a soft robot, no animal; its age counts from the session",
            sex="U",
            date_of_birth=start,
        ),
    )


def _ring_centres(run: Run) -> list[Array]:
    """Centre of every segment's ring at the recorded postures, m, ``(n_frames, 3)``; none where there are no rings."""
    try:
        track = track_of(run)
    except RunFileError:
        return []
    planes = track.crossing_m.reshape(len(track.time_s), -1, track.n_per_plane, 3)
    return [planes[:, plane].mean(axis=1) for plane in track.ring_planes]


def _clock(times_s: Array) -> dict[str, Any]:
    """The times of samples as a rate where they are evenly spaced to within rounding, otherwise one by one."""
    steps = np.diff(times_s)
    if steps.size and np.ptp(steps) <= 1e-9 * steps[0]:
        return {"starting_time": float(times_s[0]), "rate": float(steps.size / (times_s[-1] - times_s[0]))}
    return {"timestamps": times_s}


def _labels(signal: DataArray) -> str:
    """The labels along the dimensions behind the time, as JSON; those that have none are numbered from 0."""
    dims = signal.dims[1:]
    return json.dumps({dim: signal[dim].values.tolist() if dim in signal.coords else "from 0" for dim in dims})


def _key(label: str) -> str:
    """A label as a name in an NWB file, which has no slash and no colon."""
    return re.sub(r"[^\w.+-]", "_", label) or "_"


def _packed(values: Array) -> Any:
    from hdmf.backends.hdf5 import H5DataIO

    return H5DataIO(data=values, compression="gzip")


FORMATS.add("nwb", Format("nwb", "run.nwb", ".nwb", SELECTION, write_nwb, "pynwb"))
