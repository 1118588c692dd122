"""What a run file contains, and the recorder that fills it while the run goes on."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from math import prod
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from annelid.config import RunConfig
from annelid.protocols import Array, Controller, Plant, Recordable, Records, Sensation, Signal
from annelid.simulation import container
from annelid.simulation.checkpoint import slot_capacity, to_slot
from annelid.simulation.container import RawWriter, Variable
from annelid.simulation.runfile import (
    CPU_TIME,
    MESSAGE_BYTES,
    SCHEMA,
    SCHEMA_VERSION,
    SLOTS,
    STATUSES,
    WARNING_BYTES,
    WARNINGS,
)

Values = Mapping[str, "NDArray[np.generic] | float"]

_BLOCK_BYTES = 4_194_304


@dataclass(frozen=True, slots=True)
class Schedule:
    """Which control steps are recorded; all counts are of control steps since time zero.

    Attributes:
        start: Steps taken before this run (0 unless it continues another).
        end: Steps taken when it is over.
        sample_every: Steps from one sample of the signals to the next.
        frame_every: Steps from one frame to the next.
        timestep_s: Control step, s.
    """

    start: int
    end: int
    sample_every: int
    frame_every: int
    timestep_s: float

    @classmethod
    def of(cls, config: RunConfig, start: int = 0) -> Schedule:
        """Returns the schedule of a configuration whose run starts after ``start`` control steps."""
        timestep_s = config.clock.control_timestep_s
        return cls(
            start=start,
            end=round(config.duration_s / timestep_s),
            sample_every=round(config.record.signals_interval_s / timestep_s),
            frame_every=round(config.record.frames_interval_s / timestep_s),
            timestep_s=timestep_s,
        )

    def sample_times_s(self) -> Array:
        """Returns the times of the samples, s: every interval from time zero on, both ends included."""
        return self._times(self.sample_every)

    def frame_times_s(self) -> Array:
        """Returns the times of the frames, s."""
        return self._times(self.frame_every)

    def steps_to_record(self, step: int) -> int:
        """Returns how many control steps after ``step`` the next sample or frame is due, or the run ends."""
        to_sample = self.sample_every - step % self.sample_every
        to_frame = self.frame_every - step % self.frame_every
        return min(to_sample, to_frame, self.end - step)

    def _times(self, every: int) -> Array:
        # A run that continues another leaves its first instant to that one's file.
        first = 0 if self.start == 0 else self.start // every + 1
        return np.arange(first, self.end // every + 1) * every * np.float64(self.timestep_s)


def recordable_of(part: Plant | Controller) -> Recordable:
    """Returns what a plant or a controller offers to the recorder; nothing if it does not record."""
    return part.recordable() if isinstance(part, Records) else Recordable()


def sensation_signals(sensation: Sensation) -> Recordable:
    """Returns the sensation's own signals, recorded for a plant that names none."""
    segments, sensors = sensation.stretch_m.shape
    muscles = sensation.ring_length_m.shape
    return Recordable(
        signals=(
            Signal("stretch_length", ("segment", "sensor"), (segments, sensors), "m", "length of a stretch sensor"),
            Signal("ring_length", ("muscle",), muscles, "m", "length of a ring muscle"),
            Signal("muscle_force", ("muscle",), muscles, "N", "contractile force of a ring muscle"),
            Signal("contact_force", ("segment", "axis"), (segments, 3), "N", "force of the ground on a segment"),
            Signal("center_of_mass", ("axis",), (3,), "m", "centre of mass"),
        )
    )


