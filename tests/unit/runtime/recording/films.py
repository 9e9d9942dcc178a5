"""Recordings with videos for tests: data of a real encoder, at times that a test chooses."""

import time
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from tests.films import pictures
from urc.model.driver import Driver, TransportSpec
from urc.model.profile import Profile
from urc.model.values import Sample, Signal
from urc.runtime.hub import LogEntry
from urc.runtime.recording.recorder import Recorder
from urc.video import VideoUnit, encode_unit
from urc.video_reader import UnitReader

__all__ = ["BEGAN_S", "BORN_NS", "PROFILE", "film_of", "record", "utc_ns"]

BORN_NS = 1_700_000_000_000_000_000
"""Time of the clock's zero, in nanoseconds since 1970."""
BEGAN_S = 100.0
"""Time of the first image, in monotonic seconds."""
PROFILE = Profile(
    "bot",
    "Bot",
    "bot.yaml",
    driver=Driver(
        {"eye": TransportSpec("eye", "camera")},
        {
            "front": Signal("front", "video"),
            "rear": Signal("rear", "video"),
            "battery": Signal("battery", "integer"),
        },
    ),
)


def film_of(
    times: Sequence[float], codec: str = "libx264", signal: str = "front", **options: str
) -> list[Sample]:
    """Return a film with one image at each time, in seconds since `BEGAN_S`."""
    reader = UnitReader(is_hevc=codec == "libx265", began_s=BEGAN_S)
    found = []
    units = islice(pictures("moving", codec, **options), len(times))
    for at_s, (_, data) in zip(times, units, strict=True):
        unit = reader.unit(data, BEGAN_S + at_s)
        assert isinstance(unit, VideoUnit)
        found.append(Sample(signal, encode_unit(unit), BEGAN_S + at_s))
    return found


def utc_ns(time_s: float) -> int:
    """Return monotonic seconds as nanoseconds since 1970."""
    return BORN_NS + round(time_s * 1e9)


def record(file: Path, events: Sequence[Sample | LogEntry]) -> Path:
    """Write events to a recording, whose clock begins at `BORN_NS`; return its path."""
    kept = Recorder(file, PROFILE, document="urc: 1\n")
    while not kept.is_begun:
        time.sleep(0.001)
    kept._shapes._utc_ns = utc_ns
    kept._writer._Writer__chunk_size = 4000
    kept.record(events)
    kept.close()
    return file
