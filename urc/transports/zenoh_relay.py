"""The relay between the Zenoh library and a connection that URC has opened.

The library opens its connections itself. It would queue data that URC cannot see, and it would
reconnect without a report. URC therefore opens the connection, and the library connects to this
relay through a private socket. The relay accepts one connection, so a lost router stays lost. It
counts all bytes, so URC knows which data has not left this computer yet.
"""

import asyncio
import logging
import os
import shutil
import socket
import tempfile
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any, Final

from urc.transports._faults import broke
from urc.transports.base import ByteStream, PeerClosed, TransportError, reset, unsent_of

__all__ = ["ZenohRelay"]

_PIECE_BYTES: Final = 65536
GATHER_S: Final = 1 / 60
"""Time for which the relay gathers the router's data after a small piece, in seconds: one display
frame. Each piece wakes threads of the library and the event loop, which costs more than its bytes.
"""
GATHER_BYTES: Final = 8192
"""Size of a small piece, in bytes. Larger ones belong to images, which must not wait."""
_HAS_PATHS: Final = os.name == "posix"
"""Whether the library can connect to a socket in the file system."""

log = logging.getLogger(__name__)


class ZenohRelay:
    """The relay of one connection."""

    def __init__(
        self,
        stream: ByteStream,
        ended: Callable[[str, bool], None],
        passed_on: Callable[[], object] = lambda: None,
    ) -> None:
        """Initialise the relay.

        Args:
            stream: the open connection to the router, owned by the relay from now on.
            ended: callback for the end of the connection; it receives the reason, and whether the
                library ended it.
            passed_on: callback after the library was sent data from the router.
        """
        self._stream = stream
        self._ended = ended
        self._passed_on = passed_on
        self._loop = asyncio.get_running_loop()
        self._folder = ""
        self._listener: socket.socket | None = None
        self._task: asyncio.Task[None] | None = None
        self._read = 0
        """Number of bytes received from the library."""
        self._written = 0
        """Number of bytes passed to the kernel."""
        self._wanted: dict[asyncio.Future[None], int] = {}
        self._fault = ""
        """Why the network connection ended; "" if the library ended it."""
        self.heard_s = self._loop.time()
        """Time of the newest data from the router, on the event loop's clock."""
        self.is_gathering = False
        """Whether small pieces from the router are gathered. A session that is opening does not
        gather, because a stop may wait for it."""

    def listen(self) -> str:
        """Open the private socket; return its Zenoh endpoint.

        Raises:
            TransportError: the system refuses the socket.
        """
        try:
            if _HAS_PATHS:
                self._folder = tempfile.mkdtemp(prefix="urc-")  # only for this user
                path = str(Path(self._folder, "z"))
                self._listener = socket.socket(socket.AF_UNIX)
                self._listener.bind(path)
                endpoint = f"unixsock-stream/{path}"
            else:
                self._listener = socket.socket()
                self._listener.bind(("127.0.0.1", 0))
                endpoint = f"tcp/127.0.0.1:{self._listener.getsockname()[1]}"
            self._listener.setblocking(False)
            self._listener.listen(1)
        except OSError as fault:
            self._close_listener()
            raise TransportError(f"no private socket for the Zenoh library ({fault})") from fault
        self._task = asyncio.create_task(self._run())
        return endpoint

    @property
    def read(self) -> int:
        """Number of bytes received from the library."""
        return self._read

    def unsent(self) -> int:
        """Return the number of bytes that the router has not acknowledged."""
        return self._read - self._written + unsent_of(self._stream)

    async def passed(self, count: int, silent_s: float) -> None:
        """Wait until the kernel has accepted the first `count` bytes, or the relay has ended.

        Raises:
            TimeoutError: the kernel has accepted nothing for `silent_s` seconds.
        """
        while self._written < count and self._task is not None and not self._task.done():
            before, reached = self._written, self._loop.create_future()
            self._wanted[reached] = count
            try:
                async with asyncio.timeout(silent_s):
                    await reached
            except TimeoutError:
                if self._written == before:
                    raise
            finally:
                self._wanted.pop(reached, None)

    async def close(self) -> None:
        """Close both sides immediately. The method never raises."""
        await self._end(self._stream.abort())

    async def abort(self) -> None:
        """Close both sides immediately and discard unsent data. Never raises."""
        await self._end(reset(self._stream))

    async def _end(self, closing: Coroutine[Any, Any, None]) -> None:
        self._close_listener()
        task, self._task = self._task, None
        try:
            await closing
        finally:
            if task is not None:
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)
            self._wake()

    def _close_listener(self) -> None:
        listener, self._listener = self._listener, None
        folder, self._folder = self._folder, ""
        if listener is not None:
            listener.close()
        if folder:
            shutil.rmtree(folder, ignore_errors=True)

    def _wake(self) -> None:
        """Wake the tasks whose bytes have left; at the end of the relay, wake all tasks."""
        is_over = self._task is None or self._task.done()
        for reached, count in self._wanted.items():
            if not reached.done() and (is_over or self._written >= count):
                reached.set_result(None)

    async def _run(self) -> None:
        listener = self._listener
        assert listener is not None  # noqa: S101 - `listen` created it
        try:
            end, _ = await self._loop.sock_accept(listener)
        except OSError as fault:
            self._ended(broke(fault), True)
            return
        self._close_listener()  # one connection only: the library cannot reconnect
        end.setblocking(False)
        try:
            async with asyncio.TaskGroup() as ways:
                outward = ways.create_task(self._until_ended(self._out(end)))
                inward = ways.create_task(self._until_ended(self._back(end)))
                outward.add_done_callback(lambda _: inward.cancel())
                inward.add_done_callback(lambda _: outward.cancel())
        finally:
            end.close()
            try:
                await self._stream.abort()
            finally:
                self._ended(self._fault, not self._fault)
                self._task = None
                self._wake()

    async def _until_ended(self, way: Coroutine[Any, Any, None]) -> None:
        """Run one direction until either side ends; keep the network's reason."""
        try:
            await way
        except PeerClosed as fault:
            self._fault = self._fault or str(fault)
        except OSError:
            return  # the library has closed its socket
        except Exception as bug:  # supervisor: both directions end together, with a reason
            log.error("the relay of a Zenoh connection failed", exc_info=bug)
            self._fault = self._fault or f"the relay failed ({type(bug).__name__}: {bug})"

    async def _out(self, end: socket.socket) -> None:
        while data := await self._loop.sock_recv(end, _PIECE_BYTES):
            self._read += len(data)
            await self._stream.write(data)
            self._written += len(data)
            if self._wanted:
                self._wake()

    async def _back(self, end: socket.socket) -> None:
        while True:
            data = await self._stream.read()
            self.heard_s = self._loop.time()
            await self._loop.sock_sendall(end, data)
            self._passed_on()
            if self.is_gathering and len(data) < GATHER_BYTES:
                await asyncio.sleep(GATHER_S)
