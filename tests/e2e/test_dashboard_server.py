"""The dashboard's server over real sockets, without a browser: limits, slow clients, its end."""

import asyncio
import contextlib
import gc
import json
import socket
from collections.abc import Callable
from urllib.parse import urlsplit

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from tests.e2e.dashboards import running_dashboard, until, until_closed
from tests.e2e.keys import headers_for
from tests.e2e.processes import UrcProcess
from urc._addresses import local_addresses
from urc.model.interface import WidgetUse
from urc.model.values import Signal
from urc.problems import UrcError
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import BEARER
from urc.web.app import build_app, serve
from urc.web.serve.policy import REFUSAL_HEADERS
from urc.web.serve.server import reachable_urls

pytestmark = pytest.mark.anyio

CROWD = 100
"""Connections with a request at the same time; all of them wait for at least one turn of others."""


def joined(address: str, **options: object) -> connect:
    """Return a connection to the robot's socket, as its own page makes it."""
    origin = address.rstrip("/")
    url = address.replace("http://", "ws://") + "ws?robot=puppet"
    options = {"compression": None, "additional_headers": headers_for(address) or BEARER, **options}
    return connect(url, origin=origin, **options)  # type: ignore[arg-type]


async def next_value(line: ClientConnection) -> object:
    """Return the next value that arrives."""
    async with asyncio.timeout(30):
        while True:
            message = json.loads(await line.recv())
            if message["t"] == "v":
                return message["v"][0]


def text_robot() -> FakeRobot:
    """Return a robot with one text signal, for large frames."""
    signals = {"text": Signal("text", "string", stale_after_s=3)}
    return FakeRobot(
        dashboard_profile(signals=signals, uses=[WidgetUse("t", "value", {"value": "text"})])
    )


@pytest.mark.parametrize(
    ("origin", "host", "status"),
    [
        ("http://evil.example", None, 403),
        ("null", None, 403),
        (None, None, 403),
        ("http://evil.example", "evil.example", 421),
    ],
)
async def test_a_foreign_page_gets_no_socket(
    origin: str | None, host: str | None, status: int
) -> None:
    """A cross-site page, a sandboxed one, a rebound name: 0 upgrades."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        parts = urlsplit(address)
        url = f"ws://{host or parts.netloc}/ws"
        with pytest.raises(InvalidStatus) as caught:
            await connect(url, origin=origin, host=parts.hostname, port=parts.port)  # type: ignore[arg-type]
        assert caught.value.response.status_code == status
        assert "content-security-policy" in caught.value.response.headers
        assert robot.opened == 0


async def test_values_are_not_compressed_and_the_socket_names_its_robot() -> None:
    """Compression costs more than it saves on a LAN; an unknown robot has a code of its own."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        async with joined(address, compression="deflate") as line:
            assert line.protocol.extensions == []
            assert json.loads(await line.recv())["robot"] == "puppet"
        url = address.replace("http://", "ws://") + "ws?robot=nobody"
        async with connect(url, origin=address.rstrip("/"), additional_headers=BEARER) as line:  # type: ignore[arg-type]
            assert await until_closed(line) == 4404


async def test_a_client_that_does_not_read_is_only_its_own_problem() -> None:
    """The other gets every value; the slow one skips, and then sees the newest."""
    robot = text_robot()
    frames = 200
    async with running_dashboard(robot) as address, joined(address) as quick:
        parts = urlsplit(address)
        raw = socket.create_connection((parts.hostname, parts.port))
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        async with joined(address, sock=raw, max_queue=1) as slow:
            assert json.loads(await slow.recv())["t"] == "hello"
            slow.transport.pause_reading()
            seen = 0
            for number in range(frames):
                robot.set_reading("text", f"{number:06d}" + "x" * 4000)
                value = await next_value(quick)
                assert str(value).startswith(f"{number:06d}")
                seen += 1
            slow.transport.resume_reading()
            got = []
            while not got or not got[-1].startswith(f"{frames - 1:06d}"):
                got.append(str(await next_value(slow)))
        assert seen == frames
        assert len(got) < frames / 2
        assert got == sorted(got)


