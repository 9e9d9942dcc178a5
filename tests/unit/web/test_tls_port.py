"""Plain HTTP on a port with TLS, and requests from a web server in front of URC."""

from typing import Any

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.testclient import TestClient
from starlette.types import ASGIApp
from starlette.websockets import WebSocket, WebSocketDisconnect

from urc.web.serve.tls_port import BehindProxy, TlsPort


async def seen(request: Request) -> PlainTextResponse:
    """Show the scheme that the application sees."""
    return PlainTextResponse(f"{request.url.scheme} {request.url.path}")


async def joined(socket: WebSocket) -> None:
    """Show the scheme of a WebSocket."""
    await socket.accept()
    await socket.send_text(socket.url.scheme)
    await socket.close()


NAMES = ("robot.local",)
APP = Starlette(
    routes=[
        WebSocketRoute("/ws", joined),
        Route("/{path:path}", seen, methods=["GET", "POST", "HEAD"]),
    ]
)


def client(app: ASGIApp, base: str, peer: str = "192.168.4.7") -> TestClient:
    """Return a client whose network address is `peer`."""
    return TestClient(app, base_url=base, client=(peer, 50000), follow_redirects=False)


@pytest.mark.parametrize(
    ("path", "place"),
    [
        ("/", "https://robot.local:8080/"),
        ("/robots/cart/?page=2", "https://robot.local:8080/robots/cart/?page=2"),
        ("//evil.example/x", "https://robot.local:8080/evil.example/x"),
        ("/trust/other", "https://robot.local:8080/trust/other"),
        ("/api/v1/robots/cart/stop", "https://robot.local:8080/api/v1/robots/cart/stop"),
    ],
)
def test_plain_pages_are_redirected_to_https(path: str, place: str) -> None:
    answer = client(TlsPort(APP, NAMES), "http://robot.local:8080").get(
        f"http://robot.local:8080{path}"
    )
    assert (answer.status_code, answer.headers["location"]) == (307, place)
    assert answer.headers["cache-control"] == "no-store"


def test_a_plain_request_that_changes_something_gets_one_line() -> None:
    plain = client(TlsPort(APP, NAMES), "http://robot.local:8080")
    answer = plain.post("/api/v1/robots/cart/commands")
    assert answer.status_code == 403
    assert answer.text == "This port requires HTTPS: use an address that begins with https://\n"
    assert "content-security-policy" in answer.headers
    assert plain.get("/", headers={"host": "a b"}).status_code == 403
    with pytest.raises(WebSocketDisconnect), plain.websocket_connect("/ws"):
        pass


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/trust"), ("GET", "/trust/authority.crt"), ("GET", "/static/core/app.css"),
        ("GET", "/words/de.js"), ("GET", "/healthz"), ("POST", "/api/v1/robots/cart/stop"),
    ],
)  # fmt: skip
def test_stop_and_what_a_device_needs_before_trust_are_plain(method: str, path: str) -> None:
    plain = client(TlsPort(APP, NAMES), "http://192.168.4.1:8080")
    assert plain.request(method, path).text == f"http {path}"


def test_everything_else_needs_both_ends_on_this_machine() -> None:
    """A client's address alone is no proof: a router may translate it."""
    assert (
        client(TlsPort(APP, NAMES), "http://127.0.0.1:8080", "127.0.0.1").get("/").status_code
        == 200
    )
    assert (
        client(TlsPort(APP, NAMES), "http://[::1]:8080", "::ffff:127.0.0.1").get("/").status_code
        == 200
    )
    for base, peer in (
        ("http://127.0.0.1:8080", "192.168.4.7"), ("http://192.168.4.1:8080", "127.0.0.1"),
    ):  # fmt: skip
        assert client(TlsPort(APP, NAMES), base, peer).get("/").status_code == 307


def test_https_reaches_the_application() -> None:
    secure = client(TlsPort(APP, NAMES), "https://robot.local:8080")
    assert secure.get("/robots/cart/").text == "https /robots/cart/"
    with secure.websocket_connect("wss://robot.local:8080/ws") as socket:
        assert socket.receive_text() == "wss"


@pytest.mark.parametrize(
    ("host", "scheme"),
    [
        ("robots.example", "https"), ("ROBOTS.example", "https"), ("robots.example:8080", "http"),
        ("r.lab:8443", "https"), ("r.lab", "http"), ("127.0.0.1:8080", "http"),
        ("robots.example.evil.example", "http"),
    ],
)  # fmt: skip
def test_a_public_name_has_the_scheme_of_its_web_server(host: str, scheme: str) -> None:
    app = BehindProxy(APP, ["robots.example", "r.lab:8443"])
    answer = client(app, "http://127.0.0.1:8080", "127.0.0.1").get("/x", headers={"host": host})
    assert answer.text == f"{scheme} /x"


def test_a_socket_of_a_public_name_is_secure() -> None:
    app: Any = BehindProxy(APP, ["robots.example"])
    headers = {"host": "robots.example"}
    with client(app, "http://127.0.0.1").websocket_connect("/ws", headers=headers) as socket:
        assert socket.receive_text() == "wss"


@pytest.mark.parametrize("host", ["evil.example", "robot.local.evil.example", "-"])
def test_a_foreign_host_is_not_redirected(host: str) -> None:
    """A page of that host would follow it, and its address would look as if it were URC's."""
    plain = client(TlsPort(APP, NAMES), "http://robot.local:8080")
    answer = plain.get("/robots/cart/", headers={"host": host})
    assert answer.status_code in (403, 421)
    assert "location" not in answer.headers


def test_an_address_of_the_machine_is_redirected() -> None:
    plain = client(TlsPort(APP), "http://192.168.4.1:8080")
    assert plain.get("/").headers["location"] == "https://192.168.4.1:8080/"
