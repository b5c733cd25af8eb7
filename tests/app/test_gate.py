"""Nobody gets past the gate without its token, by another name of this machine, or from the page of another site."""

from __future__ import annotations

from collections.abc import Callable

import pytest

pytest.importorskip("nicegui", reason="the extra app is not installed")

from starlette.applications import Starlette
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocket, WebSocketDisconnect

from rigsight.app.gate import Gate

TOKEN = "a-token-of-this-test"
HERE = "http://127.0.0.1:8000"


async def _greet(socket: WebSocket) -> None:
    await socket.accept()
    await socket.send_text("inside")
    await socket.close()


@pytest.fixture
def visit() -> Callable[..., TestClient]:
    def client(host: str = "127.0.0.1", at: str = HERE) -> TestClient:
        routes = [
            Route("/{path:path}", lambda _: PlainTextResponse("inside"), methods=["GET", "PUT"]),
            WebSocketRoute("/socket", _greet),
        ]
        return TestClient(Gate(Starlette(routes=routes), TOKEN, host, 8000), at)

    return client


@pytest.mark.parametrize(
    "path",
    ["/", "/_nicegui/3/static/x.js", "/folder/campaign.toml", "/?token=", "/?token=wrong", "/?token=%ff"],
)
def test_nothing_is_served_without_the_token(path: str, visit: Callable[..., TestClient]) -> None:
    answer = visit().get(path)
    assert (answer.status_code, "inside" in answer.text, "set-cookie" in answer.headers) == (
        403,
        False,
        False,
    )


def test_the_token_becomes_a_cookie_and_leaves_the_address(visit: Callable[..., TestClient]) -> None:
    client = visit()
    first = client.get(f"/rig?token={TOKEN}&a=1", follow_redirects=False)
    assert (first.status_code, first.headers["location"]) == (303, "/rig?a=1")
    assert "HttpOnly" in first.headers["set-cookie"]
    assert "samesite=strict" in first.headers["set-cookie"].lower()
    assert client.get("/rig").text == "inside"
    assert client.get("/rig").headers["x-frame-options"] == "SAMEORIGIN"


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8000", "127.0.0.1.evil.example", "localhost.evil:8000", ""]
)
def test_a_name_that_was_made_to_point_here_is_refused(host: str, visit: Callable[..., TestClient]) -> None:
    client = visit()
    client.get(f"/?token={TOKEN}")
    assert client.get("/", headers={"host": host}).status_code == 421


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8000", "localhost:8000", "[::1]:8000", "192.168.0.7:8000", "rig.lab:8000"]
)
def test_addresses_of_this_machine_are_answered(host: str, visit: Callable[..., TestClient]) -> None:
    client = visit("rig.lab")
    cookie = {"cookie": f"rigsight_8000={TOKEN}"}
    assert client.get("/", headers={"host": host, **cookie}).status_code == 200


@pytest.mark.parametrize(
    ("origin", "code"),
    [(HERE, 200), ("http://127.0.0.1:9000", 403), ("https://evil.example", 403), ("null", 403)],
)
def test_another_page_of_this_machine_cannot_send(
    origin: str, code: int, visit: Callable[..., TestClient]
) -> None:
    client = visit()
    client.get(f"/?token={TOKEN}")
    assert client.put("/upload", headers={"origin": origin}).status_code == code


def test_a_websocket_needs_the_token_too(visit: Callable[..., TestClient]) -> None:
    client, host = visit(), {"host": "127.0.0.1:8000"}
    known = {**host, "cookie": f"rigsight_8000={TOKEN}"}
    for path, headers in (
        ("/socket", host),
        (f"/socket?token={TOKEN}", host),
        ("/socket", {**known, "origin": "null"}),
        ("/socket", {**known, "host": "evil.example"}),
    ):
        with pytest.raises(WebSocketDisconnect), client.websocket_connect(path, headers=headers):
            pass
    with client.websocket_connect("/socket", headers={**known, "origin": HERE}) as socket:
        assert socket.receive_text() == "inside"