def sensation_values(sensation: Sensation) -> Values:
    """Returns the present values of `sensation_signals`."""
    return {
        "stretch_length": sensation.stretch_m,
        "ring_length": sensation.ring_length_m,
        "muscle_force": sensation.muscle_force_N,
        "contact_force": sensation.contact_force_N,
        "center_of_mass": sensation.center_of_mass_m,
    }


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
    """Returns the file's global attributes: what the parts add, the whole configuration, and versions."""
    attrs: dict[str, Any] = {}
    for part in parts:
        attrs.update(part.attrs)
    return attrs | {
        SCHEMA: SCHEMA_VERSION,
        "config": config.model_dump_json(),
        # The format's integers have 64 bits, a seed may have more.
        "seed": config.seed if config.seed < 2**63 else str(config.seed),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "annelid_version": _version("annelid"),
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


@dataclass(frozen=True, slots=True)
class Layout:
    """A run file as it will be laid out.

    Attributes:
        sizes: Size of every dimension.
        variables: All variables.
        signals: Those recorded at the rate of the signals.
        frame_signals: Those recorded at frame rate.
    """

    sizes: dict[str, int]
    variables: list[Variable]
    signals: tuple[Signal, ...]
    frame_signals: tuple[Signal, ...]


def layout(schedule: Schedule, parts: Sequence[Recordable], rest_stretch_m: Array, checkpoint: bytes | None) -> Layout:
    """Lays out a run file.

    Args:
        schedule: When is recorded.
        parts: What the plant, the controller and the loop record.
        rest_stretch_m: Lengths of the stretch sensors at rest, m, shape ``(n_segments, n_sensors)``.
        checkpoint: The first checkpoint, or None if this simulation cannot be continued.

    Raises:
        ValueError: Two signals share a name, or give one dimension different sizes.
    """
    signals = [signal for part in parts for signal in part.signals]
    times = {"time": schedule.sample_times_s(), "frame": schedule.frame_times_s()}
    # A dimension of size 0 would be an unlimited one, so a spare row stays NaN where there is no instant.
    times = {dim: values if values.size else np.array([np.nan]) for dim, values in times.items()}
    sizes = {dim: values.size for dim, values in times.items()} | {"message_character": MESSAGE_BYTES}
    sizes["warning_character"] = WARNING_BYTES
    sizes |= dict(zip(("segment", "sensor"), rest_stretch_m.shape, strict=True))
    variables = [
        *_bookkeeping(),
        Variable("time", ("time",), "s", "simulated time", data=times["time"]),
        Variable("frame_time", ("frame",), "s", "simulated time of a frame", data=times["frame"]),
    ]
    for signal in signals:
        for dim, size in zip(signal.dims, signal.shape, strict=True):
            if sizes.setdefault(dim, size) != size:
                raise ValueError(f"signal {signal.name!r} has {size} along {dim!r}, others have {sizes[dim]}")
    labels = {"segment": range(1, sizes["segment"] + 1), "axis": ("x", "y", "z")}
    for part in parts:
        labels |= part.coords
    variables += [_label_variable(dim, values) for dim, values in labels.items() if dim in sizes]
    rest = "length of a stretch sensor at rest"
    variables.append(Variable("stretch_rest_length", ("segment", "sensor"), "m", rest, data=rest_stretch_m))
    for signal in signals:
        first, attrs = ("frame", {"coordinates": "frame_time"}) if signal.every_frame else ("time", {})
        variables.append(Variable(signal.name, (first, *signal.dims), signal.units, signal.long_name, attrs=attrs))
    if checkpoint is not None:
        sizes["checkpoint_byte"] = slot_capacity(checkpoint)
        slot = "state of the simulation at a checkpoint, written in turn with the other slot"
        variables += [Variable(name, ("checkpoint_byte",), "1", slot, dtype="u1") for name in SLOTS]
    names = [variable.name for variable in variables]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"recorded more than once: {', '.join(twice)}")
    return Layout(
        sizes,
        variables,
        tuple(signal for signal in signals if not signal.every_frame),
        tuple(signal for signal in signals if signal.every_frame),
    )


def _label_variable(dim: str, labels: Sequence[str] | Sequence[int]) -> Variable:
    text = all(isinstance(label, str) for label in labels)
    return Variable(dim, (dim,), "1", f"label of each {dim}", "str" if text else "<i8", list(labels))


def _bookkeeping() -> list[Variable]:
    flags = {
        "flag_values": np.arange(len(STATUSES), dtype="i1"),
        "flag_meanings": " ".join(STATUSES),
    }
    return [
        Variable("samples_written", (), "1", "samples of the signals that hold data", "<i8"),
        Variable("frames_written", (), "1", "frames that hold data", "<i8"),
        Variable("status_code", (), "1", "how the run ended", "i1", attrs=flags),
        Variable(
            "status_message",
            ("message_character",),
            "1",
            "why the run ended before its time",
            "S1",
            attrs={"_Encoding": "utf-8"},
        ),
        Variable(
            WARNINGS,
            ("warning_character",),
            "1",
            "what is doubtful about the run, a sentence a line",
            "S1",
            attrs={"_Encoding": "utf-8"},
        ),
        Variable(CPU_TIME, (), "s", "processor time that the process spent from the start to the end of the run"),
    ]


