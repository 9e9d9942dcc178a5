"""HTTP against web servers that URC's authors did not write: lighttpd, ffmpeg, OpenSSL."""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.certificates import Authority
from tests.e2e.transports.detour import Detour
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.processes import Server
from tests.e2e.transports.programs import listens, program
from tests.e2e.transports.web import PASSWORD, USER, camera, lighttpd
from urc.model.payload import Envelope
from urc.transports.base import (
    ConnectFailed,
    PeerClosed,
    TopicSubscription,
    Transport,
    TransportSetup,
)
from urc.transports.http import from_setup

WAIT_S = 15.0

pytestmark = [pytest.mark.anyio]
WEB = pytest.mark.needs("lighttpd")


@pytest.fixture
async def web(tmp_path: Path) -> AsyncIterator[Server]:
    server = lighttpd(tmp_path)
    await server.start()
    yield server
    server.kill()


@asynccontextmanager
async def line(
    port: int, *topics: TopicSubscription, scheme: str = "http", **options: object
) -> AsyncIterator[Transport]:
    """Open a line to a port of loopback, and see to it that nothing of it is left."""
    options = {"url": f"{scheme}://127.0.0.1:{port}", **options}
    async with nothing_left():
        transport = from_setup(TransportSetup("web", options, topics))
        try:
            await transport.open(20.0)
            yield transport
        finally:
            await transport.close()
            del transport


async def received(transport: Transport) -> Envelope:
    async with asyncio.timeout(WAIT_S):
        got = await transport.receive()
    assert isinstance(got, Envelope)
    return got


async def asked(transport: Transport, path: str, **rest: object) -> Envelope:
    """Make a request and return its answer."""
    body = rest.pop("body", None)
    await transport.send(Envelope("request", {"id": 1, "path": path, **rest}, body))
    answer = await received(transport)
    assert answer.verb == "response"
    assert answer.attributes["id"] == 1
    return answer


@WEB
async def test_request_and_answer(web: Server) -> None:
    """The body comes as bytes, with the status and the headers of the answer."""
    async with line(web.port) as transport:
        answer = await asked(transport, "/state.json", method="GET")
        assert answer.body == b'{"battery": 87}'
        assert answer.attributes["ok"] is True
        assert answer.attributes["status"] == 200
        headers = answer.attributes["headers"]
        assert isinstance(headers, dict)
        assert headers["content-type"] == "application/json"


@WEB
async def test_method_query_headers_and_body_arrive(web: Server) -> None:
    """An object goes as JSON, bytes as they are; values of the query are escaped."""
    async with line(web.port, headers={"X-Robot": "arm 7"}) as transport:
        query = {"speed": 0.5, "on": True, "name": "a&b"}
        answer = await asked(
            transport, "/echo.cgi", method="PUT", query=query, body={"joint": [1, 2]}
        )
        assert answer.body == b'PUT speed=0.5&on=true&name=a%26b arm 7 {"joint":[1,2]}'
        answer = await asked(transport, "/echo.cgi?a=1", method="POST", query="b=2", body=b"\0x")
        assert answer.body == b"POST a=1&b=2 arm 7 \0x"


@WEB
@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("/missing", "404 Not Found"),
        ("/busy.cgi", "503 Service Unavailable: the arm is moving"),
        (
            "/moved",
            "the robot redirected to http://127.0.0.1:1/elsewhere; redirects are not followed",
        ),
        ("/basic/state.json", "401 Unauthorized"),
        ("/a\nb", "GET '/a\\nb' is not a valid request"),
        ("/flood.cgi", "the response is longer than 100000 bytes"),
    ],
)
async def test_bad_answer_is_one_line(web: Server, path: str, reason: str) -> None:
    """Whatever goes wrong with one request, the line stands and the next one is answered."""
    async with line(web.port, max_body=100_000) as transport:
        answer = await asked(transport, path)
        assert answer.attributes["ok"] is False
        assert str(answer.attributes["reason"]).startswith(reason)
        assert (await asked(transport, "/state.json")).attributes["ok"] is True


@WEB
async def test_bad_answer_brings_its_status_and_its_body(web: Server) -> None:
    """What the driver has forms for is in there; one line for people stands beside it."""
    async with line(web.port) as transport:
        answer = await asked(transport, "/busy.cgi")
        assert answer.attributes["status"] == 503
        assert isinstance(answer.body, bytes)
        assert b"the arm is moving" in answer.body
        moved = await asked(transport, "/moved")
        headers = moved.attributes["headers"]
        assert isinstance(headers, dict)
        assert headers["location"] == "http://127.0.0.1:1/elsewhere"


@WEB
async def test_a_url_that_the_robot_named_is_asked_for(web: Server) -> None:
    """Whole, or from its root: what is below the document's URL is not put before it."""
    async with line(web.port, url=f"http://127.0.0.1:{web.port}/basic") as transport:
        for url in (f"http://127.0.0.1:{web.port}/state.json", "/state.json#end"):
            await transport.send(Envelope("request", {"id": 1, "url": url}, None))
            answer = await received(transport)
            assert answer.body == b'{"battery": 87}'


