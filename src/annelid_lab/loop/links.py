"""Lines to hardware: a serial port (pseudo-terminals too), or UDP."""

from __future__ import annotations

import os
import select
import socket
from typing import Any, Protocol

from annelid.errors import ConfigError, MissingDependency, listed

MOST_READ = 4096
"""Bytes that one call returns, at most."""
_WRITE_TIMEOUT_S = 0.05


class Link(Protocol):
    """A line that carries bytes, and may lose, damage or reorder them. Where it is gone it raises OSError."""

    name: str

    def send(self, data: bytes) -> None:
        """Sends bytes, all that are left of one frame or more, without waiting long."""
        ...

    def receive(self, timeout_s: float) -> bytes:
        """Returns at most `MOST_READ` bytes that have come, as soon as there are any; none after the time-out, s."""
        ...

    def close(self) -> None:
        """Closes the line."""
        ...


class SerialLink:
    """A serial port, by pyserial.

    Attributes:
        name: For sentences.

    Raises:
        MissingDependency: There is no pyserial.
        ConfigError: The port cannot be opened.
    """

    def __init__(self, port: str, baud: int = 115_200) -> None:
        """Opens a port such as ``/dev/ttyACM0`` at a rate in bits per second."""
        try:
            import serial
            from serial.tools.list_ports import comports
        except ImportError:
            raise MissingDependency(
                "a serial port needs pyserial: install it with  pip install 'annelid[hardware]'"
            ) from None
        self.name = port
        try:
            self._port: Any = serial.Serial(port, baud, timeout=0, write_timeout=_WRITE_TIMEOUT_S, exclusive=True)
        except (OSError, ValueError) as error:
            code = getattr(error, "errno", None)
            reason = os.strerror(code) if isinstance(code, int) else str(error)
            found = listed(one.device for one in comports()) or "none"
            raise ConfigError(
                f"cannot open the serial port {port}: {reason}; ports of this machine: {found}; "
                "annelid loop PRESET --pseudo needs none"
            ) from None

    def send(self, data: bytes) -> None:
        """Sends bytes; a port that takes none for long raises OSError."""
        self._port.write(data)

    def receive(self, timeout_s: float) -> bytes:
        """Returns what has come."""
        if hasattr(self._port, "fileno"):
            # Changing the port's own time-out would cost a system call per read.
            ready = select.select([self._port.fileno()], [], [], max(timeout_s, 0.0))[0]
            return self._port.read(MOST_READ) if ready else b""
        self._port.timeout = max(timeout_s, 0.0)
        return self._port.read(min(max(self._port.in_waiting, 1), MOST_READ))

    def close(self) -> None:
        """Closes the port."""
        self._port.close()


class UdpLink:
    """Datagrams to and from one address, and no other.

    Attributes:
        name: For sentences.

    Raises:
        ConfigError: There is no such host, or the address cannot be used.
    """

    def __init__(self, host: str, port: int, *, listen: bool = False) -> None:
        """Opens a socket to an address, or one that listens at it and answers the latest sender."""
        self.name = f"{host}:{port}"
        try:
            family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, socket.SOCK_DGRAM)
            (self._socket.bind if listen else self._socket.connect)(address)
        except OSError as error:
            raise ConfigError(f"cannot use {self.name}: {error.strerror or error}") from None
        self._listens, self._sender = listen, None

    def send(self, data: bytes) -> None:
        """Sends one datagram."""
        if not self._listens:
            self._socket.send(data)
        elif self._sender is not None:
            self._socket.sendto(data, self._sender)

    def receive(self, timeout_s: float) -> bytes:
        """Returns a datagram; what is longer than `MOST_READ` is cut."""
        self._socket.settimeout(max(timeout_s, 1e-6))
        try:
            data, self._sender = self._socket.recvfrom(MOST_READ)
        except TimeoutError:
            return b""
        return data

    def close(self) -> None:
        """Closes the socket."""
        self._socket.close()


def open_link(text: str) -> Link:
    """Opens the line that a user names.

    Args:
        text: ``udp:HOST:PORT``, or the path of a serial port, with ``@BAUD`` behind it if need be.

    Raises:
        ConfigError: It is neither, or cannot be opened.
        MissingDependency: There is no pyserial.
    """
    if text.startswith("udp:"):
        host, _, port = text.removeprefix("udp:").rpartition(":")
        if not host or not port.isdecimal() or not 0 < int(port) < 65536:
            raise ConfigError(f"{text!r} is no address: write udp:HOST:PORT, for example udp:192.168.1.7:4242")
        return UdpLink(host.strip("[]"), int(port))
    port, at, baud = text.partition("@")
    if at and not (baud.isdecimal() and int(baud) > 0):
        raise ConfigError(f"{text!r} has no rate behind the @: write bits per second, for example {port}@1000000")
    return SerialLink(port, int(baud) if at else 115_200)
