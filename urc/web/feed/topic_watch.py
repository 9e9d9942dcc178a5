"""A watcher of one ROS robot's topics, which finds mistakes that ROS does not report.

Layer 5. The watcher requests the topics that the driver uses, at a low rate. While a developer page
shows the list of topics, it requests all topics. The transport does not answer while URC publishes.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, Protocol, runtime_checkable

from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError
from urc.runtime.clock import Clock
from urc.runtime.hub import Hub, LinkStatus
from urc.runtime.settings import options_of
from urc.runtime.topic_check import TopicUse, find_mismatches, topic_uses
from urc.transports.ros.topic_list import TopicList

__all__ = ["TopicRates", "SupportsTopicList", "TopicWatch"]

FIRST_S: Final = 2.0
"""Time for which a connection is open before the first request, in seconds. ROS needs this time to
announce all topics and nodes."""
EVERY_S: Final = 10.0
"""Interval between two requests, in seconds."""
SHOWN_EVERY_S: Final = 2.0
"""Interval between two requests while a page lists all topics, in seconds."""
_LOOK_S: Final = 0.5


@runtime_checkable
class SupportsTopicList(Protocol):
    """A session that can request topics; recordings and remote robots cannot."""

    @property
    def hub(self) -> Hub:
        """The latest values, link states and topics."""

    def ask_topics(self, transport: str, names: list[str], *, is_all: bool) -> None:
        """Request the topics of the robot behind a transport."""


class TopicRates:
    """Rates of received messages, from two successive lists."""

    def __init__(self) -> None:
        self._counts: dict[tuple[str, str], tuple[float, int]] = {}
        self._lists: dict[str, TopicList] = {}
        self._rates: dict[tuple[str, str], float] = {}

    def take(self, transport: str, listed: TopicList, now_s: float) -> None:
        """Update the rates from a list of topics."""
        if self._lists.get(transport) is listed:
            return
        self._lists[transport] = listed
        for row in listed.rows:
            key = transport, row.name
            before = self._counts.pop(key, None)
            if row.received is None:
                continue
            self._counts[key] = now_s, row.received
            if before is not None and now_s > before[0] and row.received >= before[1]:
                self._rates[key] = (row.received - before[1]) / (now_s - before[0])

    def of(self, transport: str, topic: str) -> float | None:
        """Return the rate of a topic, in messages per second; None if it is not measured."""
        return self._rates.get((transport, topic)) if (transport, topic) in self._counts else None


class TopicWatch:
    """The watcher of one open session."""

    def __init__(
        self, profile: Profile, settings: dict[str, Value], session: object, clock: Clock
    ) -> None:
        """Find the driver's topics, without requesting anything."""
        driver = profile.driver
        self._source = session if isinstance(session, SupportsTopicList) else None
        self._clock = clock
        self.uses: list[TopicUse] = topic_uses(driver, settings) if self._source else []
        self._lines: dict[str, object] = {}
        """Declared ROS version of each ROS transport."""
        for name, spec in driver.transports.items() if self._source else ():
            if spec.type == "ros":
                try:
                    self._lines[name] = options_of(spec, settings).get("version")
                except UrcError:
                    continue
        self._due_s: dict[str, float] = {}
        self.rates = TopicRates()
        self._readers = 0

    @property
    def transports(self) -> tuple[str, ...]:
        """The robot's ROS transports."""
        return tuple(self._lines)

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Request all topics, and more often, while the context is open."""
        self._readers += 1
        self._due_s = dict.fromkeys(self._due_s, self._clock.now())
        try:
            yield
        finally:
            self._readers -= 1

    async def run(self) -> None:
        """Watch until cancelled."""
        if self._source is None or not self._lines:
            return
        while True:
            self._look(self._source)
            await self._clock.sleep(_LOOK_S)

    def _look(self, source: SupportsTopicList) -> None:
        hub, now_s = source.hub, self._clock.now()
        for name in self._lines:
            link = hub.links.get(name)
            if link is None or not _is_open(link):
                self._due_s.pop(name, None)
                continue
            if now_s >= self._due_s.setdefault(name, now_s + FIRST_S):
                self._due_s[name] = now_s + (SHOWN_EVERY_S if self._readers else EVERY_S)
                names = dict.fromkeys(one.topic for one in self.uses if one.transport == name)
                source.ask_topics(name, [*names], is_all=self._readers > 0)
            if name in hub.topic_lists:
                self.rates.take(name, hub.topic_lists[name], now_s)
        hub.set_mismatches(find_mismatches(self.uses, hub.topic_lists, self._lines))


def _is_open(link: LinkStatus) -> bool:
    return link.state in ("live", "silent") or link.is_ready
