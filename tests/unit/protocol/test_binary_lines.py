"""Lines of binary frames: bare bytes one way, frames the other, and no word of text."""

import pytest

from tests.unit.protocol.framing_samples import spec
from urc.model.driver import Driver, Message, TransportSpec
from urc.protocol.engine import Engine
from urc.protocol.events import Violation
from urc.protocol.framing.table import build_framing
from urc.testing.profile import regex
from urc.testing.struct import struct_read

FRAMED = "{ type: length, start: 0x13, length: { offset: 1, size: 1, adjust: 2 } }"


def test_what_is_sent_may_be_framed_otherwise_than_what_comes() -> None:
    """Bare bytes go out, frames come in; the other end of the line sees it the other way round."""
    made = build_framing(spec(FRAMED)._replace(sent=spec("{ type: delimiter, tx: CR, rx: CR }")))
    assert made.encode(b"ask") == b"ask\r"
    assert made.decoder().feed(b"\x13\x02ok") == [b"ok"]
    there = made.reversed()
    assert there.decoder().feed(made.encode(b"ask")) == [b"ask"]
    assert made.decoder().feed(there.encode(b"ok")) == [b"ok"]


@pytest.mark.parametrize(
    ("read", "fault"),
    [
        (struct_read("struct: [u8 4]"), ("no-match", "no declaration matches ff 01")),
        (regex("^hello$"), ("bad-text", r"hex ff is not utf-8 text")),
    ],
    ids=["struct", "regex"],
)
def test_bytes_are_no_faulty_text_where_nobody_wants_text(
    read: object, fault: tuple[str, str]
) -> None:
    """On a line of binary frames, that one is no text is no news."""
    line = TransportSpec("wire", "tcp", framing=spec(FRAMED))
    message = Message("hello", "wire", read)  # type: ignore[arg-type]
    engine = Engine(Driver(transports={"wire": line}, messages={"hello": message}), {})
    engine.start("wire", 0.0)
    assert engine.receive("wire", b"\x13\x02\xff\x01", 0.1) == [Violation("wire", *fault)]
