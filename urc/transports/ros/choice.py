"""The kinds of ROS connections and the automatic choice between bridges.

A WebSocket client offers subprotocols, and the server selects at most one. A Foxglove protocol
server requires one of its own subprotocols. A rosbridge server selects no subprotocol. With ``via:
auto``, the transport therefore offers Foxglove's subprotocols and follows the server's selection.
With ``via: auto`` and no port, the transport tries the usual ports of both kinds, beginning with
the port that worked last.
"""

from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import Final, Protocol

from urc.model.payload import Envelope, Payload
from urc.ros_names import namespace_fault
from urc.transports._faults import one_line
from urc.transports.base import (
    ConnectFailed,
    GoalRecord,
    PeerClosed,
    Transport,
    TransportError,
    TransportSetup,
)
from urc.transports.ros import rosbridge
from urc.transports.ros.foxglove import DEFAULT_PORT as FOXGLOVE_PORT
from urc.transports.ros.foxglove import FoxgloveTransport
from urc.transports.ros.foxglove_frames import SUBPROTOCOLS
from urc.transports.ros.foxglove_topics import TopicWish
from urc.transports.ros.goals import UnfinishedGoals
from urc.transports.ros.robot_time import CLOCK_TOPIC, CLOCK_TYPE
from urc.transports.ros.rosbridge import RosbridgeTransport
from urc.transports.ros.rosbridge_client import RosSubscription
from urc.transports.ros.rosbridge_operations import MAX_BYTES
from urc.transports.websocket import WebSocketTransport
from urc.transports.zenoh_options import DEFAULT_PORT as ZENOH_PORT

__all__ = ["PORTS", "AnyBridgeTransport", "from_setup"]

PORTS: Final[Mapping[str, tuple[int, ...]]] = {
    "rosbridge": (rosbridge.DEFAULT_PORT,),
    "foxglove": (FOXGLOVE_PORT,),
    "zenoh": (ZENOH_PORT,),
    "auto": (FOXGLOVE_PORT, rosbridge.DEFAULT_PORT),
}
"""Usual ports for each kind of bridge, in the order in which they are tried."""
_SHOWN: Final = 60
_CLOCK: Final = RosSubscription(CLOCK_TOPIC, CLOCK_TYPE, throttle_ms=20, queue_length=1)
"""Subscription to the simulated time; simulators publish it up to a thousand times a second."""
_WEBSOCKET: Final = ("auth", "headers")
"""Options that are passed to the WebSocket transport."""


class _Bridge(Protocol):
    """A transport that can start on an open WebSocket."""

    @property
    def address(self) -> str: ...
    async def begin(self, timeout_s: float) -> None: ...
    async def receive(self) -> Envelope: ...
    async def send(self, data: Payload) -> None: ...
    async def close(self) -> None: ...
    async def abort(self) -> None: ...
    async def settle(self) -> str: ...
    async def probe(self) -> None: ...
    def arrivals(self) -> int: ...
    def unsent(self) -> int: ...
    def end_cancellations(self, actions: Collection[str]) -> None: ...


class Candidate:
    """One address of a bridge, with a transport for each kind of bridge."""

    def __init__(
        self,
        port: int,
        wire: WebSocketTransport,
        foxglove: FoxgloveTransport,
        other: RosbridgeTransport,
    ) -> None:
        self.port = port
        self.kind = "rosbridge"
        """Kind of the bridge at the last successful attempt."""
        self._wire = wire
        self._foxglove = foxglove
        self._rosbridge = other

    async def open(self, timeout_s: float) -> _Bridge:
        """Connect and return the transport for the server's kind of bridge."""
        await self._wire.open(timeout_s)
        is_foxglove = self._wire.subprotocol in SUBPROTOCOLS
        bridge: _Bridge = self._foxglove if is_foxglove else self._rosbridge
        await bridge.begin(timeout_s)
        self.kind = "foxglove" if is_foxglove else "rosbridge"
        return bridge


class AnyBridgeTransport:
    """A reusable transport to the first bridge that answers."""

    def __init__(self, candidates: list[Candidate], where: str, goals: UnfinishedGoals) -> None:
        """Store the candidates, without connecting.

        Args:
            candidates: the bridges to try.
            where: target in readable form.
            goals: record of unfinished goals, which the candidates share.
        """
        self._candidates = candidates
        self._goals = goals
        self._where = where
        self._bridge: _Bridge | None = None

    @property
    def address(self) -> str:
        """The transport's target in readable form, such as ``ros 192.168.1.5``."""
        return self._bridge.address if self._bridge is not None else f"ros {self._where}"

    @property
    def chosen(self) -> tuple[str, int]:
        """Kind and port of the bridge that answered last."""
        return self._candidates[0].kind, self._candidates[0].port

    def keep_goals(self, record: GoalRecord, changed: Callable[[GoalRecord], None]) -> None:
        """Take over the goals of an earlier process; see `urc.transports.base.SupportsGoals`."""
        self._goals.keep(record, changed)

    def end_cancellations(self, actions: Collection[str]) -> None:
        """End unanswered cancellations of all goals; see `urc.transports.base.SupportsGoals`."""
        if self._bridge is not None:
            self._bridge.end_cancellations(actions)
        for action in self._goals.owed(actions):
            self._goals.drop(action)

    async def open(self, timeout_s: float) -> None:
        """Connect to a bridge within `timeout_s` seconds, or raise `ConnectFailed`."""
        await self.close()
        faults = []
        for candidate in tuple(self._candidates):
            try:
                self._bridge = await candidate.open(timeout_s / len(self._candidates))
            except ConnectFailed as fault:
                faults.append(str(fault))
                continue
            # The next attempt begins with this bridge, because a stop may depend on that attempt.
            self._candidates.remove(candidate)
            self._candidates.insert(0, candidate)
            return
        raise ConnectFailed("; ".join(faults))

    async def receive(self) -> Envelope:
        """Return the next message, definition or response; raise `PeerClosed` after the last."""
        return await self._open_bridge().receive()

    async def send(self, data: Payload) -> None:
        """Publish a message or call a service; raise `TransportError` on failure."""
        await self._open_bridge().send(data)

    async def close(self) -> None:
        """Close the connection immediately. The method never raises and may be called twice."""
        bridge, self._bridge = self._bridge, None
        if bridge is not None:
            await bridge.close()

    async def abort(self) -> None:
        """Close the connection immediately and discard unsent data. Never raises."""
        bridge, self._bridge = self._bridge, None
        if bridge is not None:
            await bridge.abort()

    async def settle(self) -> str:
        """Wait until the first messages have arrived; return a line about lost messages, or ""."""
        return "" if self._bridge is None else await self._bridge.settle()

    async def probe(self) -> None:
        """Probe the bridge; return when the bridge sends data."""
        await self._open_bridge().probe()

    def arrivals(self) -> int:
        """Return the number of frames that have arrived over this connection."""
        return 0 if self._bridge is None else self._bridge.arrivals()

    def unsent(self) -> int:
        """Return the number of unacknowledged bytes."""
        return 0 if self._bridge is None else self._bridge.unsent()

    def _open_bridge(self) -> _Bridge:
        if self._bridge is None:
            raise PeerClosed("the connection is closed")
        return self._bridge


