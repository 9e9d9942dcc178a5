"""The task that notes which robots are used and heard.

Layer 5. A look takes microseconds for a hundred robots, so no event of a robot is needed.
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
"""Interval between two looks, in seconds, and accuracy of the times."""
_SAVE_S: Final = 60.0
"""Interval between two writes of the file, in seconds."""


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
            services: function that returns the served robots, by the name in their URL.
            folder: the data folder; None stores nothing.
            utc: source of the time, in seconds since 1970.
        """
        self._services = services
        self._store = ContactStore(folder / FILE if folder is not None else None)
        self._utc = utc

    def times(self, name: str) -> ContactTimes:
        """Return the contact times of a served robot; an unknown robot has none."""
        service = self._services().get(name)
        return self._store.of(_key(name, service)) if service is not None else NO_CONTACT

    def look(self) -> None:
        """Note the robots that are used or heard now."""
        now = self._utc()
        for name, service in self._services().items():
            if service.robot.playback is None:
                self._store.note(
                    _key(name, service), now, is_used=service.is_used, is_seen=service.is_heard
                )

    async def run(self) -> None:
        """Look at the robots until cancelled, and save the times now and then."""
        loop = asyncio.get_running_loop()
        saved_s = loop.time()
        while True:
            await asyncio.sleep(_LOOK_S)
            self.look()
            if loop.time() - saved_s >= _SAVE_S:
                saved_s = loop.time()
                await asyncio.to_thread(self._store.save)

    async def close(self) -> None:
        """Note and save the last times."""
        self.look()
        await asyncio.to_thread(self._store.save)


def _key(name: str, service: RobotService) -> str:
    return ContactStore.key(name, is_emulated=service.robot.is_emulated)
