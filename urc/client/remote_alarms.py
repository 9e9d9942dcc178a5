"""The alarms of a server's robot, and the actions that a program can take on them.

Layer 5. The list arrives over the WebSocket. Actions are HTTP requests; the server answers after it
has stored the change.
"""

from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Final

from urc.problems import UrcError
from urc.wire.server_messages import AlarmRow, AlarmsMessage

__all__ = ["RemoteAlarms"]

_HIDDEN: Final = ("shelved", "suppressed")
Post = Callable[[str, Mapping[str, Any]], Awaitable[Mapping[str, Any]]]
"""Function that sends a request about alarms, and returns the server's answer."""


class RemoteAlarms:
    """The alarms of one robot, except alarms in the normal state."""

    def __init__(self, post: Post) -> None:
        """Begin without alarms.

        Args:
            post: function that sends a request's JSON to a path below the robot's alarms.
        """
        self._post = post
        self.rows: dict[str, AlarmRow] = {}
        """Alarms by signal; times are in milliseconds since 1970."""
        self.is_flooded = False
        """Whether more than 10 alarms began within 10 minutes."""

    @property
    def active(self) -> tuple[AlarmRow, ...]:
        """Active alarms that are neither shelved nor suppressed, in first-out order."""
        shown = (one for one in self.rows.values() if one.active and one.state not in _HIDDEN)
        return tuple(sorted(shown, key=lambda row: row.number))

    async def acknowledge(self, *signals: str) -> tuple[str, ...]:
        """Acknowledge alarms that this program has received; without names, all pending alarms.

        Returns:
            The signals of the acknowledged alarms, except alarms raised again in the meantime.

        Raises:
            UrcError: the server refused, or could not be reached.
        """
        known = [self.rows[one] for one in signals if one in self.rows] if signals else [
            one for one in self.rows.values() if one.state in ("unacknowledged", "returned")
        ]  # fmt: skip
        if not known:
            return ()
        return await self._act("acknowledge", {"alarms": {one.signal: one.raised for one in known}})

    async def shelve(self, *signals: str, for_s: float) -> tuple[str, ...]:
        """Shelve alarms for a time in seconds, at most 24 hours; return the shelved signals.

        Raises:
            UrcError: the server refused, or could not be reached.
        """
        return await self._act("shelve", {"signals": signals, "for_s": for_s})

    async def unshelve(self, *signals: str) -> tuple[str, ...]:
        """Unshelve alarms; return the signals that were shelved.

        Raises:
            UrcError: the server refused, or could not be reached.
        """
        return await self._act("unshelve", {"signals": signals})

    def update(self, message: AlarmsMessage) -> None:
        """Update the list with the changes in a server's message."""
        if message.full:
            self.rows.clear()
        for signal in message.gone:
            self.rows.pop(signal, None)
        self.rows |= {row.signal: row for row in message.rows}
        self.is_flooded = message.flood

    def clear(self) -> None:
        """Clear the list; after a new connection, the server sends all alarms."""
        self.rows.clear()
        self.is_flooded = False

    async def _act(self, verb: str, body: Mapping[str, Any]) -> tuple[str, ...]:
        answer = await self._post(verb, body)
        try:
            return tuple(str(one) for one in answer["signals"])
        except (KeyError, TypeError):
            raise UrcError("the server sent an invalid response about alarms") from None
