"""The channels and services that one visitor's current rights permit.

Layer 5. The module has no side effects, but the client stores a task in each `Offer`. Channel and
service ids come from one counter, so no id is ever reused.
"""

import asyncio
from collections.abc import Callable, Mapping
from typing import NamedTuple
from weakref import WeakKeyDictionary

from urc.model.role import Role
from urc.runtime.hub import Hub
from urc.web.api.describe import may_run
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.robots import Robot, RobotService
from urc.web.foxglove.robot_feed import RobotFeed
from urc.web.foxglove.services import STOP, RobotServiceType, robot_services
from urc.web.foxglove.topics import HubMessages, RobotTopic, robot_topics
from urc.wire import foxglove as wire

__all__ = ["Changes", "Offer", "OfferSource", "Offers", "RobotCatalogue"]


class RobotContents(NamedTuple):
    """The topics and services of one version of a robot."""

    robot: Robot
    topics: tuple[RobotTopic, ...]
    services: tuple[RobotServiceType, ...]


class RobotCatalogue:
    """The topics and services of all robots, created once for all clients.

    Creating the topics and services of a hundred robots for each client would block the event loop
    for too long.
    """

    def __init__(self) -> None:
        """Start without robots."""
        self._known: WeakKeyDictionary[RobotService, RobotContents] = WeakKeyDictionary()

    def of(self, name: str, service: RobotService) -> RobotContents:
        """Return the topics and services of a robot's version; a playback has no services."""
        robot, known = service.robot, self._known.get(service)
        if known is None or known.robot is not robot:
            is_played = robot.playback is not None
            known = self._known[service] = RobotContents(
                robot,
                robot_topics(name, robot.profile),
                () if is_played else robot_services(name, robot.profile.driver),
            )
        return known


class OfferSource(NamedTuple):
    """The served robots, with functions that return one visitor's rights."""

    services: Callable[[], Mapping[str, RobotService]]
    """Function that returns the robots, keyed by their names in URLs."""
    may_watch: Callable[[str], bool]
    """Function that returns whether the visitor may watch a robot."""
    is_let_in: Callable[[], bool]
    """Function that returns whether the visitor has any role."""
    peer: Callable[[str, RobotService], SocketPeer]
    """Function that returns the visitor with their rights for a robot."""
    messages: Callable[[Hub, str, RobotService], HubMessages]
    """Function that returns the messages of a hub, shared by all clients."""
    catalogue: RobotCatalogue
    """The robots' topics and services, shared by all clients."""


class Offer:
    """One robot that is offered to the visitor."""

    def __init__(
        self,
        name: str,
        service: RobotService,
        contents: RobotContents,
        peer: SocketPeer,
        ready: Callable[[str, RobotFeed], None],
    ) -> None:
        self.name = name
        self.service = service
        self.contents = contents
        self.peer = peer
        self.feed = RobotFeed(lambda: ready(name, self.feed))
        self.task: asyncio.Task[None] | None = None
        """Task that keeps the robot connected while the client subscribes to a channel."""
        self.channels: list[int] = []
        self.services: dict[str, int] = {}
        """Ids of the services, keyed by command."""
        self.allowed: frozenset[str] | None = None
        """STOP and the commands that the visitor may run; None until the services are offered."""

    @property
    def role(self) -> Role | None:
        """Current role of the visitor for the robot."""
        return self.peer.rights.role()


class Changes(NamedTuple):
    """The changes that resulted from one update of the offers."""

    texts: list[bytes]
    """Messages for the client, in order."""
    ended: list[Offer]
    """Robots that are no longer offered."""


