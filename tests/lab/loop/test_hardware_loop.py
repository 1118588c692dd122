"""The loop at the pace of the wall clock: its times, a robot of servos, firmware over UDP, and the commands."""

from __future__ import annotations

import os
import shutil
import subprocess
import threading
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_frames import c_peer
from typer.testing import CliRunner
from wire_line import FakeClock, Line

import annelid
from annelid.cli import app
from annelid.control import SENSED
from annelid.errors import ConfigError, SimulationStopped
from annelid.nervous import peristalsis_network
from annelid.protocols import Sensation
from annelid.simulation.runfile import open_run
from annelid_lab.firmware import controller_firmware
from annelid_lab.loop import Interface, Limits, Peer, PseudoRobot, Role, UdpLink, Wiring, drive, open_link
from annelid_lab.loop.dynamixel import PROTOCOLS, Register
from annelid_lab.loop.links import Link
from annelid_lab.loop.peer import serve
from annelid_lab.loop.servos import ServoPlant
from annelid_lab.loop.session import Pace

COMPILER = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler called cc")
WIRING = Wiring()
ARM = Path(__file__).parents[3] / "benchmarks" / "arm"


def test_every_missed_deadline_counts() -> None:
    clock = FakeClock()
    pace = Pace(0.01, clock, clock.sleep)
    pace.tick()
    for busy_s, missed in ((0.009, 0), (0.0105, 0), (0.0125, 1), (0.002, 1), (0.044, 1 + 4), (0.001, 5)):
        clock.now += busy_s
        pace.tick()
        assert pace.missed == missed, busy_s
    # 3.4 periods late: that command, and those of three periods that had none.
    assert pace.slipped_s == pytest.approx(0.034, abs=1e-3)
    assert len(pace.late_s) == 7


@given(
    st.lists(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=2), max_size=20),
    st.floats(0.0, 0.4),
    st.floats(0.5, 1.0),
    st.floats(0.1, 100.0),
)
def test_limits_hold_for_every_command(wanted: list[list[float]], low: float, high: float, rate: float) -> None:
    limits, before = Limits(low, high, rate), np.zeros(2)
    for activation in wanted:
        command = limits.within(np.array(activation), before, 0.01)
        assert (np.abs(command - before) <= rate * 0.01 + 1e-12).all()
        # From zero it comes up to the least at the allowed rate.
        assert ((command <= high) & (command >= np.minimum(low, before))).all()
        before = command


class Bus(PseudoRobot):
    """A pseudo-robot of three segments, of whose answers `fault` says what arrives."""

    name = "bus"

    def __init__(self, **fields: Any) -> None:
        self.clock = FakeClock()
        self.fault: Callable[[bytes], bytes] = lambda data: data
        super().__init__(3, 3, **fields, clock=self.clock, sleep=self.clock.sleep)

    def send(self, data: bytes) -> None:
        self.fault(b"")
        super().send(data)

    def receive(self, timeout_s: float) -> bytes:
        return self.fault(super().receive(timeout_s))

    def later(self, time_s: float) -> np.ndarray:
        """Returns how far each servo is contracted after a time in which nobody says anything, s."""
        self.clock.now += time_s
        super().receive(0.0)
        return self.contraction


def servo_plant(bus: Bus, n_muscles: int = 3, limits: Limits | None = None) -> ServoPlant:
    pace = Pace(0.01, bus.clock, bus.clock.sleep)
    return ServoPlant(bus, pace, limits or Limits(), np.full(3, 0.3), n_muscles, 0.001, 5, bus.wiring)


