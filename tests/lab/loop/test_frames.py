"""The frames of the wire, in Python and in C."""

from __future__ import annotations

import binascii
import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from wire_line import INTERFACE, Body, robot

import annelid
from annelid.control import SENSED
from annelid.errors import ConfigError
from annelid_lab.firmware import Firmware, controller_firmware
from annelid_lab.firmware.host import OPTIONS
from annelid_lab.loop.dynamixel import PROTOCOLS, PacketDecoder, crc16
from annelid_lab.loop.frames import (
    MOST_BYTES,
    Decoder,
    Frame,
    FrameError,
    Hello,
    Interface,
    Kind,
    Role,
    decoded,
    most_stuffed,
    packed,
    stuffed,
    unstuffed,
)
from annelid_lab.loop.peer import Fault, Peer

COMPILER = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler called cc")
FRAMES = st.builds(
    Frame,
    st.sampled_from(list(Kind)),
    st.integers(0, 0xFFFF),
    st.integers(0, 0xFFFF),
    st.one_of(st.binary(max_size=1024), st.integers(250, 258).map(lambda n: b"\x01" * n)),
)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        # Cheshire and Baker 1999, and the edge at blocks of 254 bytes.
        (b"", b"\x01"),
        (b"\0", b"\x01\x01"),
        (b"\x45\0\0\x2c\x4c", b"\x02\x45\x01\x03\x2c\x4c"),
        (bytes(range(1, 255)) + b"\0", b"\xff" + bytes(range(1, 255)) + b"\x01\x01"),
    ],
)
def test_stuffing_by_hand(data: bytes, expected: bytes) -> None:
    assert stuffed(data) == expected


@given(FRAMES, st.lists(st.integers(1, 40), max_size=30))
def test_a_frame_comes_back_however_it_is_cut(frame: Frame, cuts: list[int]) -> None:
    assert 0 not in frame.encoded()[1:-1]
    assert len(frame.encoded()) <= most_stuffed(MOST_BYTES) + 2
    line, decoder, found = frame.encoded() * 2, Decoder(), []
    for n in [*cuts, len(line)]:
        found += decoder.feed(line[:n])
        line = line[n:]
    assert found == [frame, frame]
    assert not decoder.rejected


