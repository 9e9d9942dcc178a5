"""Who may talk to the dashboard: hosts, origins, body sizes and the headers of every answer."""

import socket
from collections.abc import Iterable

import pytest
from starlette.types import Message, Receive, Scope, Send

from urc.web.serve.access import Access
from urc.web.serve.policy import (
    BODY_BYTES,
    Authority,
    Policy,
    is_host_allowed,
    is_origin_ours,
    own_names,
    parse_host,
)

pytestmark = pytest.mark.anyio

NAMES = frozenset({"robot-pi", "lab.example.org", "lab-pc.local"})

HOSTS = [
    ("127.0.0.1", True),
    ("127.0.0.1:8080", True),
    ("192.168.4.1:8080", True),
    ("0.0.0.0:8080", True),
    ("[::1]", True),
    ("[::1]:8080", True),
    ("[FE80::1]:80", True),
    ("[::ffff:127.0.0.1]:8080", True),
    ("localhost", True),
    ("LOCALHOST:8080", True),
    ("localhost.:8080", True),
    ("lab-pc.local", True),
    ("Lab-PC.LOCAL:8080", True),
    ("lab-pc.local.:8080", True),
    ("puppet.local", False),
    ("evil.local:8080", False),
    ("evil.lab-pc.local", False),
    ("robot-pi:8080", True),
    ("ROBOT-PI", True),
    ("lab.example.org", True),
    ("", False),
    ("evil.example", False),
    ("evil.example:8080", False),
    ("localhost.evil.example", False),
    ("localhost:8080.evil.example", False),
    ("127.0.0.1.evil.example", False),
    ("127.0.0.1.", False),
    ("127.1", False),
    ("2130706433", False),
    ("0x7f.0.0.1", False),
    ("0177.0.0.1", False),
    ("256.0.0.1", False),
    ("local", False),
    (".local", False),
    ("-.local", False),
    ("evil..local", False),
    ("foo.localhost", False),
    ("lab.example.org.evil.example", False),
    ("sub.lab.example.org", False),
    ("user@127.0.0.1", False),
    ("user:password@localhost", False),
    ("127.0.0.1:", False),
    ("127.0.0.1:0", False),
    ("127.0.0.1:65536", False),
    ("127.0.0.1:80:80", False),
    ("127.0.0.1 ", False),
    ("127.0.0.1/x", False),
    ("localhost\tx", False),
    ("::1", False),
    ("[::1", False),
    ("[::1%25eth0]", False),
    ("[v1.x]", False),
    ("löcalhost", False),
    ("localhost\n", False),
    ("localhost,localhost", False),
    ("127.0.0.\u0661", False),
]

ORIGINS = [
    ("http://127.0.0.1:8080", "ws", "127.0.0.1:8080", True),
    ("http://127.0.0.1:8080", "http", "127.0.0.1:8080", True),
    ("HTTP://LOCALHOST:8080", "ws", "localhost:8080", True),
    ("http://puppet.local", "ws", "puppet.local", True),
    ("http://puppet.local", "ws", "puppet.local:80", True),
    ("http://puppet.local:80", "ws", "puppet.local", True),
    ("https://puppet.local", "wss", "puppet.local:443", True),
    ("http://[::1]:8080", "ws", "[::1]:8080", True),
    ("null", "ws", "127.0.0.1:8080", False),
    ("", "ws", "127.0.0.1:8080", False),
    ("file://", "ws", "127.0.0.1:8080", False),
    ("http://evil.example", "ws", "127.0.0.1:8080", False),
    ("http://127.0.0.1:8081", "ws", "127.0.0.1:8080", False),
    ("http://127.0.0.1", "ws", "127.0.0.1:8080", False),
    ("http://localhost:8080", "ws", "127.0.0.1:8080", False),
    ("http://sub.puppet.local", "ws", "puppet.local", False),
    ("http://puppet.local.evil.example", "ws", "puppet.local", False),
    ("http://puppet.local.", "ws", "puppet.local", False),
    ("https://127.0.0.1:8080", "ws", "127.0.0.1:8080", False),
    ("http://127.0.0.1:8080", "wss", "127.0.0.1:8080", False),
    ("http://127.0.0.1:8080/", "ws", "127.0.0.1:8080", False),
    ("http://user@127.0.0.1:8080", "ws", "127.0.0.1:8080", False),
    ("http://127.0.0.1:8080 http://evil.example", "ws", "127.0.0.1:8080", False),
    ("ws://127.0.0.1:8080", "ws", "127.0.0.1:8080", False),
    ("chrome-extension://abcdefgh", "ws", "127.0.0.1:8080", False),
]


