"""Robots on HTTP and WebSocket that are none: what they do stays theirs, and is told in a line."""

import asyncio
import base64
import gzip
import hashlib
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest

from tests.e2e.transports.hostile import WAIT_S, Talk, bounded, ended, liar, turn_deaf, until
from tests.e2e.transports.leaks import nothing_left
from urc.model.payload import Envelope
from urc.transports import http, http_streams, websocket
from urc.transports.base import (
    PeerClosed,
    TopicSubscription,
    Transport,
    TransportError,
    TransportSetup,
)

pytestmark = pytest.mark.anyio

MAGIC = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"


def answers(*texts: bytes, count: list[int] | None = None) -> Talk:
    """Answer each request with the next of `texts`, the last one again and again."""
    number = 0

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal number
        while True:
            await reader.readuntil(b"\r\n\r\n")
            if count is not None:
                count.append(number)
            writer.write(texts[min(number, len(texts) - 1)])
            await writer.drain()
            number += 1

    return talk


@asynccontextmanager
async def line(
    factory: Callable[[TransportSetup], Transport],
    url: str,
    subscriptions: tuple[TopicSubscription, ...] = (),
    **options: object,
) -> AsyncIterator[Transport]:
    """Open a line, and see to it that nothing of it is left."""
    async with nothing_left():
        transport = factory(TransportSetup("robot", {"url": url, **options}, subscriptions))
        try:
            await transport.open(20.0)
            yield transport
        finally:
            await transport.close()
            del transport


async def asked(transport: Transport, path: str = "/") -> Envelope:
    """Make a request and return what is told of it."""
    async with asyncio.timeout(WAIT_S):
        await transport.send(Envelope("request", {"path": path, "method": "GET", "id": 7}))
        told = await transport.receive()
    assert isinstance(told, Envelope)
    assert told.attributes["id"] == 7
    return told


DENIED = b"HTTP/1.1 401 No\r\nContent-Length: 0\r\nWWW-Authenticate: %s\r\n\r\n"
FINE = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok"


@pytest.mark.parametrize(
    "challenge",
    [b"Digest realm", b"Digest ", b'Digest realm="x",nonce',
     b'Digest nonce="x",algorithm=ROT13,realm=x',
     b'Digest realm="x",nonce="y",qop="auth-int"'],
)  # fmt: skip
async def test_senseless_challenge_fails_that_request_alone(challenge: bytes) -> None:
    """It is answered, in one line, and the next request goes through."""
    talk = answers(DENIED % challenge, FINE)
    auth = {"type": "digest", "user": "me", "password": "s3cret"}
    async with (
        liar(talk) as port,
        line(http.from_setup, f"http://127.0.0.1:{port}/", auth=auth) as robot,
    ):
        refused = await asked(robot)
        assert refused.attributes["ok"] is False
        assert "\n" not in str(refused.attributes["reason"])
        assert "s3cret" not in str(refused.attributes["reason"])
        assert (await asked(robot)).attributes["ok"] is True


async def test_challenge_without_end_is_answered_once() -> None:
    """A server that is never content gets two requests, and the refusal is told."""
    count: list[int] = []
    talk = answers(DENIED % b'Digest realm="x",nonce="y",qop="auth"', count=count)
    auth = {"type": "digest", "user": "me", "password": "s3cret"}
    async with (
        liar(talk) as port,
        line(http.from_setup, f"http://127.0.0.1:{port}/", auth=auth) as robot,
    ):
        assert "401" in str((await asked(robot)).attributes["reason"])
    assert len(count) == 2


async def test_answer_that_was_cut_short_is_no_answer() -> None:
    """A packed body must be whole."""
    packed = gzip.compress(b"battery 87" * 100)[:-12]
    head = b"HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\nContent-Length: %d\r\n\r\n" % len(packed)
    async with (
        liar(answers(head + packed)) as port,
        line(http.from_setup, f"http://127.0.0.1:{port}/") as robot,
    ):
        told = await asked(robot)
        assert told.attributes["ok"] is False
        assert "ended too early" in str(told.attributes["reason"])


