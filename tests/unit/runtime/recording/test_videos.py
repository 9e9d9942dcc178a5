"""Videos in recordings: unchanged, as other programs expect them, and played from a keyframe on."""

import json
from base64 import b64decode
from pathlib import Path

import av
import jsonschema
import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from mcap.reader import make_reader

from tests.films import GROUP, RATE
from tests.unit.runtime.recording.films import BEGAN_S, BORN_NS, PROFILE, film_of, record, utc_ns
from urc.model.driver import Driver
from urc.model.values import Sample, Signal
from urc.runtime.hub import LogEntry, Traffic
from urc.runtime.json_messages import as_json
from urc.runtime.recording import recorder
from urc.runtime.recording.events import event_of, topic_of
from urc.runtime.recording.player import PlaybackSession
from urc.runtime.recording.reader import open_recording
from urc.runtime.recording.recorder import Recorder
from urc.runtime.recording.shapes import RecordingEncoder, channels
from urc.runtime.recording.videos import (
    GROUP_UNITS,
    Group,
    RecordedUnit,
    RecordedVideos,
    recorded_unit,
)
from urc.video import VideoUnit, encode_unit, read_unit, with_time

SECONDS = 2
TIMES = [place / RATE for place in range(SECONDS * RATE)]
SIGNALS = PROFILE.driver.signals


def unit_of(sample: Sample) -> VideoUnit:
    assert isinstance(sample.value, bytes)
    found = read_unit(sample.value)
    assert found is not None
    return found


@pytest.mark.parametrize("codec", ["libx264", "libx265"])
def test_other_programs_read_the_video_and_decode_it(tmp_path: Path, codec: str) -> None:
    """The library of MCAP's authors, Foxglove's message type, and FFmpeg."""
    film = film_of(TIMES, codec)
    file = record(tmp_path / "bot.mcap", film)
    kind = "hevc" if codec == "libx265" else "h264"
    decoder, images = av.CodecContext.create(kind, "r"), 0
    with file.open("rb") as stream:
        found = list(make_reader(stream, validate_crcs=True).iter_messages("/signals/front"))
    assert len(found) == len(film)
    for sample, (schema, _, message) in zip(film, found, strict=True):
        assert schema is not None
        assert (schema.name, schema.encoding) == ("foxglove.CompressedVideo", "jsonschema")
        told = json.loads(message.data)
        jsonschema.validate(told, json.loads(schema.data))
        assert set(told) == {field.name for field in CompressedVideo.DESCRIPTOR.fields}
        assert told["format"] == ("h265" if codec == "libx265" else "h264")
        assert b64decode(told["data"]) == unit_of(sample).data
        at_s = told["timestamp"]["sec"] + told["timestamp"]["nsec"] / 1e9
        assert at_s - BORN_NS / 1e9 == pytest.approx(sample.time_s, abs=1e-6)
        images += len(decoder.decode(av.Packet(b64decode(told["data"]))))
    assert images + len(decoder.decode(None)) == len(film)


