"""Lets those who wait for something go on in the order in which they came.

Floor 4. Who waits for an event goes on some turns of the loop after it; somebody who comes in those
turns, and finds that it has happened, would go first.
"""

import asyncio

__all__ = ["Turnstile"]


class Turnstile:
    """Closed until an event has happened, and until all who waited for it are through."""

    def __init__(self, event: asyncio.Event) -> None:
        """Prepare; the event is never cleared."""
        self._event = event
        self._turn = asyncio.Lock()  # the first who wants it has it first
        self._waiting = 0

    @property
    def is_open(self) -> bool:
        """Whether somebody who comes now overtakes nobody."""
        return self._event.is_set() and not self._waiting

    async def wait(self) -> None:
        """Return when it is one's turn; who gives up holds up nobody."""
        self._waiting += 1
        try:
            async with self._turn:
                await self._event.wait()
        finally:
            self._waiting -= 1
