"""The server of a live view: who reaches it, and with what. Each attack is one that a page of a stranger can try."""

from __future__ import annotations

import http.client
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import msgspec
import pytest
import viser
from websockets.exceptions import ConnectionClosedError, InvalidStatus
from websockets.sync.client import connect

from annelid.errors import MissingDependency
from annelid.live.server import MOST_BYTES, WRONG_TOKEN, Server, warning_of


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.stop()


def get(server: Server, path: str) -> tuple[int, str]:
    link = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=20)
    link._encode_request = lambda request: request.encode("latin-1")  # type: ignore[attr-defined]
    link.request("GET", path)
    answer = link.getresponse()
    return answer.status, answer.read().decode()


def websocket(server: Server, path: str) -> Any:
    protocol: Any = [f"viser-v{viser.__version__}"]
    address = f"ws://127.0.0.1:{server.get_port()}{path}"
    return connect(address, subprotocols=protocol, compression=None, proxy=None)


def test_the_page_opens_with_the_token_and_listens_to_this_machine(server: Server) -> None:
    path = urlsplit(server.address).path
    assert server.address == f"http://127.0.0.1:{server.get_port()}/{server.token}/"
    assert len(server.token) >= 32
    for own in (path, f"{path}index.html", f"{path}?websocket=ws"):
        status, page = get(server, own)
        assert status == 200
        assert "<html" in page
    with websocket(server, f"/{server.token}") as socket:
        assert socket.recv(20.0)


@pytest.mark.parametrize(
    "path", ["/", "/index.html", "//", "/?token", "/{}x/", "/x{}/", "/\u00e9/", "/%2e%2e/{}/", "/ws", "", "/{}x"]
)
def test_without_the_token_nothing_is_served(server: Server, path: str) -> None:
    asked = path.format(server.token).encode().decode("latin-1")
    if asked:
        assert get(server, asked) == (403, WRONG_TOKEN)
    if asked.isascii():
        with pytest.raises(InvalidStatus) as refused:
            websocket(server, asked)
        assert refused.value.response.status_code == 403


def test_a_huge_message_ends_the_connection(server: Server) -> None:
    sent = msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": b"x" * MOST_BYTES}})
    with websocket(server, f"/{server.token}") as socket:
        socket.send(sent)
        with pytest.raises(ConnectionClosedError):
            list(socket)
        assert socket.close_code == 1009


def test_a_viser_that_cannot_be_protected_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    import websockets
    from websockets.asyncio.server import serve

    # As if viser had imported the function itself.
    own = SimpleNamespace(serve=serve, ServerConnection=object)
    others = {name: getattr(websockets, name) for name in ("datastructures", "exceptions")}
    renamed = SimpleNamespace(asyncio=SimpleNamespace(server=own), **others)
    monkeypatch.setattr("viser.infra._infra.websockets", renamed)
    with pytest.raises(MissingDependency, match=r"pip install 'viser==1\.1\.1'"):
        Server()


def test_a_view_for_other_machines_says_so() -> None:
    assert [warning_of(host) for host in ("127.0.0.1", "::1", "localhost")] == [None] * 3
    assert "other machines reach this view" in (warning_of("0.0.0.0") or "")