@WEB
@pytest.mark.parametrize(
    "url",
    [
        "http://127.0.0.1:1/state.json",
        "http://localhost/state.json",
        "//127.0.0.1/state.json",
        "https://127.0.0.1/state.json",
        "http://me@127.0.0.1:{port}/state.json",
        "http://127.0.0.1:{port}@evil/state.json",
        "file:///etc/passwd",
        "\\\\evil\\x",
        "http://[",
    ],
)
async def test_a_url_that_leads_elsewhere_is_not_asked_for(web: Server, url: str) -> None:
    """Nothing that a robot says makes URC talk to another host, port or protocol."""
    async with line(web.port) as transport:
        named = url.replace("{port}", str(web.port))
        await transport.send(Envelope("request", {"id": 1, "url": named}, None))
        answer = await received(transport)
        if named.startswith("\\"):
            assert answer.attributes["status"] == 404  # a path of the robot's own
            return
        assert answer.attributes["ok"] is False
        assert "status" not in answer.attributes
        reason = str(answer.attributes["reason"])
        assert "requests are sent only to the robot" in reason or "is not a URL" in reason


@WEB
@pytest.mark.parametrize("kind", ["basic", "digest"])
async def test_robot_that_asks_who_we_are(web: Server, kind: str) -> None:
    """The right password opens; a wrong one is told by the robot, again and again."""
    right = {"type": kind, "user": USER, "password": PASSWORD}
    async with line(web.port, auth=right) as transport:
        for _ in range(3):
            answer = await asked(transport, f"/{kind}/state.json?a=b")
            assert answer.body == b'{"battery": 87}'
    async with line(web.port, auth={**right, "password": "guess"}) as transport:
        for _ in range(2):
            answer = await asked(transport, f"/{kind}/state.json")
            assert answer.attributes["reason"] == "401 Unauthorized"


@WEB
async def test_request_without_an_answer_is_given_up(web: Server) -> None:
    """It fails after its time, and the robot, which is still there, is asked on."""
    async with line(web.port, response_timeout="300ms") as transport:
        answer = await asked(transport, "/slow.cgi")
        assert answer.attributes == {"id": 1, "ok": False, "reason": "no answer within 0.3 s"}
        assert (await asked(transport, "/state.json")).attributes["ok"] is True


@WEB
async def test_newer_requests_overtake_those_that_hang(web: Server) -> None:
    """Nothing waits for a robot that hangs for longer than a moment: a stop must get through."""
    async with line(web.port, in_flight=2) as transport:
        async with asyncio.timeout(WAIT_S):
            for number in (1, 2):
                await transport.send(Envelope("request", {"id": number, "path": "/slow.cgi"}))
            await transport.send(Envelope("request", {"id": 3, "path": "/state.json"}))
        answer = await received(transport)
        assert answer.attributes["id"] == 3
        assert answer.attributes["ok"] is True


@WEB
async def test_robot_that_is_gone_ends_the_line(web: Server) -> None:
    """The request fails with the reason, the line ends with it, and opens again later."""
    async with line(web.port) as transport:
        assert (await asked(transport, "/state.json")).attributes["ok"] is True
        web.kill()
        reason = f"nothing listens on 127.0.0.1:{web.port} (connection refused)"
        answer = await asked(transport, "/state.json")
        assert answer.attributes["ok"] is False
        assert answer.attributes["reason"] == reason
        with pytest.raises(PeerClosed, match="nothing listens"):
            await received(transport)
        with pytest.raises(ConnectFailed, match="nothing listens"):
            await transport.open(20.0)
        await web.start()
        await transport.open(20.0)
        assert (await asked(transport, "/state.json")).attributes["ok"] is True


@WEB
async def test_probe_decides_whether_the_robot_is_there(web: Server) -> None:
    """A connection alone is not enough then."""
    async with line(web.port, probe="/state.json"):
        pass
    with pytest.raises(ConnectFailed, match="the probe of /missing failed: 404 Not Found"):
        async with line(web.port, probe="/missing"):
            pass


@WEB
async def test_events_go_on_after_the_last_one(web: Server) -> None:
    """Named events have a topic of their own; a new connection starts where the old one ended."""
    topics = [
        TopicSubscription("/events.cgi#battery", {"stream": "sse"}),
        TopicSubscription("/events.cgi", {"stream": "sse"}),
    ]
    async with line(web.port, *topics) as transport:
        heard = [await received(transport) for _ in range(14)]
    levels = [one.body for one in heard if one.attributes["topic"] == "/events.cgi#battery"]
    ticks = [one.body for one in heard if one.attributes["topic"] == "/events.cgi"]
    assert levels == [str(99 - n).encode() for n in range(7)]
    assert ticks == [f'{{"tick":\n{n}}}'.encode() for n in range(1, 8)]
    assert heard[0].attributes["event"] == "battery"
    assert heard[0].attributes["id"] == "1"