@pytest.mark.parametrize(
    ("message", "code"), [("x" * 65_537, 1009), (b"\x00" * 65_537, 1009)], ids=["text", "bytes"]
)
async def test_a_message_that_is_too_long_closes_the_socket(message: str, code: int) -> None:
    """One byte more than 64 KiB is refused by the protocol itself."""
    async with (
        running_dashboard(FakeRobot(dashboard_profile())) as address,
        joined(address) as line,
    ):
        await line.recv()
        await line.send(message)
        assert await until_closed(line) == code


async def test_a_flood_closes_the_socket_that_makes_it() -> None:
    """More than a hundred messages a second end with a code; the server lives."""
    robot = FakeRobot(dashboard_profile())
    async with (
        running_dashboard(robot) as address,
        joined(address) as line,
        joined(address) as other,
    ):
        with contextlib.suppress(ConnectionClosed):
            for number in range(10_000):
                await line.send(json.dumps({"t": "ping", "c": number}))
        assert await until_closed(line) == 4429
        robot.set_reading("battery", 5)
        assert await next_value(other) == 5


async def test_the_server_ends_while_pages_are_open() -> None:
    """Cancelled with open sockets it closes them, says why, and closes the robot's session."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        line = await joined(address)
        await line.recv()
        assert robot.is_open
    assert await until_closed(line) == 1012
    assert not robot.is_open


@pytest.mark.parametrize("turns", range(5))
async def test_a_client_that_comes_while_the_server_ends_is_hung_up(turns: int) -> None:
    """The end comes a few turns of the loop after the call: before, while or after it is taken."""
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        place = urlsplit(address)
        late = socket.create_connection((place.hostname, place.port))
        for _ in range(turns):
            await asyncio.sleep(0)
    with late:
        late.settimeout(5)
        with contextlib.suppress(ConnectionResetError):
            assert late.recv(1) == b""
    gc.collect()  # tells of a connection that nobody has closed


async def test_a_signal_ends_the_process_while_pages_are_open(
    urc_process: Callable[..., UrcProcess],
) -> None:
    """Ctrl-C is a good end, not a crash, and no page can hold it up."""
    process = urc_process("serve", "robots/puppet.yaml", "--port", "0", "--simulate")
    address = (await process.wait_for_async(r"(http://\S+)"))[1]
    async with joined(address) as line:
        assert isinstance(await next_value(line), int)
        code = await asyncio.to_thread(process.interrupt, 8.0)
    assert code == 0
    assert not [text for text in process.errors if "Traceback" in text]


async def test_an_address_that_is_taken_is_told_in_one_line() -> None:
    """The second server on a port does not start."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        port = urlsplit(address).port
        assert port is not None
        with pytest.raises(UrcError) as caught:
            await serve(build_app({}), port=port)
        assert str(caught.value) == (
            f"cannot listen on 127.0.0.1 port {port}: Address already in use;"
            " choose another port with --port"
        )


