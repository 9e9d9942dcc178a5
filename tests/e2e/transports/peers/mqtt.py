"""A broker with a robot behind it, run by the test: as much of MQTT 3.1.1 as the dialogues need."""

import asyncio

from tests.e2e.transports.peers.base import Behaviour, Traits
from tests.e2e.transports.peers.tcp import StreamRobot, TcpPeer
from urc.model.payload import Envelope
from urc.transports.base import TopicSubscription, Transport, TransportSetup
from urc.transports.mqtt import from_setup

__all__ = ["MqttPeer"]

CONNECT, PUBLISH, SUBSCRIBE, PINGREQ = 1, 3, 8, 12
CONNACK, PINGRESP = b"\x20\x02\x00\x00", b"\xd0\x00"


def packet(kind: int, body: bytes) -> bytes:
    """Return a packet of MQTT with less than 128 bytes."""
    return bytes([kind << 4, len(body)]) + body


class Broker(StreamRobot):
    """Answers what is published to ``ask`` with a message on ``answer``."""

    async def _behave(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while not reader.at_eof():
            try:
                kind, body = await self._packet(reader)
            except asyncio.IncompleteReadError:
                return
            if kind == CONNECT:
                writer.write(CONNACK)
            elif kind == SUBSCRIBE:
                writer.write(packet(9, body[:2] + b"\x00"))
                if self._behaviour == "deaf":
                    writer.transport.pause_reading()  # type: ignore[attr-defined]
                    await writer.drain()
                    await asyncio.Event().wait()
            elif kind == PINGREQ:
                writer.write(PINGRESP)
            elif kind == PUBLISH and self._behaviour == "closes":
                return
            elif kind == PUBLISH and self._behaviour != "silent":
                await self._say(writer)
            await writer.drain()

    async def _say(self, writer: asyncio.StreamWriter) -> None:
        message = packet(PUBLISH, b"\x00\x06answer" + self._answer)
        while self._behaviour == "floods":
            writer.write(message * 1000)
            await writer.drain()
        if self._behaviour == "drips":
            for byte in message:
                writer.write(bytes([byte]))
                await asyncio.sleep(0.01)
        else:
            writer.write(message)

    async def _packet(self, reader: asyncio.StreamReader) -> tuple[int, bytes]:
        first, length = await reader.readexactly(2)
        shift = 7
        length, more = length & 127, length & 128
        while more:
            (digit,) = await reader.readexactly(1)
            length, more, shift = length | (digit & 127) << shift, digit & 128, shift + 7
        return first >> 4, await reader.readexactly(length)


class MqttPeer(TcpPeer):
    """Listens on a free port of loopback."""

    traits = Traits(is_stream=False)
    ask = Envelope("publish", {"topic": "ask"}, b"how much?")
    answer = Envelope("message", {"topic": "answer", "retain": False, "qos": 0}, b"42 %")

    async def start(self, behaviour: Behaviour) -> Transport:
        """Listen; a broker that refuses or is mute needs no MQTT."""
        if behaviour in ("refuses", "mute"):
            return await super().start(behaviour)
        self._listener.bind(("127.0.0.1", 0))
        self._begin(self._listener.getsockname()[1])
        self._robot = Broker(behaviour, b"42 %")
        self._server = await asyncio.start_server(self._robot.meet, sock=self._listener)
        return self.transport()

    def transport(self) -> Transport:
        """Return a line that leads here."""
        options = {"host": "127.0.0.1", "port": self.port, "version": "3.1.1"}
        return from_setup(TransportSetup("wire", options, (TopicSubscription("answer"),)))
