"""Frames of public documents, for each framing: declared as in a document, byte for byte."""

from functools import cache
from typing import Any

from tests.unit.protocol.framing_samples_sized import SIZED, Sample, wire
from tests.unit.protocol.framing_samples_text import TEXT
from urc.config.node import Node, Problems
from urc.config.parse.framing import parse_framing
from urc.model.driver import FramingSpec
from urc.problems import to_text
from urc.protocol.framing.base import Framing
from urc.protocol.framing.table import FRAMINGS, build_framing
from urc.registry import Registries, Table
from urc.source import parse_document

__all__ = ["SAMPLES", "Sample", "framing", "spec", "wire"]

CATALOG = Registries(transports=Table("none", {}), framings=FRAMINGS)


@cache
def spec(text: str, encoding: str = "latin-1") -> FramingSpec:
    """Return the framing that a document declares with `text`; it must have no finding."""
    document = parse_document(f"framing: {text}\n", "sample.yaml")
    problems = Problems()
    data: Any = document.data
    part = Node(document, ("framing",), data["framing"])
    parsed = parse_framing(part, encoding, problems, CATALOG)
    assert [to_text(one) for one in problems] == []
    return parsed


def framing(text: str) -> Framing:
    """Return the framing that a document declares with `text`."""
    return build_framing(spec(text))


MAVLINK = (
    "{ type: length, start: 0xFD, length: { offset: 1, size: 1, adjust: 12 }, max: 280,"
    " checksum: { algorithm: crc16-mcrf4xx, over: { from: 1 }, endian: little,"
    ' salt: { offset: 7, size: 3, endian: little, table: { "0": 50, "69": 243, "76": 152 } } } }'
)
UBX = (
    "{ type: length, start: [0xB5, 0x62], max: 256,"
    " length: { offset: 4, size: 2, endian: little, adjust: 8 },"
    " checksum: { algorithm: fletcher16-mod256, over: { from: 2 }, endian: little } }"
)
NMEA = (
    "{ type: delimiter, tx: CRLF, rx: CRLF, max: 82,"
    " checksum: { algorithm: xor8, over: { from: 1, to: -3 }, at: -2, as: HEX } }"
)
GGA = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*"
RMC = b"$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*"
UBX_POLL = wire("B5 62 06 01 02 00 F0 05 FE 16")
HEARTBEAT = wire("fd 09 00 00 00 ff be 00 00 00 00 00 00 00 06 08 00 04 03 3d 48")
ARM = wire("fd 20 00 00 00 ff be 4c 00 00 00 00 80 3f" + "00" * 24 + "90 01 01 01 9e 4e")
CONTROL = wire("fd 0b 00 00 00 ff be 45 00 00 f4 01 00 00 f4 01 00 00 00 00 01 8a 24")