def test_the_stated_time_is_that_of_arrival_although_the_server_was_held_up() -> None:
    sample = film_of([0.0])[0]._replace(time_s=BEGAN_S + 2.5)
    ((_, time_ns, data),) = RecordingEncoder(PROFILE.driver, utc_ns).messages(sample)
    assert time_ns == utc_ns(BEGAN_S + 2.5)
    assert json.loads(data)["timestamp"] == {"sec": utc_ns(BEGAN_S) // 10**9, "nsec": 0}


def test_a_message_is_the_same_access_unit_again() -> None:
    film = film_of(TIMES)
    encoder, videos = RecordingEncoder(PROFILE.driver, utc_ns), RecordedVideos()
    for number, sample in enumerate(film):
        ((topic, _, data),) = encoder.messages(sample)
        again = event_of(topic, data, float(number), SIGNALS, videos)
        assert isinstance(again, Sample)
        assert isinstance(sample.value, bytes)
        assert again == Sample("front", with_time(sample.value, number), number)


def test_nothing_is_played_before_a_keyframe_or_after_a_loss() -> None:
    film = film_of(TIMES)
    encoder, videos = RecordingEncoder(PROFILE.driver, utc_ns), RecordedVideos()

    def played(sample: Sample) -> bool:
        ((topic, _, data),) = encoder.messages(sample)
        return event_of(topic, data, 1.0, SIGNALS, videos) is not None

    assert [played(one) for one in film[1 : GROUP + 2]] == [False] * (GROUP - 1) + [True, True]
    videos.lose()
    assert [played(one) for one in film[GROUP + 2 : 2 * GROUP + 1]] == [False] * (GROUP - 2) + [
        True
    ]


def test_a_jump_begins_with_the_keyframe_before_the_position(tmp_path: Path) -> None:
    film = film_of(TIMES)
    rear = film_of(TIMES, signal="rear")
    battery = [Sample("battery", place, BEGAN_S + at_s) for place, at_s in enumerate(TIMES)]
    events = [one for three in zip(battery, film, rear, strict=True) for one in three]
    recording = open_recording(record(tmp_path / "bot.mcap", events))
    position = 2 * GROUP + 4
    found = recording.before(utc_ns(BEGAN_S + TIMES[position]))
    fronts = [one.data for one in found if one.topic == topic_of("front")]
    wanted = [unit_of(one).data for one in film[2 * GROUP : position]]
    assert [b64decode(json.loads(one)["data"]) for one in fronts] == wanted
    assert len([one for one in found if one.topic == topic_of("rear")]) == len(wanted)
    assert [json.loads(one.data) for one in found if one.topic == topic_of("battery")] == [
        {"value": position - 1}
    ]


def test_a_playback_compares_no_videos() -> None:
    """A jump shows the same images again, which no camera has repeated."""
    signals = {
        "film": Signal("film", "video", frozen_after_s=2.0),
        "front": Signal("front", "image", frozen_after_s=2.0),
    }
    profile = PROFILE._replace(driver=Driver(signals=signals))
    hub = PlaybackSession(profile, {}).hub
    assert [one.frozen_after_s for one in hub.signals.values()] == [0.0, 2.0]


def test_a_group_without_an_end_is_left_out() -> None:
    """A stream with one keyframe must not fill the memory."""
    group = Group[int]()
    key, other = (unit_of(one).data for one in film_of(TIMES[:2]))
    stamp = {"sec": 0, "nsec": 0}

    def add(number: int, data: bytes) -> None:
        group.add(number, RecordedUnit(data, "h264", stamp))  # type: ignore[arg-type]

    add(0, key)
    for number in range(1, GROUP_UNITS):
        add(number, other)
    assert len(group.items) == GROUP_UNITS
    add(GROUP_UNITS, other)
    add(GROUP_UNITS + 1, other)
    assert group.items == []
    add(7, key)
    assert group.items == [7]


def test_an_older_recording_with_whole_values_is_still_played() -> None:
    value = encode_unit(VideoUnit("avc1.42E01E", True, 4, 4, 1.5, b"\0\0\1\x65"))
    found = event_of("/signals/front", as_json({"value": value}), 1.0, SIGNALS)
    assert found == Sample("front", value, 1.0)


def test_the_data_of_a_camera_is_recorded_once() -> None:
    """Its traffic would repeat each image in hex."""
    assert "/wire/eye" not in {one.topic for one in channels(PROFILE.driver)}
    encoder = RecordingEncoder(PROFILE.driver, utc_ns)
    assert encoder.messages(Traffic(1.0, "eye", "received", b"\0" * 100)) == []
    assert encoder.messages(LogEntry(1.0, "info", "eye", "text")) != []


def test_a_loss_costs_whole_groups_and_never_leaves_images_without_their_keyframe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A slow disk: the keyframe is too large for the queue, and the images after it are not."""
    film = film_of([place / RATE for place in range(4 * GROUP)])
    file = tmp_path / "bot.mcap"
    kept = Recorder(file, PROFILE, document="urc: 1\n")
    with kept._wakes:  # nothing is written meanwhile
        kept.record(film[:GROUP])
        key, others = len(film[GROUP].value), [len(one.value) for one in film[GROUP + 1 :]]  # type: ignore[arg-type]
        assert key > 3 * max(others[: GROUP - 1])
        monkeypatch.setattr(recorder, "MOST_WAITING_BYTES", kept._waiting_bytes + key)
        kept.record(film[GROUP : 2 * GROUP + 3])
        assert len(kept._waiting) == GROUP
    monkeypatch.undo()
    kept.record(film[2 * GROUP + 3 :])
    kept.record(film[GROUP + 2 : GROUP + 4], lost=1)
    kept.close()
    units = [
        unit.data
        for message in open_recording(file).messages(0)
        if (unit := recorded_unit(message.data)) is not None
    ]
    wanted = [*film[:GROUP], *film[3 * GROUP :]]
    assert units == [unit_of(one).data for one in wanted]
