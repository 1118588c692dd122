"""What can go wrong on the wire: no unsafe command, a sentence, and a run file that is whole, whatever it is."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
from wire_line import INTERFACE, Body, FakeClock, Line, kind_of, robot

import annelid
from annelid.errors import AnnelidError, ConfigError, SimulationStopped
from annelid.protocols import Array, Sensation
from annelid.simulation.runfile import open_run, verify_run
from annelid_lab.loop.frames import Frame, Kind, Role, packed, stuffed, unstuffed
from annelid_lab.loop.peer import Fault, Peer
from annelid_lab.loop.remote import RemoteController, RemotePlant
from annelid_lab.loop.session import Limits, Pace, WirePartner

Arrivals = list[tuple[float, bytes]]
PERIOD_S, N_STEPS, WATCHDOG = 0.01, 10, 5
LIMITS = Limits(0.0, 0.8, 6.0)
CONFIG = annelid.load_config("riddle2023-rods", {"duration_s": 0.3})


def whole(data: bytes) -> bytearray:
    return bytearray(unstuffed(data.strip(b"\0")))


def forged(change: Callable[[bytearray], bytearray | None]) -> Callable[[bytes], Arrivals]:
    """A frame that was changed before its checksum was made."""

    def arrive(data: bytes) -> Arrivals:
        raw = whole(data)[:-4]
        raw = change(raw) or raw
        return [(0.0, stuffed(bytes(raw) + struct.pack("<I", zlib.crc32(bytes(raw)))) + b"\0")]

    return arrive


def put(at: int, value: bytes) -> Callable[[bytes], Arrivals]:
    def change(raw: bytearray) -> None:
        raw[at : at + len(value)] = value

    return forged(change)


def add(at: int, by: int) -> Callable[[bytes], Arrivals]:
    def change(raw: bytearray) -> None:
        struct.pack_into("<H", raw, at, (struct.unpack_from("<H", raw, at)[0] + by) & 0xFFFF)

    return forged(change)


def sized(n: int) -> Callable[[bytes], Arrivals]:
    """A payload of another length, which says so."""

    def change(raw: bytearray) -> bytearray:
        payload = (bytes(raw[8:]) * 40)[:n]
        return raw[:6] + struct.pack("<H", n) + payload

    return forged(change)


def flipped(at: int) -> Callable[[bytes], Arrivals]:
    def arrive(data: bytes) -> Arrivals:
        raw = whole(data)
        raw[at] ^= 0x10
        return [(0.0, stuffed(bytes(raw)) + b"\0")]

    return arrive


def gone(data: bytes) -> Arrivals:
    raise OSError(19, "No such device")


def also(*more: tuple[float, bytes]) -> Callable[[bytes], Arrivals]:
    return lambda data: [(0.0, data), *more]


NOISE = np.random.default_rng(0).integers(0, 256, 4096).astype(np.uint8).tobytes()
FAULTS: dict[str, Callable[[bytes], Arrivals]] = {
    "drop": lambda data: [],
    "delay of most of a period": lambda data: [(0.008, data)],
    "delay of a period and a half": lambda data: [(0.015, data)],
    "delay of three periods": lambda data: [(0.03, data)],
    "delay of a second": lambda data: [(1.0, data)],
    "twice": lambda data: [(0.0, data), (0.0, data)],
    "again after a period": lambda data: [(0.0, data), (0.012, data)],
    "half of it": lambda data: [(0.0, data[: len(data) // 2])],
    "without the end": lambda data: [(0.0, data[:-1])],
    "cut in two": lambda data: [(0.0, data[:6]), (0.001, data[6:])],
    "cut in two, and a long time between": lambda data: [(0.0, data[:6]), (0.02, data[6:])],
    "byte by byte": lambda data: [(1e-5 * i, data[i : i + 1]) for i in range(len(data))],
    "noise instead": lambda data: [(0.0, NOISE[: len(data)])],
    "noise and a zero before": lambda data: [(0.0, NOISE[:50] + b"\0" + data)],
    "a flood of noise": lambda data: [(0.0, NOISE)] * 20 + [(0.0, data)],
    "a flood without zeros": lambda data: [(0.0, b"\x01" * 4096)] * 20 + [(0.0, b"\0" + data)],
    "a flipped bit in the version": flipped(0),
    "a flipped bit in the payload": flipped(9),
    "a flipped bit in the checksum": flipped(-1),
    "another version": put(0, b"\x02"),
    "an unknown kind": put(1, b"\x63"),
    "a hello": put(1, b"\x01"),
    "a sensation": put(1, b"\x02"),
    "an activation": put(1, b"\x03"),
    "a stop": put(1, b"\x04"),
    "an error": put(1, b"\x05"),
    "another session": add(2, 1),
    "the next number": add(4, 1),
    "the number before": add(4, -1),
    "a number far ahead": add(4, 0x7000),
    "a length too large": add(6, 1),
    "no payload": sized(0),
    "a number too many": sized(16),
    "the longest payload": sized(1024),
    "a payload that is too long": sized(1028),
    "not a number": put(8, packed(np.nan)),
    "negative": put(8, packed(-0.5)),
    "beyond one": put(8, packed(1.5)),
    "a line that is gone": gone,
    "a stop behind it": also((0.0, Frame(Kind.STOP, 0, 0).encoded())),
    "an error behind it": also((0.0, Frame(Kind.ERROR, 0, 0, b"\x01").encoded())),
}
STAGES: dict[str, Callable[[int, Kind | None], bool]] = {
    "from the hello on": lambda n, kind: True,
    "in the middle once": lambda n, kind: n == 12,
    "in the middle on": lambda n, kind: n >= 12,
    "at the stop": lambda n, kind: kind == Kind.STOP,
}
CASES = list(product(FAULTS, ("to", "from"), STAGES))
FAST = CASES[::37]
"""A sample for the fast tests, of both directions and all stages: a run file takes its time."""


def loop(line: Line, out: Path, controller: Callable[[Sensation], Array] | None = None) -> str:
    """Runs the loop for 30 periods; returns the sentence with which it ended, empty if it went through."""
    pace = Pace(PERIOD_S, line.clock, line.clock.sleep)
    partner = WirePartner(Role.BODY, line, pace, INTERFACE, N_STEPS, WATCHDOG)
    plant = RemotePlant(partner, pace, LIMITS, np.full(3, 0.3), INTERFACE)
    wave = controller or (lambda s: 0.5 - 0.5 * np.cos(40.0 * s.time_s - np.arange(3)))
    try:
        annelid.simulate(CONFIG, out, plant=plant, controller=wave, progress=False)
    except AnnelidError as error:
        return str(error)
    finally:
        plant.stop()
    return ""


def check(line: Line, body: Body, out: Path, ended: str) -> None:
    sent = [frame for frame in line.sent if frame.kind == Kind.ACTIVATION]
    commands = [frame.numbers(3) for frame in sent]
    for command in (*commands, *body.commands):
        assert ((command >= 0) & (command <= 0.8 + 1e-6)).all()
    for (one, before), (other, after) in pairwise(zip(sent, commands, strict=True)):
        if one.session == other.session and after.any():
            assert np.abs(after - before).max() <= LIMITS.rate_per_s * PERIOD_S + 1e-6
    stops = [n for n, frame in enumerate(line.sent) if frame.kind == Kind.STOP]
    if stops:
        after = [each.numbers(3) for each in line.sent[stops[0] :] if each.kind == Kind.ACTIVATION]
        assert not np.any(after), "a command after the stop"
    # Whatever is still on its way, and then silence, for which the robot has its own watchdog.
    line.fault = lambda direction, n, data: [(0.0, data)]
    line.receive(3.0)
    while line.receive(0.0):
        pass
    assert not body.activation.any(), "the robot is not relaxed"
    if (out / "run.nc").exists():
        run = open_run(out)
        assert run.status == ("stopped_by_guard" if ended else "complete"), run.message
        assert (run.message == ended) or run.message.endswith(ended)
        assert "intact" in verify_run(out)
        assert np.isfinite(run.data["stretch_length"].values).all()
        assert run.data.sizes["time"] >= 1
    else:
        assert ended, "neither a file nor a sentence"
    if ended:
        assert len(ended.split()) >= 6
        assert "memory" in ended, "it does not say which line"


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, id="-".join(case), marks=[] if case in FAST else [pytest.mark.slow]) for case in CASES],
)
def test_a_fault_ends_safely_or_is_survived(case: tuple[str, str, str], tmp_path: Path) -> None:
    name, direction, stage = case
    body = Body()

    def fault(way: str, n: int, data: bytes) -> Arrivals:
        if way == direction and STAGES[stage](n, kind_of(data)):
            return FAULTS[name](data)
        return [(0.0, data)]

    line = Line(robot(body), FakeClock(), fault)
    ended = loop(line, tmp_path / "run")
    check(line, body, tmp_path / "run", ended)
    if stage == "in the middle once" and name in ("drop", "delay of three periods", "half of it", "noise instead"):
        assert not ended, "one frame is not missed"
        assert any(doubt == "lost answers of the robot: 1" for doubt in open_run(tmp_path / "run").warnings)
    if stage == "in the middle on" and name in ("drop", "noise instead", "another session", "an unknown kind"):
        assert "no answer of the robot at memory for 5 periods of 0.01 s" in ended


def test_without_a_fault_all_commands_arrive(tmp_path: Path) -> None:
    body = Body()
    line = Line(robot(body), FakeClock())
    assert loop(line, tmp_path / "run") == ""
    check(line, body, tmp_path / "run", "")
    run = open_run(tmp_path / "run")
    assert run.warnings == ()
    # The lengths of the answer to a command are those of the sample with that command.
    command, lengths = run.data["command"].values, run.data["stretch_length"].values[..., 0]
    np.testing.assert_allclose(lengths[1:], 0.3 + 0.06 * command[1:], atol=1e-7)
    np.testing.assert_allclose(run.data["robot_latency"].values[1:], 0.001, atol=1e-5)


def test_an_error_of_the_robot_and_one_of_the_controller(tmp_path: Path) -> None:
    body = Body()

    def failing(activation: Array, n_steps: int) -> Array:
        if len(body.commands) == 9:
            raise Fault(7)
        return body.move(activation, n_steps)

    line = Line(Peer(Role.BODY, INTERFACE, failing, body.relax), FakeClock())
    ended = loop(line, tmp_path / "one")
    assert "the robot at memory reports error 7" in ended
    check(line, body, tmp_path / "one", ended)
    other = Line(robot(body := Body()), FakeClock())
    ended = loop(other, tmp_path / "two", lambda s: np.full(3, 0.5 if s.time_s < 0.1 else np.nan))
    assert "the controller gave muscle 1 an activation of nan" in ended
    assert open_run(tmp_path / "two").status == "stopped_by_guard"
    other.receive(0.2)
    assert body.commands[-1].max() == 0.0


def test_a_stop_comes_before_the_file_is_closed(tmp_path: Path) -> None:
    """The digest of a large file takes long, and the robot must not wait for it."""
    body = Body()
    line = Line(robot(body), FakeClock())
    pace = Pace(PERIOD_S, line.clock, line.clock.sleep)
    partner = WirePartner(Role.BODY, line, pace, INTERFACE, N_STEPS, WATCHDOG)
    plant = RemotePlant(partner, pace, LIMITS, np.full(3, 0.3), INTERFACE)
    run = annelid.simulate(CONFIG, tmp_path, plant=plant, controller=lambda s: np.full(3, 0.5), progress=False)
    assert run.status == "complete"
    assert line.sent[-1].kind == Kind.STOP, "nobody else has called stop"
    with pytest.raises(SimulationStopped, match="has been stopped"):
        plant.stride(np.full((N_STEPS, 3), 0.5))


@pytest.mark.parametrize("fault", ["drop", "beyond one"])
def test_firmware_that_fails_stops_the_simulated_worm(fault: str, tmp_path: Path) -> None:
    config = annelid.load_config("riddle2022-planar", {"duration_s": 0.2})
    body = annelid.build_plant(config)
    interface = INTERFACE.__class__(("lengthening_m",), body.n_segments, body.n_muscles, 1000)
    peer = Peer(Role.CONTROLLER, interface, lambda sensed, n_steps: np.full(body.n_muscles, 0.5))

    def arrive(way: str, n: int, data: bytes) -> Arrivals:
        return FAULTS[fault](data) if way == "from" and n > 9 else [(0.0, data)]

    line = Line(peer, FakeClock(), arrive)
    pace = Pace(PERIOD_S, line.clock, line.clock.sleep)
    partner = WirePartner(Role.CONTROLLER, line, pace, interface, N_STEPS, WATCHDOG)
    controller = RemoteController(partner, pace, interface, N_STEPS, keeps_pace=True)
    with pytest.raises(SimulationStopped) as stopped:
        annelid.simulate(config, tmp_path, plant=body, controller=controller, progress=False)
    run = open_run(tmp_path)
    assert run.status == "stopped_by_guard"
    assert str(stopped.value) == run.message
    assert (run.data["activation"].values <= 1).all()
    assert line.sent[-1].kind == Kind.STOP


def test_what_does_not_fit_is_said(tmp_path: Path) -> None:
    other = INTERFACE.__class__(("lengthening_m",), 4, 4, 1000)
    line = Line(Peer(Role.BODY, other, lambda a, n: a), FakeClock())
    assert "does not fit this worm: it has 4 segments, not 3" in loop(line, tmp_path / "one")
    line = Line(Peer(Role.CONTROLLER, INTERFACE, lambda a, n: a), FakeClock())
    assert "it has role 2, not 1 (body)" in loop(line, tmp_path / "two")
    slower = INTERFACE.__class__(("lengthening_m",), 3, 3, 2000)
    line = Line(Peer(Role.BODY, slower, lambda a, n: a), FakeClock())
    assert "its sensors or its control step are others" in loop(line, tmp_path / "three")
    assert not any(frame.kind == Kind.ACTIVATION for frame in line.sent)


def test_the_limits_refuse_what_is_none() -> None:
    for numbers in ((0.5, 0.5), (-0.1, 1.0), (0.0, 1.1), (float("nan"), 1.0)):
        with pytest.raises(ConfigError, match="lowest < highest"):
            Limits(*numbers)
    with pytest.raises(ConfigError, match="rate_per_s must be positive"):
        Limits(rate_per_s=0.0)
