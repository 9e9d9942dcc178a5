"""The task that records when robots were last used and last sent data.

Layer 5. The task checks all robots periodically; a check of a hundred robots takes only
microseconds.
"""

import asyncio
from collections.abc import Callable, Mapping
from pathlib import Path
from time import time
from typing import Final

from urc.runtime.contact_times import FILE, NO_CONTACT, ContactStore, ContactTimes
from urc.web.fleet.robots import RobotService

__all__ = ["ContactWatch"]

_LOOK_S: Final = 2.0
"""Interval between checks, and therefore the accuracy of the times, in seconds."""
_SAVE_S: Final = 60.0
"""Interval between two saves of the file, in seconds."""


class ContactWatch:
    """The contact times of the served robots."""

    def __init__(
        self,
        services: Callable[[], Mapping[str, RobotService]],
        folder: Path | None,
        utc: Callable[[], float] = time,
    ) -> None:
        """Read the stored times.

        Args:
            services: function that returns the robots' services, keyed by the robots' names in
                URLs.
            folder: the data folder; None to store nothing.
            utc: function that returns the UTC time, in seconds since 1970.
        """
        self._services = services
        self._store = ContactStore(folder / FILE if folder is not None else None)
        self._utc = utc

    def times(self, name: str) -> ContactTimes:
        """Return the contact times of a robot; `NO_CONTACT` for an unknown robot."""
        service = self._services().get(name)
        return self._store.of(_key(name, service)) if service is not None else NO_CONTACT

    def look(self) -> None:
        """Record the current time for robots in use and for robots with a live connection."""
        now = self._utc()
        for name, service in self._services().items():
            if service.robot.playback is None:
                self._store.note(
                    _key(name, service), now, is_used=service.is_used, is_seen=service.is_heard
                )

    async def run(self) -> None:
        """Check the robots and save the times periodically, until cancelled."""
        loop = asyncio.get_running_loop()
        saved_s = loop.time()
        while True:
            await asyncio.sleep(_LOOK_S)
            self.look()
            if loop.time() - saved_s >= _SAVE_S:
                saved_s = loop.time()
                await asyncio.to_thread(self._store.save)

    async def close(self) -> None:
        """Record and save the contact times for the last time, before the server ends."""
        self.look()
        await asyncio.to_thread(self._store.save)


def _key(name: str, service: RobotService) -> str:
    return ContactStore.key(name, is_emulated=service.robot.is_emulated)