@WEB
async def test_lines_come_one_by_one(web: Server) -> None:
    """In order and whole, while the body is still under way."""
    async with line(web.port, TopicSubscription("/lines.cgi", {"stream": "lines"})) as transport:
        heard = [await received(transport) for _ in range(50)]
    assert [one.body for one in heard] == [f"line {n}".encode() for n in range(1, 51)]


@WEB
async def test_stills_are_fetched_again_and_again(
    web: Server, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """One picture a period; one that fails is told once, and the line stands."""
    picture = tmp_path / "www" / "still.jpg"
    caplog.set_level(logging.INFO, "urc.transports")
    picture.write_bytes(b"\xff\xd8 one \xff\xd9")
    topic = TopicSubscription("/still.jpg", {"stream": "stills", "every": 0.05})
    async with line(web.port, topic) as transport:
        first = await received(transport)
        assert (first.attributes["topic"], first.body) == ("/still.jpg", b"\xff\xd8 one \xff\xd9")
        picture.unlink()
        async with asyncio.timeout(WAIT_S):
            while not caplog.messages:  # noqa: ASYNC110 - a log tells nobody
                await asyncio.sleep(0.02)
        picture.write_bytes(b"\xff\xd8 two \xff\xd9")
        while (await received(transport)).body != b"\xff\xd8 two \xff\xd9":
            pass
    failed, mended = caplog.messages
    assert failed.endswith(" /still.jpg: 404 Not Found; trying again")
    assert " /still.jpg: recovered after " in mended


@pytest.mark.needs("ffmpeg")
async def test_camera_that_streams() -> None:
    """Pictures come whole; whoever takes them slowly gets the newest, and others are dropped."""
    port = free_port()
    async with program(*camera(port)):
        await listens(port)
        async with line(port, TopicSubscription("/cam", {"stream": "mjpeg"})) as transport:
            for _ in range(10):
                picture = await received(transport)
                assert picture.attributes["topic"] == "/cam"
                assert isinstance(picture.body, bytes)
                assert picture.body[:3] == b"\xff\xd8\xff"
                assert picture.body[-2:] == b"\xff\xd9"
            dropped = picture.attributes["dropped"]
            assert isinstance(dropped, int)
            late = dropped
            async with asyncio.timeout(WAIT_S):
                while late < dropped + 10:
                    await asyncio.sleep(0.3)  # some pictures
                    late = (await received(transport)).attributes["dropped"]
                    assert isinstance(late, int)


@pytest.mark.needs("openssl")
async def test_secure_server_is_checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its certificate must be known; then everything goes as without TLS."""
    monkeypatch.chdir(tmp_path)  # what it serves
    authority, port = Authority(tmp_path), free_port()
    pair = authority.sign("127.0.0.1")
    state = tmp_path / "state.json"
    # With -HTTP the file is the whole answer, head included.
    state.write_bytes(b"HTTP/1.0 200 OK\r\nContent-Length: 15\r\n\r\n" + b'{"battery": 87}')
    server = ["openssl", "s_server", "-accept", f"127.0.0.1:{port}", "-HTTP", "-quiet"]
    async with program(*server, "-cert", pair.cert, "-key", pair.key):
        await listens(port)
        with pytest.raises(ConnectFailed, match="unknown authority"):
            async with line(port, scheme="https"):
                pass
        async with line(port, scheme="https", tls={"ca": authority.file}) as transport:
            for _ in range(2):
                answer = await asked(transport, "/state.json")
                assert answer.attributes["ok"] is True
                assert answer.body == b'{"battery": 87}'


@WEB
async def test_proxies_of_the_environment_are_not_used(
    web: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A robot is on this network, whatever the environment says about the way out."""
    for name in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.setenv(name, "http://127.0.0.1:1")
    async with line(web.port) as transport:
        assert (await asked(transport, "/state.json")).attributes["ok"] is True


@WEB
@pytest.mark.parametrize("path", ["//127.0.0.1:1/x", "http://127.0.0.1:1/x", "@127.0.0.1:1/x"])
async def test_no_path_leads_to_another_host(web: Server, path: str) -> None:
    """What looks like another place is a path of this one, which is not there."""
    async with line(web.port) as transport:
        answer = await asked(transport, path)
        assert answer.attributes["reason"] == "404 Not Found"


@WEB
async def test_line_through_another_transport(web: Server) -> None:
    """The far end of the carrier knows the name; streams and requests go through it alike."""
    async with nothing_left():
        topics = (TopicSubscription("/lines.cgi", {"stream": "lines"}),)
        options = {"url": "http://robot.inside"}
        transport = from_setup(TransportSetup("web", options, topics, tunnel=Detour(web.port)))
        await transport.open(20.0)
        heard = [(await received(transport)).body for _ in range(3)]
        assert heard == [b"line 1", b"line 2", b"line 3"]
        await transport.send(Envelope("request", {"id": 5, "path": "/state.json"}))
        while (got := await received(transport)).verb != "response":
            pass
        assert got.body == b'{"battery": 87}'
        await transport.close()
        del transport