SAMPLES = [
    *SIZED,
    *TEXT,
    Sample(
        "delimiter",
        "{ type: delimiter, tx: CRLF, rx: CRLF }",
        b"a\r\n\r\nb\r\n",
        [b"a", b"", b"b"],
        "-",
    ),
    Sample("nmea", NMEA, GGA + b"47\r\n" + RMC + b"6A\r\n", [GGA, RMC], "gpsd's NMEA notes"),
    Sample(
        "modbus ascii",
        "{ type: brackets, open: ':', close: CRLF,"
        " checksum: { algorithm: lrc, as: HEX, from_hex: true } }",
        b":1103006B00037E\r\n:F7031389000A60\r\n",
        [b"1103006B0003", b"F7031389000A"],
        "Modbus over serial line: ASCII mode",
    ),
    Sample(
        "create 2 stream",
        "{ type: length, start: 0x13, length: { offset: 1, size: 1, adjust: 3 },"
        " checksum: { algorithm: lrc, over: frame } }",
        wire("13 05 1D 02 19 0D 00 A3 13 06 16 3A A4 19 08 98 3A"),
        [wire("1D 02 19 0D 00"), wire("16 3A A4 19 08 98")],
        "iRobot Create 2 Open Interface, opcode 148",
    ),
    Sample(
        "mavlink",
        MAVLINK,
        HEARTBEAT + ARM + CONTROL,
        [HEARTBEAT[2:-2], ARM[2:-2], CONTROL[2:-2]],
        "MAVLink 2 serialization, common.xml",
    ),
    Sample("ubx", UBX, UBX_POLL, [UBX_POLL[2:-2]], "u-blox protocol specification, CFG-MSG poll"),
    Sample(
        "ur realtime",
        "{ type: length, length: { offset: 0, size: 4 }, max: 4096 }",
        wire("00 00 00 0C") + bytes(8) + wire("00 00 00 06 01 02"),
        [bytes(8), b"\x01\x02"],
        "UR client interface, port 30003",
    ),
    Sample(
        "ur rtde",
        "{ type: length, length: { offset: 0, size: 2 } }",
        wire("00 05 56 00 02 00 04 56 01 00 03 53"),
        [wire("56 00 02"), wire("56 01"), wire("53")],
        "UR RTDE guide",
    ),
    Sample(
        "remregs replies",
        "{ type: switch, cases: [{ first: 0x06, framing: { type: fixed, size: 2 } },"
        " { first: 0x0F, framing: { type: fixed, size: 1 } }] }",
        wire("06 05 0F 06 49"),
        [wire("06 05"), wire("0F"), wire("06 49")],
        "remregs: ACK with a byte, or NAK alone",
    ),
    Sample(
        "remregs request",
        "{ type: fixed, size: 3 }",
        wire("13 C1 C9 10 00 01"),
        [wire("13 C1 C9"), wire("10 00 01")],
        "remregs: WRITE_8",
    ),
    Sample(
        "remregs read_mb",
        "{ type: length, start: ACK, length: { offset: 1, size: 1, adjust: 2 } }",
        wire("06 03 AA BB CC 06 00"),
        [wire("AA BB CC"), b""],
        "remregs: READ_MB",
    ),
    Sample(
        "vesc",
        "{ type: length, start: 0x02, end: 0x03, length: { offset: 1, size: 1, adjust: 5 },"
        " checksum: { algorithm: crc16-xmodem } }",
        wire("02 01 00 00 00 03"),
        [b"\x00"],
        "VESC: COMM_FW_VERSION",
    ),
    Sample(
        "dynamixel 1 ping",
        "{ type: length, start: [0xFF, 0xFF], length: { offset: 3, size: 1, adjust: 4 },"
        " checksum: { algorithm: { fold: sum, complement: ones }, over: { from: 2 } } }",
        wire("FF FF 01 02 01 FB"),
        [wire("01 02 01")],
        "Dynamixel protocol 1.0, ping",
    ),
    Sample(
        "dynamixel 2 ping",
        "{ type: length, start: [0xFF, 0xFF, 0xFD, 0x00],"
        " length: { offset: 5, size: 2, endian: little, adjust: 7 },"
        " checksum: { algorithm: crc16-umts, over: frame, endian: little } }",
        wire("FF FF FD 00 01 03 00 01 19 4E"),
        [wire("01 03 00 01")],
        "Dynamixel protocol 2.0, ping",
    ),
    Sample(
        "modbus rtu",
        "{ type: datagram, checksum: { algorithm: crc16-modbus, over: frame, endian: little } }",
        wire("11 03 00 6B 00 03 76 87"),
        [wire("11 03 00 6B 00 03")],
        "Modbus: read holding registers",
    ),
    Sample(
        "slip",
        "{ type: slip }",
        wire("01 DB DC 02 C0 DB DD 03 C0"),
        [wire("01 C0 02"), wire("DB 03")],
        "RFC 1055",
    ),
    Sample(
        "cobs",
        "{ type: cobs }",
        wire("01 01 00  01 01 01 00  03 11 22 02 33 00  05 11 22 33 44 00  02 11 01 01 01 00"),
        [wire("00"), wire("00 00"), wire("11 22 00 33"), wire("11 22 33 44"), wire("11 00 00 00")],
        "Consistent Overhead Byte Stuffing",
    ),
    Sample(
        "cobs, full blocks",
        "{ type: cobs }",
        b"\xff"
        + bytes(range(1, 255))
        + b"\0"
        + b"\x01\xff"
        + bytes(range(1, 255))
        + b"\0"
        + b"\xff"
        + bytes(range(1, 255))
        + b"\x02\xff\0"
        + b"\xff"
        + bytes(range(2, 256))
        + b"\x01\x01\0"
        + b"\xfe"
        + bytes(range(3, 256))
        + b"\x02\x01\0",
        [
            bytes(range(1, 255)),
            bytes(range(255)),
            bytes(range(1, 256)),
            bytes(range(2, 256)) + b"\0",
            bytes(range(3, 256)) + b"\0\x01",
        ],
        "Consistent Overhead Byte Stuffing",
    ),
    Sample(
        "regex",
        r"{ type: regex, pattern: '\$[^\r\n]{1,80}\r\n' }",
        b"$A,1\r\n$B\r\n",
        [b"$A,1\r\n", b"$B\r\n"],
        "-",
    ),
    Sample(
        "brackets",
        '{ type: brackets, open: "<", close: ">" }',
        b"<a><><bc>",
        [b"a", b"", b"bc"],
        "-",
    ),
    Sample(
        "equal marks", '{ type: brackets, open: "~", close: "~" }', b"~a~~bc~", [b"a", b"bc"], "-"
    ),
    Sample(
        "json",
        "{ type: json }",
        rb'{"a":"}\"]\\"}[1,[{}]]{}',
        [rb'{"a":"}\"]\\"}', b"[1,[{}]]", b"{}"],
        "RFC 8259",
    ),
    Sample(
        "nmea and ubx",
        f'{{ type: switch, cases: [{{ first: "$", framing: {NMEA} }},'
        f' {{ first: "0xB562", framing: {UBX} }}] }}',
        GGA + b"47\r\n" + UBX_POLL + RMC + b"6A\r\n",
        [GGA, UBX_POLL[2:-2], RMC],
        "u-blox receivers",
    ),
    Sample(
        "hex length",
        "{ type: length, length: { offset: 0, size: 4, as: hex, adjust: 4 } }",
        b"000chost:version0004OKAY",
        [b"host:version", b"OKAY"],
        "Android debug bridge",
    ),
    Sample(
        "flags beside the length",
        "{ type: length, length: { offset: 0, size: 2, bits: 10, adjust: 2 },"
        " payload: { from: 0 } }",
        wire("FC 02 AA BB"),
        [wire("FC 02 AA BB")],
        "-",
    ),
    Sample(
        "words",
        "{ type: length, start: 0xAB, length: { offset: 1, size: 1, unit: 4, adjust: 2 } }",
        wire("AB 01 01 02 03 04"),
        [wire("01 02 03 04")],
        "-",
    ),
    Sample(
        "checksum before the payload",
        "{ type: length, start: 0xAA, length: { offset: 1, size: 1, adjust: 3 },"
        " checksum: { algorithm: sum8, at: 2, over: payload } }",
        wire("AA 02 03 01 02"),
        [wire("01 02")],
        "-",
    ),
    Sample(
        "decimal checksum",
        "{ type: fixed, size: 6, start: STX, end: ETX, checksum: { algorithm: xor8, as: dec } }",
        b"\x02A065\x03",
        [b"A"],
        "-",
    ),
    Sample(
        "xbee, escaped",
        "{ type: length, start: 0x7E, length: { offset: 1, size: 2, adjust: 4 },"
        " checksum: { algorithm: { fold: sum, complement: ones } },"
        " escape: { byte: 0x7D, xor: 0x20, bytes: [0x11, 0x13] } }",
        wire("7E 00 02 23 7D 31 CB 7E 00 02 23 7D 31 CB"),
        [wire("23 11"), wire("23 11")],
        "Digi XBee, API operating mode 2",
    ),
    Sample(
        "ppp",
        "{ type: brackets, open: 0x7E, close: 0x7E, escape: { byte: 0x7D, xor: 0x20 },"
        " checksum: { algorithm: crc16-ibm-sdlc, endian: little } }",
        wire("7E 313233343536373839 6E90 7E 7E 7D5D 7D5E 02 D5 7E"),
        [b"123456789", wire("7D 7E")],
        "RFC 1662",
    ),
    Sample(
        "slip, written out",
        "{ type: delimiter, tx: 0xC0, rx: 0xC0,"
        ' escape: { byte: 0xDB, table: { "0xC0": 0xDC, "0xDB": 0xDD } } }',
        wire("01 DB DC 02 C0 DB DD 03 C0"),
        [wire("01 C0 02"), wire("DB 03")],
        "RFC 1055",
    ),
    Sample(
        "garmin",
        "{ type: brackets, open: DLE, close: [DLE, ETX], escape: { byte: DLE, double: true },"
        " checksum: { algorithm: lrc } }",
        wire("10 FE 00 02 10 03  10 06 02 10 10 00 E8 10 03  10 06 02 FE 00 FA 10 03"),
        [wire("FE 00"), wire("06 02 10 00"), wire("06 02 FE 00")],
        "Garmin device interface: product request, acknowledgements",
    ),
    Sample(
        "tsip",
        "{ type: brackets, open: DLE, close: [DLE, ETX], escape: { byte: DLE, double: true } }",
        wire("10 1F 10 03 10 8E 10 10 03 10 03"),
        [wire("1F"), wire("8E 10 03")],
        "Trimble standard interface protocol",
    ),
    Sample(
        "dle etx alone",
        "{ type: delimiter, tx: [DLE, ETX], rx: [DLE, ETX], escape: { byte: DLE, double: true } }",
        wire("41 10 10 03 10 03 42 10 03"),
        [wire("41 10 03"), b"B"],
        "-",
    ),
    Sample(
        "dynamixel 2, stuffed",
        "{ type: length, start: [0xFF, 0xFF, 0xFD, 0x00],"
        " length: { offset: 5, size: 2, endian: little, adjust: 7 },"
        " escape: { after: [0xFF, 0xFF, 0xFD], insert: 0xFD, of: payload },"
        " checksum: { algorithm: crc16-umts, over: frame, endian: little } }",
        wire("FF FF FD 00 01 0C 00 03 74 00 FF FF FD FD 00 00 00 C8 D3")
        + wire("FF FF FD 00 01 03 00 01 19 4E"),
        [wire("01 0C 00 03 74 00 FF FF FD 00 00 00"), wire("01 03 00 01")],
        "Dynamixel protocol 2.0, byte stuffing",
    ),
    Sample(
        "min",
        "{ type: length, start: [0xAA, 0xAA, 0xAA], end: 0x55,"
        " length: { offset: 4, size: 1, adjust: 10 }, payload: { from: 3, to: -5 },"
        " escape: { after: [0xAA, 0xAA], insert: 0x55 },"
        " checksum: { algorithm: crc32, over: payload } }",
        wire("AA AA AA 01 02 AA AA 55 F8 97 72 82 55"),
        [wire("01 02 AA AA")],
        "MIN: microcontroller interconnect network 2.0",
    ),
    Sample(
        "two checksums",
        "{ type: length, start: 0xA5, length: { offset: 1, size: 2, endian: little, adjust: 9 },"
        " payload: { from: 3, to: -2 }, checksum: ["
        "{ algorithm: { width: 8, poly: 0x31, init: 0xFF, refin: true, refout: true },"
        " over: { from: 0, to: 4 }, at: 4 },"
        " { algorithm: crc16-mcrf4xx, over: frame, endian: little }] }",
        wire("A5 02 00 07 0F 01 02 AA BB 78 82"),
        [wire("07 0F 01 02 AA BB")],
        "RoboMaster referee system: header with CRC-8, frame with CRC-16",
    ),
    Sample(
        "two checksums at the end",
        "{ type: length, start: 0x02, length: { offset: 1, size: 1, adjust: 5 }, end: 0x03,"
        " checksum: [{ algorithm: xor8 }, { algorithm: sum8, over: { from: 1 } }] }",
        wire("02 02 41 42 03 88 03"),
        [b"AB"],
        "-",
    ),
    Sample(
        "unknown kinds of frames",
        MAVLINK.replace("endian: little, table", "endian: little, else: skip, table"),
        HEARTBEAT + ARM,
        [HEARTBEAT[2:-2], ARM[2:-2]],
        "MAVLink 2",
    ),
    Sample(
        "lines, and stuffed frames between them",
        '{ type: switch, cases: [{ first: "$", framing: { type: delimiter, tx: LF, rx: LF } }],'
        " else: { type: slip, max: 100 } }",
        b"$A,1\n" + wire("01 02 C0") + b"$B\n$C\n" + wire("24 25 C0")[1:] + wire("DB DC C0"),
        [b"$A,1", wire("01 02"), b"$B", b"$C", b"%", wire("C0")],
        "-",
    ),
]