def from_setup(setup: TransportSetup) -> Transport:
    """Return a ROS transport for a document's options.

    See docs/transports/rosbridge.md, docs/transports/foxglove.md and docs/transports/ros-zenoh.md.

    Raises:
        TransportError: an option is missing or invalid.
    """
    options = setup.options
    via = options.get("via", "rosbridge")
    if not isinstance(via, str) or via not in PORTS:
        raise TransportError(f"ros: via must be one of {', '.join(PORTS)}, not {via!r}")
    _check_namespace(options.get("namespace"))
    _use_sim_time(options.get("use_sim_time"))
    if via == "zenoh":
        from urc.transports.ros import zenoh  # not needed for the bridges

        return zenoh.from_setup(setup)
    host, port = options.get("host"), options.get("port")
    if not isinstance(host, str) or not host.strip():
        raise TransportError(f"ros: host must be a host name or address, not {host!r}")
    host = host.strip()
    if port is not None and (
        isinstance(port, bool) or not isinstance(port, int) or not 1 <= port <= 65535
    ):
        raise TransportError(f"ros: port must be an integer from 1 to 65535, not {port!r}")
    ros = options.get("version")
    if ros is not None and (isinstance(ros, bool) or ros not in (1, 2, rosbridge.AUTO)):
        raise TransportError(f"ros: version must be 1, 2 or auto, not {ros!r}")
    wanted = rosbridge.merged(
        [rosbridge.subscription(one.topic, one.attributes) for one in setup.subscriptions]
    )
    clock_only = None
    if _use_sim_time(options.get("use_sim_time")):
        clock_only = all(one.topic != CLOCK_TOPIC for one in wanted)
        wanted += (_CLOCK,) if clock_only else ()
    wishes = tuple(TopicWish(one.topic, one.type, one.throttle_ms / 1000) for one in wanted)
    declared = ros if isinstance(ros, int) else None
    candidates, goals = [], UnfinishedGoals()  # STOP after a change of the bridge ends all goals
    for number in PORTS[via] if port is None else (port,):
        where = f"[{host}]:{number}" if ":" in host else f"{host}:{number}"
        wire = _wire(setup, where, offers=via != "rosbridge")
        foxglove = FoxgloveTransport(wire, where, wishes, declared, goals, clock_only)
        spare = partial(_wire, setup, where, offers=False)
        other = RosbridgeTransport(wire, where, wanted, ros, goals, spare, clock_only)
        if via == "rosbridge":
            return other
        if via == "foxglove":
            return foxglove
        candidates.append(Candidate(number, wire, foxglove, other))
    return AnyBridgeTransport(candidates, host if port is None else where, goals)


def _check_namespace(given: object) -> None:
    """Raise `TransportError` if the namespace is invalid; the engine has already applied it."""
    if given is None:
        return
    fault = namespace_fault(given) if isinstance(given, str) else "it must be text"
    if fault:
        raise TransportError(
            f"ros: namespace: {one_line(str(given), _SHOWN)!r} is invalid: {fault}"
        )


def _use_sim_time(given: object) -> bool:
    """Return the option ``use_sim_time``; raise `TransportError` if it is invalid."""
    if given not in (None, True, False):
        shown = one_line(str(given), _SHOWN)
        raise TransportError(f"ros: use_sim_time must be true or false, not {shown!r}")
    return given is True


def _wire(setup: TransportSetup, where: str, *, offers: bool) -> WebSocketTransport:
    path, tls = setup.options.get("path", "/"), setup.options.get("tls") or None
    if not isinstance(path, str) or not path.startswith("/"):
        raise TransportError(f"ros: path must be text that starts with /, not {path!r}")
    options: dict[str, object] = {
        "url": f"{'ws' if tls is None else 'wss'}://{where}{path}",
        "tls": tls,
        "max_message": MAX_BYTES,
    }
    if offers:
        options["subprotocols"] = list(SUBPROTOCOLS)
    options |= {name: setup.options[name] for name in _WEBSOCKET if name in setup.options}
    return WebSocketTransport(setup._replace(options=options))
