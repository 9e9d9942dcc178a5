"""The MP4 file of a recorded video: the same images at the same times, or one clear line."""

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pytest

from tests.films import GROUP, RATE, encoder, film_image
from tests.unit.runtime.recording.films import BEGAN_S, film_of, record
from urc.model.values import Sample
from urc.problems import UrcError
from urc.runtime.hub import LogEntry
from urc.runtime.recording import film as module
from urc.runtime.recording.film import Film, export_film
from urc.runtime.recording.reader import open_recording
from urc.video import encode_unit, read_unit
from urc.video_reader import UnitReader

TICKS = 90_000
EVEN = [place / RATE for place in range(2 * RATE)]
UNEVEN = [0.0, 0.04, 0.05, 0.5, 0.501, 2.0, *(2.0 + place / 10 for place in range(1, 40))]
"""A network that holds images up, and a pause."""


def exported(folder: Path, samples: list[Sample | LogEntry], signal: str = "front") -> Film:
    file = record(folder / "bot.mcap", samples)
    return export_film(open_recording(file), signal, folder / "film.mp4")


def data_of(samples: list[Sample]) -> list[bytes]:
    return [unit.data for one in samples if (unit := read_unit(one.value)) is not None]  # type: ignore[arg-type]


def decoded(codec: str, units: list[bytes]) -> list[bytes]:
    """Return the pixels of each image, in the order in which they are shown."""
    decoder = av.CodecContext.create("hevc" if codec == "libx265" else "h264", "r")
    images = [image for one in units for image in decoder.decode(av.Packet(one))]
    return [image.to_ndarray().tobytes() for image in [*images, *decoder.decode(None)]]


def shown(file: Path) -> tuple[list[bytes], list[float]]:
    """Return the pixels and times of the images of an MP4 file."""
    with av.open(str(file)) as container:
        frames = list(container.decode(video=0))
    times = [float(one.pts * one.time_base) for one in frames]
    return [one.to_ndarray().tobytes() for one in frames], times


@pytest.mark.parametrize("codec", ["libx264", "libx265"])
@pytest.mark.parametrize("times", [EVEN, UNEVEN], ids=["even", "uneven"])
def test_the_film_has_the_same_images_at_the_same_times(
    tmp_path: Path, codec: str, times: list[float]
) -> None:
    samples = film_of(times, codec)
    film = exported(tmp_path, [*samples])
    assert film == Film(len(times), pytest.approx(times[-1], abs=1e-3))
    images, at_s = shown(tmp_path / "film.mp4")
    assert images == decoded(codec, data_of(samples))
    assert at_s == pytest.approx(times, abs=1e-4)


def test_nothing_is_encoded_anew(tmp_path: Path) -> None:
    """The container states lengths instead of start codes; apart from this, the bytes are equal."""
    samples = film_of(EVEN)
    exported(tmp_path, [*samples])
    with av.open(str(tmp_path / "film.mp4")) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.width, stream.height) == ("h264", 320, 240)
        found = [bytes(packet) for packet in container.demux(stream) if packet.size]
    for packet, data in zip(found, data_of(samples), strict=True):
        nals = [nal for nal in data.replace(b"\0\0\0\1", b"\0\0\1").split(b"\0\0\1") if nal]
        assert packet == b"".join(len(nal).to_bytes(4, "big") + nal for nal in nals)


def test_images_that_an_encoder_sends_in_another_order_are_shown_in_theirs(tmp_path: Path) -> None:
    samples = film_of_b_frames()
    film = exported(tmp_path, [*samples])
    assert film.images == len(samples)
    images, at_s = shown(tmp_path / "film.mp4")
    assert images == decoded("libx264", data_of(samples))
    assert all(later > earlier for earlier, later in pairwise(at_s))
    steps = np.diff(at_s)
    assert steps[2:-4] == pytest.approx([1 / RATE] * len(steps[2:-4]), abs=1e-3)


def film_of_b_frames() -> list[Sample]:
    """Return a film whose encoder looks ahead; its first units arrive with the second group."""
    made = encoder(
        preset="medium", tune="animation", bf="2", **{"b-adapt": "0", "rc-lookahead": "5"}
    )
    made.time_base = Fraction(1, RATE)
    packets = []
    for place in range(2 * RATE):
        frame = av.VideoFrame.from_ndarray(film_image(place, "moving"), "rgb24")
        frame.pts = place
        packets += made.encode(frame)
    packets += made.encode(None)
    assert [one.pts for one in packets] != sorted(one.pts for one in packets)
    reader, found = UnitReader(is_hevc=False, began_s=BEGAN_S), []
    for place, packet in enumerate(packets):
        unit = reader.unit(bytes(packet), BEGAN_S + place / RATE)
        assert unit is not None
        found.append(Sample("front", encode_unit(unit), unit.time_s))
    return found


