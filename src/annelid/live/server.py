"""The web server of a view, on this machine only unless asked otherwise; its page needs nothing from the network.

Only the page that it gave out itself may talk to it, under an address with a secret token.
"""

from __future__ import annotations

import asyncio
import hmac
import ipaddress
import logging
import re
import secrets
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from importlib import resources
from typing import Any

import rich

from annelid.errors import ConfigError, MissingDependency

try:
    import msgspec
    import viser
    from websockets.asyncio import server as web
    from websockets.datastructures import Headers
    from websockets.http11 import Request, Response
except ImportError:
    raise MissingDependency(
        "the live view needs viser: install it with  pip install 'annelid[view]'  or look at a worm without a browser "
        "with annelid view --native"
    ) from None

LOOPBACK = "127.0.0.1"
ANY_ADDRESS = ("", "0.0.0.0", "::")
USUAL_PORT = 8080
_TRIED_PORTS = 100
MOST_BYTES = 64 * 1024  # of one message from the page; those of camera, sliders and clicks have some hundred
MESSAGES = frozenset({"ViewerCameraMessage", "GuiUpdateMessage", "ScenePointerMessage"})
"""What the page may say: where its camera is, what was turned, where the scene was clicked. No uploads, no sharing."""
WRONG_HOST = "This view is not served under that name: open the address that annelid view printed.\n"
WRONG_ORIGIN = "Other pages may not use this view: open the address that annelid view printed.\n"
WRONG_TOKEN = "This view opens only under the whole address that annelid view printed, with its token.\n"
_POLICY_VIOLATION = 1008
_HOST = re.compile(r"(?P<name>\[[0-9a-f:.]+\]|[a-z0-9_.-]+)(:\d{1,5})?")

# A handler of its own keeps what strangers send, and errors over it, from the user's terminal.
_log = logging.getLogger(__name__)
_log.addHandler(logging.NullHandler())


class Guard:
    """Looks at every request before the server does.

    Attributes:
        token: First part of the path of every address that is answered.
        in_place: Whether viser has started its server behind this guard.
    """

    def __init__(self, host: str) -> None:
        """Draws a token; ``host`` is the address that the server listens on, as the user gave it."""
        self.token = secrets.token_urlsafe(24)
        self.in_place = False
        self._open = not is_loopback(host)
        self._names = {"localhost", host.lower()}
        if self._open:
            self._names |= {socket.gethostname().lower(), f"{socket.gethostname().lower()}.local"}

    @contextmanager
    def on_duty(self) -> Iterator[None]:
        """Puts the server that viser starts meanwhile behind this guard, and bounds what it reads."""
        serve: Any = web.serve

        def guarded(handler: Any, *where: Any, **options: Any) -> Any:
            if not getattr(handler, "__module__", "").startswith("viser."):
                return serve(handler, *where, **options)
            page = options.get("process_request")
            self.in_place = page is not None
            ours = {"process_request": self._before(page), "create_connection": _Listener}
            return serve(handler, *where, **{**options, **ours, "max_size": MOST_BYTES, "logger": _log})

        web.serve = guarded  # type: ignore[misc, assignment]
        try:
            yield
        finally:
            web.serve = serve  # type: ignore[misc]

    def refusal(self, request: Request) -> str | None:
        """Returns why a request is refused, or None.

        The host must be one of this machine's own, or another name could be made to point here (DNS rebinding); what
        a page asks for must come from the page of this very host; and the path must begin with the token.
        """
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        host = hosts[0].lower() if len(hosts) == 1 else ""
        if not self._is_own(host):
            return WRONG_HOST
        # A browser names the page that opens a websocket, and the page that asks for something across origins.
        if origins or "Upgrade" in request.headers:
            own = f"http://{host}", f"https://{host}"
            if len(origins) != 1 or origins[0].lower() not in own:
                return WRONG_ORIGIN
        if not hmac.compare_digest(_parts(request.path)[0], self.token.encode()):
            return WRONG_TOKEN
        return None

    def _before(self, page: Callable[..., Any] | None) -> Callable[..., Any]:
        def process_request(connection: web.ServerConnection, request: Request) -> Response | None:
            refusal = self.refusal(request)
            if refusal is not None or page is None:
                return connection.respond(HTTPStatus.FORBIDDEN, refusal or WRONG_HOST)
            path = _parts(request.path)[1].decode("ascii", "replace")
            # Uncompressed, so that it can be added to.
            plain = Headers((name, value) for name, value in request.headers.raw_items() if name != "Accept-Encoding")
            answer = page(connection, Request(f"/{path}", plain))
            if answer is not None:
                if answer.headers.get("Content-Type", "").startswith("text/html"):
                    answer.body = with_extras(answer.body.decode()).encode()
                    del answer.headers["Content-Length"]
                    answer.headers["Content-Length"] = str(len(answer.body))
                host = request.headers["Host"]
                answer.headers["Referrer-Policy"] = "no-referrer"
                answer.headers["Content-Security-Policy"] = content_policy("'self'", f"ws://{host}", f"wss://{host}")
            return answer

        return process_request

    def _is_own(self, host: str) -> bool:
        match = _HOST.fullmatch(host)
        if match is None:
            return False
        try:
            address = ipaddress.ip_address(match["name"].strip("[]"))
        except ValueError:
            return match["name"] in self._names
        # No name can point to the server under a page that was opened by a number.
        return self._open or address.is_loopback