def test_a_robot_of_servos_follows_with_its_lag_and_is_read_in_whole_counts() -> None:
    bus = Bus(noise_m=0.0, lag_s=0.1)
    plant = servo_plant(bus)
    assert plant.reset(0).stretch_m == pytest.approx(0.3)
    sensed = [plant.stride(np.tile([1.0, 0.5, 0.0], (10, 1))).stretch_m[:, 0] - 0.3 for _ in range(60)]
    counts = np.array(sensed) / WIRING.m_per_count
    assert counts == pytest.approx(np.rint(counts), abs=1e-6)
    # First order, from the first exchange on; an answer is some 1 ms later than its command.
    times = 0.01 * np.arange(60)
    expected = 0.06 * (1.0 - np.exp(-times / 0.1))
    assert np.abs(np.array(sensed)[:, 0] - expected).max() < 0.06 * 0.02 / 0.1 + WIRING.m_per_count
    assert np.array(sensed)[-1] == pytest.approx([0.06, 0.03, 0.0], abs=3e-4)
    plant.stop()
    assert bus.later(3.0) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    "wiring",
    [
        Wiring(relaxed=-9000, contracted=11_000),
        Wiring(relaxed=0, contracted=9000, is_wheel=True),
        Wiring(relaxed=0, contracted=-9000, rest_counts=0, m_per_count=-0.06 / 9000, protocol=1, is_wheel=True),
        Wiring(relaxed=200, contracted=800, protocol=1),
    ],
)
def test_servos_of_several_turns_and_wheels_get_there_and_back(wiring: Wiring) -> None:
    bus = Bus(noise_m=0.0, lag_s=0.05, wiring=wiring)
    plant = servo_plant(bus)
    sensed = plant.reset(0)
    for _ in range(150):
        sensed = plant.stride(np.tile([1.0, 0.5, 0.0], (10, 1)))
    assert bus.contraction == pytest.approx([1.0, 0.5, 0.0], abs=2e-3)
    assert sensed.stretch_m[:, 0] - 0.3 == pytest.approx([0.06, 0.03, 0.0], abs=3e-4)
    mode = PROTOCOLS[wiring.protocol].wheel_mode if wiring.is_wheel else 4
    assert wiring.mode is None or (bus._table[Register.MODE] == mode).all()
    plant.stop()
    assert bus.later(3.0) == pytest.approx(0.0, abs=1e-3)
    assert not plant.doubts()


def test_a_winch_that_has_no_time_to_unwind_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("annelid_lab.loop.servos._LONGEST_UNWINDING_S", 0.0)
    plant = servo_plant(Bus(noise_m=0.0, lag_s=0.05, wiring=Wiring(relaxed=0, contracted=9000, is_wheel=True)))
    plant.reset(0)
    for _ in range(150):
        plant.stride(np.ones((10, 3)))
    plant.stop()
    assert "turns from where cables are slack" in plant.doubts()[0]


def test_the_latency_timer_of_a_usb_adapter_is_recognised() -> None:
    bus = Bus(latency_s=0.016)
    with pytest.raises(ConfigError, match=r"take 16 ms .* half a period of 10 ms: .*latency timer .* rate to 31 Hz"):
        servo_plant(bus).reset(0)


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        (lambda data: b"", "no answer of the robot at bus for 5 periods of 0.01 s: nothing came"),
        (lambda data: data[:-3], "a packet with"),
        (lambda data: data.replace(b"\x55", b"\x54"), "a packet with a wrong checksum"),
        (lambda data: b"\xff\xff\xfd\x00\x01\xff\xff" * 40 if data else b"", "a packet with a wrong length"),
    ],
)
def test_a_bus_that_fails_stops_the_loop(fault: Callable[[bytes], bytes], sentence: str) -> None:
    bus = Bus()
    plant = servo_plant(bus)
    plant.reset(0)
    plant.stride(np.ones((10, 3)))
    bus.fault = fault

    def go_on() -> None:
        for _ in range(10):
            plant.stride(np.ones((10, 3)))

    with pytest.raises(SimulationStopped, match=sentence):
        go_on()
    plant.stop()
    assert plant.doubts()[0].startswith("the robot at bus did not confirm that it stopped")
    # The command to relax went out all the same.
    assert bus.later(3.0) == pytest.approx(0.0, abs=1e-3)
    with pytest.raises(SimulationStopped, match="has been stopped"):
        plant.stride(np.ones((10, 3)))


