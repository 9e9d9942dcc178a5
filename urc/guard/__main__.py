"""The guard process, ``python -m urc.guard PIPE DOOR…``, started only by `PipeChannel`."""

import asyncio
import gc
import logging
import os
import signal
import socket
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from urc._event_loop import run
from urc.guard import messages
from urc.guard.pipe import Pipe
from urc.guard.process import DOOR
from urc.guard.real_time_priority import RealTimePriority
from urc.guard.server import FINISH_S, GuardServer
from urc.transports.own_listeners import OWN_DOORS

__all__ = ["BEAT_S", "main"]

BEAT_S: Final = 0.1
_GRACE_S: Final = 0.7
_ENTER_S: Final = 5.0


class _Clock:
    """This machine's monotonic clock, shared with the engine's process."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop

    now = staticmethod(time.monotonic)

    async def sleep(self, seconds: float) -> None:
        await asyncio.sleep(seconds)

    def call_at(self, time_s: float, action: Callable[[], None]) -> asyncio.TimerHandle:
        return self._loop.call_later(max(0.0, time_s - time.monotonic()), action)


async def _guard(line: socket.socket, priority: RealTimePriority) -> None:
    loop = asyncio.get_running_loop()
    over = asyncio.Event()
    for name in ("SIGTERM", "SIGHUP"):
        with suppress(AttributeError, NotImplementedError):  # Windows: the pipe ends instead
            loop.add_signal_handler(getattr(signal, name), over.set)

    def emit(said: messages.FromGuard) -> int:
        return pipe.post(said)

    host = GuardServer(emit, _Clock(loop))
    pipe = Pipe(
        line,
        messages.encoder(),
        messages.decoder_of_guard(),
        take=host.handle,
        settle=host.settle,
        gone=over.set,
    )
    due_s = loop.time()

    def heartbeat() -> None:
        nonlocal due_s
        priority.retry()
        late_s = loop.time() - due_s
        if not pipe.is_backed_up:
            pipe.post(messages.Heartbeat(late_s))
        due_s = loop.time() + BEAT_S
        loop.call_at(due_s, heartbeat)

    def begin() -> None:
        priority.request()  # after a refusal the priority is ordinary: see `urc doctor`
        heartbeat()

    # A timer runs after the first messages have been read, which load the transports. Loading
    # takes longer than real-time priority allows, and the first heartbeat ends the guard's turn.
    loop.call_later(0.0, begin)
    await over.wait()
    with suppress(TimeoutError):
        async with asyncio.timeout(FINISH_S + _GRACE_S):
            await host.finish()
    pipe.close()
    logging.shutdown()
    os._exit(0)  # library threads and tasks must not keep the process alive


def _line(place: str) -> socket.socket:
    """Return the guard's end of the pipe: an inherited socket, or a connection to the server."""
    if not place.startswith(DOOR):
        return socket.socket(fileno=int(place))
    line = socket.create_connection(("127.0.0.1", int(place.removeprefix(DOOR))), timeout=_ENTER_S)
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    line.sendall(sys.stdin.buffer.read())
    return line


def main() -> None:
    """Guard the connections of one robot until the pipe closes or SIGTERM arrives."""
    # Ctrl-C reaches every process in the terminal; the server decides how to react.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    logging.basicConfig(format="%(levelname)s: guard: %(message)s", level=logging.WARNING)
    line = _line(sys.argv[1])
    OWN_DOORS.learn(sys.argv[2:])
    gc.collect()
    gc.freeze()  # excludes all loaded modules from later collections
    run(_guard(line, RealTimePriority()))


if __name__ == "__main__":
    main()
