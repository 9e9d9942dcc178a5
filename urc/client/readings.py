"""Readings of a robot from a hub: latest values, waits, streams and the log.

Layer 5. Both openings of a robot share this code. Each opening has a `urc.runtime.hub.Hub`: the hub
of a session, or a hub filled by a server's messages.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AbstractContextManager, nullcontext

from urc.model.values import Reading, Sample, Signal
from urc.problems import UrcError
from urc.runtime.hub import Hub, LinkState, LinkStatus, LogEntry

__all__ = ["HubReadings"]


class HubReadings:
    """The part of `urc.client.robot.RobotInterface` that reads values."""

    def __init__(self, hub: Hub) -> None:
        """Store the hub."""
        self.hub = hub

    @property
    def signals(self) -> Mapping[str, Signal]:
        """All signals of the robot, by name."""
        return self.hub.signals

    @property
    def links(self) -> Mapping[str, LinkStatus]:
        """State of every transport of the robot, by name of the transport."""
        return self.hub.links

    def latest(self, name: str, /) -> Sample | None:
        """Return a signal's newest reading; None before the first reading.

        Raises:
            UrcError: the robot has no signal with this name.
        """
        self._check(name)
        return self.hub.latest(name)

    def state(self, transport: str, /) -> LinkState:
        """Return a transport's state: ``idle``, ``connecting``, ``live``, ``silent`` or ``lost``.

        Raises:
            UrcError: the robot has no transport with this name.
        """
        if transport not in self.hub.links:
            known = ", ".join(self.hub.links)
            raise UrcError(f"unknown transport {transport!r}; expected one of: {known}")
        return self.hub.links[transport].state

    async def wait_for(
        self,
        name: str,
        /,
        is_met: Callable[[Reading], bool] | None = None,
        *,
        timeout: float | None = None,
    ) -> Sample:
        """Return the first reading that meets the condition, starting with the current reading.

        Raises:
            TimeoutError: the timeout has passed.
            UrcError: the robot has no signal with this name, or the connection has ended
                permanently.
        """
        self._check(name)
        async with asyncio.timeout(timeout):
            with self.shown((name,)), self.hub.subscribe() as subscription:
                while True:
                    found = self.hub.latest(name)
                    if found is not None and (is_met is None or is_met(found.value)):
                        return found
                    self.check_open()
                    subscription.seen = self.hub.revision
                    await subscription.changed()

    async def watch(self, *names: str) -> AsyncIterator[Sample]:
        """Yield readings of the named signals, or of all signals, until the caller stops.

        The stream begins with the current readings. Only the newest reading of each signal is kept,
        so a slow program skips readings and never falls behind.

        Raises:
            UrcError: the robot has no signal with this name, or the connection has ended
                permanently.
        """
        for name in names:
            self._check(name)
        with self.shown(names or self.hub.names), self.hub.subscribe() as subscription:
            while True:
                for sample in subscription.changes():
                    if not names or sample.signal in names:
                        yield sample
                self.check_open()
                await subscription.changed()

    def log(self) -> AsyncIterator[LogEntry]:
        """Yield each new line of the robot's log, until the caller stops.

        A warning replaces lost lines and states their number.

        Raises:
            UrcError: the connection has ended permanently.
        """
        return self._lines(self.hub.notes_count)

    async def _lines(self, count: int) -> AsyncIterator[LogEntry]:
        hub = self.hub
        with hub.subscribe() as subscription:
            while True:
                new = hub.notes_count - count
                lines = list(hub.notes)[-new:] if new else []
                count = hub.notes_count
                if lost := new - len(lines):
                    text = f"log lines lost, because this program reads the log too slowly: {lost}"
                    yield LogEntry(lines[0].time_s, "warning", "urc", text)
                for line in lines:
                    yield line
                if hub.notes_count == count:
                    self.check_open()
                    subscription.seen = hub.revision
                    await subscription.changed()

    # -- for the openings

    def check_open(self) -> None:
        """Raise `ConnectionLost` if no further reading can arrive."""

    def shown(self, names: tuple[str, ...]) -> AbstractContextManager[None]:
        """Request the images of the image signals in `names` while the context is open."""
        return nullcontext()

    def _check(self, name: str) -> None:
        if name not in self.hub.signals:
            known = ", ".join(self.hub.signals) or "none"
            raise UrcError(f"unknown signal {name!r}; expected one of: {known}")
