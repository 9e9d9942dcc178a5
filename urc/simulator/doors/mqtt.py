"""The emulated robot as a client of a real MQTT broker.

There is no broker in here: as with the real robot, one has to run where the settings say. Every
message on it is taken for the robot's, except those on topics that the driver listens to: they are
what the robot itself says.
"""

import asyncio
import logging
from collections.abc import Sequence
from contextlib import suppress

from urc.model.codec import Envelope, Payload
from urc.problems import UrcError
from urc.protocol.topics import matches
from urc.simulator.doors.base import Crowd, Guest, Listening, Place, converse
from urc.transports.base import Setup, Subscription, Transport, TransportError
from urc.transports.mqtt import from_setup

__all__ = ["MqttDoor"]

OPEN_S = 5.0
AGAIN_S = 1.0
"""Before the next attempt, after the broker has gone."""
_NOT_OURS = ("client_id", "will")
"""Options that are the driver's own: two clients of one name would throw each other out."""

log = logging.getLogger(__name__)


class MqttDoor:
    """One client of the broker."""

    def __init__(self, place: Place) -> None:
        """Prepare the client; `open` connects."""
        self._place = place
        self._crowd = Crowd(place)
        self._own = [matches(topic) for topic in place.topics]
        self._transport: Transport | None = None

    async def open(self) -> Listening:
        """Connect to the broker that the options name."""
        place = self._place
        options = {name: value for name, value in place.options.items() if name not in _NOT_OURS}
        try:
            transport = from_setup(Setup(place.name, options, (Subscription("#"),)))
            await transport.open(OPEN_S)
        except TransportError as fault:
            hint = "an emulated MQTT robot needs a broker; start one, such as mosquitto -p 1883"
            raise UrcError(f"transports.{place.name}: {fault}; {hint}") from fault
        self._transport = transport
        self._crowd.welcome(lambda guest: self._stay(guest, transport), lambda: None)
        host, port = str(options["host"]), options.get("port", 0)
        where = transport.address.removeprefix("mqtt ")
        port = port if isinstance(port, int) else 0
        return Listening(host, port, f"mqtt through the broker {where}")

    async def close(self) -> None:
        """Leave the broker."""
        await self._crowd.close()
        if self._transport is not None:
            await self._transport.close()

    async def _stay(self, guest: Guest, transport: Transport) -> None:
        """Talk through the broker, and come back to it when it was gone."""
        while True:
            await self._talk(guest, transport)
            log.info("%s: the broker has gone", self._place.name)
            while True:
                await asyncio.sleep(AGAIN_S)
                with suppress(TransportError):
                    await transport.open(OPEN_S)
                    break

    async def _talk(self, guest: Guest, transport: Transport) -> None:
        async def take() -> Payload | None:
            with suppress(TransportError):
                while True:
                    heard = await transport.receive()
                    if isinstance(heard, Envelope) and not self._is_own(heard):
                        topic = heard.attributes["topic"]
                        return Envelope("publish", {"topic": topic}, heard.body)
            return None

        async def put(said: Sequence[Payload]) -> None:
            with suppress(TransportError):  # the broker has gone: `take` sees it, too
                for payload in said:
                    if isinstance(payload, Envelope) and payload.verb == "message":
                        topic = payload.attributes.get("topic")
                        await transport.send(Envelope("publish", {"topic": topic}, payload.body))

        await converse(self._place, guest, take, put)

    def _is_own(self, heard: Envelope) -> bool:
        topic = str(heard.attributes["topic"])
        return any(fits(topic) for fits in self._own)