def test_a_loss_costs_the_images_up_to_the_next_keyframe(tmp_path: Path) -> None:
    samples = film_of(EVEN)
    lost = LogEntry(samples[20].time_s, "warning", "recording", "events are missing here: 3")
    film = exported(tmp_path, [*samples[:20], lost, *samples[23:]])
    assert film.images == 20 + len(EVEN) - 2 * GROUP
    images, at_s = shown(tmp_path / "film.mp4")
    assert images == decoded("libx264", data_of([*samples[:20], *samples[2 * GROUP :]]))
    assert at_s[20] == pytest.approx(EVEN[2 * GROUP], abs=1e-4)


def test_a_film_begins_with_a_keyframe(tmp_path: Path) -> None:
    samples = film_of(EVEN)
    film = exported(tmp_path, [*samples[4:]])
    assert film.images == len(EVEN) - GROUP
    assert shown(tmp_path / "film.mp4")[1][0] == 0


def test_another_size_ends_the_film_and_is_said(tmp_path: Path) -> None:
    small = film_of(EVEN)
    later = [one._replace(time_s=one.time_s + 10) for one in film_of(EVEN, "libx265")]
    film = exported(tmp_path, [*small, *later])
    assert film.images == len(EVEN)
    assert film.ended.startswith("the video changes after 2.0 s from avc1.")
    assert film.ended.endswith("with 320 by 240")


def refused(work: Callable[[], object]) -> str:
    with pytest.raises(UrcError) as caught:
        work()
    return str(caught.value)


def test_each_fault_is_one_clear_line(tmp_path: Path) -> None:
    samples = film_of(EVEN)
    battery = Sample("battery", 4, BEGAN_S)
    file = record(tmp_path / "bot.mcap", [battery, *samples])
    recording = open_recording(file)
    target = tmp_path / "film.mp4"
    faults = {
        "side": f"{file} contains no reading of 'side'; its videos are: front",
        "battery": f"'battery' is no video in {file}; its videos are: front",
    }
    for signal, said in faults.items():
        assert refused(lambda name=signal: export_film(recording, name, target)) == said
    target.write_bytes(b"mine")
    said = f"{target} exists already; select another file with --output"
    assert refused(lambda: export_film(recording, "front", target)) == said
    assert target.read_bytes() == b"mine"
    nowhere = tmp_path / "no" / "film.mp4"
    said = f"{nowhere} cannot be written: No such file or directory"
    assert refused(lambda: export_film(recording, "front", nowhere)) == said
    blind = open_recording(record(tmp_path / "blind.mcap", [battery, *samples[1:GROUP]]))
    said = f"{blind.file} contains no keyframe of 'front', so no image can be decoded"
    assert refused(lambda: export_film(blind, "front", tmp_path / "blind.mp4")) == said
    none = open_recording(record(tmp_path / "none.mcap", [battery]))
    said = f"'battery' is no video in {none.file}; it contains no video"
    assert refused(lambda: export_film(none, "battery", tmp_path / "none.mp4")) == said
    assert {one.name for one in tmp_path.iterdir()} == {
        *("bot.mcap", "film.mp4", "blind.mcap", "none.mcap"),
    }


def test_a_full_disk_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> Film:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "_write", full)
    file = record(tmp_path / "bot.mcap", film_of(EVEN))
    target = tmp_path / "film.mp4"
    said = f"{target} cannot be written: No space left on device"
    assert refused(lambda: export_film(open_recording(file), "front", target)) == said
    assert list(tmp_path.iterdir()) == [file]


def test_a_damaged_recording_gives_what_can_be_read(tmp_path: Path) -> None:
    file = record(tmp_path / "bot.mcap", film_of(EVEN))
    data = bytearray(file.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 100] = bytes(100)
    file.write_bytes(data)
    film = export_film(open_recording(file), "front", tmp_path / "film.mp4")
    images, _ = shown(tmp_path / "film.mp4")
    assert 0 < film.images < len(EVEN)
    assert len(images) == film.images


def test_a_recording_without_its_end_gives_what_was_written(tmp_path: Path) -> None:
    """Its process was killed."""
    file = record(tmp_path / "bot.mcap", film_of(EVEN))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    film = export_film(open_recording(file), "front", tmp_path / "film.mp4")
    images, at_s = shown(tmp_path / "film.mp4")
    assert 0 < film.images < len(EVEN)
    assert images == decoded("libx264", data_of(film_of(EVEN)[: film.images]))
    assert at_s == pytest.approx(EVEN[: film.images], abs=1e-4)


def test_without_the_package_it_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = record(tmp_path / "bot.mcap", film_of(EVEN))
    recording = open_recording(file)
    monkeypatch.setattr(module, "find_spec", lambda _: None)
    said = refused(lambda: export_film(recording, "front", tmp_path / "film.mp4"))
    assert said.startswith("exporting a video needs the package av: ")
