"""Transcoded videos, and cameras of this computer, by the real library."""

import io
import os
import threading
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

import av
import pytest
from PIL import Image

from urc._image_encoders import FrameEncoder, jpeg_of
from urc.transports.camera_process import read_units
from urc.transports.camera_records import NOTE, RECORD, UNIT, DemuxJob, UnitQueue
from urc.transports.jpeg_tables import usual_tables, with_tables
from urc.transports.packet_reader import device_time_s
from urc.transports.transcoder import Transcoder
from urc.video import JPEG, VideoUnit, read_unit
from urc.video_reader import VideoFault

COUNT: Final = 20
WIDTH, HEIGHT = 320, 240


def picture(number: int) -> av.VideoFrame:
    """Return a grey image whose brightness is its number."""
    frame = av.VideoFrame(WIDTH, HEIGHT, "yuv420p")
    for place, plane in enumerate(frame.planes):
        plane.update(bytes([8 * number + 16 if place == 0 else 128]) * plane.buffer_size)
    frame.pts = number
    return frame


def film(folder: Path, codec: str, kind: str = "mpegts", count: int = COUNT) -> Path:
    """Return a film with a keyframe at every fifth image."""
    file = folder / f"film.{kind}"
    options = {"x265-params": "log-level=none"} if codec == "libx265" else {}
    with av.open(str(file), "w", format=kind) as container:
        stream: Any = container.add_stream(codec, rate=30, options=options)
        stream.width, stream.height, stream.gop_size = WIDTH, HEIGHT, 5
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.max_b_frames = 0
        for number in range(count):
            container.mux(stream.encode(picture(number)))
        container.mux(stream.encode(None))
    return file


def records(job: DemuxJob, file: Path | None = None) -> tuple[list[VideoUnit], list[str], str]:
    """Return the units, the notes and the end of a stream."""
    queue, end = UnitQueue(), ""
    with open(os.devnull if file is None else file, "rb", buffering=0) as source:
        try:
            read_units(job, source, queue)
        except VideoFault as fault:
            end = str(fault)
    queue.end()
    units, notes = [], []
    while (record := queue.take()) is not None:
        _, kind = RECORD.unpack(record[: RECORD.size])
        content = record[RECORD.size :]
        if kind == NOTE:
            notes.append(content.decode())
        unit = read_unit(content) if kind == UNIT else None
        if unit is not None:
            units.append(unit)
    return units, notes, end


def brightness(units: list[VideoUnit]) -> list[int]:
    """Return the number of each image, decoded by the library."""
    decoder: Any = av.CodecContext.create("h264", "r")
    frames = [frame for unit in units for frame in decoder.decode(av.Packet(unit.data))]
    frames += decoder.decode(None)
    return [round((bytes(frame.planes[0])[0] - 16) / 8) for frame in frames]