def test_a_servo_that_is_unplugged_or_missing_or_overheated_is_said() -> None:
    bus = Bus()
    with pytest.raises(ConfigError, match=r"servos 4, 5, 6 do not answer at bus"):
        servo_plant(bus, 6).reset(0)
    bus = Bus()
    plant = servo_plant(bus)
    plant.reset(0)
    plant.stride(np.ones((10, 3)))

    def unplugged(data: bytes) -> bytes:
        raise OSError(5, "Input/output error")

    bus.fault = unplugged
    with pytest.raises(SimulationStopped, match="the line to the robot at bus is gone: Input/output error"):
        plant.stride(np.ones((10, 3)))
    plant.stop()
    bus = Bus()
    plant = servo_plant(bus)
    plant.reset(0)
    bus.fault = lambda data: PROTOCOLS[2].packet(2, 0x55, b"\x80\0\0") if data else b""
    with pytest.raises(SimulationStopped, match="servo 2 at bus reports error 0x80"):
        plant.stride(np.ones((10, 3)))


def test_the_loop_drives_a_pseudo_robot_by_the_wall_clock(tmp_path: Path) -> None:
    config = annelid.load_config("riddle2023-rods", {"duration_s": 0.6})
    driven = drive(config, tmp_path, servos=PseudoRobot(3, 3), rate_hz=50.0, watchdog=20, limits=Limits(0.0, 0.7))
    run = driven.run
    assert run.status == "complete", run.message
    assert run.wall_time_s == pytest.approx(0.6, abs=0.4)
    assert 0.0 <= run.data["command"].values.min() <= run.data["command"].values.max() <= 0.7
    assert driven.report["periods"] == 31
    assert {"median", "p99", "p99_9", "max"} == driven.report["robot"]["latency_s"].keys()
    assert annelid.summary(run).elongation_mean_max_m is not None
    assert run.data.attrs["hardware"] == "robot"


def test_a_serial_port_carries_bytes_both_ways() -> None:
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    link = open_link(f"{os.ttyname(theirs)}@57600")
    link.send(b"\x00\xff\n")
    assert os.read(ours, 10) == b"\x00\xff\n"
    assert link.receive(0.001) == b""
    os.write(ours, b"\r\x03")
    assert link.receive(1.0) == b"\r\x03"
    link.close()
    os.close(ours)


def served(link: UdpLink, peer: Peer) -> Callable[[], None]:
    """Serves a peer in a thread; returns what ends it."""
    over = threading.Event()
    thread = threading.Thread(target=serve, args=(link, peer, over.is_set), daemon=True)
    thread.start()

    def end() -> None:
        over.set()
        thread.join()
        link.close()

    return end


@COMPILER
@pytest.mark.slow
def test_firmware_over_udp_walks_as_python_does(tmp_path: Path) -> None:
    """Order and period are the same, and the elongation is within 1 % of that of the controller in Python."""
    config = annelid.load_config("riddle2023-rods", {"duration_s": 8.0})
    code, _, _ = c_peer(tmp_path, "float")
    listening = UdpLink("127.0.0.1", 0, listen=True)
    end = served(listening, code)  # type: ignore[arg-type]
    link = UdpLink("127.0.0.1", listening._socket.getsockname()[1])
    try:
        walks_as_python_does(config, link, tmp_path)
    finally:
        end()
        link.close()


