"""A send queue for a transport whose `send` may wait."""

import asyncio
import logging
from collections import deque
from collections.abc import Callable
from typing import Generic, ParamSpec, Protocol, TypeVar

from urc.model.payload import Payload
from urc.transports.base import PeerClosed, TransportError

__all__ = ["LaneClock", "SendQueue", "TimerHandle", "tolerant", "why_broken"]

log = logging.getLogger(__name__)

_Tag = TypeVar("_Tag")
_P = ParamSpec("_P")
_R = TypeVar("_R")


class TimerHandle(Protocol):
    """A timer."""

    def cancel(self) -> None:
        """Cancel the timer; do nothing if the timer has fired."""


class LaneClock(Protocol):
    """A monotonic clock with timers, such as `urc.runtime.clock.Clock`."""

    def now(self) -> float:
        """Return monotonic seconds."""

    async def sleep(self, seconds: float) -> None:
        """Return after `seconds`."""

    def call_at(self, time_s: float, action: Callable[[], None]) -> TimerHandle:
        """Run `action` at `time_s`, or immediately if that time has passed."""


class Sender(Protocol):
    """The only method of a transport that the queue uses."""

    async def send(self, data: Payload) -> None:
        """Hand `data` over."""


class SendQueue(Generic[_Tag]):
    """A short send queue for one transport, with one task that sends the frames in order."""

    def __init__(
        self,
        sender: Sender,
        clock: LaneClock,
        done: Callable[[_Tag, TransportError | None], None],
        *,
        after: "SendQueue[object] | None" = None,
    ) -> None:
        """Create an empty queue.

        Args:
            sender: the transport.
            clock: the time source.
            done: callback after each frame, with the frame's tag and the error; None without an
                error.
            after: queue whose frames are sent before this queue's frames; None for no other queue.
        """
        self._sender = sender
        self._clock = clock
        self._done = done
        self._after = after
        self._waiting: deque[tuple[Callable[[], Payload | None], _Tag]] = deque()
        self._filled = asyncio.Event()
        self._is_free = asyncio.Event()
        self._is_free.set()
        self._task: asyncio.Task[None] | None = None
        self.busy_since_s: float | None = None
        """Time at which the first frame in the queue began to wait; None for an empty queue."""

    @property
    def is_idle(self) -> bool:
        """Whether all frames were handed to the transport."""
        return not self._waiting

    async def until_idle(self) -> None:
        """Wait until all frames have been handed to the transport."""
        await self._is_free.wait()

    def push(self, make: Callable[[], Payload | None], tag: _Tag) -> None:
        """Add a frame to the queue.

        Args:
            make: function that renders the frame at the head of the queue; a result of None drops
                the frame.
            tag: argument for the callback `done`. The callback is not called for a dropped frame.
        """
        if not self._waiting:
            self.busy_since_s = self._clock.now()
            self._is_free.clear()
        self._waiting.append((make, tag))
        self._filled.set()
        if self._task is None:
            self._task = asyncio.get_running_loop().create_task(self._run())

    def end(self) -> list[_Tag]:
        """Stop sending and return the unsent frames' tags."""
        task, self._task = self._task, None
        if task is not None:
            task.cancel()
        left = [tag for _, tag in self._waiting]
        self._waiting.clear()
        self._filled.clear()
        self._empty()
        return left

    def _empty(self) -> None:
        self.busy_since_s = None
        self._is_free.set()

    async def _run(self) -> None:
        while True:
            await self._filled.wait()
            self._filled.clear()
            while self._waiting:
                if self._after is not None:
                    await self._after.until_idle()
                make, tag = self._waiting[0]
                data = make()
                fault = None if data is None else await self._send(data)
                self._waiting.popleft()
                self.busy_since_s = self._clock.now()
                if not self._waiting:
                    self._empty()
                if data is not None:
                    self._done(tag, fault)

    async def _send(self, data: Payload) -> TransportError | None:
        try:
            await self._sender.send(data)
        except TransportError as fault:
            return fault
        except Exception as bug:  # supervisor: a third-party transport may raise anything
            return PeerClosed(why_broken(bug))
        return None


def why_broken(bug: Exception) -> str:
    """Log an unexpected error from a transport; return an error message for the operator."""
    log.error("a transport failed in an unexpected way", exc_info=bug)
    return f"the transport failed in an unexpected way ({type(bug).__name__}: {bug})"


def tolerant(
    call: Callable[_P, _R], instead: _R, failed: Callable[[str], None]
) -> Callable[_P, _R]:
    """Return `call`, wrapped so that a failure calls `failed` and returns `instead`.

    A third-party transport may raise any exception, but the exception must not end a lease's timer.
    """

    def tried(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        try:
            return call(*args, **kwargs)
        except Exception as bug:  # a third-party transport may raise anything
            failed(why_broken(bug))
            return instead

    return tried
