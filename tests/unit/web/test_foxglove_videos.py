"""Videos for Foxglove viewers: from a keyframe on, in order, and whole groups for a slow viewer."""

import json
from base64 import b64decode
from collections import deque
from collections.abc import Iterator

import pytest

from urc.model.driver import Driver
from urc.model.profile import Profile
from urc.model.values import Sample, Signal
from urc.runtime.hub import Hub
from urc.video import VideoUnit, encode_unit
from urc.web.foxglove.robot_feed import RobotFeed
from urc.web.foxglove.topics import HubMessages, TopicSource
from urc.web.foxglove.video_queue import LATE_UNITS, MOST_BYTES, MOST_UNITS, add_unit

EYE = Signal("eye", "video")
SOURCE = TopicSource("signal", "eye")


def unit(text: str, time_s: float = 1.0, size: int = 0) -> Sample:
    """Return an access unit; those whose text begins with K are keyframes."""
    data = text.encode() + bytes(size)
    made = VideoUnit("avc1.42E01E", text.startswith("K"), 64, 48, time_s, data)
    return Sample("eye", encode_unit(made), time_s)


class Viewer:
    """A viewer that subscribes to the video of one robot."""

    def __init__(self) -> None:
        self.hub = Hub({"eye": EYE})
        profile = Profile("bot", "Bot", "bot.yaml", driver=Driver(signals={"eye": EYE}))
        self.messages = HubMessages("bot", profile, lambda time_s: round(time_s * 1e9))
        self.feed = RobotFeed(lambda: None)

    def film(self, *texts: str) -> None:
        for text in texts:
            self.hub.publish((unit(text),))

    def read(self, most: int = 10_000) -> list[str]:
        """Return the waiting access units."""
        found = []
        while len(found) < most and (message := self.feed.next_message()) is not None:
            told = json.loads(message[message.index(b"{") :])
            assert (told["format"], told["frame_id"]) == ("h264", "eye")
            found.append(b64decode(told["data"]).decode())
        return found


@pytest.fixture
def viewer() -> Iterator[Viewer]:
    made = Viewer()
    with made.feed.attached(made.hub, made.messages):
        yield made


def test_a_subscription_begins_with_a_keyframe(viewer: Viewer) -> None:
    viewer.film("K1", "a")
    viewer.feed.subscribe(SOURCE, 1, EYE)
    assert viewer.hub.viewers.sees(("eye",), 0.0)
    viewer.film("b", "c")
    assert viewer.read() == []
    viewer.film("K2", "d")
    viewer.film("e")
    assert viewer.read() == ["K2", "d", "e"]
    assert viewer.feed.take_dropped() == 0


def test_a_slow_viewer_goes_on_with_the_newest_group(viewer: Viewer) -> None:
    viewer.feed.subscribe(SOURCE, 1, EYE)
    viewer.film("K1", *["a"] * LATE_UNITS)
    assert viewer.read(1) == ["K1"]
    viewer.film("K2", "b")
    assert viewer.read() == [*["a"] * LATE_UNITS, "K2", "b"], "a short delay costs nothing"
    viewer.film("K3", *["c"] * LATE_UNITS, "K4", "d")
    assert viewer.read() == ["K4", "d"]
    assert viewer.feed.take_dropped() == LATE_UNITS + 1


def test_a_viewer_that_reads_nothing_takes_no_memory(viewer: Viewer) -> None:
    viewer.feed.subscribe(SOURCE, 1, EYE)
    viewer.film("K1", *["a"] * (MOST_UNITS - 1))
    viewer.film("b", "c", "d")
    assert viewer.read() == []
    assert viewer.feed.take_dropped() == MOST_UNITS + 1
    viewer.film("e", "K2")
    assert viewer.read() == ["K2"]


def test_the_unsent_bytes_are_limited() -> None:
    waiting = deque((unit("K1", size=MOST_BYTES - 100),))
    assert add_unit(waiting, unit("a", size=200), needs_key=False) == (2, True)
    assert not waiting


def test_a_new_session_begins_with_a_keyframe() -> None:
    viewer = Viewer()
    viewer.feed.subscribe(SOURCE, 1, EYE)
    with viewer.feed.attached(viewer.hub, viewer.messages):
        viewer.film("K1", "a")
    with viewer.feed.attached(viewer.hub, viewer.messages):
        viewer.film("b")
        assert viewer.read() == []
        viewer.film("K2", "c")
        assert viewer.read() == ["K2", "c"]


def test_the_end_of_a_subscription_ends_the_film(viewer: Viewer) -> None:
    viewer.feed.subscribe(SOURCE, 1, EYE)
    viewer.film("K1", "a")
    viewer.feed.unsubscribe(SOURCE)
    viewer.film("K2")
    assert viewer.read() == []
    assert not viewer.hub.viewers.sees(("eye",), 1e9)