@pytest.mark.slow
@pytest.mark.skipif(
    not (shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm")),
    reason="gcc-arm-none-eabi or qemu-system-arm is not installed",
)
def test_firmware_on_a_cortex_m4_walks_as_python_does(tmp_path: Path) -> None:
    """The same without an operating system, under QEMU, whose serial port is a pseudo-terminal."""
    config = annelid.load_config("riddle2023-rods", {"duration_s": 8.0})
    controller = annelid.build_controller(config, annelid.build_plant(config))
    controller_firmware(controller, "worm", real="float").write(tmp_path, wire=True)
    names = {"RECEIVE": "worm_wire_receive", "ELAPSED": "worm_wire_elapsed", "INIT": "worm_init"}
    names |= {"ANSWER": "WORM_WIRE_ANSWER"}
    lines = ['#include "worm_wire.h"', *(f"#define {name} {value}" for name, value in names.items())]
    (tmp_path / "wire_names.h").write_text("\n".join(lines) + "\n")
    flags = ["-std=gnu99", "-O2", "-ffp-contract=off", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mthumb"]
    flags += ["-mfloat-abi=hard", "-nostartfiles", "-T", str(ARM / "mps2.ld"), "--specs=nosys.specs"]
    sources = [ARM / "wire.c", ARM / "start.c", tmp_path / "worm.c", tmp_path / "worm_wire.c"]
    elf = str(tmp_path / "worm.elf")
    subprocess.run(["arm-none-eabi-gcc", *flags, f"-I{tmp_path}", *map(str, sources), "-o", elf, "-lm"], check=True)
    command = ["qemu-system-arm", "-M", "mps2-an386", "-kernel", elf, "-display", "none", "-monitor", "none"]
    with subprocess.Popen([*command, "-serial", "pty"], stdout=subprocess.PIPE, text=True) as board:
        assert board.stdout is not None
        link = None
        try:
            terminal = next(word for line in board.stdout for word in line.split() if word.startswith("/dev/"))
            link = open_link(terminal)
            walks_as_python_does(config, link, tmp_path)
        finally:
            board.kill()
            if link is not None:
                link.close()


def walks_as_python_does(config: annelid.RunConfig, link: Link, folder: Path) -> None:
    driven = drive(config, folder / "firmware", firmware=link, rate_hz=50.0, watchdog=50, progress=False)
    python = annelid.simulate(config, folder / "python", progress=False)
    here, there = annelid.summary(driven.run), annelid.summary(python)
    assert driven.run.status == "complete", driven.run.message
    assert here.order == there.order
    assert here.period_s == pytest.approx(there.period_s, rel=0.005)
    assert here.elongation_mean_max_m == pytest.approx(there.elongation_mean_max_m, rel=0.01)
    assert driven.run.data.attrs["hardware"] == "firmware"


def robot_and_firmware() -> tuple[Peer, Peer]:
    interface = Interface(("lengthening_m",), 3, 3, 1000)
    return (
        Peer(Role.BODY, interface, lambda activation, n: 0.1 * activation),
        Peer(Role.CONTROLLER, interface, lambda lengthening, n: np.minimum(0.05 + 5.0 * lengthening, 1.0)),
    )


def test_what_the_firmware_says_is_what_the_robot_does(tmp_path: Path) -> None:
    """Each command is computed from the lengths that the command before it made."""
    clock = FakeClock()
    robot, firmware = (Line(peer, clock) for peer in robot_and_firmware())
    config = annelid.load_config("riddle2023-rods", {"duration_s": 0.5, "record.signals_interval_s": 0.02})
    driven = drive(
        config, tmp_path, robot=robot, firmware=firmware, rate_hz=25.0, watchdog=20, clock=clock, sleep=clock.sleep
    )
    command = driven.run.data["command"].values[:, 0]
    expected, now = [0.0], 0.0
    for _ in range(12):
        now = 0.05 + 0.5 * now
        expected.append(now)
    assert len(command) == 26
    assert command[::2] == pytest.approx(expected, abs=1e-6)
    assert driven.report["robot"]["lost"] == driven.report["firmware"]["lost"] == 0


def test_a_robot_sends_what_the_given_controller_senses(tmp_path: Path) -> None:
    """Whatever the configured one senses: the two sides agree on it when they say hello."""
    clock = FakeClock()
    interface = Interface(("lengthening_m", "touch_N"), 3, 3, 1000)
    robot = Line(Peer(Role.BODY, interface, lambda activation, n: np.repeat([0.0, 2.0], [3, 12])), clock)
    felt: list[float] = []

    class Feeler:
        name = "feeler"
        senses = ("lengthening_m", "touch_N")

        def reset(self, seed: int) -> None:
            """Has no state."""

        def step(self, sensation: Sensation) -> np.ndarray:
            felt.append(float(np.max(SENSED["touch_N"].read(sensation))))
            return np.zeros(3)

    config = annelid.load_config("riddle2023-rods", {"duration_s": 0.2})
    driven = drive(
        config, tmp_path, robot=robot, controller=Feeler(), rate_hz=25.0, watchdog=20, clock=clock, sleep=clock.sleep
    )
    assert driven.run.status == "complete", driven.run.message
    assert max(felt) == 2.0
    servos = PseudoRobot(3, 3)
    with pytest.raises(ConfigError, match="this controller needs touch_N, which a robot of servos does not sense"):
        drive(config, tmp_path / "servos", servos=servos, controller=Feeler())


def test_a_robot_and_firmware_over_udp(tmp_path: Path) -> None:
    listening, peers = [UdpLink("127.0.0.1", 0, listen=True) for _ in range(2)], robot_and_firmware()
    ends = [served(link, peer) for link, peer in zip(listening, peers, strict=True)]
    links = [UdpLink("127.0.0.1", link._socket.getsockname()[1]) for link in listening]
    config = annelid.load_config("riddle2023-rods", {"duration_s": 0.5})
    try:
        driven = drive(config, tmp_path, robot=links[0], firmware=links[1], rate_hz=25.0, watchdog=20)
    finally:
        for each in (*ends, *(link.close for link in links)):
            each()
    assert driven.run.status == "complete", driven.run.message
    assert driven.run.data["command"].values.max() > 0.0
    assert driven.run.data.attrs["hardware"] == "robot and firmware"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ([], "name what is real"),
        (["--robot", "udp:nowhere"], "write udp:HOST:PORT"),
        (["--robot", "/no/such/port"], "cannot open the serial port /no/such/port"),
        (["--robot", "/dev/null@fast"], "has no rate behind the @"),
        (["--firmware", "udp:127.0.0.1:9", "--most", "0.5"], "they need --robot or --servos"),
        (["--robot", "udp:127.0.0.1:9", "--rate", "300"], "a period must be 1 .. 1000 control steps"),
        (["--servos", "udp:127.0.0.1:9", "--ticks", "9", "9"], "relaxed and contracted must differ"),
        (["--robot", "udp:127.0.0.1:9", "--least", "2"], "0 <= lowest < highest <= 1"),
    ],
)
def test_the_command_refuses_in_a_sentence(words: list[str], sentence: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["loop", "riddle2023-rods", "-o", str(tmp_path / "run"), *words])
    assert done.exit_code == 2
    assert sentence in " ".join(done.output.replace("│", " ").split())
    assert not (tmp_path / "run" / "run.nc").exists()