async def test_packed_bomb_is_not_unpacked() -> None:
    """What a small answer swells to counts, and no more of it is made than is taken."""
    packed = gzip.compress(gzip.compress(bytes(300_000_000)))
    once = gzip.decompress(packed)
    head = b"HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\nContent-Length: %d\r\n\r\n" % len(once)
    async with (
        liar(answers(head + once)) as port,
        line(http.from_setup, f"http://127.0.0.1:{port}/") as robot,
    ):
        with bounded(40_000_000):
            told = await asked(robot)
        assert "longer than" in str(told.attributes["reason"])


async def test_a_header_without_end_is_given_up() -> None:
    """Long before it fills the memory."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 200 OK\r\n")
        while True:
            writer.write(b"X-Header: %s\r\n" % (b"x" * 10_000))
            await writer.drain()

    async with liar(talk) as port, line(http.from_setup, f"http://127.0.0.1:{port}/") as robot:
        with bounded(20_000_000):
            told = await asked(robot)
        assert "does not speak HTTP" in str(told.attributes["reason"])


@pytest.mark.parametrize("kind", ["mjpeg", "sse", "stills", "lines"])
@pytest.mark.parametrize(
    "head",
    [b"WWW-Authenticate: Digest realm\r\n",
     b"Content-Type: multipart/x; boundary*0*=\xff'\xfe'%zz\r\n",
     b"Content-Type: multipart/x-mixed-replace; boundary*=unknown'x'%ff\r\n",
     b"Content-Encoding: gzip\r\n", b"Set-Cookie: \xff=\x80; Expires=Never; Max-Age=x\r\n"],
)  # fmt: skip
async def test_stream_with_a_senseless_head_is_asked_for_again(
    kind: str, head: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever stands there, a stream never falls silent for good."""
    monkeypatch.setattr(http_streams, "_FIRST_WAIT_S", 0.01)
    status = b"401 No" if b"Digest" in head else b"200 OK"
    count: list[int] = []
    talk = answers(
        b"HTTP/1.1 " + status + b"\r\nContent-Length: 3\r\n" + head + b"\r\nabc", count=count
    )
    how = TopicSubscription("/cam", {"stream": kind, "every": 0.01})
    auth = {"type": "digest", "user": "me", "password": "s3cret"}
    async with (
        liar(talk) as port,
        line(http.from_setup, f"http://127.0.0.1:{port}/", (how,), auth=auth),
    ):
        await until(lambda: len(count) >= 3)


async def test_stream_that_wants_no_pause_gets_one() -> None:
    """``retry: 0`` does not keep this machine busy."""
    count: list[int] = []
    body = b"retry: 0\ndata: x\n\n"
    head = b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nContent-Length: %d\r\n\r\n"
    talk = answers(head % len(body) + body, count=count)
    how = TopicSubscription("/events", {"stream": "sse"})
    async with (
        liar(talk) as port,
        line(http.from_setup, f"http://127.0.0.1:{port}/", (how,)) as robot,
    ):
        clock = asyncio.get_running_loop().time
        began_s = clock()
        for _ in range(4):
            await robot.receive()
        assert clock() - began_s >= 3 * http_streams.SHORTEST_RETRY_S * 0.9


