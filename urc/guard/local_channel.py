"""A guard in this process, for tests and for the option ``--no-guard``."""

from collections.abc import Sequence

from urc.guard import messages
from urc.guard.channel import ChannelListener, GuardedLineSpec
from urc.guard.send_queue import LaneClock
from urc.guard.server import GuardServer
from urc.model.payload import size_of

__all__ = ["LocalChannel"]

_OVERHEAD_BYTES = 32
"""Assumed size of a message without payload, in bytes, for flow control."""


class LocalChannel:
    """A channel to a guard in this process; if the process hangs, the guard cannot stop robots."""

    def __init__(
        self, listener: ChannelListener, *, lines: Sequence[GuardedLineSpec], clock: LaneClock
    ) -> None:
        """Create the channel; `start` starts the guard.

        Args:
            listener: the client.
            lines: the transports; a tunnel precedes the transports that it carries.
            clock: the time source.
        """
        self._listener = listener
        self._lines = tuple(lines)
        self._clock = clock
        self._host = GuardServer(self._emit, clock)

    def start(self) -> None:
        """Create the transports in the guard, which needs no start of its own."""
        for spec in self._lines:
            self._host.add(spec.make, spec.transport)

    async def finish(self) -> None:
        """Stop all controls and close every connection."""
        await self._host.finish()

    def post(self, message: messages.ToGuard, *, slot: str = "", is_urgent: bool = False) -> None:
        """Deliver a message, which the guard handles immediately."""
        self._host.handle(message)
        self._host.settle()

    def drop(self, slot: str) -> None:
        """Do nothing, because messages are delivered immediately."""

    async def ready(self) -> None:
        """Return immediately."""

    def now(self) -> float:
        """Return the current time of the guard's clock, in seconds."""
        return self._clock.now()

    def _emit(self, message: messages.FromGuard) -> int:
        size = (
            size_of(message.data) + _OVERHEAD_BYTES
            if isinstance(message, messages.BytesReceived)
            else 0
        )
        self._listener.handle(message, size)
        return size