@pytest.fixture(autouse=True)
def encodes_every_image(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file is read faster than it is decoded, which a camera is not."""
    monkeypatch.setattr("urc.transports.transcoder._BEHIND", COUNT)


@pytest.mark.parametrize(
    ("codec", "name"), [("libx265", "H.265"), ("mpeg4", "MPEG-4"), ("mpeg2video", "mpeg2video")]
)
def test_another_codec_becomes_h264_with_the_same_images(
    codec: str, name: str, tmp_path: Path
) -> None:
    units, notes, end = records(DemuxJob(transcode="h264_software"), film(tmp_path, codec))
    assert end == "the camera ended the stream"
    assert units[0].is_key
    assert {one.codec[:5] for one in units} == {"avc1."}
    assert {(one.width, one.height) for one in units} == {(WIDTH, HEIGHT)}
    seen = brightness(units)
    assert seen == sorted(seen)
    assert set(seen) >= set(range(5, COUNT - 2)), "some begin or end in the library"
    assert notes == [f"transcodes {name} of 320 × 240 pixels to H.264, with libx264"]


def test_each_image_keeps_its_time_of_arrival(tmp_path: Path) -> None:
    """A decoder and an encoder must not make an image younger."""
    units = [
        unit._replace(time_s=100.0 + place / 8)
        for place, unit in enumerate(records(DemuxJob(), film(tmp_path, "libx265"))[0])
    ]
    assert {one.codec[:5] for one in units} == {"hev1."}
    queue = UnitQueue()
    make = partial(av.CodecContext.create, "hevc", "r")
    transcoder = Transcoder(av, "hevc", make, ("libx264",), queue)
    transcoder.put(units)
    transcoder.end()
    made = list(taken(queue))
    first = brightness(made)[0]
    assert [one.time_s for one in made] == [
        100.0 + (number - first) / 8 for number in brightness(made)
    ]
    assert len(made) >= len(units) - 3


def test_the_wanted_codec_passes_unchanged(tmp_path: Path) -> None:
    file = film(tmp_path, "libx264")
    plain, _, _ = records(DemuxJob(), file)
    asked, notes, _ = records(DemuxJob(transcode="h264"), file)
    assert [one.data for one in asked] == [one.data for one in plain]
    assert notes == []


def test_without_the_key_nothing_is_transcoded(tmp_path: Path) -> None:
    units, _, end = records(DemuxJob(), film(tmp_path, "mpeg4"))
    assert units == []
    assert end.startswith("the camera sends mpeg4; URC passes on H.264 and H.265: ")
    assert end.endswith("or write transcode: h264")


def test_jpeg_images_of_a_video(tmp_path: Path) -> None:
    units, notes, _ = records(DemuxJob(transcode="jpeg"), film(tmp_path, "libx264"))
    assert {(one.codec, one.is_key) for one in units} == {(JPEG, True)}
    assert opened(units[-1].data).size == (WIDTH, HEIGHT)
    assert notes == ["transcodes h264 of 320 × 240 pixels to JPEG"]


def opened(data: bytes) -> Image.Image:
    image = Image.open(io.BytesIO(data))
    image.load()
    assert image.format == "JPEG"
    return image


@pytest.mark.parametrize("codec", ["libx265", "mpeg4"])
def test_an_image_beyond_the_limit_is_not_transcoded(
    codec: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("urc.video_reader", "urc.transports.packet_reader"):
        monkeypatch.setattr(f"{module}.MAX_PIXELS", 320 * 240 - 1)
    units, _, end = records(DemuxJob(transcode="h264_software"), film(tmp_path, codec))
    assert units == []
    assert end.startswith("the camera sends images of 320 by 240 pixels; the limit is 76799 in")


# Cameras of this computer: the library reads a file in place of the device


def device(file: Path, kind: str, transcode: str = "", **options: str) -> DemuxJob:
    return DemuxJob(
        device=str(file), format=kind, device_options=tuple(options.items()), transcode=transcode
    )


def test_the_jpeg_images_of_a_device_pass_unchanged(tmp_path: Path) -> None:
    file = film(tmp_path, "mjpeg", "mjpeg")
    units, notes, end = records(device(file, "mjpeg"))
    assert len(units) == COUNT
    assert b"".join(one.data for one in units) == file.read_bytes()
    assert {(one.codec, one.width, one.height) for one in units} == {(JPEG, WIDTH, HEIGHT)}
    assert (notes, end) == ([], "the camera ended the stream")


def test_the_h264_of_a_device_passes_unchanged(tmp_path: Path) -> None:
    units, _, _ = records(device(film(tmp_path, "libx264", "h264"), "h264"))
    assert {one.codec[:5] for one in units} == {"avc1."}
    assert brightness(units) == list(range(COUNT))


@pytest.mark.parametrize("transcode", ["h264_software", "jpeg"])
def test_raw_images_of_a_device_are_encoded(transcode: str, tmp_path: Path) -> None:
    options = {"video_size": f"{WIDTH}x{HEIGHT}", "pixel_format": "yuyv422", "framerate": "30"}
    file = tmp_path / "film.raw"
    frames = [picture(number).reformat(format="yuyv422") for number in range(COUNT)]
    file.write_bytes(b"".join(bytes(one.planes[0]) for one in frames))
    units, notes, _ = records(device(file, "rawvideo", transcode, **options))
    assert len(units) == COUNT
    if transcode == "jpeg":
        assert opened(units[9].data).size == (WIDTH, HEIGHT)
    else:
        assert brightness(units) == list(range(COUNT))
    assert notes[0].startswith("transcodes raw images of 320 × 240 pixels to ")


def test_a_device_that_is_missing_or_closed_is_named(tmp_path: Path) -> None:
    assert records(device(tmp_path / "video7", "v4l2"))[2] == "this computer has no such device"
    assert "v4l2" in {name for one in av.formats_available for name in one.split(",")}


class Stamped:
    """A packet of a device, with its time of capture in microseconds."""

    time_base = 1e-6

    def __init__(self, pts: int | None) -> None:
        self.pts = pts


def test_a_device_states_the_time_of_capture_on_the_same_clock() -> None:
    assert device_time_s(Stamped(99_500_000), 100.0) == pytest.approx(99.5)
    assert device_time_s(Stamped(None), 100.0) == 100.0
    assert device_time_s(Stamped(101_000_000), 100.0) == 100.0, "never younger than its arrival"
    assert device_time_s(Stamped(5_000_000), 100.0) == 100.0, "a time of another clock"


def test_tables_that_a_webcam_leaves_out_are_added() -> None:
    """Browsers show no JPEG image without its tables."""
    whole = jpeg_of(av, picture(9))
    tables = usual_tables(av)
    assert with_tables(whole, tables) == whole
    plain = io.BytesIO()
    Image.new("L", (WIDTH, HEIGHT), 88).save(plain, "JPEG")  # has the usual tables
    bare = without_tables(plain.getvalue())
    assert b"\xff\xc4" not in bare[: bare.index(b"\xff\xda")]
    assert opened(with_tables(bare, tables)).getpixel((9, 9)) == 88


def without_tables(data: bytes) -> bytes:
    place = 2
    while data[place + 1] != 0xDA:
        end = place + 2 + int.from_bytes(data[place + 2 : place + 4], "big")
        if data[place + 1] == 0xC4:
            data, end = data[:place] + data[end:], place
        place = end
    return data


# Slow computers and damage


class Gate:
    """A decoder that waits for the test."""

    def __init__(self) -> None:
        self.decoder: Any = av.CodecContext.create("h264", "r")
        self.is_open = threading.Event()

    def decode(self, packet: Any) -> Any:
        assert self.is_open.wait(30.0)
        return self.decoder.decode(packet)


def h264_units(folder: Path) -> list[VideoUnit]:
    return records(DemuxJob(), film(folder, "libx264"))[0]


def taken(queue: UnitQueue) -> Iterator[VideoUnit]:
    queue.end()
    for record in iter(queue.take, None):
        unit = read_unit(record[RECORD.size :])
        if unit is not None:
            yield unit


def test_a_slow_computer_leaves_out_images_and_shows_the_newest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("urc.transports.transcoder._BEHIND", 1)
    units, queue, gate = h264_units(tmp_path), UnitQueue(), Gate()
    transcoder = Transcoder(av, "h264", lambda: gate, (), queue)
    transcoder.put(units)
    gate.is_open.set()
    transcoder.end()
    made = list(taken(queue))
    assert 1 <= len(made) <= 3
    assert made[-1].time_s == pytest.approx(units[-1].time_s, abs=1e-5)


def test_damage_costs_images_until_the_next_keyframe(tmp_path: Path) -> None:
    units, queue = h264_units(tmp_path), UnitQueue()
    keys = [place for place, one in enumerate(units) if one.is_key]
    units[keys[1]] = units[keys[1]]._replace(data=b"\0\0\0\1\x65" + bytes(range(200)))

    def decoder() -> Any:
        made: Any = av.CodecContext.create("h264", "r")
        made.options = {"err_detect": "explode"}
        return made

    transcoder = Transcoder(av, "h264", decoder, (), queue)
    transcoder.put(units)
    transcoder.end()
    assert len(list(taken(queue))) >= COUNT - 6


def test_a_stream_that_cannot_be_decoded_ends_with_a_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("urc.transports.transcoder._MOST_FAILURES", 20)

    class Deaf:
        def decode(self, _: Any) -> list[Any]:
            return []

    transcoder = Transcoder(av, "vp9", Deaf, (), UnitQueue())
    unit = VideoUnit("decoded", True, 64, 64, 1.0, b"x")
    transcoder.put([unit] * 40)
    transcoder.end()
    with pytest.raises(VideoFault, match=r"^the camera's vp9 cannot be decoded$"):
        transcoder.put([unit])


def test_an_encoder_without_its_hardware_is_replaced() -> None:
    """The first one that works is used: no computer has the hardware of all makers."""
    missing = [one for one in ("h264_nvenc", "h264_amf") if one in av.codecs_available]
    encoder = FrameEncoder(av, 0.0, (*missing, "libx264"))
    (made,) = encoder.encode(picture(3), 5.0)
    assert made.is_key
    assert made.time_s == 5.0
    assert encoder.name == "libx264" or encoder.name in missing


def test_a_keyframe_is_made_every_second() -> None:
    encoder = FrameEncoder(av, 0.0)
    keys = [encoder.encode(picture(place % 9), place / 10)[0].is_key for place in range(25)]
    assert [place for place, one in enumerate(keys) if one] == [0, 10, 20]


def test_the_options_of_a_device_reach_the_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, str, Mapping[str, str]]] = []

    def refused(place: str, *, format: str, options: Mapping[str, str]) -> None:
        asked.append((place, format, options))
        raise av.error.PermissionError(13, "Permission denied")

    monkeypatch.setattr(av, "open", refused)
    job = device(Path("/dev/video0"), "v4l2", input_format="mjpeg", video_size="640x480")
    assert records(job)[2].startswith("URC may not open the device: ")
    options = {"input_format": "mjpeg", "video_size": "640x480"}
    assert asked == [("/dev/video0", "v4l2", options)]