async def test_picture_that_drips_is_asked_for_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A byte now and then is no picture."""
    monkeypatch.setattr(http_streams, "SILENCE_S", 0.3)
    monkeypatch.setattr(http_streams, "_FIRST_WAIT_S", 0.01)
    came = 0

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal came
        came += 1
        writer.write(
            b"HTTP/1.1 200 OK\r\n"
            b"Content-Type: multipart/x-mixed-replace; boundary=a\r\n\r\n--a\r\n\r\n"
        )
        while True:
            writer.write(b"x")
            await writer.drain()
            await asyncio.sleep(0.02)

    how = TopicSubscription("/cam", {"stream": "mjpeg"})
    async with liar(talk) as port, line(http.from_setup, f"http://127.0.0.1:{port}/", (how,)):
        await until(lambda: came >= 3)
    assert f"http 127.0.0.1:{port} /cam: no picture within 0.3 s" in caplog.text


# -- WebSocket


def upgraded(then: Talk) -> Talk:
    """Shake hands, and go on with `then`."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = await reader.readuntil(b"\r\n\r\n")
        key = next(
            row.split(b": ")[1]
            for row in head.split(b"\r\n")
            if row.lower().startswith(b"sec-websocket-key")
        )
        accept = base64.b64encode(hashlib.sha1(key + MAGIC).digest())  # noqa: S324 - as RFC 6455 says
        writer.write(
            b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Accept: " + accept + b"\r\n\r\n"
        )
        await then(reader, writer)

    return talk


async def flood(writer: asyncio.StreamWriter, piece: bytes) -> None:
    while True:
        writer.write(piece)
        await writer.drain()


async def test_message_of_endless_nothing_ends_the_line() -> None:
    """Empty fragments weigh nothing on the wire, but here."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"\x02\x00")
        await flood(writer, b"\x00\x00" * 30_000)

    async with (
        liar(upgraded(talk)) as port,
        line(websocket.from_setup, f"ws://127.0.0.1:{port}/") as robot,
    ):
        with bounded(60_000_000):
            assert "fragments" in await ended(robot)


async def test_pings_without_end_and_no_ear_end_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unread replies are bounded, whatever the time-out of the system."""
    monkeypatch.setattr("urc.transports._stream._UNANSWERED_MS", 600_000)

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        turn_deaf(writer)
        await flood(writer, (b"\x89\x7d" + b"p" * 125) * 500)

    async with (
        liar(upgraded(talk)) as port,
        line(websocket.from_setup, f"ws://127.0.0.1:{port}/") as robot,
    ):
        with bounded(30_000_000):
            assert "does not read the replies to its pings" in await ended(robot)


@pytest.mark.parametrize(
    ("frame", "told"),
    [
        (b"\x81\x02\xff\xfe", "\ufffd\ufffd"),
        (b"\x82\x7f\x7f\xff\xff\xff\xff\xff\xff\xff", "1009"),
        (b"\xc2\x01a", "1002"),
        (b"\x88\x1e\x03\xf0stop\x1b[31m\nfatal: all is lost", "stop"),
    ],
)
async def test_frames_that_lie_are_told_in_one_line(frame: bytes, told: str) -> None:
    """Whatever the other side says, it is one line without control characters."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(frame)
        await reader.read()

    async with (
        liar(upgraded(talk)) as port,
        line(websocket.from_setup, f"ws://127.0.0.1:{port}/") as robot,
    ):
        async with asyncio.timeout(WAIT_S):
            try:
                text = (await robot.receive()).decode("utf-8", "replace")  # type: ignore[union-attr]
            except PeerClosed as over:
                text = str(over)
        assert told in text
        assert text.isprintable()


@pytest.mark.parametrize(
    ("reason", "told"),
    [
        (b"Go\taway  now", "answered 403"),
        # Some releases of the library pass such words on, others take it for no HTTP at all.
        (b"Go\x1b[31m away\tnow", "answered 403|does not speak HTTP"),
    ],
)
async def test_refusal_is_told_in_one_line(reason: bytes, told: str) -> None:
    """The words of a status are the server's own."""
    talk = answers(b"HTTP/1.1 403 " + reason + b"\r\nContent-Length: 0\r\n\r\n")
    async with liar(talk) as port:
        transport = websocket.from_setup(
            TransportSetup("robot", {"url": f"ws://127.0.0.1:{port}/"})
        )
        with pytest.raises(TransportError, match=told) as raised:
            await transport.open(20.0)
        assert str(raised.value).isprintable()