@given(FRAMES, st.data())
def test_a_flipped_bit_is_never_another_frame(frame: Frame, data: st.DataObject) -> None:
    """Behind a full block of 254 bytes the last code is redundant: a bit of it may be flipped."""
    line = bytearray(frame.encoded()[:-1])
    line[data.draw(st.integers(0, len(line) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    decoder = Decoder()
    assert list(decoder.feed(bytes(line) + b"\0")) in ([], [frame])


def test_a_long_flood_is_one_wrong_frame() -> None:
    decoder = Decoder()
    for _ in range(1000):
        assert list(decoder.feed(b"\x07" * 4096)) == []
    assert len(decoder._held) < 2 * MOST_BYTES
    after = Frame(Kind.STOP, 1, 2)
    assert list(decoder.feed(b"\0" + after.encoded())) == [after]
    assert decoder.rejected == {"a wrong length": 1}


def test_another_version_is_said() -> None:
    whole = bytearray(unstuffed(Frame(Kind.STOP, 1, 2).encoded()[1:-1]))[:-4]
    whole[0] = 2
    with pytest.raises(FrameError, match="version 2 of the protocol, not 1"):
        decoded(stuffed(bytes(whole) + binascii.crc32(bytes(whole)).to_bytes(4, "little")))


def test_a_frame_is_too_small_for_a_very_long_worm() -> None:
    with pytest.raises(ConfigError, match="a frame holds 256 numbers, not the 400"):
        Interface(("touch_N",), 100, 100, 1000)
    with pytest.raises(ConfigError, match="'touch' can be sensed; did you mean 'touch_N'"):
        Interface(("touch",), 3, 3, 1000)


def test_the_interface_distinguishes_what_has_as_many_numbers() -> None:
    assert Interface(("heading_rad", "front_m"), 3, 3, 1000).digest != Interface(("lengthening_m",), 3, 3, 1000).digest
    assert Interface(("lengthening_m",), 3, 3, 1000).digest != Interface(("lengthening_m",), 3, 3, 500).digest


def test_servo_packets_are_those_of_the_manual() -> None:
    # The examples of https://emanual.robotis.com/docs/en/dxl/protocol2: ping of servo 1, and a read of its position.
    packet = PROTOCOLS[2].packet
    assert packet(1, 0x01) == bytes.fromhex("fffffd00010300 01 194e".replace(" ", ""))
    assert packet(1, 0x02, b"\x84\x00\x04\x00") == bytes.fromhex("fffffd0001070002840004001d15")
    assert crc16(b"") == 0
    # The examples of protocol1: reading the temperature of servo 1, and its answer.
    assert PROTOCOLS[1].packet(1, 0x02, b"\x2b\x01") == bytes.fromhex("ffff0104022b01cc")
    assert list(PacketDecoder(PROTOCOLS[1]).feed(bytes.fromhex("ffff01030020db"))) == [(1, 0, b"\x20")]


@given(st.sampled_from([1, 2]), st.integers(0, 253), st.binary(max_size=100), st.binary(max_size=20))
def test_servo_packets_come_back_with_marks_inside(protocol: int, servo: int, data: bytes, noise: bytes) -> None:
    data = data + b"\xff\xff\xfd" + data
    line = PROTOCOLS[protocol].packet(servo, 0x55, data)
    assert protocol == 1 or line.count(b"\xff\xff\xfd\0") == 1
    decoder = PacketDecoder(PROTOCOLS[protocol])
    assert list(decoder.feed(noise.replace(b"\xff", b"") + line + line)) == [(servo, 0x55, data)] * 2


class CPeer:
    """The C client, with the methods of a `Peer`."""

    def __init__(self, firmware: Firmware, folder: Path) -> None:
        firmware.write(folder, wire=True)
        name, library = firmware.name, folder / "wire.so"
        options = [*OPTIONS.split(), "-o", str(library)]
        sources = [str(folder / f"{name}{ending}") for ending in (".c", "_wire.c")]
        subprocess.run(["cc", *options, *sources, "-lm"], check=True)
        self._code: Any = ctypes.CDLL(str(library))
        self._receive = getattr(self._code, f"{name}_wire_receive")
        self._receive.restype, self._receive.argtypes = ctypes.c_size_t, [ctypes.c_ubyte, ctypes.c_char_p]
        self._elapsed = getattr(self._code, f"{name}_wire_elapsed")
        self._move = ctypes.c_void_p.in_dll(self._code, f"{name}_wire_move")
        self._ms = 0.0

    def be_robot(self, body: Body, n_muscles: int, real: Any) -> None:
        """Moves a body, whose lengthening is the first thing sensed."""

        def move(activation: Any, sensors: Any) -> int:
            given = np.array(activation[:n_muscles])
            body.move(given, 1)
            for i, value in enumerate(0.06 * given):
                sensors[i] = value
            return 7 if given.max() > 0.99 else 0

        pointer = ctypes.POINTER(real)
        self._callback = ctypes.CFUNCTYPE(ctypes.c_int, pointer, pointer)(move)
        self._move.value = ctypes.cast(self._callback, ctypes.c_void_p).value

    def receive(self, data: bytes) -> bytes:
        answer, result = ctypes.create_string_buffer(4096), b""
        for byte in data:
            n = self._receive(byte, answer)
            result += answer.raw[:n]
        return result

    def elapsed(self, time_s: float) -> None:
        self._ms += 1e3 * min(time_s, 1e6)
        self._elapsed(ctypes.c_ulong(int(self._ms)))
        self._ms %= 1.0


def c_peer(folder: Path, real: Any = "double", preset: str = "riddle2023-rods") -> tuple[CPeer, Any, Interface]:
    config = annelid.load_config(preset)
    plant = annelid.build_plant(config)
    controller: Any = annelid.build_controller(config, plant)
    interface = Interface(controller.senses, plant.n_segments, plant.n_muscles, 1000)
    return CPeer(controller_firmware(controller, "worm", real=real), folder), controller, interface


@COMPILER
@pytest.mark.parametrize("real", ["double", "float"])
def test_the_c_client_answers_as_the_python_one(real: Any, tmp_path: Path) -> None:
    """Random frames of all kinds, right and damaged, to both: as robots they must answer with the same bytes."""
    code, _, interface = c_peer(tmp_path, real)
    assert interface == INTERFACE
    bodies = Body(), Body()
    code.be_robot(bodies[0], 3, ctypes.c_double if real == "double" else ctypes.c_float)

    def moved(activation: np.ndarray, n_steps: int) -> np.ndarray:
        # As the C client's body, in its type of numbers.
        kind = np.float64 if real == "double" else np.float32
        if activation.max() > 0.99:
            raise Fault(7)
        return (0.06 * activation.astype(kind).astype(float)).astype(kind)

    python = Peer(Role.BODY, INTERFACE, moved)
    rng = np.random.default_rng(0)
    session, sequence, answers = 1, 0, 0
    for n in range(2500):
        choice = rng.integers(12)
        sequence = (sequence + int(rng.integers(-1, 4))) & 0xFFFF
        payload = packed(rng.uniform(0.0, 0.995, 3))
        frame = Frame(Kind.ACTIVATION, session, sequence, payload)
        if choice == 0 or n == 0:
            session = int(rng.integers(1, 4))
            hello = Hello.of(Role.HOST, INTERFACE, int(rng.integers(0, 3)), int(rng.integers(0, 300)))
            sequence = int(rng.choice([0, 5, 65530]))
            frame = Frame(Kind.HELLO, session, sequence, hello.payload())
        elif choice == 1:
            frame = Frame(Kind.STOP, session, sequence)
        elif choice == 2:
            values = rng.choice(np.array([np.nan, np.inf, -0.5, 1.5, 0.5]), 3)
            frame = Frame(Kind.ACTIVATION, session, sequence, packed(values))
        elif choice == 3:
            frame = Frame(Kind(int(rng.integers(1, 6))), session, sequence, bytes(rng.integers(0, 256, 15).tolist()))
        line = bytearray(frame.encoded())
        if choice == 4:
            line[int(rng.integers(len(line)))] ^= 1 << int(rng.integers(8))
        elif choice == 5:
            del line[int(rng.integers(len(line))) :]
        elif choice == 6:
            line = bytearray(rng.integers(0, 256, 30).astype(np.uint8).tobytes())
        answer = code.receive(bytes(line))
        assert answer == python.receive(bytes(line)), (n, frame)
        answers += bool(answer)
        waited = float(rng.choice([0.0, 0.001, 0.01, 0.2]))
        code.elapsed(waited)
        python.elapsed(waited)
    assert answers > 200


@COMPILER
def test_the_c_client_steps_the_controller(tmp_path: Path) -> None:
    """The closed form: the controller in Python, given the same numbers for as many steps."""
    code, controller, interface = c_peer(tmp_path)
    hello = Hello.of(Role.HOST, interface, 10, 1000)
    answer = code.receive(Frame(Kind.HELLO, 9, 0, hello.payload()).encoded())
    (greeting,) = Decoder().feed(answer)
    assert Hello.read(greeting.payload) == Hello.of(Role.CONTROLLER, interface, 10, 1000)
    controller.reset(0)
    rng = np.random.default_rng(1)
    for n in range(1, 300):
        values = np.float32(rng.uniform(0.0, 0.06, interface.n_sensed)).astype(float)
        (frame,) = Decoder().feed(code.receive(Frame(Kind.SENSATION, 9, n, packed(values)).encoded()))
        sensation = annelid.Sensation(
            time_s=(n - 1) * 0.01,
            stretch_m=values[:, np.newaxis],
            rest_stretch_m=np.zeros((3, 1)),
            ring_length_m=np.zeros(3),
            muscle_force_N=np.zeros(3),
            contact_force_N=np.zeros((3, 3)),
            center_of_mass_m=np.zeros(3),
        )
        assert SENSED["lengthening_m"].read(sensation) == pytest.approx(values)
        expected = controller.stride(sensation, 10)[-1]
        assert frame.numbers(3) == pytest.approx(expected, abs=1e-5)


def test_a_python_robot_relaxes_after_silence_and_obeys_again_after_a_new_hello() -> None:
    body = Body()
    peer = robot(body)
    hello = Hello.of(Role.HOST, INTERFACE, 10, 100).payload()
    peer.receive(Frame(Kind.HELLO, 5, 0, hello).encoded())
    command = packed([0.5, 0.5, 0.5])
    assert peer.receive(Frame(Kind.ACTIVATION, 5, 1, command).encoded())
    peer.elapsed(0.09)
    assert body.activation.any()
    peer.elapsed(0.02)
    assert not body.activation.any()
    assert peer.receive(Frame(Kind.ACTIVATION, 5, 2, command).encoded()) == b""
    peer.receive(Frame(Kind.HELLO, 5, 0, hello).encoded())
    assert peer.receive(Frame(Kind.ACTIVATION, 5, 3, command).encoded()) == b"", "the session that ended"
    peer.receive(Frame(Kind.HELLO, 6, 0, hello).encoded())
    assert peer.receive(Frame(Kind.ACTIVATION, 6, 1, command).encoded())
