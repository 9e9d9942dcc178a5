"""The alarms of a robot of a server, and the actions of a program on them.

Layer 5. The WebSocket brings the list; actions are HTTP requests, whose answer comes after the
server has stored the change.
"""

from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Final

from urc.problems import UrcError
from urc.wire.server_messages import AlarmRow, AlarmsMessage

__all__ = ["RemoteAlarms"]

_HIDDEN: Final = ("shelved", "suppressed")
Post = Callable[[str, Mapping[str, Any]], Awaitable[Mapping[str, Any]]]
"""Function that sends a request about alarms, and returns its answer."""


class RemoteAlarms:
    """The alarms of one robot that are not normal."""

    def __init__(self, post: Post) -> None:
        """Begin without alarms.

        Args:
            post: sends the JSON of a request to a path below the robot's alarms.
        """
        self._post = post
        self.rows: dict[str, AlarmRow] = {}
        """Alarms by signal; times are in milliseconds since 1970."""
        self.is_flooded = False
        """Whether more than 10 alarms have come in 10 minutes."""

    @property
    def active(self) -> tuple[AlarmRow, ...]:
        """Active alarms that are neither shelved nor suppressed, in first-out order."""
        shown = (one for one in self.rows.values() if one.active and one.state not in _HIDDEN)
        return tuple(sorted(shown, key=lambda row: row.number))

    async def acknowledge(self, *signals: str) -> tuple[str, ...]:
        """Acknowledge alarms as this program knows them; without names, all that wait for it.

        Returns:
            The signals whose alarm was acknowledged; an alarm that was raised again is left out.

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
        """End the shelves of alarms; return the signals that were shelved.

        Raises:
            UrcError: the server refused, or could not be reached.
        """
        return await self._act("unshelve", {"signals": signals})

    def update(self, message: AlarmsMessage) -> None:
        """Apply the changes of a message."""
        if message.full:
            self.rows.clear()
        for signal in message.gone:
            self.rows.pop(signal, None)
        self.rows |= {row.signal: row for row in message.rows}
        self.is_flooded = message.flood

    def clear(self) -> None:
        """Forget the list: after a new connection the server sends all alarms."""
        self.rows.clear()
        self.is_flooded = False

    async def _act(self, verb: str, body: Mapping[str, Any]) -> tuple[str, ...]:
        answer = await self._post(verb, body)
        try:
            return tuple(str(one) for one in answer["signals"])
        except (KeyError, TypeError):
            raise UrcError("the server sent an unknown answer about alarms") from None
