"""Sends one thing after the other where sending has to wait."""

import asyncio
import logging
from collections import deque
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from urc.model.payload import Payload
from urc.transports.base import PeerClosed, TransportError

__all__ = ["LaneClock", "SendQueue", "TimerHandle", "why_broken"]

log = logging.getLogger(__name__)

_Tag = TypeVar("_Tag")


class TimerHandle(Protocol):
    """A call that is due later."""

    def cancel(self) -> None:
        """Call it off; harmless when it has been made."""


class LaneClock(Protocol):
    """Time; `urc.runtime.clock` has the same."""

    def now(self) -> float:
        """Return monotonic seconds."""

    async def sleep(self, seconds: float) -> None:
        """Return after `seconds`."""

    def call_at(self, time_s: float, action: Callable[[], None]) -> TimerHandle:
        """Make `action` run at `time_s`, or at once when that is past."""


class Sender(Protocol):
    """The member of a transport that is needed here."""

    async def send(self, data: Payload) -> None:
        """Hand `data` over."""


class SendQueue(Generic[_Tag]):
    """A short queue before a transport, with one task for as long as it is open."""

    def __init__(
        self,
        sender: Sender,
        clock: LaneClock,
        done: Callable[[_Tag, TransportError | None], None],
        *,
        after: "SendQueue[object] | None" = None,
    ) -> None:
        """Prepare a lane.

        Args:
            sender: takes what is put in.
            clock: the time.
            done: told of each thing with its tag; with what went wrong, if anything did.
            after: another lane, of which everything goes before anything of this one.
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
        """When the first of what waits was put in; None while nothing does."""

    @property
    def is_idle(self) -> bool:
        """Whether everything was handed over."""
        return not self._waiting

    async def until_idle(self) -> None:
        """Return when everything was handed over."""
        await self._is_free.wait()

    def push(self, make: Callable[[], Payload | None], tag: _Tag) -> None:
        """Send something after what waits.

        Args:
            make: asked for it when its turn has come; None: it is not to be sent any more.
            tag: what `done` is told; not where nothing was sent.
        """
        if not self._waiting:
            self.busy_since_s = self._clock.now()
            self._is_free.clear()
        self._waiting.append((make, tag))
        self._filled.set()
        if self._task is None:
            self._task = asyncio.get_running_loop().create_task(self._run())

    def end(self) -> list[_Tag]:
        """Send nothing more; return the tags of what was not handed over."""
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
        except Exception as bug:  # supervisor: a foreign transport may raise what it likes
            return PeerClosed(why_broken(bug))
        return None


def why_broken(bug: Exception) -> str:
    """Log what no transport should raise, and return the line for people."""
    log.error("a transport failed in an unexpected way", exc_info=bug)
    return f"the transport failed in an unexpected way ({type(bug).__name__}: {bug})"
