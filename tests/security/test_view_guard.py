"""The server of a live view: who reaches it, and with what. Each attack is one that a page of a stranger can try."""

from __future__ import annotations

import http.client
from collections.abc import Iterator
from contextlib import suppress
from time import perf_counter, sleep
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import msgspec
import pytest
import viser
from websockets.exceptions import ConnectionClosed, ConnectionClosedError, InvalidStatus
from websockets.sync.client import connect

from annelid.errors import MissingDependency
from annelid.live import server as guard
from annelid.live.server import MOST_BYTES, Guard, Server, warning_of

if TYPE_CHECKING:
    from websockets.sync.connection import Connection

CAMERA = {"wxyz": (1.0, 0.0, 0.0, 0.0), "position": (1.0, 1.0, 1.0), "look_at": (0.0, 0.0, 0.0)}
CAMERA |= {"image_height": 9, "image_width": 9, "fov": 1.0, "near": 0.1, "far": 9.0, "up_direction": (0.0, 0.0, 1.0)}


UPLOAD = {"source_component_uuid": "x", "transfer_uuid": "x", "filename": "x", "mime_type": "x"}


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.stop()


def place(server: Server) -> str:
    return f"127.0.0.1:{server.get_port()}"


def get(server: Server, path: str, **headers: str) -> tuple[int, bytes]:
    link = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=20)
    link.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    answer = link.getresponse()
    return answer.status, answer.read()


def websocket(server: Server, path: str, origin: str | None, **headers: str) -> Connection:
    protocol: Any = [f"viser-v{viser.__version__}"]
    return connect(
        f"ws://{place(server)}{path}",
        origin=origin,  # type: ignore[arg-type]
        subprotocols=protocol,
        additional_headers=headers,
        compression=None,
        proxy=None,
    )


def message(kind: str, **fields: Any) -> bytes:
    return msgspec.msgpack.encode({"type": kind, **fields})


def closed_with(socket: Connection) -> int | None:
    """The code that a server ends a websocket with."""

    def listen() -> None:
        while True:
            socket.recv(60.0)

    with pytest.raises(ConnectionClosedError):
        listen()
    return socket.close_code


def test_the_page_opens_with_the_token(server: Server) -> None:
    path = urlsplit(server.address).path
    assert server.address == f"http://{place(server)}/{server.token}/"
    assert len(server.token) >= 32
    for own in (path, f"{path}index.html", f"{path}?websocket=ws"):
        status, page = get(server, own)
        assert status == 200
        assert b"<html" in page
    assert (
        get(server, path, Host=f"localhost:{server.get_port()}", Origin=f"http://localhost:{server.get_port()}")[0]
        == 200
    )
    # Through a tunnel the browser sees another port.
    assert get(server, path, Host="localhost:9000")[0] == 200


def test_without_the_token_nothing_is_served(subtests: pytest.Subtests, server: Server) -> None:
    for path in ("/", "/index.html", "//", "/?token", "/{}x/", "/x{}/", "/\u00e9/", "/%2e%2e/{}/", "/ws"):
        with subtests.test(f"{path!r:.60}"):
            asked = path.format(server.token).encode().decode("latin-1")
            link = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=20)
            link._encode_request = lambda request: request.encode("latin-1")  # type: ignore[attr-defined]
            link.request("GET", asked)
            answer = link.getresponse()
            assert (answer.status, answer.read().decode()) == (403, guard.WRONG_TOKEN)


def test_another_name_for_this_machine_is_refused(subtests: pytest.Subtests, server: Server) -> None:
    for host in (
        "evil.example",
        "evil.example:8080",
        "127.0.0.1.evil.example",
        "127.0.0.1@evil.example",
        "0.0.0.0",
        "",
        "[",
    ):
        with subtests.test(f"{host!r:.60}"):
            status, words = get(server, f"/{server.token}/", Host=host)
            assert (status, words.decode()) == (403, guard.WRONG_HOST)
            with pytest.raises(InvalidStatus) as refused:
                websocket(server, f"/{server.token}", f"http://{host}", Host=host)
            assert refused.value.response.status_code in (400, 403)


def test_another_page_gets_no_websocket(subtests: pytest.Subtests, server: Server) -> None:
    for origin in ("http://evil.example", "null", "http://localhost:1", "http://127.0.0.1", None):
        with subtests.test(f"{origin!r:.60}"):
            with pytest.raises(InvalidStatus) as refused:
                websocket(server, f"/{server.token}", origin)
            assert refused.value.response.status_code == 403
            if origin is not None:
                assert get(server, f"/{server.token}/", Origin=origin) == (403, guard.WRONG_ORIGIN.encode())


