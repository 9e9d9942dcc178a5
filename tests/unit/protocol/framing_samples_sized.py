"""Frames that say their size in unusual ways, and checksums over more than is sent."""

from typing import NamedTuple


class Sample(NamedTuple):
    """One framing, bytes of it, and the payloads in them."""

    name: str
    text: str
    wire: bytes
    payloads: list[bytes]
    source: str


def wire(text: str) -> bytes:
    return bytes.fromhex(text)


SIZED = [
    Sample(
        "scpi block",
        "{ type: length, start: '#', max: 64,"
        " length: { offset: 1, size: 1, counted: true, as: dec, adjust: 1 }, end: LF }",
        b"#15he\nlo\n#211hello world\n#10\n",
        [b"he\nlo", b"hello world", b""],
        "SCPI 1999, volume 1, definite length block data",
    ),
    Sample(
        "netstring",
        "{ type: length, max: 64, length: { offset: 0, size: 3, until: ':', as: dec, adjust: 1 },"
        " end: ',' }",
        b"5:hello,0:,12:a, b: c, d, ,",
        [b"hello", b"", b"a, b: c, d, "],
        "D. J. Bernstein, Netstrings",
    ),
    Sample(
        "header and body",
        "{ type: length, start: 'Content-Length: ', max: 64,"
        " length: { offset: 16, size: 5, until: [CRLF, CRLF], as: dec } }",
        b'Content-Length: 2\r\n\r\n{}Content-Length: 10\r\n\r\n{"id": 1}\n',
        [b"{}", b'{"id": 1}\n'],
        "Language Server Protocol 3.17, base protocol",
    ),
    Sample(
        "thorlabs apt",
        "{ type: length, max: 64, payload: { from: 0 },"
        " length: { offset: 2, size: 2, endian: little, adjust: 6,"
        " flag: { offset: 4, mask: 0x80 } } }",
        wire("23 02 01 00 50 01  53 04 06 00 D0 01 01 00 00 3C 05 00  44 04 01 00 01 50"),
        [
            wire("23 02 01 00 50 01"),
            wire("53 04 06 00 D0 01 01 00 00 3C 05 00"),
            wire("44 04 01 00 01 50"),
        ],
        "Thorlabs APT communications protocol",
    ),
    Sample(
        "arcos",
        "{ type: length, start: [0xFA, 0xFB], length: { offset: 2, size: 1, adjust: 3 }, max: 64,"
        " checksum: { algorithm: { fold: sum, bits: 16, of: 16, odd: xor } } }",
        wire("FA FB 03 01 00 01  FA FB 06 04 3B 01 00 05 3B"),
        [wire("01"), wire("04 3B 01 00")],
        "Pioneer 3 operations manual, chapter 6",
    ),
    Sample(
        "checksum over the request",
        "{ type: fixed, size: 4, checksum: { algorithm: crc16-xmodem, before: [0x80, 24] } }",
        wire("00 7B F8 06"),
        [wire("00 7B")],
        "RoboClaw user manual, packet serial; computed",
    ),
]
