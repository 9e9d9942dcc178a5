"""Delimiters after the images of an RTSP stream, judged by the parsers of FFmpeg."""

import struct
from collections.abc import Iterator

import av
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.transports.rtp_packets import film, with_start_codes
from urc.transports.rtsp_delimiters import UnitDelimiters, without_delimiter

TRUSTED = 30
"""Images of which the relay sees the marks before it believes them."""
SDP = b"v=0\r\nm=video 0 RTP/AVP 96\r\na=rtpmap:96 %s/90000\r\n"
H264_END, H265_END = b"\x29\xf0", b"\x46\x07\x50"


def described(codec: bytes) -> bytes:
    """Return the camera's reply to DESCRIBE."""
    sdp = SDP % codec
    return b"RTSP/1.0 200 OK\r\nContent-Length: %d\r\n\r\n" % len(sdp) + sdp


def framed(packet: bytes, channel: int = 0) -> bytes:
    """Return a packet as it travels between RTSP messages."""
    return b"$" + bytes([channel]) + len(packet).to_bytes(2, "big") + packet


def rtp(sequence: int, stamp: int, payload: bytes, *, is_last: bool) -> bytes:
    """Return an RTP packet of payload type 96."""
    kind = 96 | (0x80 if is_last else 0)
    return struct.pack(">BBHII", 0x80, kind, sequence & 0xFFFF, stamp, 7) + payload


def images(count: int, first: int = 0, *, marks_parts: bool = False) -> list[bytes]:
    """Return the frames of images of two parts each, without content."""
    found = []
    for place in range(first, first + count):
        for part in range(2):
            is_last = marks_parts or part == 1
            packet = rtp(2 * place + part, 3000 * place, b"part", is_last=is_last)
            found.append(framed(packet))
    return found


def packets(data: bytes) -> Iterator[tuple[int, int, bool, bytes]]:
    """Yield sequence number, time stamp, mark and payload of each RTP packet."""
    while data:
        (length,) = struct.unpack_from(">H", data, 2)
        _, kind, sequence, stamp, _ = struct.unpack_from(">BBHII", data, 4)
        yield sequence, stamp, kind >= 0x80, data[16 : 4 + length]
        data = data[4 + length :]


def begun(codec: bytes = b"H264", first: int = 0) -> UnitDelimiters:
    """Return delimiters of a stream whose marks have proved right."""
    delimiters = UnitDelimiters()
    assert delimiters.passed(described(codec)) == described(codec)
    data = b"".join(images(TRUSTED, first))
    assert delimiters.passed(data) == data
    return delimiters


def test_each_image_is_ended_by_a_packet_of_its_own_time() -> None:
    """The later packets have higher numbers, so nothing seems lost."""
    found = list(packets(begun().passed(b"".join(images(2, TRUSTED)))))
    assert found == [
        (60, 90000, False, b"part"),
        (61, 90000, True, b"part"),
        (62, 90000, False, H264_END),
        (63, 93000, False, b"part"),
        (64, 93000, True, b"part"),
        (65, 93000, False, H264_END),
    ]


def test_numbers_begin_again_after_65535() -> None:
    first = 32768 - TRUSTED - 1  # the last number before the end is the one of a mark
    found = list(packets(begun(first=first).passed(b"".join(images(2, 32767)))))
    assert [number for number, *_ in found] == [65534, 65535, 0, 1, 2, 3]


def test_a_camera_that_marks_each_part_gets_no_delimiter() -> None:
    """A delimiter between the parts would cut the image."""
    delimiters = UnitDelimiters()
    delimiters.passed(described(b"H264"))
    data = b"".join(images(2 * TRUSTED, marks_parts=True))
    assert delimiters.passed(data) == data


def test_a_camera_that_begins_to_mark_each_part_gets_no_more_delimiters() -> None:
    """The numbers stay higher, because the library would take a step back for a loss."""
    delimiters = begun()
    delimiters.passed(b"".join(images(1, TRUSTED)))
    odd = list(packets(delimiters.passed(b"".join(images(9, TRUSTED + 1, marks_parts=True)))))
    assert [payload for *_, payload in odd].count(H264_END) == 1
    later = list(packets(delimiters.passed(b"".join(images(9, TRUSTED + 10)))))
    assert later[0][0] == 2 * (TRUSTED + 10) + 2
    assert H264_END not in [payload for *_, payload in later]


def test_reports_replies_and_other_codecs_pass_unchanged() -> None:
    delimiters = begun()
    report = framed(b"\x80\xc8\x00\x06" + bytes(24), channel=1)
    short = framed(b"\x80")
    sound = framed(struct.pack(">BBHII", 0x80, 0x80 | 8, 1, 2, 3) + b"sound", channel=2)
    for message in (
        report,
        short,
        sound,
        b"RTSP/1.0 200 OK\r\nCSeq: 9\r\n\r\n",
        b"RTSP/1.0 200 OK\n\n",
    ):
        assert delimiters.passed(message) == message
    still = UnitDelimiters()
    assert still.passed(described(b"JPEG")) == described(b"JPEG")
    data = b"".join(images(2 * TRUSTED))
    assert still.passed(data) == data


def test_a_message_without_an_end_is_passed_on() -> None:
    """A hostile camera fills no memory."""
    delimiters = UnitDelimiters()
    sent = b"RTSP/1.0 200 OK\r\n" + b"x" * 70_000
    assert delimiters.passed(sent) == sent
    data = b"".join(images(2 * TRUSTED))
    assert delimiters.passed(data) == data


@given(st.lists(st.integers(1, 400), min_size=1, max_size=60))
def test_the_pieces_in_which_bytes_arrive_do_not_matter(sizes: list[int]) -> None:
    data = described(b"H265") + b"".join(images(TRUSTED + 3))
    whole = UnitDelimiters().passed(data)
    assert whole.count(H265_END) == 3
    delimiters, found = UnitDelimiters(), b""
    for size in sizes:
        found += delimiters.passed(data[:size])
        data = data[size:]
    assert found + delimiters.passed(data) == whole


@pytest.mark.parametrize("codec", ["h264", "hevc"])
def test_a_parser_of_ffmpeg_gives_each_image_at_its_delimiter(codec: str) -> None:
    """Without the next image, and the image is the camera's, byte for byte."""
    units = [with_start_codes(one) for one in film(6, is_hevc=codec == "hevc")]
    end = H264_END if codec == "h264" else H265_END
    parser = av.CodecContext.create(codec, "r")
    found: list[av.Packet] = []
    for place, unit in enumerate(units):
        assert len(found) == place
        found += parser.parse(unit)
        found += parser.parse(b"\0\0\0\1" + end)
    assert [without_delimiter(bytes(one)).rstrip(b"\0") for one in found] == [
        unit.rstrip(b"\0") for unit in units
    ]


def test_a_delimiter_of_the_camera_stays() -> None:
    for unit in (b"\0\0\0\1\x09\xf0\0\0\0\1\x65", b"\0\0\1\x46\x01\x50\0\0\1\x26"):
        assert without_delimiter(unit) == unit
        ours = b"\0\0\0\1" + (H264_END if unit[4] == 9 else H265_END)
        assert without_delimiter(ours + unit) == unit