class Offers:
    """The robots, channels and services that are offered to one visitor."""

    def __init__(self, source: OfferSource) -> None:
        """Start without offers; `update` adds them."""
        self._source = source
        self._last_id = 0
        self._served: dict[str, tuple[RobotService, Robot]] = {}
        """All robots of the server at the last update."""
        self.robots: dict[str, Offer] = {}
        self.channels: dict[int, tuple[Offer, RobotTopic]] = {}
        self.services: dict[int, tuple[Offer, RobotServiceType]] = {}

    @property
    def is_let_in(self) -> bool:
        """Whether the visitor may still watch at least one robot."""
        return self._source.is_let_in()

    @property
    def is_outdated(self) -> bool:
        """Whether a robot was added, removed or changed since the last update."""
        services, served = self._source.services(), self._served
        if services.keys() != served.keys():
            return True
        return any(
            service is not served[name][0] or service.robot is not served[name][1]
            for name, service in services.items()
        )

    def was_offered(self, number: int) -> bool:
        """Return whether an id belongs, or once belonged, to a channel or service."""
        return 0 < number <= self._last_id

    def messages(self, offer: Offer, hub: Hub) -> HubMessages:
        """Return the messages of a hub, shared by all clients."""
        return self._source.messages(hub, offer.name, offer.service)

    def update(self, ready: Callable[[str, RobotFeed], None]) -> Changes:
        """Update the offers to match the robots and the visitor's rights; return the changes.

        Args:
            ready: function that is called with a robot's name and its feed when a message of the
                robot is ready.
        """
        changes = Changes([], [])
        services = self._source.services()
        self._served = {name: (service, service.robot) for name, service in services.items()}
        wanted = {
            name: service for name, service in services.items() if self._source.may_watch(name)
        }
        for name, offer in list(self.robots.items()):
            service = wanted.get(name)
            if service is not offer.service or offer.service.robot is not offer.contents.robot:
                self._withdraw(offer, changes)
        for name, service in wanted.items():
            if name not in self.robots:
                self._offer(name, service, ready, changes)
            self._update_services(self.robots[name], changes)
        return changes

    def _offer(
        self,
        name: str,
        service: RobotService,
        ready: Callable[[str, RobotFeed], None],
        changes: Changes,
    ) -> None:
        contents, peer = self._source.catalogue.of(name, service), self._source.peer(name, service)
        offer = Offer(name, service, contents, peer, ready)
        self.robots[name] = offer
        announced = []
        for topic in contents.topics:
            number = self._next_id()
            offer.channels.append(number)
            self.channels[number] = (offer, topic)
            announced.append(
                wire.OfferedChannel(number, topic.topic, topic.schema_name, topic.schema)
            )
        changes.texts.append(wire.encode_advertise(announced))

    def _withdraw(self, offer: Offer, changes: Changes) -> None:
        del self.robots[offer.name]
        for number in offer.channels:
            del self.channels[number]
        for number in offer.services.values():
            del self.services[number]
        changes.texts.append(wire.encode_unadvertise(offer.channels))
        if offer.services:
            changes.texts.append(wire.encode_unadvertise_services(offer.services.values()))
        changes.ended.append(offer)

    def _update_services(self, offer: Offer, changes: Changes) -> None:
        """Offer the commands that the visitor may run now."""
        commands = offer.contents.robot.profile.driver.commands
        role, may_give = offer.role, offer.peer.rights.may_give
        names = [name for name, one in commands.items() if may_run(one, role) and may_give(name)]
        allowed = frozenset((STOP, *names))
        if offer.allowed == allowed:
            return
        offer.allowed = allowed
        found = {one.command: one for one in offer.contents.services if one.command in allowed}
        ended = {name: number for name, number in offer.services.items() if name not in found}
        for name, number in ended.items():
            del offer.services[name], self.services[number]
        if ended:
            changes.texts.append(wire.encode_unadvertise_services(ended.values()))
        announced = []
        for name, one in found.items():
            if name not in offer.services:
                number = offer.services[name] = self._next_id()
                self.services[number] = (offer, one)
                announced.append(
                    wire.OfferedService(number, one.name, one.type, one.request, one.response)
                )
        if announced:
            changes.texts.append(wire.encode_services(announced))

    def _next_id(self) -> int:
        self._last_id += 1
        return self._last_id
