"""Protocols for both sides of the channel between the guard client and the guard.

`urc.guard.pipe_channel.PipeChannel` connects to a guard process, and
`urc.guard.local_channel.LocalChannel` to a guard in this process. Only the client keeps the table
of armed controls; a channel cannot access this table.
"""

from collections.abc import Iterable
from typing import NamedTuple, Protocol

from urc.guard import messages
from urc.transports.base import Transport

__all__ = ["Channel", "ChannelListener", "GuardedLineSpec"]


class GuardedLineSpec(NamedTuple):
    """One guarded transport: how a guard creates it, and its object in this process."""

    make: messages.MakeTransport
    transport: Transport
    """Transport object in this process, equivalent to the result of `make`. Only a guard in this
    process opens the transport object."""


class ChannelListener(Protocol):
    """Receiver of the guard's messages, implemented by `urc.guard.guard_client.GuardClient`."""

    @property
    def may_move(self) -> bool:
        """Whether a control may be moving the robot."""

    def briefing(self) -> Iterable[messages.ToGuard]:
        """Return the messages that initialise a new guard, in sending order.

        The channel calls this method once for each new guard. The method resets the tick numbers,
        and disarms controls with a pending stop.
        """

    def handle(self, message: messages.FromGuard, size: int) -> None:
        """Handle a message from the guard; `size` is its size in bytes for flow control."""

    def lost(self, reason: str) -> None:
        """Handle the end of the guard process, which closes every connection."""


class Channel(Protocol):
    """The connection to a guard, with methods to start and end the guard. Posting never waits."""

    def start(self) -> None:
        """Start the guard; requires a running event loop."""

    async def finish(self) -> None:
        """Stop all controls and close every connection, then end the guard."""

    def post(self, message: messages.ToGuard, *, slot: str = "", is_urgent: bool = False) -> None:
        """Send a message to the guard.

        If no guard is running, drop the message: the next guard is initialised from the client's
        table.

        Args:
            message: the message.
            slot: a newer message replaces an unsent message with the same slot; "" to replace no
                message.
            is_urgent: whether to send the message before all unsent messages.

        Raises:
            UNFIT: the message cannot be encoded (`urc.guard.pipe.UNFIT`).
        """

    def drop(self, slot: str) -> None:
        """Discard the unsent message with this slot, if there is one."""

    async def ready(self) -> None:
        """Wait until a guard has been started and initialised."""

    def now(self) -> float:
        """Return the guard's time, in seconds."""
