"""The table of framings, which convert byte streams to frames and frames to bytes.

Pure. This module also builds framings from their declarations. Each
family of framings is imported on first use. `urc.protocol.framing.base` defines the interfaces of
framings.
"""

from typing import NamedTuple

from urc.model.driver import FramingSpec
from urc.model.framing import EscapeSpec
from urc.protocol.framing.base import Decoder, Framing
from urc.protocol.framing.receive_buffer import ReceiveBuffer
from urc.registry import Table

__all__ = ["FRAMINGS", "build_framing"]


class AsymmetricFraming(NamedTuple):
    """A pair of framings: one for sent data and one for received data."""

    sent: Framing
    received: Framing

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        return self.sent.encode(payload)

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        return self.received.decoder(stream)

    def reversed(self) -> "AsymmetricFraming":
        """Return the framing for the other end of the connection."""
        return AsymmetricFraming(self.received.reversed(), self.sent.reversed())


def build_framing(spec: FramingSpec) -> Framing:
    """Return the framing declared by `spec`."""
    framing = _of_type(spec)
    if spec.timeout_s is not None or spec.strips_ansi:
        from urc.protocol.framing.timeout import TimeoutFraming

        framing = TimeoutFraming(framing, spec.timeout_s, spec.strips_ansi)
    if spec.sent is None:
        return framing

    return AsymmetricFraming(build_framing(spec.sent), framing)


def _of_type(spec: FramingSpec) -> Framing:
    """Return the framing from the table, or an `EscapedFraming` if the whole content is stuffed."""
    if isinstance(spec.options.get("escape"), EscapeSpec):
        from urc.protocol.framing.escaped import EscapedFraming

        return EscapedFraming.from_spec(spec)
    framing: Framing = FRAMINGS[spec.type].load()(spec)
    return framing


FRAMINGS = Table(
    "urc.framings",
    {
        "delimiter": "urc.protocol.framing.delimited:DelimiterFraming.from_spec",
        "fixed": "urc.protocol.framing.length:LengthFraming.from_spec",
        "length": "urc.protocol.framing.length:LengthFraming.from_spec",
        "slip": "urc.protocol.framing.stuffed:SlipFraming.from_spec",
        "cobs": "urc.protocol.framing.stuffed:CobsFraming.from_spec",
        "idle": "urc.protocol.framing.idle:IdleFraming.from_spec",
        "datagram": "urc.protocol.framing.idle:DatagramFraming.from_spec",
        "regex": "urc.protocol.framing.searched:RegexFraming.from_spec",
        "brackets": "urc.protocol.framing.searched:BracketsFraming.from_spec",
        "json": "urc.protocol.framing.json_values:JsonFraming.from_spec",
        "xml": "urc.protocol.framing.xml_elements:XmlFraming.from_spec",
        "switch": "urc.protocol.framing.switched:SwitchFraming.from_spec",
    },
)
