"""Access units of videos: their properties are read from streams that a real encoder made."""

import io
from collections.abc import Iterator

import av
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc._h264 import (
    BadStream,
    StreamInfo,
    info_of,
    is_keyframe,
    nal_units,
    with_parameter_sets,
)
from urc.video import VideoUnit, encode_unit, read_unit


def encoded(codec: str, width: int, height: int, count: int = 4, **options: str) -> list[bytes]:
    """Return the access units of a grey film, made by the encoder inside PyAV."""
    target = io.BytesIO()
    raw = "hevc" if codec == "libx265" else "h264"
    with av.open(target, "w", format=raw) as container:
        stream = container.add_stream(codec, rate=30, options=options)
        assert isinstance(stream, av.VideoStream)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.gop_size = 2
        packets = []
        for _ in range(count):
            frame = av.VideoFrame(width, height, "yuv420p")
            for plane in frame.planes:  # otherwise, uninitialised memory
                plane.update(bytes([128]) * plane.buffer_size)
            packets += stream.encode(frame)
        packets += stream.encode(None)
        return [bytes(packet) for packet in packets]


def bits(*codes: int | str) -> bytes:
    """Return Exp-Golomb codes and raw bits (as text) as bytes, with the stop bit."""
    text = ""
    for code in codes:
        text += (
            code
            if isinstance(code, str)
            else f"{code + 1:b}".zfill(2 * (code + 1).bit_length() - 1)
        )
    text += "1"
    text += "0" * (-len(text) % 8)
    return int(text, 2).to_bytes(len(text) // 8, "big")


def baseline_sps(width: int, height: int) -> bytes:
    """Return the parameter set of a baseline stream, by the syntax of H.264, 7.3.2.1.1."""
    body = bits(0, 0, 2, 1, "0", width // 16 - 1, height // 16 - 1, "1", "1", "0", "0")
    return b"\0\0\0\1\x67\x42\x00\x1e" + body.replace(b"\0\0\0", b"\0\0\3\0").replace(
        b"\0\0\1", b"\0\0\3\1"
    )


SIZES = [(640, 480), (642, 358), (16, 16), (1918, 1078)]


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("profile", ["baseline", "main", "high"])
def test_size_and_codec_of_h264(width: int, height: int, profile: str) -> None:
    """The crop is applied, whatever the profile."""
    units = encoded("libx264", width, height, preset="veryfast", profile=profile)
    info = info_of(units[0], is_hevc=False)
    assert info is not None
    assert info[1:] == (width, height)
    number = {"baseline": "42", "main": "4D", "high": "64"}[profile]
    assert info.codec.startswith(f"avc1.{number}")


@pytest.mark.parametrize("interlaced", ["tff=1", "fake-interlaced=1"])
def test_size_of_interlaced_h264(interlaced: str) -> None:
    """Rows are counted in pairs, so the crop is too."""
    options = {"x264-params": interlaced, "preset": "ultrafast"}
    info = info_of(encoded("libx264", 640, 360, **options)[0], is_hevc=False)
    assert info is not None
    assert info[1:] == (640, 360)


@pytest.mark.parametrize(("width", "height"), SIZES[:2])
def test_size_and_codec_of_h265(width: int, height: int) -> None:
    """As in ISO/IEC 14496-15, E.3."""
    options = {"x265-params": "log-level=none", "preset": "ultrafast"}
    units = encoded("libx265", width, height, **options)
    info = info_of(units[0], is_hevc=True)
    assert info is not None
    assert info[1:] == (width, height)
    assert info.codec.startswith("hev1.1.6.L")
    assert is_keyframe(units[0], is_hevc=True)


def test_keyframes_are_found() -> None:
    """The encoder starts a group every two images."""
    units = encoded("libx264", 64, 64, preset="ultrafast", tune="zerolatency")
    assert [is_keyframe(one, is_hevc=False) for one in units] == [True, False, True, False]


def test_a_keyframe_without_parameter_sets_gets_those_of_the_container() -> None:
    """Cameras over RTSP may state them only in the session description."""
    unit = encoded("libx264", 64, 64, preset="ultrafast")[0]
    nals = list(nal_units(unit))
    sets = b"".join(b"\0\0\0\1" + nal for nal in nals if nal[0] & 0x1F in (7, 8))
    image = b"".join(b"\0\0\0\1" + nal for nal in nals if nal[0] & 0x1F not in (7, 8))
    assert info_of(image, is_hevc=False) is None
    assert with_parameter_sets(image, sets, is_hevc=False) == sets + image
    assert with_parameter_sets(unit, sets, is_hevc=False) is unit
    assert with_parameter_sets(image, b"", is_hevc=False) == image


def test_a_gigantic_size_is_read_without_decoding() -> None:
    """30,000 by 30,000 pixels would take 1.3 GB in a decoder."""
    found = info_of(baseline_sps(30_000, 30_000), is_hevc=False)
    assert found == StreamInfo("avc1.42001E", 30_000, 30_000)


def test_a_truncated_parameter_set_is_refused() -> None:
    whole = baseline_sps(640, 480)
    for length in range(6, len(whole) - 1):
        with pytest.raises(BadStream, match="parameter set"):
            info_of(whole[:length], is_hevc=False)


def hostile() -> Iterator[st.SearchStrategy[bytes]]:
    for start in (b"\0\0\1\x67\x64\0\x1e", b"\0\0\1\x67\x42\0\x1e", b"\0\0\1\x42\x01\x0f", b""):
        yield st.binary(max_size=300).map(lambda data, start=start: start + data)


@given(data=st.one_of(*hostile()), is_hevc=st.booleans())
def test_random_bytes_raise_nothing_else(data: bytes, is_hevc: bool) -> None:
    """A parameter set out of the network ends in a size, in nothing or in `BadStream`."""
    is_keyframe(data, is_hevc=is_hevc)
    try:
        found = info_of(data, is_hevc=is_hevc)
    except BadStream:
        return
    assert found is None or (found.width > 0 and found.height > 0)


@given(
    data=st.binary(min_size=1, max_size=99),
    is_key=st.booleans(),
    time_s=st.floats(allow_nan=False),
    size=st.integers(0, 65535),
)
def test_a_unit_becomes_a_value_and_back(
    data: bytes, is_key: bool, time_s: float, size: int
) -> None:
    unit = VideoUnit("avc1.42E01E", is_key, size, 480, time_s, data)
    assert read_unit(encode_unit(unit)) == unit


@pytest.mark.parametrize("value", [b"", b"\xff\xd8\xff", b"URCV", b"URCV" + bytes(30)])
def test_other_bytes_are_no_unit(value: bytes) -> None:
    assert read_unit(value) is None


def test_a_unit_without_an_image_is_none() -> None:
    whole = encode_unit(VideoUnit("avc1.42E01E", True, 1, 1, 0.0, b"x"))
    for length in range(len(whole)):
        assert read_unit(whole[:length]) is None