async def test_the_session_closes_when_the_last_page_has_gone() -> None:
    """Two pages share it; it ends a short while after the second."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        async with joined(address) as first:
            await first.recv()
            async with joined(address) as second:
                await second.recv()
            assert robot.is_open
        await until(lambda: not robot.is_open)
        assert robot.opened == 1


async def answer_to(reader: asyncio.StreamReader) -> tuple[int, dict[str, str], str]:
    """Read one answer up to the end of the connection: its status, headers and body."""
    async with asyncio.timeout(30):
        text = (await reader.read()).decode()
    head, _, body = text.partition("\r\n\r\n")
    first, *lines = head.split("\r\n")
    headers = dict(line.lower().split(": ", 1) for line in lines)
    return int(first.split()[1]), headers, body


def check_refusal(answer: tuple[int, dict[str, str], str], status: int, text: str) -> None:
    """Check that it says why, under the headers of the policy, and closes."""
    found, headers, body = answer
    assert (found, body.strip()) == (status, text)
    assert headers["connection"] == "close"
    for name, value in REFUSAL_HEADERS:
        assert headers[name.decode()] == value.decode().lower()


async def opened(address: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """Connect to the server, below HTTP."""
    parts = urlsplit(address)
    return await asyncio.open_connection(parts.hostname, parts.port)


async def test_what_is_no_http_is_refused_under_the_policy() -> None:
    """uvicorn's own 400 has our headers."""
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        reader, writer = await opened(address)
        writer.write(b"\x16\x03\x01 hello\r\n\r\n")
        check_refusal(await answer_to(reader), 400, "Invalid HTTP request received.")
        writer.close()


@pytest.mark.parametrize(
    "begin",
    [
        b"GET / HTTP/1.1\r\nHost: localhost\r\n",
        b"POST / HTTP/1.1\r\nHost: evil.example\r\nContent-Length: 1000\r\n",
        b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\nGET / HTTP/1.1\r\n",
    ],
    ids=["first request", "another verb", "second request"],
)
async def test_a_request_that_drips_in_is_given_up(begin: bytes) -> None:
    """Each byte comes soon enough, the whole never: 408, and the connection is free again."""
    async with running_dashboard(FakeRobot(dashboard_profile()), request_s=0.5) as address:
        status, headers, body = await answer_to_drips(address, begin)
        if begin.endswith(b"GET / HTTP/1.1\r\n"):
            status, headers, body = last_answer(status, headers, body)
        text = "The request did not arrive within 0.5 s."
        check_refusal((status, headers, body), 408, text)


async def answer_to_drips(address: str, begin: bytes) -> tuple[int, dict[str, str], str]:
    """Send the beginning of a request and then a byte every now and then; return the answer.

    A byte that meets the end of the connection has the system reset it. The answer came before, and
    is read all the same: of a plain socket, since a stream forgets what it has once it hears that.
    """
    loop, parts, heard = asyncio.get_running_loop(), urlsplit(address), asyncio.StreamReader()

    async def drip(line: socket.socket) -> None:
        while True:
            await loop.sock_sendall(line, b"x")
            await asyncio.sleep(0.05)

    with socket.create_connection((parts.hostname, parts.port)) as line:
        line.setblocking(False)
        await loop.sock_sendall(line, begin)
        dripping = asyncio.create_task(drip(line))
        with contextlib.suppress(ConnectionResetError):
            async with asyncio.timeout(30):
                while piece := await loop.sock_recv(line, 65536):
                    heard.feed_data(piece)
        dripping.cancel()
        await asyncio.gather(dripping, return_exceptions=True)
    heard.feed_eof()
    return await answer_to(heard)


def last_answer(status: int, headers: dict[str, str], body: str) -> tuple[int, dict[str, str], str]:
    """Return the second of two answers on one connection."""
    assert status == 200
    _, _, rest = body.partition("HTTP/1.1 ")
    head, _, text = rest.partition("\r\n\r\n")
    first, *lines = head.split("\r\n")
    return int(first.split()[0]), dict(line.lower().split(": ", 1) for line in lines), text


async def test_a_body_that_drips_in_is_given_up() -> None:
    """The headers were whole; the connection is cut all the same."""
    async with running_dashboard(FakeRobot(dashboard_profile()), request_s=0.5) as address:
        reader, writer = await opened(address)
        origin = address.rstrip("/").encode()
        host = urlsplit(address).netloc.encode()
        head = b"POST /healthz HTTP/1.1\r\nHost: %s\r\nOrigin: %s\r\n" % (host, origin)
        writer.write(head + b"Content-Length: 100000\r\n\r\n")
        with contextlib.suppress(ConnectionError):
            async with asyncio.timeout(30):
                while not reader.at_eof():
                    writer.write(b"x")
                    await writer.drain()
                    with contextlib.suppress(TimeoutError):
                        async with asyncio.timeout(0.05):
                            await reader.read(4096)
        writer.close()


