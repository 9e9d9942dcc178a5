"""A TLS connection over real sockets, under both event loops: pressure, pauses, handshakes."""

import asyncio
import contextlib
import select
import socket
import ssl
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from urc.access.authority import CertificateAuthority
from urc.web.serve.tls_connection import TlsConnection
from urc.web.serve.tls_listener import FirstBytes, Handshakes

uvloop = pytest.importorskip("uvloop")
LOOPS = {"asyncio": asyncio.SelectorEventLoop, "uvloop": uvloop.new_event_loop}
FRAME = b"x" * 4000
KERNEL_BYTES = 1 << 20
"""More than two sockets of this machine keep."""


class Upper(asyncio.Protocol):
    """A protocol above TLS that writes down what it sees."""

    made: "list[Upper]"

    def __init__(self) -> None:
        self.is_full = False
        self.received = bytearray()
        self.is_lost = False
        self.transport: asyncio.Transport

    def connection_made(self, transport: Any) -> None:
        """Ask for pressure at the first byte, as sockets of pages do."""
        self.transport = transport
        transport.set_write_buffer_limits(high=0)
        type(self).made.append(self)

    def data_received(self, data: bytes) -> None:
        """Keep data."""
        self.received += data

    def pause_writing(self) -> None:
        """The kernel is full."""
        self.is_full = True

    def resume_writing(self) -> None:
        """The kernel is empty."""
        self.is_full = False

    def connection_lost(self, exc: Exception | None) -> None:
        """The end."""
        self.is_lost = True


class Rig:
    """A server, its certificates, and clients in threads."""

    def __init__(self, place: tuple[str, int], trusted: ssl.SSLContext, held: Handshakes) -> None:
        self.place = place
        self.trusted = trusted
        self.handshakes = held
        self.opened: list[socket.socket] = []

    def plain(self) -> socket.socket:
        """Connect without TLS."""
        line = socket.create_connection(self.place)
        self.opened.append(line)
        return line

    def client(self) -> ssl.SSLSocket:
        """Connect; blocks."""
        line = socket.socket()
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        line.settimeout(10)
        line.connect(self.place)
        secure = self.trusted.wrap_socket(line, server_hostname="127.0.0.1")
        self.opened.append(secure)
        return secure

    async def connected(self) -> tuple[ssl.SSLSocket, Upper]:
        """Connect; return both ends."""
        before = len(Upper.made)
        line = await asyncio.to_thread(self.client)
        await until(lambda: len(Upper.made) > before)
        return line, Upper.made[-1]


async def until(is_true: Callable[[], bool]) -> None:
    """Wait at most ten seconds."""
    async with asyncio.timeout(10):
        while not is_true():  # noqa: ASYNC110 - of sockets, nothing tells
            await asyncio.sleep(0.005)


@pytest.fixture(params=LOOPS)
def run(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[..., None]:
    """Run a test under one event loop."""
    Upper.made = []
    authority = CertificateAuthority(tmp_path, ["127.0.0.1"], datetime.now(UTC))
    leaf = authority.issue()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(leaf.chain, leaf.key)
    trusted = ssl.create_default_context(cafile=str(authority.file))

    @asynccontextmanager
    async def served(**limits: Any) -> AsyncIterator[Rig]:

        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 64 * 1024)
        listener.bind(("127.0.0.1", 0))
        held = Handshakes(lambda: context, **limits)
        loop = asyncio.get_running_loop()
        server = await loop.create_server(lambda: FirstBytes(held, Upper), sock=listener)
        rig = Rig(listener.getsockname(), trusted, held)
        try:
            yield rig
        finally:
            for line in rig.opened:
                line.close()
            server.close()
            held.close()
            for one in Upper.made:
                one.transport.abort()

    def runner(test: Callable[[Rig], Awaitable[None]], **limits: Any) -> None:
        async def whole() -> None:
            async with served(**limits) as rig:
                await test(rig)

        with asyncio.Runner(loop_factory=LOOPS[request.param]) as loop:
            loop.run(whole())

    return runner


