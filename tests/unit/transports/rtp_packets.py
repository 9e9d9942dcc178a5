"""Encoded films, and their packets, cut by RFC 6184 and RFC 7798, as a sender would."""

import io
from collections.abc import Iterable, Iterator

import av
import numpy as np

from urc._h264 import nal_units
from urc.transports.rtp_assembler import RtpPiece

__all__ = ["MTU", "film", "payloads_of", "pieces_of", "with_start_codes"]

MTU = 300
"""Small, so that even small images need several packets."""
STEP = 3000
"""Ticks between two images: 30 images a second."""


def film(count: int, *, is_hevc: bool = False) -> list[bytes]:
    """Return the access units of a film of coloured squares; each second one is a keyframe."""
    noise, target = np.random.default_rng(7), io.BytesIO()
    options = {"tune": "zerolatency", "preset": "ultrafast", "x264opts": "scenecut=0:slices=2"}
    if is_hevc:
        options["x265-params"] = "log-level=none:scenecut=0:keyint=2:min-keyint=2"
    with av.open(target, "w", format="hevc" if is_hevc else "h264") as container:
        stream = container.add_stream("libx265" if is_hevc else "libx264", rate=30, options=options)
        assert isinstance(stream, av.VideoStream)
        stream.width, stream.height, stream.pix_fmt, stream.gop_size = 320, 240, "yuv420p", 2
        packets = []
        for _ in range(count):
            blocks = noise.integers(0, 256, (6, 8, 3), np.uint8)
            image = np.kron(blocks, np.ones((40, 40, 1), np.uint8))
            packets += stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24"))
        packets += stream.encode(None)
    return [bytes(packet) for packet in packets]


def with_start_codes(unit: bytes) -> bytes:
    """Return an access unit with start codes of four bytes, as URC assembles it."""
    return b"".join(b"\0\0\0\1" + nal for nal in nal_units(unit))


def payloads_of(unit: bytes, *, is_hevc: bool) -> list[bytes]:
    """Return an access unit as payloads: small NAL units together, and large ones in parts."""
    found: list[bytes] = []
    small: list[bytes] = []
    for nal in nal_units(unit):
        if len(nal) < MTU // 3:
            small.append(nal)
            continue
        found += _together(small, is_hevc=is_hevc)
        small = []
        found += _cut(nal, is_hevc=is_hevc) if len(nal) > MTU else [nal]
    return found + _together(small, is_hevc=is_hevc)


def _together(nals: list[bytes], *, is_hevc: bool) -> list[bytes]:
    if len(nals) < 2:
        return nals
    head = bytes([48 << 1, 1]) if is_hevc else bytes([24 | max(nal[0] & 0x60 for nal in nals)])
    return [head + b"".join(len(nal).to_bytes(2, "big") + nal for nal in nals)]


def _cut(nal: bytes, *, is_hevc: bool) -> Iterator[bytes]:
    size = 2 if is_hevc else 1
    kind = nal[0] >> 1 & 0x3F if is_hevc else nal[0] & 0x1F
    head = bytes([nal[0] & 0x81 | 49 << 1, nal[1]]) if is_hevc else bytes([nal[0] & 0xE0 | 28])
    for start in range(size, len(nal), MTU):
        flags = 0x80 * (start == size) | 0x40 * (start + MTU >= len(nal))
        yield head + bytes([flags | kind]) + nal[start : start + MTU]


def pieces_of(
    units: Iterable[bytes], *, is_hevc: bool = False, first: int = 0, every_s: float = 1 / 30
) -> list[RtpPiece]:
    """Return the packets of a film, numbered from `first`; each image arrives at once."""
    found: list[RtpPiece] = []
    for place, unit in enumerate(units):
        payloads = payloads_of(unit, is_hevc=is_hevc)
        for index, payload in enumerate(payloads):
            number = (first + len(found)) % 65536
            is_last = index == len(payloads) - 1
            stamp = (4_294_960_000 + STEP * place) % 2**32
            found.append(RtpPiece(number, stamp, is_last, payload, 10.0 + place * every_s))
    return found