async def test_a_connection_made_in_advance_is_closed_without_a_word() -> None:
    """Browsers make some, and take an answer that nobody asked for as a fault."""
    async with running_dashboard(FakeRobot(dashboard_profile()), request_s=0.2) as address:
        reader, writer = await opened(address)
        async with asyncio.timeout(30):
            assert await reader.read() == b""
        writer.close()


async def test_an_open_socket_outlives_the_limit_of_a_request() -> None:
    """It was a request once; as a WebSocket it stays."""
    robot = FakeRobot(dashboard_profile())
    async with (
        running_dashboard(robot, request_s=0.2) as address,
        joined(address) as line,
    ):
        await line.recv()
        await asyncio.sleep(0.6)
        robot.set_reading("battery", 7)
        assert await next_value(line) == 7


async def test_one_connection_too_many_is_told_so() -> None:
    """503 under the policy; those that are open go on, and a closed one makes room."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot, connections=2) as address:
        async with joined(address) as first, joined(address) as second:
            await first.recv()
            await second.recv()
            reader, writer = await opened(address)
            writer.write(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
            check_refusal(await answer_to(reader), 503, "Too many connections are open.")
            writer.close()
            robot.set_reading("battery", 8)
            assert await next_value(first) == 8
        async with joined(address) as third:
            assert json.loads(await third.recv())["t"] == "hello"


async def test_stop_overtakes_a_crowd_of_requests() -> None:
    """All requests are sent before the server can read; STOP is the last of them."""
    requests = [("GET", f"/missing/{number}") for number in range(CROWD)]
    requests.append(("POST", "/api/v1/robots/puppet/stop"))
    answered: list[str] = []

    async def await_answer(path: str, reader: asyncio.StreamReader) -> None:
        assert (await reader.readline()).startswith(b"HTTP/1.1 ")
        answered.append(path)

    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        lines = [(one, *(await opened(address))) for one in requests]
        for (method, path), _, writer in lines:
            head = f"{method} {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n"
            writer.write(head.encode())
        async with asyncio.timeout(30), asyncio.TaskGroup() as group:
            for (_, path), reader, _ in lines:
                group.create_task(await_answer(path, reader))
        for _, _, writer in lines:
            writer.close()
    assert answered.index("/api/v1/robots/puppet/stop") < CROWD / 2
    assert sorted(answered) == sorted(path for _, path in requests)


async def test_every_address_that_is_told_answers() -> None:
    """What listens everywhere is reached at each address of this machine."""
    for host in ("0.0.0.0", "::"):
        told: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        try:
            task = asyncio.create_task(
                serve(build_app({}), host=host, port=0, on_ready=told.set_result)
            )
            async with asyncio.timeout(30):
                await asyncio.wait((told, task), return_when=asyncio.FIRST_COMPLETED)
            if task.done() and ":" in host:
                pytest.skip("no IPv6 here")
            port = urlsplit(await told).port
            for url in reachable_urls(host, port or 0):
                reader, writer = await opened(url)
                name = urlsplit(url).netloc.encode()
                writer.write(b"GET /healthz HTTP/1.0\r\nHost: " + name + b"\r\n\r\n")
                status, _, _ = await answer_to(reader)
                assert status == 200
                writer.close()
        finally:
            task.cancel()
            await asyncio.wait((task,), timeout=20)


def test_an_address_of_this_machine_is_one_that_others_can_use() -> None:
    """No loopback, no range that a browser cannot open, each once."""
    found = local_addresses()
    assert len(set(found)) == len(found)
    assert [each for each in found if each.is_loopback or each.is_unspecified] == []
    assert [each for each in found if each.version == 6 and each.is_link_local] == []
