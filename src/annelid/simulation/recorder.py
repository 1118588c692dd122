"""What a run file contains, and the recorder that fills it while the run goes on."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from math import prod
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from annelid.config import RunConfig
from annelid.errors import ConfigError
from annelid.protocols import Array, Recordable, Sensation, Signal, Values
from annelid.simulation import container, runfile
from annelid.simulation.checkpoint import slot_capacity, to_slot
from annelid.simulation.container import RawWriter, Variable

_BLOCK_BYTES = 4_194_304


@dataclass(frozen=True, slots=True)
class Schedule:
    """Which control steps are recorded; all counts are of control steps since time zero."""

    start: int  # steps taken before this run (0 unless it continues another)
    end: int  # steps taken when it is over
    sample_every: int  # steps from one sample of the signals to the next
    frame_every: int  # steps from one frame to the next
    timestep_s: float  # control step

    @classmethod
    def of(cls, config: RunConfig, start: int = 0) -> Schedule:
        """Returns the schedule of a configuration whose run starts after ``start`` control steps."""
        timestep_s, record = config.clock.control_timestep_s, config.record
        times_s = config.duration_s, record.signals_interval_s, record.frames_interval_s
        end, sample_every, frame_every = (round(time_s / timestep_s) for time_s in times_s)
        return cls(start, end, sample_every, frame_every, timestep_s)

    def times_s(self, every: int) -> Array:
        """Returns the times of what is recorded every so many steps from time zero on, both ends included, s."""
        # A run that continues another leaves its first instant to that one's file.
        first = 0 if self.start == 0 else self.start // every + 1
        return np.arange(first, self.end // every + 1) * every * np.float64(self.timestep_s)

    def steps_to_record(self, step: int) -> int:
        """Returns how many control steps after ``step`` the next sample or frame is due, or the run ends."""
        to_sample = self.sample_every - step % self.sample_every
        to_frame = self.frame_every - step % self.frame_every
        return min(to_sample, to_frame, self.end - step)


_SENSED = {
    "stretch_length": ("stretch_m", ("segment", "sensor"), "m", "length of a stretch sensor"),
    "ring_length": ("ring_length_m", ("muscle",), "m", "length of a ring muscle"),
    "muscle_force": ("muscle_force_N", ("muscle",), "N", "contractile force of a ring muscle"),
    "contact_force": ("contact_force_N", ("segment", "axis"), "N", "force of the ground on a segment"),
    "center_of_mass": ("center_of_mass_m", ("axis",), "m", "centre of mass"),
}
"""The sensation's own signals, recorded for a plant that names none: field, dimensions, unit and what it is."""


class Senses:
    """Records the sensation of a plant that names no signals of its own."""

    def __init__(self, sensation: Callable[[], Sensation]) -> None:
        """Takes what gives the latest."""
        self._sensation = sensation

    def recordable(self) -> Recordable:
        """Names the signals."""
        shapes = {name: np.shape(value) for name, value in self.read(False).items()}
        return Recordable(tuple(Signal(name, d, shapes[name], u, words) for name, (_, d, u, words) in _SENSED.items()))

    def read(self, frame: bool) -> Values:
        """Reads the present values."""
        latest = self._sensation()
        return {} if frame else {name: getattr(latest, field) for name, (field, *_) in _SENSED.items()}


def loop_signals(n_muscles: int) -> Recordable:
    """Returns the signals that the loop itself records."""
    activation = "activation in force since the control step before; 0 before the first"
    return Recordable(
        signals=(
            Signal("activation", ("muscle",), (n_muscles,), "1", activation),
            Signal("wall_time", (), (), "s", "wall-clock time spent on this run so far"),
        )
    )


def global_attributes(config: RunConfig, parts: Sequence[Recordable]) -> dict[str, Any]:
    """Returns the file's global attributes: what the parts add, the whole configuration, versions, and those of CF.

    Three of CF's attributes are left out. ``featureType`` would promise that all variables are series at places or
    along paths. ``axis`` and ``standard_name`` of a time ask for units with a date, which simulated time does not have.
    """
    created, version = datetime.now(UTC).isoformat(timespec="seconds"), _version("annelid")
    sections = (config.body, config.arena, config.turning, config.controller)
    cited = (key for section in sections if section is not None for key, _ in section.cited())
    return {name: value for part in parts for name, value in part.attrs.items()} | {
        "Conventions": "CF-1.11",
        "title": f"run of {config.name}",
        "source": f"annelid {version}, a simulation of a soft earthworm robot",
        # Its time is in `created`: all else of two runs of one configuration is the same.
        "history": f"run by annelid {version}",
        "references": f"{', '.join(dict.fromkeys(('annelid', *cited)))}: annelid cite prints these entries",
        "comment": "config has the whole configuration as JSON; times are from the start of the simulation",
        runfile.SCHEMA: runfile.SCHEMA_VERSION,
        "config": config.model_dump_json(),
        # The format's integers have 64 bits, a seed may have more.
        "seed": config.seed if config.seed < 2**63 else str(config.seed),
        "created": created,
        "annelid_version": version,
        "mujoco_version": _version("mujoco-core"),
        "numpy_version": np.__version__,
        "python_version": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
    }


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "not installed"