@pytest.mark.parametrize(("host", "is_allowed"), HOSTS)
def test_hosts(host: str, is_allowed: bool) -> None:
    """Addresses, localhost and names that are known pass; nothing else, in no disguise."""
    authority = parse_host(host)
    assert (authority is not None and is_host_allowed(authority, NAMES)) is is_allowed


@pytest.mark.parametrize(
    ("host", "is_allowed"),
    [
        ("localhost:8080", True),
        ("127.0.0.1:8080", True),
        ("127.9.9.9", True),
        ("[::1]:8080", True),
        ("[::ffff:127.0.0.1]", True),
        ("robot-pi", True),
        ("192.168.4.1:8080", False),
        ("0.0.0.0:8080", False),
        ("[fe80::1]", False),
        ("evil.local", False),
    ],
)
def test_over_loopback_only_loopback_is_answered(host: str, is_allowed: bool) -> None:
    """A name that was bound to 127.0.0.1 by somebody else is not this machine's."""
    authority = parse_host(host)
    assert authority is not None
    assert is_host_allowed(authority, NAMES, is_loopback=True) is is_allowed


@pytest.mark.parametrize(
    ("name", "names"),
    [
        ("Lab-PC", {"lab-pc.local"}),
        ("lab-pc.local", {"lab-pc.local"}),
        ("lab-pc.example.org", {"lab-pc.local"}),
        ("", set()),
        ("lab pc", set()),
    ],
)
def test_under_local_only_this_machines_own_name_is_answered(
    name: str, names: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Any neighbour may answer for any other."""
    monkeypatch.setattr(socket, "gethostname", lambda: name)
    assert own_names() == names


@pytest.mark.parametrize(
    ("client", "host", "status"),
    [
        ("127.0.0.1", "localhost", 200),
        ("127.0.0.1", "lab-pc.local", 421),
        ("127.0.0.1", "evil.local", 421),
        ("192.168.4.2", "lab-pc.local", 200),
        ("192.168.4.2", "192.168.4.1:8080", 200),
        ("192.168.4.2", "evil.local", 421),
        ("127.0.0.1", "robot-pi", 200),
    ],
)
async def test_who_comes_how_decides_which_names_are_answered(
    client: str, host: str, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page of another name, bound to this machine, gets one line and nothing else."""
    monkeypatch.setattr(socket, "gethostname", lambda: "lab-pc")
    sent = await ask(("host", host), client=client)
    assert sent[0]["status"] == status


@pytest.mark.parametrize(("origin", "scheme", "host", "is_ours"), ORIGINS)
def test_origins(origin: str, scheme: str, host: str, is_ours: bool) -> None:
    """Only exactly our own scheme, host and port are ours."""
    authority = parse_host(host)
    assert authority is not None
    assert is_origin_ours(origin, scheme, authority) is is_ours


def test_a_host_is_kept_with_its_port() -> None:
    """The parts of a host are told apart, and compared without case."""
    assert parse_host("Puppet.Local:8080") == Authority("puppet.local", 8080)
    assert parse_host("[::1]") == Authority("[::1]", None)


async def inner(scope: Scope, receive: Receive, send: Send) -> None:
    """Stand for the application: reads the whole body, then answers 200."""
    while (await receive()).get("more_body"):
        pass
    await send({"type": "http.response.start", "status": 200, "headers": [(b"x-ours", b"1")]})
    await send({"type": "http.response.body", "body": b""})


async def ask(
    *headers: tuple[str, str],
    kind: str = "http",
    method: str = "GET",
    body: Iterable[bytes] = (),
    client: str = "127.0.0.1",
) -> list[Message]:
    """Return what the policy around `inner` answers."""
    scope: Scope = {
        "type": kind,
        "scheme": "ws" if kind == "websocket" else "http",
        "method": method,
        "path": "/",
        "client": (client, 50_000),
        "headers": [(name.encode(), value.encode()) for name, value in headers],
        "extensions": {"websocket.http.response": {}},
    }
    parts = [*body]
    sent: list[Message] = []

    async def receive() -> Message:
        part = parts.pop(0) if parts else b""
        return {"type": "http.request", "body": part, "more_body": bool(parts)}

    async def send(message: Message) -> None:
        sent.append(message)

    await Policy(inner, Access(key=KEY), allowed_hosts=["Robot-Pi."])(scope, receive, send)
    return sent


KEY = "the-start-key"
HOST = ("host", "127.0.0.1:8080")
WITH_KEY = ("authorization", f"Bearer {KEY}")
OURS = ("origin", "http://127.0.0.1:8080")


@pytest.mark.parametrize(
    ("headers", "kind", "method", "status"),
    [
        ([HOST], "http", "GET", 200),
        ([("host", "robot-pi")], "http", "GET", 200),
        ([HOST], "http", "HEAD", 200),
        ([HOST, OURS], "http", "POST", 200),
        ([HOST, WITH_KEY], "http", "POST", 200),
        ([HOST, WITH_KEY], "websocket", "GET", 200),
        ([HOST, WITH_KEY, ("origin", "http://evil.example")], "http", "POST", 403),
        # No page of another site can send it; the sign-in refuses the token, or lets STOP pass.
        ([HOST, ("authorization", "Bearer guessed")], "http", "POST", 200),
        ([HOST, ("authorization", "Basic guessed")], "http", "POST", 403),
        ([HOST, ("origin", "http://evil.example")], "http", "GET", 200),
        ([], "http", "GET", 421),
        ([HOST, HOST], "http", "GET", 421),
        ([("host", "evil.example")], "http", "GET", 421),
        ([("host", "evil.example"), ("origin", "http://evil.example")], "websocket", "GET", 421),
        ([HOST], "http", "POST", 403),
        ([HOST], "http", "DELETE", 403),
        ([HOST], "http", "OPTIONS", 403),
        ([HOST, ("origin", "null")], "http", "POST", 403),
        ([HOST], "websocket", "GET", 403),
        ([HOST, ("origin", "http://evil.example")], "websocket", "GET", 403),
        ([HOST, OURS, OURS], "websocket", "GET", 403),
        ([HOST, OURS, ("content-length", str(BODY_BYTES))], "http", "POST", 200),
        ([HOST, OURS, ("content-length", str(BODY_BYTES + 1))], "http", "POST", 413),
        ([HOST, OURS, ("content-length", "9" * 5000)], "http", "POST", 413),
        ([HOST, OURS, ("content-length", "-1")], "http", "POST", 413),
    ],
)
async def test_requests(
    headers: list[tuple[str, str]], kind: str, method: str, status: int
) -> None:
    """Each refusal has its status, and every answer the headers of the page policy."""
    start = (await ask(*headers, kind=kind, method=method))[0]
    assert start["status"] == status
    names = [name for name, _ in start["headers"]]
    assert {b"content-security-policy", b"x-content-type-options", b"referrer-policy"} <= {*names}
    assert len(names) == len(set(names))


async def test_a_body_with_two_lengths_is_refused_and_ends_the_connection() -> None:
    """A web server in front that reads the other length would see a smuggled request."""
    two = (("content-length", "4"), ("transfer-encoding", "chunked"))
    start = (await ask(HOST, OURS, *two, method="POST"))[0]
    assert start["status"] == 400
    assert (b"connection", b"close") in start["headers"]


async def test_an_allowed_upgrade_reaches_the_application() -> None:
    """With our host and our origin, the upgrade is the application's business."""
    sent = await ask(HOST, OURS, kind="websocket")
    assert [message["type"] for message in sent][:1] == ["http.response.start"]


async def test_a_body_that_grows_too_long_is_refused_while_it_is_read() -> None:
    """Without a length in front, the bytes themselves are counted."""
    from starlette.exceptions import HTTPException

    with pytest.raises(HTTPException) as caught:
        await ask(HOST, OURS, method="POST", body=[b"x" * BODY_BYTES, b"x"])
    assert caught.value.status_code == 413


async def test_each_answer_has_its_own_nonce() -> None:
    """A nonce that is used twice is no nonce."""
    policies = set()
    for _ in range(3):
        headers = dict((await ask(HOST))[0]["headers"])
        policies.add(headers[b"content-security-policy"])
    assert len(policies) == 3
