"""The connection of a program to a server: certificates, redirects, images, lost lines."""

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

import urc.client
from tests.e2e.dashboards import running_dashboard
from tests.e2e.open_robots import STOPPED, carted, served_robot, until
from urc.client import ConnectionLost, MotionEnded
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import KEY
from urc.web.serve.certificates import Certificates, LocalCertificate

pytestmark = pytest.mark.anyio

JPEG = b"\xff\xd8\xff\xe0 and so on"
HELLO = {
    "t": "hello", "version": 1, "session": "s", "robot": "toy", "title": "Toy", "now": 0,
    "names": ["level"], "signals": [{"name": "level", "type": "integer"}], "controls": ["drive"],
}  # fmt: skip
LINKS = {"t": "links", "links": []}


# -- certificates


async def test_a_program_that_trusts_the_authority_reads_and_drives(tmp_path: Path) -> None:
    """Over TLS, with STOP by HTTP too."""
    certificates = await Certificates.of(LocalCertificate(tmp_path / "tls", "127.0.0.1"))
    async with (
        carted(tmp_path) as (cart, file),
        served_robot(file, certificates=certificates) as address,
    ):
        assert address.startswith("https://")
        authority = tmp_path / "tls" / "authority.pem"
        async with urc.client.open(address, token=KEY, authority=authority) as robot:
            async with robot.drive() as stick:
                await stick.hold(0.3, speed=0.5)
            assert cart.newest("V") == STOPPED
            robot.motion._socket.send = lambda message: True  # type: ignore[method-assign]
            assert await robot.stop() is True


async def test_a_certificate_that_nobody_signed_is_refused(tmp_path: Path) -> None:
    """The token is not sent, and no option turns the check off."""
    certificates = await Certificates.of(LocalCertificate(tmp_path / "tls", "127.0.0.1"))
    async with (
        carted(tmp_path) as (_, file),
        served_robot(file, certificates=certificates) as address,
    ):
        with pytest.raises(ConnectionLost, match=r"is not trusted: .*; specify the file"):
            async with urc.client.open(address, token=KEY):
                pytest.fail("it opened")


# -- images


async def test_images_arrive_while_a_program_watches_them(tmp_path: Path) -> None:
    """And only then: they are large."""
    signals = {"level": Signal("level", "integer"), "eye": Signal("eye", "image")}
    fake = FakeRobot(dashboard_profile(signals={"battery": Signal("battery"), **signals}))
    async with (
        running_dashboard(fake) as address,
        urc.client.open(address.rstrip("/"), token=KEY) as robot,
    ):
        fake.set_reading("eye", JPEG)
        fake.set_reading("level", 1)
        await robot.wait_for("level", timeout=10)
        assert robot.latest("eye") is None
        assert (await robot.wait_for("eye", timeout=10)).value == JPEG
        watching = robot.watch("eye")
        await anext(watching)
        fake.set_reading("eye", JPEG + b"2")
        async with asyncio.timeout(10):
            assert (await anext(watching)).value == JPEG + b"2"
        await watching.aclose()  # type: ignore[attr-defined]


# -- a server that plays any part


@asynccontextmanager
async def server(
    part: Callable[[ServerConnection], Awaitable[None]],
    answer: Callable[[ServerConnection, Request], Response | None] | None = None,
) -> AsyncIterator[str]:
    """Serve one part of a server; give the address."""
    async with serve(part, "127.0.0.1", 0, process_request=answer) as listening:
        port = next(iter(listening.sockets)).getsockname()[1]
        yield f"http://127.0.0.1:{port}"


def tell(line: ServerConnection, *messages: object) -> Awaitable[None]:
    """Send messages in one go."""

    async def each() -> None:
        for message in messages:
            await line.send(json.dumps(message))

    return each()


def log(first: int, *texts: str) -> dict[str, object]:
    """Return a message with lines of the log."""
    lines = [{"age": 0, "level": "info", "source": "wire", "text": text} for text in texts]
    return {"t": "log", "first": first, "lines": lines}


async def test_lost_lines_of_the_log_are_counted_and_none_comes_twice() -> None:
    """Across a reconnection in the same session, too."""
    goes_on = asyncio.Event()
    visits = 0

    async def part(line: ServerConnection) -> None:
        nonlocal visits
        visits += 1
        await tell(line, HELLO, LINKS)
        if visits == 1:
            await goes_on.wait()
            await tell(line, log(50, "a", "b"), log(55, "c"))
            return
        await tell(line, log(54, "again", "c", "d"))
        await line.wait_closed()

    async with server(part) as address, urc.client.open(address) as robot:
        lines = robot.log()
        goes_on.set()
        texts = []
        async with asyncio.timeout(20):
            while "d" not in texts:
                texts.append((await anext(lines)).text)
    wanted = ["a", "b", "log lines lost: 3", "c"]
    assert [text for text in texts if "connection" not in text] == [*wanted, "d"]


