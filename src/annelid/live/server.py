"""The web server of a view, on this machine only unless asked otherwise; its page needs nothing from the network."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from annelid.errors import ConfigError, MissingDependency
from annelid.live.guard import Guard, is_loopback, viser

LOOPBACK = "127.0.0.1"
ANY_ADDRESS = ("", "0.0.0.0", "::")
USUAL_PORT = 8080
_TRIED_PORTS = 100


class Server(viser.ViserServer):
    """Viser's server without its printed box, behind a guard."""

    def __init__(self, host: str = LOOPBACK, port: int = 0) -> None:
        """Starts to serve.

        Args:
            host: Address to listen on.
            port: Port that is free; 0 for any.

        Raises:
            MissingDependency: This viser starts its server in another way, so that nothing can guard it.
        """
        guard = Guard(host)
        with _silent(), guard.on_duty():
            super().__init__(host=host, port=port, label="annelid", verbose=False)
        try:
            guard.require_in_place()
        except MissingDependency:
            self.stop()
            raise
        self.token = guard.token

    @property
    def address(self) -> str:
        """Of the page, with the token."""
        host = self.get_host()
        if host in ANY_ADDRESS:
            host = LOOPBACK
        return f"http://{f'[{host}]' if ':' in host else host}:{self.get_port()}/{self.token}/"

    def stop(self) -> None:
        """Ends the server and its threads."""
        with _silent():
            super().stop()


def warning_of(host: str) -> str | None:
    """Returns what it means to listen on an address that other machines reach, or None for one that they do not."""
    if is_loopback(host):
        return None
    return (
        f"--host {host}: other machines reach this view; whoever has its address, token and all, may do what you may, "
        "and whoever listens on the network in between can read it"
    )


def free_port(host: str, wanted: int | None) -> int:
    """Returns the port to listen on.

    Args:
        host: Address.
        wanted: The port that the user asked for, 0 for any free one; None for the usual one or the next that is free.

    Raises:
        ConfigError: It is not free, or there is no such address.
    """
    for port in range(USUAL_PORT, USUAL_PORT + _TRIED_PORTS) if wanted is None else (wanted,):
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
            with socket.socket(family, kind, protocol) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind(address)
                return int(probe.getsockname()[1])
        except (OSError, OverflowError) as error:
            if isinstance(error, socket.gaierror):
                raise ConfigError(f"--host {host}: there is no such address") from None
            if wanted is not None:
                reason = getattr(error, "strerror", None) or str(error)
                raise ConfigError(f"--host {host} --port {wanted} cannot be listened on: {reason}") from None
    raise ConfigError(f"ports {USUAL_PORT} to {USUAL_PORT + _TRIED_PORTS - 1} are all in use: choose one with --port")


@contextmanager
def _silent() -> Iterator[None]:
    """Keeps what viser prints through rich from the user's terminal."""
    import rich

    console: Any = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before