class _Listener(web.ServerConnection):
    """A websocket that ends at a message that the page of a view never sends."""

    async def recv(self, decode: bool | None = None) -> Any:
        """Returns the next message, or raises that the connection is closed; after a wrong one there is no next."""
        data = await super().recv(decode)
        if is_said_by_the_page(data):
            return data
        closing = asyncio.create_task(self.close(_POLICY_VIOLATION, "a view takes no such messages"))
        try:
            # What came after it is read, or its end would not be reached, and thrown away.
            while True:
                await super().recv(decode)
        finally:
            await closing


def is_said_by_the_page(data: str | bytes) -> bool:
    """Whether a message is one that the page of a view sends; of what is shown it can set values only."""
    if not isinstance(data, bytes):
        return False
    try:
        # Read as viser does, so that both see the same.
        message = msgspec.msgpack.decode(data)
    except (msgspec.MsgspecError, RecursionError):
        return False
    match message:
        case {"type": "GuiUpdateMessage"}:
            updates = message.get("updates")
            return isinstance(updates, dict) and updates.keys() == {"value"}
        case {"type": str(kind)}:
            return kind in MESSAGES
    return False


def content_policy(*connections: str) -> str:
    """Returns a policy with which a page of viser loads nothing from elsewhere but may connect to these addresses."""
    return (
        "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob: data:; worker-src blob: data:; "
        "style-src 'unsafe-inline'; img-src blob: data:; font-src data:; "
        f"connect-src {' '.join(('blob:', 'data:', *connections))}; base-uri 'none'; form-action 'none'"
    )


def with_extras(page: str) -> str:
    """Adds our keys, clips and looks to a page of viser, as text of annelid's own files."""
    files = resources.files("annelid.live")
    style, script = (files.joinpath(name).read_text("utf-8") for name in ("viewer.css", "viewer.js"))
    return page.replace("<head>", f"<head><style>{style}</style><script>{script}</script>", 1)


def is_loopback(host: str) -> bool:
    """Whether an address to listen on can be reached from this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


class Server(viser.ViserServer):
    """Viser's server without its printed box, behind a guard."""

    def __init__(self, host: str = LOOPBACK, port: int = 0) -> None:
        """Starts to serve on an address and a port that is free, 0 for any.

        Raises:
            MissingDependency: This viser starts its server in another way, so that nothing can guard it.
        """
        guard = Guard(host)
        with _silent(), guard.on_duty():
            super().__init__(host=host, port=port, label="annelid", verbose=False)
        if not guard.in_place:
            self.stop()
            raise MissingDependency(
                f"viser {viser.__version__} would let every page in the browser use the view: install the version that "
                "annelid can guard with  pip install 'viser==1.1.1'"
            )
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
    """Returns the port to listen on: the wanted one, 0 for any free one; None for the usual one or the next free.

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


def _parts(path: str) -> tuple[bytes, bytes]:
    """The token that a path begins with, and the rest of it."""
    token, _, rest = path.partition("?")[0].removeprefix("/").encode("utf-8", "surrogateescape").partition(b"/")
    return token, rest


@contextmanager
def _silent() -> Iterator[None]:
    """Keeps what viser prints through rich from the user's terminal."""
    console: Any = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before
