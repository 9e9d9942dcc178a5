"""The camera transport: URC's connection to a camera, and the process that reads the stream.

Each payload that the transport receives is one access unit (`urc.video`). The camera's process ends
with the connection. While no reader needs the images, the transport stays open without a connection
(`urc.runtime.image_demand`).
"""

import asyncio
import json
import logging
import os
from collections.abc import Coroutine
from contextlib import suppress
from math import inf
from typing import Any, Final
from urllib.parse import quote

from urc._helper_process import end_helper, start_helper
from urc.model.payload import Envelope, Payload
from urc.transports._faults import CLOSED, one_line
from urc.transports._stream_dialer import StreamDialer
from urc.transports.base import NOTICE, ConnectFailed, PeerClosed, TransportError
from urc.transports.camera_options import CameraOptions
from urc.transports.camera_port import CameraPort, listen
from urc.transports.camera_records import FAULT, NOTE, OFFER, RECORD, DemuxJob
from urc.transports.camera_relay import RtspRelay, RtspWatch
from urc.transports.http_body import fault_of
from urc.transports.http_client import HttpClient
from urc.transports.web_dial import Dialer
from urc.transports.whep_exchange import WhepExchange
from urc.video import MAX_UNIT_BYTES

__all__ = ["CameraTransport"]

FIRST_S: Final = 15.0
"""Maximum time from the connection to the first image, in seconds. Some cameras send a keyframe
only every 10 s."""
SILENCE_S: Final = 5.0
"""Maximum time between two images, in seconds; afterwards, the connection counts as lost."""
RESUME_S: Final = 5.0
_END_S: Final = 1.0
DEVICE_FORMAT: Final = "v4l2"
"""The library's name for cameras of this computer."""
_MOST_BYTES: Final = MAX_UNIT_BYTES + 4096

log = logging.getLogger(__name__)


class CameraTransport:
    """A reusable transport to one camera."""

    def __init__(self, options: CameraOptions) -> None:
        """Store the options, without connecting."""
        self._options = options
        self._connection: _CameraConnection | None = None
        self._ending: _CameraConnection | None = None
        """The earlier connection until its end."""
        self._is_open = False
        self._is_paused = False
        self._resumed = asyncio.Event()

    @property
    def address(self) -> str:
        """The camera's address in readable form."""
        return self._options.address

    async def open(self, timeout_s: float) -> None:
        """Connect within `timeout_s` seconds, or raise `ConnectFailed`."""
        await self.close()
        self._is_paused = False
        self._connection = await _connected(self._options, timeout_s)
        self._is_open = True

    async def receive(self) -> Payload:
        """Return the next access unit, or a notice for the log; wait while the transport is paused.

        Raises:
            PeerClosed: the connection has ended, or the stream cannot be used.
        """
        while True:
            if not self._is_open:
                raise PeerClosed(CLOSED)
            if self._is_paused:
                self._resumed.clear()
                await self._resumed.wait()
                continue
            if self._connection is None:
                self._connection = await self._reconnected()
            connection = self._connection
            try:
                return await connection.unit()
            except PeerClosed:
                if self._is_used(connection):
                    raise

    async def send(self, data: Payload) -> None:
        """Pause or resume the stream; raise `TransportError` for all other data."""
        if not isinstance(data, Envelope) or data.verb not in ("subscribe", "unsubscribe"):
            raise TransportError("a camera accepts no data")
        self._is_paused = data.verb == "unsubscribe"
        if self._is_paused:
            await self._end()
        self._resumed.set()

    async def close(self) -> None:
        """Close immediately. The method never raises and may be called twice."""
        self._is_open = False
        self._resumed.set()
        await self._end()

    def _is_used(self, connection: "_CameraConnection") -> bool:
        """Return whether a pause or a new connection has not replaced the connection."""
        return not self._is_paused and connection is self._connection

    async def _reconnected(self) -> "_CameraConnection":
        await self._end()
        try:
            return await _connected(self._options, RESUME_S)
        except TransportError as fault:
            raise PeerClosed(str(fault)) from fault

    async def _end(self) -> None:
        if self._connection is not None:
            self._ending, self._connection = self._connection, None
        if self._ending is not None:  # after a cancelled call, the next one waits again
            await self._ending.close()
            self._ending = None