def test_the_command_writes_the_c_client(tmp_path: Path) -> None:
    words = ["export-network", "riddle2023-rods", "-o", str(tmp_path), "--wire"]
    assert CliRunner().invoke(app, words).exit_code == 0
    assert {each.name for each in tmp_path.iterdir()} >= {"riddle2023_rods_wire.h", "riddle2023_rods_wire.c"}
    assert len((tmp_path / "riddle2023_rods_wire.c").read_text().splitlines()) < 200
    assert "exists" in CliRunner().invoke(app, words).output
    (tmp_path / "alone.toml").write_text(peristalsis_network(3).to_toml())
    done = CliRunner().invoke(app, ["export-network", str(tmp_path / "alone.toml"), "-o", str(tmp_path), "--wire"])
    assert done.exit_code == 2
    assert "only a whole controller answers over the wire" in " ".join(done.output.split())


def test_a_run_that_was_interrupted_is_whole(tmp_path: Path) -> None:
    """Ctrl-C in the middle: the robot is relaxed, and the run says so."""
    import signal

    bus = Bus()
    config = annelid.load_config("riddle2023-rods", {"duration_s": 5.0})
    plant = servo_plant(bus)

    def controller(sensation: annelid.Sensation) -> np.ndarray:
        if sensation.time_s == 0.5:
            signal.raise_signal(signal.SIGINT)
        return np.full(3, 0.5)

    run = annelid.simulate(config, tmp_path, plant=plant, controller=controller, progress=False)
    assert run.status == "interrupted"
    assert run.data["time"].values[-1] == pytest.approx(0.5, abs=0.02)
    assert open_run(tmp_path).message.endswith("SIGINT ended the run")
    assert bus.later(3.0) == pytest.approx(0.0, abs=1e-3)