async def test_a_newer_server_may_say_what_this_client_does_not_know() -> None:
    """Unknown messages and unknown fields are passed over."""

    async def part(line: ServerConnection) -> None:
        news = {"t": "weather", "rain": 3}
        values = {"t": "v", "n": 5, "i": [0], "v": [3], "a": 0, "extra": 1}
        await tell(line, {**HELLO, "more": 1}, LINKS, news, values)
        await line.wait_closed()

    async with server(part) as address, urc.client.open(address) as robot:
        assert (await robot.wait_for("level", timeout=10)).value == 3


async def test_signals_that_changed_end_the_connection() -> None:
    """A program must not read another meaning under a name that it knows."""
    visits = 0

    async def part(line: ServerConnection) -> None:
        nonlocal visits
        visits += 1
        hello = HELLO if visits == 1 else {**HELLO, "signals": [{"name": "x", "type": "number"}]}
        await tell(line, hello, LINKS)
        if visits > 1:
            await line.wait_closed()

    async with server(part) as address, urc.client.open(address) as robot:
        with pytest.raises(ConnectionLost, match="signals have changed"):
            await robot.wait_for("level", lambda value: value == 1, timeout=20)


async def test_a_redirect_elsewhere_does_not_get_the_token() -> None:
    """The other server sees a visitor without a name."""
    seen: list[Headers] = []

    async def part(line: ServerConnection) -> None:
        seen.append(line.request.headers)  # type: ignore[union-attr]
        await tell(line, HELLO, LINKS)
        await line.wait_closed()

    async with server(part) as other:

        def answer(_: ServerConnection, request: Request) -> Response:
            place = other.replace("http", "ws") + request.path
            return Response(307, "Temporary Redirect", Headers(Location=place))

        async with server(part, answer) as address, urc.client.open(address, token=KEY):
            pass
    assert seen
    assert all("authorization" not in headers for headers in seen)


@pytest.mark.parametrize("status", [401, 403])
async def test_a_refusal_by_http_is_a_refusal(status: int) -> None:
    """A web server in front of URC may answer so."""

    def answer(_: ServerConnection, request: Request) -> Response:
        return Response(status, "No", Headers())

    async with server(lambda line: line.wait_closed(), answer) as address:
        with pytest.raises(urc.client.AccessDenied, match=f"HTTP {status}"):
            async with urc.client.open(address, token=KEY):
                pytest.fail("it opened")


LEASE = {
    "t": "lease", "you": "s1", "name": "me", "epoch": 1, "holder": None, "asker": None, "left": 0,
    "latched": "", "stops": 0, "confirmed": True, "drives": True, "forces": False, "spare": "",
}  # fmt: skip


async def test_a_server_without_heartbeats_moves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tick must echo a heartbeat, so a silent server ends the motion."""
    monkeypatch.setattr("urc.client.remote_motion.OLDEST_S", 0.4)  # see tests/e2e/unhurried.py
    heard: list[dict[str, object]] = []

    async def part(line: ServerConnection) -> None:
        await tell(line, HELLO, LINKS, LEASE)
        async for data in line:
            message = json.loads(data)
            heard.append(message)
            if message.get("verb") == "take":
                mine = LEASE | {"epoch": 2, "holder": {"id": "s1", "name": "me"}}
                await tell(line, mine, {"t": "beat", "n": 7})
            if message.get("verb") == "leave":
                await tell(line, LEASE | {"epoch": 3})

    async with server(part) as address, urc.client.open(address) as robot:
        with pytest.raises(MotionEnded, match="the server has sent no heartbeat for 4"):
            async with robot.drive() as stick:
                await stick.hold(5, speed=1)
        await until(lambda: any(one.get("verb") == "leave" for one in heard))
    ticks = [one for one in heard if one["t"] == "tick"]
    assert 3 <= len(ticks) <= 60
    assert {(one["epoch"], one["echo"]) for one in ticks} == {(2, 7)}
    numbers = [one["number"] for one in ticks]
    assert numbers == sorted(set(numbers)), "each number once, in order"
    kinds = [one["t"] for one in heard if one["t"] in ("tick", "release")]
    assert kinds[0] == "release", "a new gesture begins with a release"
    assert kinds[-1] == "release"


async def test_a_server_that_does_not_confirm_the_release_is_cut() -> None:
    """Its own watch over the socket then stops the robot."""
    closed = asyncio.Event()

    async def part(line: ServerConnection) -> None:
        mine = LEASE | {"epoch": 2, "holder": {"id": "s1", "name": "me"}}
        await tell(line, HELLO, LINKS, LEASE)
        with suppress(ConnectionClosed):
            async for data in line:
                if json.loads(data).get("verb") == "take":
                    await tell(line, mine, {"t": "beat", "n": 7})
        closed.set()

    async with server(part) as address, urc.client.open(address) as robot:
        with pytest.raises(MotionEnded, match="did not confirm the stop"):
            async with robot.drive() as stick:
                stick(speed=1)
        async with asyncio.timeout(10):
            await closed.wait()