class _CameraConnection:
    """One connection to a camera, with the process that reads its stream."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._process: asyncio.subprocess.Process | None = None
        self._feeding: asyncio.Task[None] | None = None
        self._relay: RtspRelay | None = None
        self._reason = ""
        self._started = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        self._offer: asyncio.Future[bytes] = self._loop.create_future()
        self._has_unit = False
        self._limit_s = FIRST_S
        self._due_s = inf
        """Time at which `unit` has waited for too long; infinite if it does not wait."""
        self._watch: asyncio.TimerHandle | None = None
        self._closing: asyncio.Task[None] | None = None

    async def use_relay(self, relay: RtspRelay, job: DemuxJob) -> None:
        """Start the process on a relay."""
        self._relay = relay
        await self.start(job)

    def feed(self, source: Coroutine[Any, Any, None]) -> None:
        """Run a task that starts the process and writes the stream to it."""
        self._feeding = asyncio.create_task(self._fed(source))

    async def start(self, job: DemuxJob, port: CameraPort | None = None) -> None:
        """Start the process, which takes over a `port`."""
        descriptors = () if port is None else (port.line.fileno(),)
        self._process = await start_helper("urc.transports.camera_process", descriptors=descriptors)
        if port is not None:
            job = job._replace(socket=port.shared(self._process.pid), senders=port.senders)
        # Not an argument: every user of this computer can read arguments, and the URL of the relay
        # contains the password.
        await self.write(json.dumps(job._asdict()).encode() + b"\n")
        self._started.set()

    async def offer(self, job: DemuxJob) -> bytes:
        """Start the process, and return its offer of WHEP, which `unit` receives."""
        await self.start(job)
        return await self._offer

    async def write(self, data: bytes) -> None:
        """Pass bytes of the stream to the process, and wait until they are taken.

        Raises:
            PeerClosed: the process has ended.
        """
        process = self._process
        if process is None or process.stdin is None:
            raise PeerClosed(CLOSED)
        try:
            process.stdin.write(data)
            await process.stdin.drain()
        except OSError as fault:
            raise PeerClosed(self._why()) from fault

    async def unit(self) -> Payload:
        """Return the next access unit, or a notice for the log.

        Raises:
            PeerClosed: at the end, or after too long a pause.
        """
        self._limit_s = SILENCE_S if self._has_unit else FIRST_S
        self._due_s = self._loop.time() + self._limit_s
        if self._watch is None:
            self._watch = self._loop.call_at(self._due_s, self._check_silence)
        try:
            await self._started.wait()
            while (record := await self._record()) is None:
                pass
        finally:
            self._due_s = inf
        self._has_unit = True
        return record

    def _check_silence(self) -> None:
        """End a wait of `unit` that is too long.

        One timer for many images: a time limit for each one would cost as much as reading it.
        """
        self._watch = None
        if self._due_s == inf:
            return
        if self._loop.time() < self._due_s:
            self._watch = self._loop.call_at(self._due_s, self._check_silence)
            return
        self._reason = self._reason or f"{self._address} sent no image for {self._limit_s:g} s"
        self._started.set()
        if self._process is not None and self._process.stdout is not None:
            self._process.stdout.set_exception(PeerClosed(self._reason))

    async def _record(self) -> Payload | None:
        """Return the next access unit or notice; None for a record of another kind."""
        process = self._process
        if process is None or process.stdout is None:
            raise PeerClosed(self._why())
        try:
            head = await process.stdout.readexactly(RECORD.size)
            size, kind = RECORD.unpack(head)
            if size > _MOST_BYTES:
                raise PeerClosed("the video library's process sent an invalid record")
            content = await process.stdout.readexactly(size)
        except (asyncio.IncompleteReadError, OSError) as fault:
            raise PeerClosed(self._why()) from fault
        if kind == FAULT:
            raise PeerClosed(self._why(one_line(content.decode("utf-8", "replace"), 300)))
        if kind == NOTE:
            return Envelope(NOTICE, {}, one_line(content.decode("utf-8", "replace"), 300))
        if kind == OFFER:
            if not self._offer.done():
                self._offer.set_result(content)
            return None
        return content

    def _why(self, said: str = "") -> str:
        """Return why the connection ended; the network's reason comes first."""
        relay = self._relay.fault if self._relay is not None else ""
        fallback = "the process that reads the camera's stream has ended"
        return self._reason or relay or said or fallback

    async def _fed(self, source: Coroutine[Any, Any, None]) -> None:
        try:
            await source
            self._reason = self._reason or "the camera ended the stream"
        except TransportError as fault:
            self._reason = self._reason or str(fault)
        except Exception as bug:  # supervisor: the connection ends with a reason
            log.error("the stream of %s failed", self._address, exc_info=bug)
            self._reason = f"the stream failed ({type(bug).__name__}: {bug})"
        self._kill()
        self._started.set()

    def _kill(self) -> None:
        if self._process is not None and self._process.returncode is None:
            with suppress(ProcessLookupError):
                self._process.kill()

    async def close(self) -> None:
        """End the process and the connection immediately. The method never raises.

        If the caller is cancelled, the end still goes on.
        """
        self._reason = self._reason or CLOSED
        if self._watch is not None:
            self._watch.cancel()
        self._kill()
        if self._closing is None:
            self._closing = asyncio.create_task(self._close())
        await asyncio.shield(self._closing)

    async def _close(self) -> None:
        if self._feeding is not None:
            self._feeding.cancel()
            await asyncio.gather(self._feeding, return_exceptions=True)
        if self._relay is not None:
            await self._relay.close()
        if self._process is not None:  # the task may have started it meanwhile
            await end_helper(self._process, _END_S)


