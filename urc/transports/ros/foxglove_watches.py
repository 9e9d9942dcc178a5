"""The states of actions' goals over the Foxglove protocol, for the cancellations of a session.

Pure. A watch is a subscription of its own, so the bridge sends the latched status again. If the
driver already subscribes to the topic, its messages count instead, because a bridge accepts only
one subscription per client and channel.

A bridge can withhold the topic, or refuse the subscription. Such a silence proves nothing about the
robot's goals.
"""

from collections.abc import Callable
from typing import Final, Protocol

from urc.transports.ros.foxglove_frames import AdvertisedChannel
from urc.transports.ros.goal_status import STATUS, STATUS_TYPE, bytes_show_active
from urc.transports.ros.types import spelled

__all__ = ["StatusWatches", "WatchCalls"]

_ENCODINGS: Final = ("cdr", "json")


class WatchCalls(Protocol):
    """The parts of a session that watches need."""

    def channel(self, topic: str) -> AdvertisedChannel | None:
        """Return the first channel of a topic, or None."""

    def subscription(self, topic: str) -> int | None:
        """Return the number of the driver's own subscription to a topic, or None."""

    def is_published(self, topic: str) -> bool:
        """Return whether a node publishes a topic, as far as the bridge reports it."""

    def next_number(self) -> int:
        """Return a number that this connection has not used yet."""

    def operate(self, name: str, **fields: object) -> None:
        """Write an operation of the protocol, which is sent soon."""


class _Watch:
    def __init__(self, topic: str, channel: AdvertisedChannel, took: Callable[[bool], None]):
        self.topic, self.channel, self.took = topic, channel, took
        self.is_own = False
        """Whether the watch has a subscription of its own."""
        self.is_refused = False


class StatusWatches:
    """The watched states of one connection."""

    def __init__(self, calls: WatchCalls) -> None:
        """Watch nothing at first."""
        self._calls = calls
        self._watches: dict[int, _Watch] = {}
        """Each watch, keyed by number, which is also the number of its subscription."""
        self._newest: dict[str, tuple[int, bytes]] = {}
        """Number and newest message of the driver's own subscription to a status."""

    def watch(self, action: str, took: Callable[[bool], None]) -> int | None:
        """Pass on whether each status of an action shows an active goal, the latched one first.

        Returns:
            The number of the watch; None if the bridge does not offer the topic.
        """
        topic = action + STATUS
        channel = self._calls.channel(topic)
        if channel is None or channel.encoding not in _ENCODINGS:
            return None
        if spelled(channel.type, "msg", 2) != STATUS_TYPE:
            return None
        number = self._calls.next_number()
        one = self._watches[number] = _Watch(topic, channel, took)
        driver = self._calls.subscription(topic)
        if driver is None:
            one.is_own = True
            wanted = {"id": number, "channelId": channel.id}
            self._calls.operate("subscribe", subscriptions=[wanted])
        elif self._newest.get(topic, (None,))[0] == driver:
            took(bytes_show_active(self._newest[topic][1], channel.encoding))
        return number

    def end(self, number: int) -> None:
        """End a watch; ignore unknown numbers."""
        one = self._watches.pop(number, None)
        if one is not None and one.is_own and self._calls.channel(one.topic) == one.channel:
            self._calls.operate("unsubscribe", subscriptionIds=[number])

    def arrived(self, subscription: int, data: bytes) -> None:
        """Handle a message of a watch's own subscription; ignore unknown numbers."""
        one = self._watches.get(subscription)
        if one is not None:
            one.took(bytes_show_active(data, one.channel.encoding))

    def driver_arrived(self, subscription: int, topic: str, data: bytes) -> None:
        """Handle a status on the driver's own subscription."""
        self._newest[topic] = subscription, data
        for one in [one for one in self._watches.values() if one.topic == topic]:
            one.took(bytes_show_active(data, one.channel.encoding))

    def refuse(self, channels: set[int]) -> None:
        """Note that the bridge has refused subscriptions to these channels."""
        for one in self._watches.values():
            one.is_refused |= one.channel.id in channels

    def is_silent(self, number: int) -> bool:
        """Return whether a watch without a message proves that the action has no status yet."""
        one = self._watches.get(number)
        if one is None or one.is_refused or self._calls.channel(one.topic) != one.channel:
            return False
        return self._calls.is_published(one.topic)