def drained(line: ssl.SSLSocket, size: int) -> int:
    """Read so many bytes; blocks."""
    got = 0
    while got < size and (data := line.recv(65536)):
        got += len(data)
    return got


def test_a_full_kernel_is_known_after_the_write_that_filled_it(run: Any) -> None:
    """Else one more frame would be written, and become outdated in the buffer."""

    async def test(rig: Rig) -> None:
        line, upper = await rig.connected()
        written = 0
        while not upper.is_full:
            assert upper.transport.get_write_buffer_size() == 0
            upper.transport.write(FRAME)
            written += len(FRAME)
            assert written < KERNEL_BYTES
        assert 0 < upper.transport.get_write_buffer_size() < 2 * len(FRAME)
        assert await asyncio.to_thread(drained, line, written) == written
        await until(lambda: not upper.is_full)
        assert upper.transport.get_write_buffer_size() == 0

    run(test)


def test_paused_data_stays_in_the_kernel(run: Any) -> None:
    async def test(rig: Rig) -> None:
        line, upper = await rig.connected()
        upper.transport.pause_reading()

        def push() -> int:
            line.settimeout(0.3)
            sent = 0
            try:
                while sent < 50 * KERNEL_BYTES:
                    sent += line.send(FRAME)
            except TimeoutError:
                return sent
            return sent

        sent = await asyncio.to_thread(push)
        assert 0 < sent < 50 * KERNEL_BYTES
        assert not upper.received
        upper.transport.resume_reading()
        await until(lambda: len(upper.received) >= sent)

    run(test)


def test_data_in_one_packet_with_the_end_of_the_handshake_arrives(run: Any) -> None:
    async def test(rig: Rig) -> None:
        inside, outside = ssl.MemoryBIO(), ssl.MemoryBIO()
        tls = rig.trusted.wrap_bio(inside, outside, server_hostname="127.0.0.1")
        loop = asyncio.get_running_loop()
        line = socket.socket()
        line.setblocking(False)
        await loop.sock_connect(line, rig.place)
        while True:
            try:
                tls.do_handshake()
                break
            except ssl.SSLWantReadError:
                await loop.sock_sendall(line, outside.read())
                inside.write(await loop.sock_recv(line, 65536))
        tls.write(b"GET / HTTP/1.1")
        await loop.sock_sendall(line, outside.read())
        await until(
            lambda: bool(Upper.made) and bytes(Upper.made[-1].received) == b"GET / HTTP/1.1"
        )
        line.close()

    run(test)


def test_both_ends_can_close(run: Any) -> None:
    """The client gets all data and a proper end; the protocol hears of the client's end."""

    async def test(rig: Rig) -> None:
        line, upper = await rig.connected()
        upper.transport.write(b"bye")
        upper.transport.close()
        assert upper.transport.is_closing()
        upper.transport.write(b"late")

        def rest() -> bytes:
            return line.recv(10) + line.recv(10)

        assert await asyncio.to_thread(rest) == b"bye"
        await until(lambda: upper.is_lost)
        for how in ("unwrap", "cut"):
            line, upper = await rig.connected()
            if how == "cut":
                line.close()
            else:
                await asyncio.to_thread(line.unwrap)
            await until(lambda: upper.is_lost)  # noqa: B023 - awaited in this round

    run(test)


def test_plain_http_reaches_the_same_protocol(run: Any) -> None:
    async def test(rig: Rig) -> None:
        line = rig.plain()
        line.sendall(b"GET / HTTP/1.1\r\n")
        await until(lambda: bool(Upper.made) and Upper.made[-1].received == b"GET / HTTP/1.1\r\n")
        assert Upper.made[-1].transport.get_extra_info("sslcontext") is None
        assert not len(rig.handshakes)
        line.close()

    run(test)


def closed(line: socket.socket) -> bool:
    """Return whether the server has closed a connection; blocks shortly."""
    if not select.select([line], [], [], 0)[0]:
        return False
    try:
        return line.recv(1, socket.MSG_PEEK) == b""
    except OSError:
        return True