async def _connected(options: CameraOptions, timeout_s: float) -> _CameraConnection:
    """Return an open connection within `timeout_s` seconds, or raise `ConnectFailed`."""
    connection = _CameraConnection(options.address)
    start = _STARTS[options.scheme]
    try:
        await start(connection, options, timeout_s)
    except BaseException:
        await connection.close()
        raise
    return connection


async def _start_rtsp(
    connection: _CameraConnection, options: CameraOptions, timeout_s: float
) -> None:
    place, login = options.place, options.credentials
    dialer = StreamDialer(place.host, place.port, tls=options.tls)
    stream = await dialer.open(timeout_s)
    refuses_basic = login is not None and login.kind == "digest"
    relay = RtspRelay(stream, RtspWatch(refuses_basic=refuses_basic))
    try:
        port = relay.listen()
    except TransportError:
        await relay.close()
        raise
    user = f"{quote(login.user, safe='')}:{quote(login.secret, safe='')}@" if login else ""
    url = f"rtsp://{user}127.0.0.1:{port}{place.path}"
    job = DemuxJob(url, "", options.over, transcode=options.transcode)
    await connection.use_relay(relay, job)


async def _start_http(
    connection: _CameraConnection, options: CameraOptions, timeout_s: float
) -> None:
    place = options.place._replace(path="/")
    client = HttpClient(
        place,
        Dialer(place, tls=options.tls, tunnel=None),
        credentials=options.credentials,
        headers={},
        connections=2,
    )
    try:
        await client.reach(timeout_s)
    except BaseException:
        await client.close()
        raise

    async def read() -> None:
        try:
            request = client.follow("GET", options.place.path, {}, None)
            async with client.answer(request, SILENCE_S) as response:
                if fault := await fault_of(response):
                    raise PeerClosed(fault)
                await connection.start(DemuxJob(transcode=options.transcode))
                async for piece in response.aiter_raw():
                    await connection.write(piece)
        finally:
            await client.close()

    connection.feed(read())


async def _start_udp(
    connection: _CameraConnection, options: CameraOptions, timeout_s: float
) -> None:
    port = await listen(options, timeout_s)
    try:
        await connection.start(DemuxJob(transcode=options.transcode), port)
    finally:
        port.line.close()


async def _start_whep(
    connection: _CameraConnection, options: CameraOptions, timeout_s: float
) -> None:
    exchange = WhepExchange(options)
    ends = await exchange.reach(timeout_s)

    async def converse() -> None:
        try:
            offer = await connection.offer(DemuxJob(hosts=ends.hosts, own_hosts=ends.own_hosts))
            answer = await exchange.answer(offer, ends.hosts)
            await connection.write(json.dumps(answer._asdict()).encode() + b"\n")
            await asyncio.Event().wait()  # until `close`: the stream comes in the process's records
        finally:
            await exchange.close()

    connection.feed(converse())


async def _start_v4l2(
    connection: _CameraConnection, options: CameraOptions, timeout_s: float
) -> None:
    if not await asyncio.to_thread(os.path.exists, options.device):
        raise ConnectFailed(f"this computer has no {options.device}")
    job = DemuxJob(
        device=options.device,
        format=DEVICE_FORMAT,
        device_options=tuple(options.device_options.items()),
        transcode=options.transcode,
    )
    await connection.start(job)


_STARTS: Final = {
    "rtsp": _start_rtsp,
    "http": _start_http,
    "udp": _start_udp,
    "whep": _start_whep,
    "v4l2": _start_v4l2,
}
