"""A guard in this process, for tests and for ``--no-guard``."""

from collections.abc import Sequence

from urc.guard import messages
from urc.guard.channel import ChannelListener, GuardedLineSpec
from urc.guard.send_queue import LaneClock
from urc.guard.server import GuardServer
from urc.model.payload import size_of

__all__ = ["LocalChannel"]

_OVERHEAD_BYTES = 32
"""Size of a message without its payload, for flow control."""


class LocalChannel:
    """The channel to a guard in this process, which stops nothing when this process hangs."""

    def __init__(
        self, listener: ChannelListener, *, lines: Sequence[GuardedLineSpec], clock: LaneClock
    ) -> None:
        """Prepare; nothing runs before `start`.

        Args:
            listener: the client.
            lines: in the order in which they carry each other.
            clock: the time.
        """
        self._listener = listener
        self._lines = tuple(lines)
        self._clock = clock
        self._host = GuardServer(self._emit, clock)

    def start(self) -> None:
        """Give the guard its lines."""
        for spec in self._lines:
            self._host.add(spec.make, spec.transport)

    async def finish(self) -> None:
        """Stop everything and close every line."""
        await self._host.finish()

    def post(self, message: messages.ToGuard, *, slot: str = "", is_urgent: bool = False) -> None:
        """Send a message, which the guard handles at once."""
        self._host.handle(message)
        self._host.settle()

    def drop(self, slot: str) -> None:
        """Do nothing: no message is ever unsent."""

    async def ready(self) -> None:
        """Return at once."""

    def now(self) -> float:
        """Return the time of the clock."""
        return self._clock.now()

    def _emit(self, message: messages.FromGuard) -> int:
        size = (
            size_of(message.data) + _OVERHEAD_BYTES
            if isinstance(message, messages.BytesReceived)
            else 0
        )
        self._listener.handle(message, size)
        return size
