"""Connections to an emulated robot in the same process, in place of a network.

`transports_to` returns a table like `urc.transports.table.TRANSPORTS`, in which every type of
transport connects to the emulated robot. A byte transport carries exactly the bytes of the wire. A
message transport carries the messages as JSON, with the topics and intervals of its subscriptions.
"""

import asyncio
import time
from collections.abc import Sequence
from typing import Final

import msgspec

from urc.model.driver import Driver, TransportSpec
from urc.model.payload import Envelope, Payload
from urc.registry import RegistryEntry, Table
from urc.simulator.emulated_robot import EmulatedConnection, EmulatedRobot
from urc.simulator.servers.base import ServerContext
from urc.simulator.servers.clients import ClientConnection, converse
from urc.transports.base import PeerClosed, TransportSetup

__all__ = ["DirectTransport", "transports_to"]

MOST_WAITING: Final = 256
"""Maximum number of payloads that wait in one direction; the oldest message of the robot is
dropped, and a longer queue to the robot refuses motion."""
_EARLY: Final = 0.1
"""Share of an interval by which a message may come early, as in the emulated rosbridge."""
_ANSWERED: Final = ("call", "goal", "request")


class DirectTransport:
    """A transport to an emulated robot in this process; may be opened several times."""

    def __init__(self, robot: EmulatedRobot, spec: TransportSpec, setup: TransportSetup) -> None:
        """Initialise without connecting."""
        self._robot = robot
        self._spec = spec
        self._name = setup.name
        self._intervals = {
            one.topic: _seconds(one.attributes.get("throttle")) for one in setup.subscriptions
        }
        self._shown_s: dict[str, float] = {}
        self._arrived: asyncio.Queue[Payload | None] = asyncio.Queue()
        self._sent: asyncio.Queue[Payload | None] = asyncio.Queue()
        self._task: asyncio.Task[None] | None = None

    @property
    def address(self) -> str:
        """Text to display in place of an address."""
        return f"{self._spec.type} in this page"

    async def open(self, timeout_s: float) -> None:
        """Connect to the robot, which accepts at once."""
        await self.close()
        self._arrived, self._sent = asyncio.Queue(), asyncio.Queue()
        self._shown_s.clear()
        client = ClientConnection(self._robot.line(self._name), lambda: None)
        self._task = asyncio.create_task(self._serve(client, self._sent, self._arrived))

    async def receive(self) -> Payload:
        """Return the next payload of the robot; raise `PeerClosed` at the end."""
        found = await self._arrived.get()
        if found is None:
            self._arrived.put_nowait(None)  # for the next call
            raise PeerClosed("the robot closed the connection")
        return found

    async def send(self, data: Payload) -> None:
        """Send a payload to the robot; raise `PeerClosed` without a connection."""
        self._check()
        self._sent.put_nowait(data)
        await asyncio.sleep(0)

    def offer(self, data: bytes) -> bool:
        """Send bytes without waiting, unless too many payloads wait."""
        if self._task is None or self._task.done() or self._sent.qsize() >= MOST_WAITING:
            return False
        self._sent.put_nowait(data)
        return True

    def unsent(self) -> int:
        """Return the number of payloads that the robot has not taken."""
        return self._sent.qsize()

    async def close(self) -> None:
        """Disconnect at once; the method may be called twice."""
        task, self._task = self._task, None
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    def _check(self) -> None:
        if self._task is None or self._task.done():
            raise PeerClosed("the connection is closed")

    async def _serve(
        self,
        client: ClientConnection,
        sent: asyncio.Queue[Payload | None],
        arrived: asyncio.Queue[Payload | None],
    ) -> None:
        """Play the robot's server for one connection."""
        asked: list[tuple[Envelope, int]] = []

        async def take() -> Payload | None:
            while asked:
                envelope, faults = asked.pop()
                if client.line.faults > faults:
                    _put(arrived, _refusal(envelope))
            data = await sent.get()
            if isinstance(data, Envelope):
                data = _as_json(data)
                if data.verb in _ANSWERED:
                    asked.append((data, client.line.faults))
            return data

        async def put(said: Sequence[Payload]) -> None:
            for payload in said:
                if self._is_wanted(payload):
                    _put(arrived, _received(payload))

        try:
            await converse(self._context(client.line), client, take, put)
        finally:
            arrived.put_nowait(None)

    def _context(self, line: EmulatedConnection) -> ServerContext:
        return ServerContext(
            name=self._name,
            spec=self._spec,
            options={},
            host="",
            line=lambda: line,
            now=time.time,
        )

    def _is_wanted(self, payload: Payload) -> bool:
        """Return whether a message has subscribers, at the rate that the driver asked for."""
        if not isinstance(payload, Envelope) or payload.verb != "message" or not self._intervals:
            return True
        topic, now_s = str(payload.attributes.get("topic")), time.monotonic()
        interval_s = self._intervals.get(topic)
        if interval_s is None:
            return False
        if now_s < self._shown_s.get(topic, float("-inf")) + interval_s * (1 - _EARLY):
            return False
        self._shown_s[topic] = now_s
        return True


def _seconds(value: object) -> float:
    return float(value) if isinstance(value, int | float) else 0.0


def _put(queue: asyncio.Queue[Payload | None], payload: Payload) -> None:
    if queue.qsize() >= MOST_WAITING:
        queue.get_nowait()
    queue.put_nowait(payload)


def _as_json(envelope: Envelope) -> Envelope:
    """Return the envelope with a body as it arrives after JSON; bytes are JSON already."""
    body = envelope.body
    if isinstance(body, bytes):
        body = msgspec.json.decode(body) if body.strip() else {}
    else:
        body = msgspec.json.decode(msgspec.json.encode(body))
    return envelope._replace(body=body)


def _received(payload: Payload) -> Payload:
    """Return a payload of the robot as the transport delivers it."""
    if not isinstance(payload, Envelope):
        return payload
    payload = _as_json(payload)
    if payload.verb != "response":
        return payload
    attributes = {"ok": True, **payload.attributes}
    if attributes["ok"] is False:
        attributes.setdefault("reason", "the service refused")
    return payload._replace(attributes=attributes)


def _refusal(asked: Envelope) -> Envelope:
    """Return the reply to a request that the emulated robot does not know."""
    attributes = {"id": asked.attributes.get("id"), "ok": False, "reason": "no such action"}
    return Envelope("response", attributes)


def transports_to(robot: EmulatedRobot, driver: Driver) -> Table:
    """Return a table in which every transport of `driver` connects to `robot`."""
    return _DirectTable(robot, driver)


class _DirectTable(Table):
    def __init__(self, robot: EmulatedRobot, driver: Driver) -> None:
        types = {spec.type for spec in driver.transports.values()}
        super().__init__(
            "urc.transports", dict.fromkeys(types, "playground.direct:DirectTransport")
        )
        self._robot, self._driver = robot, driver

    def get(self, name: str) -> RegistryEntry | None:
        """Return the row of a type; None if the driver has no such transport."""
        known = super().get(name)
        return None if known is None else _DirectEntry(name, known.factory, self)

    def made(self, setup: TransportSetup) -> DirectTransport:
        """Return the transport of a setup."""
        return DirectTransport(self._robot, self._driver.transports[setup.name], setup)


class _DirectEntry(RegistryEntry):
    __slots__ = ("_table",)

    def __init__(self, name: str, factory: str, table: _DirectTable) -> None:
        super().__init__(name, factory)
        self._table = table

    def load(self) -> object:
        """Return the function that creates a transport for a setup."""
        return self._table.made