def test_a_websocket_needs_the_token(subtests: pytest.Subtests, server: Server) -> None:
    for path in ("", "/", "/wrong", "/{}x"):
        with subtests.test(f"{path!r:.60}"):
            with pytest.raises(InvalidStatus) as refused:
                websocket(server, path.format(server.token), f"http://{place(server)}")
            assert refused.value.response.status_code == 403


def test_the_page_itself_is_listened_to(server: Server) -> None:
    with websocket(server, f"/{server.token}", f"http://{place(server)}") as socket:
        socket.send(message("ViewerCameraMessage", **CAMERA))
        end = perf_counter() + 20.0
        while not server.get_clients():
            assert perf_counter() < end
            sleep(0.01)


def test_what_the_page_never_says_ends_the_connection(subtests: pytest.Subtests, server: Server) -> None:
    for sent in (
        message("FileTransferStartUpload", part_count=1000, size_bytes=700_000_000, **UPLOAD),
        message("FileTransferPart", source_component_uuid="x", transfer_uuid="x", part_index=0, content=b"x" * 1000),
        message("ShareUrlRequest"),
        message("RemoveSceneNodeMessage", name="/worm"),
        message("NoSuchMessage"),
        message("GuiUpdateMessage", uuid="x", updates={"removed": True}),
        message("GuiUpdateMessage", uuid="x", updates={"value": 1, "update_cb": []}),
        message("GuiUpdateMessage", uuid="x", updates=["value"]),
        message("GuiUpdateMessage", uuid="x"),
        msgspec.msgpack.encode([1, 2]),
        msgspec.msgpack.encode({"type": ["ViewerCameraMessage"]}),
        b"\x91" * 5000,
        b"\xc1",
        b"",
        "a text",
    ):
        with subtests.test(f"{sent!r:.60}"):
            with websocket(server, f"/{server.token}", f"http://{place(server)}") as socket:
                socket.send(sent)
                assert closed_with(socket) == 1008
            assert server.gui._current_file_upload_states == {}


FORBIDDEN = message("FileTransferStartUpload", part_count=1, size_bytes=10, **UPLOAD)
TURNED = message("GuiUpdateMessage", uuid="x", updates={"value": 1.0})


@pytest.mark.parametrize("sent", [[FORBIDDEN] * 500, [FORBIDDEN, TURNED]], ids=["500", "then allowed ones"])
def test_nothing_is_handled_after_what_the_page_never_says(server: Server, sent: list[bytes]) -> None:
    from viser import _messages

    handled: list[object] = []

    def handle(_: object, what: object) -> None:
        handled.append(what)

    kinds = _messages.FileTransferStartUpload, _messages.GuiUpdateMessage
    for kind in kinds:
        server.gui._websock_interface.register_handler(kind, handle)
    try:
        with websocket(server, f"/{server.token}", f"http://{place(server)}") as socket:
            socket.send(TURNED)
            # The view may close before all is sent.
            with suppress(ConnectionClosed):
                for each in sent:
                    socket.send(each)
            assert closed_with(socket) == 1008
        end = perf_counter() + 20.0
        while not handled:
            assert perf_counter() < end
            sleep(0.01)
        sleep(0.2)
    finally:
        for kind in kinds:
            server.gui._websock_interface.unregister_handler(kind, handle)
    assert [type(each).__name__ for each in handled] == ["GuiUpdateMessage"]


def test_a_huge_message_ends_the_connection(server: Server) -> None:
    with websocket(server, f"/{server.token}", f"http://{place(server)}") as socket:
        socket.send(message("GuiUpdateMessage", uuid="x", updates={"value": b"x" * MOST_BYTES}))
        assert closed_with(socket) == 1009


def test_a_viser_that_cannot_be_guarded_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    import websockets
    from websockets.asyncio.server import serve

    # As if viser had imported the function itself.
    own = SimpleNamespace(serve=serve, ServerConnection=object)
    others = {name: getattr(websockets, name) for name in ("datastructures", "exceptions")}
    renamed = SimpleNamespace(asyncio=SimpleNamespace(server=own), **others)
    monkeypatch.setattr("viser.infra._infra.websockets", renamed)
    with pytest.raises(MissingDependency, match=r"pip install 'viser==1\.1\.1'"):
        Server()


def test_every_message_of_the_list_is_one_of_viser() -> None:
    from viser import _messages

    assert set(_messages.Message._subclass_from_type_string()) >= guard.MESSAGES


def test_a_server_for_others_says_so_and_still_asks_for_the_token() -> None:
    assert warning_of("127.0.0.1") is None
    assert warning_of("::1") is None
    assert warning_of("localhost") is None
    assert "other machines reach this view" in (warning_of("0.0.0.0") or "")
    guarding = Guard("0.0.0.0")
    assert guarding._is_own("192.0.2.7:8080")
    assert not guarding._is_own("evil.example:8080")
    assert not Guard("127.0.0.1")._is_own("192.0.2.7:8080")