def layout(
    schedule: Schedule, parts: Sequence[Recordable], rest_stretch_m: Array, checkpoint: bytes | None
) -> tuple[dict[str, int], list[Variable]]:
    """Lays out a run file: the size of every dimension, and all variables.

    The parts are what the plant, the controller and the loop record, the lengths at rest those of the stretch sensors,
    m, ``(n_segments, n_sensors)``; without a first checkpoint the simulation cannot be continued.

    Raises:
        ConfigError: The controller is made for another number of segments.
        ValueError: Two signals share a name, or give one dimension different sizes.
    """
    signals = [signal for part in parts for signal in part.signals]
    times = {"time": schedule.times_s(schedule.sample_every), "frame": schedule.times_s(schedule.frame_every)}
    # A dimension of size 0 would be an unlimited one, so a spare row stays NaN where there is no instant.
    times = {dim: values if values.size else np.array([np.nan]) for dim, values in times.items()}
    sizes = {dim: values.size for dim, values in times.items()}
    sizes |= {"message_character": runfile.MESSAGE_BYTES, "warning_character": runfile.WARNING_BYTES}
    sizes |= dict(zip(("segment", "sensor"), rest_stretch_m.shape, strict=True))
    flags = {"flag_values": np.arange(len(runfile.STATUSES), dtype="i1"), "flag_meanings": " ".join(runfile.STATUSES)}
    text = {"_Encoding": "utf-8"}
    message, warning = "why the run ended before its time", "what is doubtful about the run, one sentence per line"
    variables = [
        Variable("samples_written", (), "1", "samples of the signals that hold data", "<i8"),
        Variable("frames_written", (), "1", "frames that hold data", "<i8"),
        Variable("status_code", (), "1", "how the run ended", "i1", attrs=flags),
        Variable("status_message", ("message_character",), "1", message, "S1", attrs=text),
        Variable(runfile.WARNINGS, ("warning_character",), "1", warning, "S1", attrs=text),
        Variable(
            runfile.CPU_TIME, (), "s", "processor time that the process spent from the start to the end of the run"
        ),
        Variable("time", ("time",), "s", "simulated time", data=times["time"]),
        Variable("frame_time", ("frame",), "s", "simulated time of a frame", data=times["frame"]),
    ]
    for signal in signals:
        for dim, size in zip(signal.dims, signal.shape, strict=True):
            if sizes.setdefault(dim, size) != size:
                raise ValueError(f"signal {signal.name!r} has {size} along {dim!r}, others have {sizes[dim]}")
    labels: dict[str, Sequence[str] | Sequence[int]]
    labels = {"segment": range(1, sizes["segment"] + 1), "axis": ("x", "y", "z")}
    for part in parts:
        labels |= part.coords
    for dim in filter(sizes.__contains__, labels):
        if len(labels[dim]) != sizes[dim]:
            raise ConfigError(
                f"the controller is made for {len(labels[dim])} of {dim!r}, and the body has {sizes[dim]}: make it for "
                "this body, or give the body as many segments"
            )
        kind = "str" if all(isinstance(label, str) for label in labels[dim]) else "<i8"
        variables.append(Variable(dim, (dim,), "1", f"label of each {dim}", kind, list(labels[dim])))
    rest = "length of a stretch sensor at rest"
    variables.append(Variable("stretch_rest_length", ("segment", "sensor"), "m", rest, data=rest_stretch_m))
    for signal in signals:
        first, attrs = ("frame", {"coordinates": "frame_time"}) if signal.every_frame else ("time", {})
        variables.append(Variable(signal.name, (first, *signal.dims), signal.units, signal.long_name, attrs=attrs))
    if checkpoint is not None:
        sizes["checkpoint_byte"] = slot_capacity(checkpoint)
        slot = "state of the simulation at a checkpoint, written in turn with the other slot"
        variables += [Variable(name, ("checkpoint_byte",), "1", slot, dtype="u1") for name in runfile.SLOTS]
    names = [variable.name for variable in variables]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"recorded more than once: {', '.join(twice)}")
    return sizes, variables