def test_a_dripping_handshake_ends_in_time(run: Any) -> None:
    """One byte at a time, or none at all: the limit counts from the opening."""

    async def test(rig: Rig) -> None:
        silent, dripping = rig.plain(), rig.plain()
        begun = time.monotonic()
        for byte in b"\x16\x03\x01\x02\x00\x01" + bytes(1000):
            if closed(silent) and closed(dripping):
                break
            try:
                dripping.send(bytes([byte]))
            except OSError:
                break
            await asyncio.sleep(0.02)
        assert 0.3 < time.monotonic() - begun < 3
        await until(lambda: closed(silent) and closed(dripping))
        assert len(rig.handshakes) == 0
        assert not Upper.made

    run(test, limit_s=0.5)


def test_unfinished_handshakes_never_keep_others_out(run: Any) -> None:
    """With too many of them, the oldest of the address with the most goes."""

    async def test(rig: Rig) -> None:
        held = [rig.plain() for _ in range(60)]
        for one in held:
            one.sendall(b"\x16\x03\x01")
        await until(lambda: len(rig.handshakes) == 16)
        _, upper = await rig.connected()
        assert isinstance(upper.transport, TlsConnection)
        assert len(rig.handshakes) <= 16
        await until(lambda: sum(map(closed, held)) >= 44)

    run(test, most=16, limit_s=30)


def test_a_handshake_in_progress_stays_among_dripping_ones(run: Any) -> None:
    """Its client has sent a whole message, so it is not the one that goes."""

    async def test(rig: Rig) -> None:
        inside, outside = ssl.MemoryBIO(), ssl.MemoryBIO()
        tls = rig.trusted.wrap_bio(inside, outside, server_hostname="127.0.0.1")
        slow = rig.plain()
        with contextlib.suppress(ssl.SSLWantReadError):
            tls.do_handshake()
        slow.sendall(outside.read())
        inside.write(await asyncio.to_thread(slow.recv, 65536))
        for _ in range(60):
            rig.plain().sendall(b"\x16\x03\x01")
            await asyncio.sleep(0)
        await until(lambda: len(rig.handshakes) == 16)
        tls.do_handshake()
        tls.write(b"here")
        slow.sendall(outside.read())
        await until(lambda: bool(Upper.made) and Upper.made[-1].received == b"here")

    run(test, most=16, limit_s=30)


def test_a_first_message_without_end_is_closed(run: Any) -> None:
    """A client gets no more memory than a handshake needs."""

    async def test(rig: Rig) -> None:
        line = rig.plain()
        hello = b"\x16\x03\x01\x40\x00\x01\xff\xff\xff" + bytes(0x4000 - 4)
        with contextlib.suppress(OSError):
            for _ in range(200):
                line.sendall(hello)
        await until(lambda: len(rig.handshakes) == 0)
        assert not Upper.made

    run(test, limit_s=30)


def test_a_flood_of_handshakes_leaves_time_for_others(run: Any) -> None:
    """All succeed, but the loop keeps most of its time."""

    async def test(rig: Rig) -> None:
        lines: list[ssl.SSLSocket] = []
        threads = [
            threading.Thread(target=lambda: lines.extend(rig.client() for _ in range(10)))
            for _ in range(4)
        ]
        began_s, used_s = time.monotonic(), time.thread_time()
        for one in threads:
            one.start()
        await until(lambda: len(lines) == 40)
        wall_s, busy_s = time.monotonic() - began_s, time.thread_time() - used_s
        assert busy_s < 0.6 * wall_s

    run(test)


def test_nonsense_after_the_first_byte_is_closed(run: Any) -> None:
    async def test(rig: Rig) -> None:
        line = rig.plain()
        line.sendall(b"\x16" + b"nonsense" * 100)
        await until(lambda: len(rig.handshakes) == 0)
        line.settimeout(5)
        assert (await asyncio.to_thread(line.recv, 100))[:1] in (b"\x15", b"")
        assert not Upper.made
        line.close()

    run(test)
