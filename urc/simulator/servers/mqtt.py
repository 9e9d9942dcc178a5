"""The emulated robot as a client of a real MQTT broker.

A broker must run at the configured address, as for the real robot. The emulated robot publishes the
topics to which the driver subscribes, and receives the messages of all other topics.
"""

import asyncio
import logging
from collections.abc import Sequence
from contextlib import suppress

from urc.model.payload import Envelope, Payload
from urc.problems import UrcError
from urc.protocol.forms.topics import matches
from urc.simulator.servers.base import Endpoint, ServerContext
from urc.simulator.servers.clients import ClientConnection, Clients, converse
from urc.transports.base import TopicSubscription, Transport, TransportError, TransportSetup
from urc.transports.mqtt import from_setup

__all__ = ["MqttRobot"]

OPEN_S = 5.0
AGAIN_S = 1.0
"""Delay before reconnecting to the broker, in seconds."""
_NOT_OURS = ("client_id", "will")
"""Options that apply only to the driver's connection to the broker. The emulated robot and the
driver would disconnect each other if they shared a client identifier."""

log = logging.getLogger(__name__)


class MqttRobot:
    """The emulated robot's connection to the broker."""

    def __init__(self, context: ServerContext) -> None:
        self._context = context
        self._clients = Clients(context)
        self._own = [matches(topic) for topic in context.topics]
        self._transport: Transport | None = None

    async def open(self) -> Endpoint:
        """Connect to the broker declared in the options."""
        context = self._context
        options = {name: value for name, value in context.options.items() if name not in _NOT_OURS}
        try:
            transport = from_setup(TransportSetup(context.name, options, (TopicSubscription("#"),)))
            await transport.open(OPEN_S)
        except TransportError as fault:
            hint = (
                "an emulated MQTT robot needs a broker; start one, for example with"
                " 'mosquitto -p 1883'"
            )
            raise UrcError(f"transports.{context.name}: {fault}; {hint}") from fault
        self._transport = transport
        self._clients.admit(lambda client: self._stay(client, transport), lambda: None)
        host, port = str(options["host"]), options.get("port", 0)
        where = transport.address.removeprefix("mqtt ")
        port = port if isinstance(port, int) else 0
        return Endpoint(host, port, f"mqtt through the broker {where}")

    async def close(self) -> None:
        """Disconnect from the broker."""
        await self._clients.close()
        if self._transport is not None:
            await self._transport.close()

    async def _stay(self, client: ClientConnection, transport: Transport) -> None:
        """Exchange messages through the broker and reconnect after each loss."""
        while True:
            await self._talk(client, transport)
            log.info("%s: lost the connection to the broker", self._context.name)
            while True:
                await asyncio.sleep(AGAIN_S)
                with suppress(TransportError):
                    await transport.open(OPEN_S)
                    break

    async def _talk(self, client: ClientConnection, transport: Transport) -> None:
        async def take() -> Payload | None:
            with suppress(TransportError):
                while True:
                    heard = await transport.receive()
                    if isinstance(heard, Envelope) and not self._is_own(heard):
                        topic = heard.attributes["topic"]
                        return Envelope("publish", {"topic": topic}, heard.body)
            return None

        async def put(said: Sequence[Payload]) -> None:
            with suppress(TransportError):  # the broker is gone: `take` notices this, too
                for payload in said:
                    if isinstance(payload, Envelope) and payload.verb == "message":
                        topic = payload.attributes.get("topic")
                        await transport.send(Envelope("publish", {"topic": topic}, payload.body))

        await converse(self._context, client, take, put)

    def _is_own(self, heard: Envelope) -> bool:
        topic = str(heard.attributes["topic"])
        return any(fits(topic) for fits in self._own)