class _Block:
    """Rows of several variables, gathered in memory and written in one go."""

    def __init__(self, signals: Sequence[Signal], n_rows: int, counter: str) -> None:
        self._counter = counter
        self._written = 0
        self._held = 0
        bytes_a_row = 8 * max(1, sum(prod(signal.shape) for signal in signals))
        self._capacity = max(1, min(n_rows, _BLOCK_BYTES // bytes_a_row))
        self._rows = [
            (signal.name, np.full((self._capacity, *signal.shape), np.nan, dtype="<f8")) for signal in signals
        ]

    @property
    def full(self) -> bool:
        return self._held == self._capacity

    def put(self, values: Values) -> None:
        row = self._held
        for name, rows in self._rows:
            rows[row] = values[name]
        self._held = row + 1

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
    """Fills a run file: gathers samples in memory and writes them in place.

    Args:
        path: The run file; made, or replaced, at once.
        plan: What it contains.
        attrs: Global attributes.

    Raises:
        RunFileError: The file cannot be written (here and from every method).
    """

    def __init__(self, path: Path, plan: Layout, attrs: Mapping[str, Any]) -> None:
        extents = container.create(path, plan.sizes, plan.variables, attrs)
        self._samples = _Block(plan.signals, plan.sizes["time"], "samples_written")
        self._frames = _Block(plan.frame_signals, plan.sizes["frame"], "frames_written")
        self._slot_bytes = plan.sizes.get("checkpoint_byte", 0)
        self._sequence = 0
        self._doubts: tuple[str, ...] = ()
        self._writer = RawWriter(path, extents)
        self._began_cpu_s = process_time()

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._writer.closed

    def sample(self, *sources: Values) -> None:
        """Takes one sample of the signals from mappings that together name all of them."""
        self._put(self._samples, sources)

    def frame(self, *sources: Values) -> None:
        """Takes one frame, in the same way."""
        self._put(self._frames, sources)

    def _put(self, block: _Block, sources: Sequence[Values]) -> None:
        values: dict[str, Any] = {}
        for source in sources:
            values.update(source)
        try:
            block.put(values)
        except KeyError as error:
            raise ValueError(f"recordable() names the signal {error} but read() does not give it") from None
        if block.full:
            block.flush(self._writer)

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
        self._writer.write(SLOTS[self._sequence % len(SLOTS)], slot)

    def warn(self, doubts: tuple[str, ...]) -> None:
        """Writes what is doubtful about the run so far, a sentence each, instead of what was written before."""
        if doubts != self._doubts:
            self._writer.write(WARNINGS, _padded("\n".join(doubts), WARNING_BYTES))
            self._doubts = doubts

    def finish(self, status: str, message: str = "") -> None:
        """Writes what is left, how the run ended and why, and closes the file.

        A run is not complete where its last samples cannot be written: its file is left open, to be closed otherwise.
        """
        try:
            if not self._writer.closed:
                self.flush()
        except BaseException:
            if status != "complete":
                self.close(status, message)
            raise
        self.close(status, message)

    def close(self, status: str, message: str = "") -> None:
        """Writes how the run ended and closes the file, without the samples still in memory.

        What a file says that is closed already, also by an error in the middle of this, is left as it is.
        """
        if self._writer.closed:
            return
        with self._writer as writer:
            writer.write("status_message", _padded(message, MESSAGE_BYTES))
            writer.write(CPU_TIME, np.array(process_time() - self._began_cpu_s, dtype="<f8"))
            writer.write("status_code", np.array(STATUSES.index(status), dtype="i1"))
            writer.write_digest()
            writer.close()


def _padded(text: str, n_bytes: int) -> bytes:
    """Returns as much of a text as fits, in whole characters, filled up with zeros."""
    return text.encode()[:n_bytes].decode(errors="ignore").encode().ljust(n_bytes, b"\0")
