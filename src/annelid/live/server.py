"""The web server of a view, on this machine only unless asked otherwise; its page needs nothing from the network.

Everything that it answers lies below a secret token, the first part of the address. So neither another page in the
browser nor another user of the machine can reach the view.
"""

from __future__ import annotations

import hmac
import ipaddress
import logging
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
    import viser
    from websockets.asyncio import server as web
    from websockets.datastructures import Headers
    from websockets.http11 import Request, Response
except ImportError:
    raise MissingDependency("the live view needs viser: install it with  pip install 'annelid[view]'") from None

LOOPBACK = "127.0.0.1"
ANY_ADDRESS = ("", "0.0.0.0", "::")
USUAL_PORT = 8080
MOST_BYTES = 64 * 1024  # of one message from the page; those of camera, sliders and clicks have some hundred
WRONG_TOKEN = "This view opens only under the whole address that annelid view printed, with its token.\n"

# A handler of its own keeps what strangers send, and errors over it, from the user's terminal.
_log = logging.getLogger(__name__)
_log.addHandler(logging.NullHandler())


class Server(viser.ViserServer):
    """Viser's server without what it prints, below a token.

    Attributes:
        token: First part of the path of every address that is answered.
    """

    def __init__(self, host: str = LOOPBACK, port: int = 0) -> None:
        """Starts to serve on an address and a port that is free, 0 for any.

        Raises:
            MissingDependency: This viser starts its server in another way, so that no token protects it.
        """
        self.token = secrets.token_urlsafe(24)
        with _silent(), _behind(self.token) as started:
            super().__init__(host=host, port=port, label="annelid", verbose=False)
        if not started:
            self.stop()
            raise MissingDependency(
                f"viser {viser.__version__} would let every page in the browser use the view: install the version that "
                "annelid can protect with  pip install 'viser==1.1.1'"
            )

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


@contextmanager
def _behind(token: str) -> Iterator[list[bool]]:
    """Puts the server that viser starts meanwhile below a token; gives a list that is empty until it has started.

    Viser has no parameter for what looks at a request first, so it is added where viser starts its server.
    """
    serve: Any = web.serve
    started: list[bool] = []

    def serve_behind(handler: Any, *where: Any, process_request: Callable[..., Any], **options: Any) -> Any:
        started.append(True)
        ours = {"process_request": _with_token(token, process_request), "max_size": MOST_BYTES, "logger": _log}
        return serve(handler, *where, **{**options, **ours})

    web.serve = serve_behind  # type: ignore[misc, assignment]
    try:
        yield started
    finally:
        web.serve = serve  # type: ignore[misc]


def _with_token(token: str, page: Callable[..., Response | None]) -> Callable[..., Response | None]:
    """Returns what answers a request below the token as viser does, with our keys and looks, and refuses any other."""

    def process_request(connection: web.ServerConnection, request: Request) -> Response | None:
        given, _, path = request.path.partition("?")[0].removeprefix("/").partition("/")
        if not hmac.compare_digest(given.encode("utf-8", "surrogateescape"), token.encode()):
            return connection.respond(HTTPStatus.FORBIDDEN, WRONG_TOKEN)
        # Uncompressed, so that it can be added to.
        plain = Headers((name, value) for name, value in request.headers.raw_items() if name != "Accept-Encoding")
        answer = page(connection, Request(f"/{path}", plain))
        if answer is not None:
            if answer.headers.get("Content-Type", "").startswith("text/html"):
                answer.body = with_extras(answer.body.decode()).encode()
                del answer.headers["Content-Length"]
                answer.headers["Content-Length"] = str(len(answer.body))
            answer.headers["Referrer-Policy"] = "no-referrer"
            host = next(iter(request.headers.get_all("Host")), "")
            answer.headers["Content-Security-Policy"] = content_policy("'self'", f"ws://{host}", f"wss://{host}")
        return answer

    return process_request


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


def warning_of(host: str) -> str | None:
    """Returns what it means to listen on an address that other machines reach, or None for one that they do not."""
    try:
        loopback = ipaddress.ip_address(host).is_loopback
    except ValueError:
        loopback = host.lower() == "localhost"
    if loopback:
        return None
    return (
        f"--host {host}: other machines reach this view. Its whole address with the token lets anybody do what you "
        "may, and all traffic can be read on the network in between"
    )


def free_port(host: str, wanted: int | None) -> int:
    """Returns the port to listen on: the wanted one, 0 for any free one; None for 8080, or any where it is taken.

    Raises:
        ConfigError: It is not free, or there is no such address.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, USUAL_PORT if wanted is None else wanted, type=socket.SOCK_STREAM
        )[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            return int(probe.getsockname()[1])
    except socket.gaierror:
        raise ConfigError(f"--host {host}: there is no such address") from None
    except (OSError, OverflowError) as error:
        if wanted is None:
            return free_port(host, 0)
        reason = getattr(error, "strerror", None) or str(error)
        raise ConfigError(f"--host {host} --port {wanted} cannot be listened on: {reason}") from None


@contextmanager
def _silent() -> Iterator[None]:
    """Keeps what viser prints through rich from the user's terminal."""
    console: Any = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before
