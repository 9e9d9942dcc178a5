"""The channel between the guard's client and the guard: its two sides, as protocols.

`urc.guard.pipe_channel.PipeChannel` leads to a process, `urc.guard.local_channel.LocalChannel` to a
guard in this process. Neither channel knows the armed controls: the client has that table.
"""

from collections.abc import Iterable
from typing import NamedTuple, Protocol

from urc.guard import messages
from urc.transports.base import Transport

__all__ = ["Channel", "ChannelListener", "GuardedLineSpec"]


class GuardedLineSpec(NamedTuple):
    """One line of the robot."""

    make: messages.MakeTransport
    transport: Transport
    """The transport of `make` in this process. Only a guard in this process opens it."""


class ChannelListener(Protocol):
    """The user of a channel: `urc.guard.guard_client.GuardClient`."""

    @property
    def may_move(self) -> bool:
        """Whether a control may be moving."""

    def briefing(self) -> Iterable[messages.ToGuard]:
        """Return the messages that initialise a new guard, in their order.

        Called once for each new guard: a pending stop counts as sent from then on.
        """

    def handle(self, message: messages.FromGuard, size: int) -> None:
        """Handle a message of the guard; `size` is its size in bytes for flow control."""

    def lost(self, reason: str) -> None:
        """Handle the end of the guard, which closes every line."""


class Channel(Protocol):
    """The connection to a guard, and the guard's life cycle. Posting never waits."""

    def start(self) -> None:
        """Start the guard; needs a running loop."""

    async def finish(self) -> None:
        """Let the guard stop all controls and close every line, then end the guard."""

    def post(self, message: messages.ToGuard, *, slot: str = "", is_urgent: bool = False) -> None:
        """Send a message to the guard.

        Without a guard, the message is dropped, because the next guard is initialised anyway.

        Args:
            message: the message.
            slot: this message replaces an unsent message of the same slot; "" for no slot.
            is_urgent: whether the message is sent before all unsent messages.

        Raises:
            UNFIT: the message cannot be encoded (`urc.guard.pipe.UNFIT`).
        """

    def drop(self, slot: str) -> None:
        """Discard the unsent message of a slot."""

    async def ready(self) -> None:
        """Return once a guard is ready."""

    def now(self) -> float:
        """Return the guard's time, in seconds."""
