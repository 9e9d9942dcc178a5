"""Checksums against the values that their catalogue and their own documents give."""

from collections.abc import Callable

import anycrc
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from tests.unit.protocol.framing_samples import NMEA, framing, spec
from urc._checksum_math import NAMED, build_algorithm
from urc.config.node import Node, Problems
from urc.config.parse.checksum import parse_checksum
from urc.expressions import compile_template
from urc.model.driver import Argument, Command, Driver, TransportSpec
from urc.model.framing import FOLDED, PLAIN_CHECKSUMS, CrcSpec, FoldSpec
from urc.model.payload import WriteSpec
from urc.problems import to_text
from urc.protocol.engine import Engine
from urc.protocol.events import Request, Send
from urc.source import parse_document

TEMPLATE = compile_template("$GO,{{ v }}*")

CHECK = b"123456789"
"""The catalogue's own input."""


def algorithm(text: str) -> CrcSpec | FoldSpec | str:
    """Return the algorithm that a document declares with `text`; it must have no finding."""
    document = parse_document(f"checksum: {{ algorithm: {text} }}\n", "sample.yaml")
    problems = Problems()
    assert isinstance(document.data, dict)
    part = Node(document, ("checksum",), document.data["checksum"])
    written = parse_checksum(part, "latin-1", problems)
    assert [to_text(one) for one in problems] == []
    assert written is not None
    return written.algorithm


def compute(text: str) -> Callable[[bytes], int]:
    return build_algorithm(algorithm(text))


@pytest.mark.parametrize("name", sorted(anycrc.models))
def test_every_crc_of_the_catalogue_gives_its_check_value(name: str) -> None:
    """By its name, and by its parameters as a document writes them."""
    model = anycrc.models[name]
    assert compute(name.lower())(CHECK) == model.check
    flags = f"refin: {str(model.refin).lower()}, refout: {str(model.refout).lower()}"
    if model.width > 60:
        return  # YAML numbers of that size are written in hex below
    text = (
        f"{{ width: {model.width}, poly: {model.poly:#x}, init: {model.init:#x}, {flags},"
        f" xorout: {model.xorout:#x} }}"
    )
    assert compute(text)(CHECK) == model.check


@pytest.mark.parametrize("name", sorted(anycrc.aliases))
def test_other_names_of_the_catalogue_are_known_too(name: str) -> None:
    """A protocol sheet may use any of them."""
    assert compute(name.lower())(CHECK) == anycrc.models[anycrc.aliases[name]].check


KNOWN = [
    ("sum8", CHECK, 0xDD),
    ("sum16", CHECK, 0x01DD),
    ("sum32", b"\xff" * 300, 0xFF * 300),
    ("xor8", CHECK, 0x31),
    ("lrc", CHECK, 0x23),
    ("fletcher8", b"\x01\x02", 0x43),
    ("fletcher16", b"abcde", 0xC8F0),
    ("fletcher16", b"abcdefgh", 0x0627),
    ("fletcher16-mod256", bytes.fromhex("06 01 02 00 F0 05"), 0x16FE),
    ("fletcher32", b"abcde", 0xF04FC729),
    ("fletcher32", b"abcdefgh", 0xEBE19591),
    ("adler32", b"Wikipedia", 0x11E60398),
    ("internet", bytes.fromhex("4500 0073 0000 4000 4011 0000 c0a8 0001 c0a8 00c7"), 0xB861),
    ("{ fold: sum, complement: twos }", bytes.fromhex("13 05 1D 02 19 0D 00"), 0xA3),
    ("{ fold: sum, complement: ones }", bytes.fromhex("01 02 01"), 0xFB),
    ("{ fold: xor, mask: 0x7F }", b"\xf0\x01", 0x71),
    ("{ fold: sum, mask: 0x3F, or: 0x40 }", b"\xff\x02", 0x41),
    ("{ fold: sum, bits: 16 }", b"\xff" * 300, 0xFF * 300 % 65536),
    ("{ fold: xor, bits: 16, of: 16 }", b"\x01\x02\x03\x04\x05", 0x0102 ^ 0x0304 ^ 0x0500),
    ("{ fold: sum, bits: 32, of: 32 }", b"\0\0\0\x01\0\0\0\x02", 3),
]


@pytest.mark.parametrize(("text", "data", "value"), KNOWN)
def test_sum_has_the_value_of_its_document(text: str, data: bytes, value: int) -> None:
    """Wikipedia's and RFC 1071's examples, and those of the robots' manuals."""
    assert compute(text)(data) == value


def test_names_that_the_loader_knows_are_those_that_there_is_code_for() -> None:
    """Two floors, one list."""
    assert NAMED.keys() == PLAIN_CHECKSUMS.keys()
    assert not NAMED.keys() & FOLDED.keys()


@pytest.mark.parametrize("spelling", ["raw", "hex", "HEX", "dec"])
@pytest.mark.parametrize("endian", ["big", "little"])
@pytest.mark.parametrize(
    "name", ["sum8", "crc16-modbus", "crc24-ble", "crc32", "crc7-mmc", "crc64-xz"]
)
@settings(max_examples=examples(20), deadline=None)
@given(payload=st.binary(max_size=40))
def test_every_spelling_and_order_is_read_as_written(
    name: str, endian: str, spelling: str, payload: bytes
) -> None:
    """decode(encode(x)) = x, and one byte less is no frame."""
    made = framing(
        f"{{ type: datagram, checksum: {{ algorithm: {name}, endian: {endian}, as: {spelling} }} }}"
    )
    frame = made.encode(payload)
    assert made.decoder().feed(frame) == [payload]
    assert frame.startswith(payload)


@settings(deadline=None)
@given(st.binary(max_size=40))
def test_checksum_in_its_own_window_counts_as_zeros(payload: bytes) -> None:
    """As in the headers of IP and ICMP."""
    made = framing(
        "{ type: length, length: { offset: 0, size: 1, adjust: 3 },"
        " checksum: { algorithm: internet, at: 1, over: { from: 0 } } }"
    )
    frame = made.encode(payload)
    assert build_algorithm("internet")(frame[:1] + b"\0\0" + frame[3:]) == int.from_bytes(
        frame[1:3]
    )
    assert made.decoder().feed(frame) == [payload]


def test_command_with_a_number_carries_its_checksum() -> None:
    """No short cut from arguments to bytes may leave the checksum out."""
    driver = Driver(
        transports={"wire": TransportSpec("wire", "tcp", framing=spec(NMEA))},
        commands={
            "go": Command(
                "go",
                "wire",
                WriteSpec("text", {"template": TEMPLATE}, TEMPLATE.names),
                {"v": Argument("v", "integer")},
            )
        },
    )
    engine = Engine(driver, {})
    engine.tick(0.0)
    engine.start("wire", 0.0)
    sent = [
        event.data
        for event in engine.command(Request(1, "go", {"v": 5}), 0.0)
        if type(event) is Send
    ]
    assert sent == [framing(NMEA).encode(b"$GO,5*")]
    assert sent[0].endswith(b"*%02X\r\n" % build_algorithm(FOLDED["xor8"])(b"GO,5"))