class _Block:
    """Rows of several variables, gathered in memory and written in one go."""

    def __init__(self, signals: Sequence[Signal], n_rows: int, counter: str) -> None:
        self._counter = counter
        self._written = self._held = 0
        bytes_a_row = 8 * max(1, sum(prod(signal.shape) for signal in signals))
        self._capacity = max(1, min(n_rows, _BLOCK_BYTES // bytes_a_row))
        self._rows = [(signal.name, np.full((self._capacity, *signal.shape), np.nan, "<f8")) for signal in signals]

    def put(self, values: Values, writer: RawWriter) -> None:
        try:
            for name, rows in self._rows:
                rows[self._held] = values[name]
        except KeyError as error:
            raise ValueError(f"recordable() names the signal {error} but read() does not give it") from None
        self._held += 1
        if self._held == self._capacity:
            self.flush(writer)

    def flush(self, writer: RawWriter) -> None:
        if not self._held:
            return
        for name, rows in self._rows:
            writer.write(name, rows[: self._held], self._written * rows[0].nbytes)
        self._written += self._held
        self._held = 0
        # Last, so that the count never promises a row that is not there.
        writer.write(self._counter, np.array(self._written, dtype="<i8"))


class Recorder:
    """Fills a run file: gathers samples in memory and writes them in place; `RunFileError` where it cannot."""

    def __init__(
        self,
        path: Path,
        schedule: Schedule,
        parts: Sequence[Recordable],
        rest_stretch_m: Array,
        checkpoint: bytes | None,
        attrs: Mapping[str, Any],
    ) -> None:
        """Makes the run file, or replaces it, with these global attributes; the others are those of `layout`."""
        sizes, variables = layout(schedule, parts, rest_stretch_m, checkpoint)
        signals = [signal for part in parts for signal in part.signals]
        extents = container.create(path, sizes, variables, attrs)
        rarely = [signal for signal in signals if signal.every_frame]
        self._frames = _Block(rarely, sizes["frame"], "frames_written")
        self._samples = _Block([one for one in signals if not one.every_frame], sizes["time"], "samples_written")
        self._slot_bytes = sizes.get("checkpoint_byte", 0)
        self._sequence = 0
        self._doubts: tuple[str, ...] = ()
        self._writer = RawWriter(path, extents)
        self._began_cpu_s = process_time()
        if checkpoint is not None:
            self.checkpoint(checkpoint)

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._writer.closed

    def sample(self, *sources: Values) -> None:
        """Takes one sample of the signals from mappings that together name all of them."""
        self._samples.put({name: value for source in sources for name, value in source.items()}, self._writer)

    def frame(self, *sources: Values) -> None:
        """Takes one frame likewise."""
        self._frames.put({name: value for source in sources for name, value in source.items()}, self._writer)

    def flush(self) -> None:
        """Writes all samples and frames taken so far."""
        self._samples.flush(self._writer)
        self._frames.flush(self._writer)

    def checkpoint(self, payload: bytes) -> None:
        """Writes a packed state into the older of the two slots, after the samples up to it."""
        self.flush()
        self._sequence += 1
        slot = to_slot(self._sequence, payload)
        if len(slot) > self._slot_bytes:
            raise ValueError(f"the state has grown from below {self._slot_bytes} to {len(slot)} bytes during the run")
        self._writer.write(runfile.SLOTS[self._sequence % len(runfile.SLOTS)], slot)

    def warn(self, doubts: tuple[str, ...]) -> None:
        """Writes what is doubtful about the run so far, a sentence each, instead of what was written before."""
        if doubts != self._doubts:
            self._writer.write(runfile.WARNINGS, _padded("\n".join(doubts), runfile.WARNING_BYTES))
            self._doubts = doubts

    def finish(self, status: str, message: str = "", *, whole: bool = True) -> None:
        """Writes how the run ended and why and closes the file, after what is left in memory if it is to be whole.

        A run is not complete where its last samples cannot be written: its file is left open, to be closed otherwise.
        What a file says that is closed already, also by an error in the middle of this, is left as it is.
        """
        writer = self._writer
        if writer.closed:
            return
        try:
            if whole:
                self.flush()
        except BaseException:
            if status != "complete":
                self.finish(status, message, whole=False)
            raise
        try:
            writer.write("status_message", _padded(message, runfile.MESSAGE_BYTES))
            writer.write(runfile.CPU_TIME, np.array(process_time() - self._began_cpu_s, dtype="<f8"))
            writer.write("status_code", np.array(runfile.STATUSES.index(status), dtype="i1"))
            writer.finish()
        finally:
            writer.close()


def _padded(text: str, n_bytes: int) -> bytes:
    """Returns as much of a text as fits, in whole characters, filled up with zeros."""
    return text.encode()[:n_bytes].decode(errors="ignore").encode().ljust(n_bytes, b"\0")
