"""Cameras that repeat their image: the true age, its end, and who is told."""

import pytest

from urc.model.values import Sample, Signal
from urc.motion.driving_lock import SeenImage, SentImages
from urc.runtime.hub import Hub
from urc.testing.clock import FakeClock
from urc.web.feed.fanout import Fanout, Place
from urc.wire.picture import PICTURE, PICTURE_HEADER, REPEATED, read_picture

pytestmark = pytest.mark.anyio

SIGNALS = {
    "front": Signal("front", "image", frozen_after_s=2.0),
    "rear": Signal("rear", "image"),
}


class Cameras:
    """A hub with a camera whose repetitions count, and one whose repetitions do not."""

    def __init__(self) -> None:
        self.hub = Hub(SIGNALS)

    def age_s(self, value: bytes | None, now_s: float, name: str = "front") -> float:
        self.hub.publish((Sample(name, value, now_s),))
        found = self.hub.latest(name)
        assert found is not None
        return round(now_s - found.time_s, 6)

    @property
    def notes(self) -> list[str]:
        return [f"{one.source}: {one.text}" for one in self.hub.notes]


def test_a_repeated_image_has_the_age_of_its_first_arrival() -> None:
    cameras = Cameras()
    assert cameras.age_s(b"old", 8.0) == 0
    found = [cameras.age_s(b"same", 10.0 + step / 2) for step in range(7)]
    assert found == [0, 0, 0, 0, 2.0, 2.5, 3.0], "not before the declared time"
    assert cameras.notes == [
        "front: the camera repeats the same image; its age counts from its first arrival"
    ]


def test_a_new_image_is_live_again() -> None:
    cameras = Cameras()
    for step in range(30):
        cameras.age_s(b"same", step / 10)
    assert "front" in cameras.hub.repeated
    assert cameras.age_s(b"new", 3.0) == 0
    assert "front" not in cameras.hub.repeated
    assert cameras.notes[1:] == ["front: the camera sends new images again, after 3.0 s"]
    assert [cameras.age_s(b"new", 3.0 + step) for step in range(4)] == [0, 0, 2, 3]


def test_images_that_differ_by_one_bit_are_new_images() -> None:
    cameras = Cameras()
    noise = [bytes(1000), bytes(999) + b"\1"]
    assert [cameras.age_s(noise[step % 2], step / 2) for step in range(20)] == [0] * 20


def test_a_camera_without_the_key_may_repeat_itself() -> None:
    cameras = Cameras()
    assert [cameras.age_s(b"same", float(step), "rear") for step in range(9)] == [0] * 9
    assert cameras.notes == []


def test_an_image_that_is_not_available_is_no_repetition() -> None:
    cameras = Cameras()
    assert [cameras.age_s(None, float(step)) for step in range(9)] == [0] * 9
    assert cameras.age_s(b"same", 10.0) == 0


def test_a_recording_that_jumps_back_begins_again() -> None:
    cameras = Cameras()
    cameras.age_s(b"same", 100.0)
    assert cameras.age_s(b"same", 50.0) == 0
    assert [cameras.age_s(b"same", 50.0 + step) for step in (1, 2)] == [0, 2]


def test_an_image_that_is_old_already_keeps_its_age() -> None:
    """It waited in the network, and its stamp told it."""
    cameras = Cameras()
    cameras.hub.publish((Sample("front", b"same", 7.0),))
    cameras.hub.publish((Sample("front", b"same", 9.5),))
    found = cameras.hub.latest("front")
    assert found is not None
    assert found.time_s == 7.0


@pytest.mark.parametrize("name", ["front", "rear"])
async def test_the_page_and_the_driving_lock_get_the_same_age(name: str) -> None:
    clock, hub = FakeClock(), Hub(SIGNALS)
    fanout, place = Fanout(hub, clock=clock), Place()
    place.images = SentImages(frozenset((name,)))
    fanout.show(place, (name,))
    began_s = clock.now()
    seen = []
    for _ in range(6):
        hub.publish((Sample(name, b"\xff\xd8same", clock.now()),))
        frame = fanout.next_picture(place)
        assert frame is not None
        message = frame[2:]
        kind, _, _, age_ms, _, number = PICTURE_HEADER.unpack_from(message)
        assert read_picture(message) is not None
        age_s = place.images.age_s(name, SeenImage(number, 0.0), clock.now())
        assert age_s == pytest.approx(age_ms / 1000, abs=0.01)
        seen.append((kind, round(age_s)))
        await clock.advance(1.0)
    live, old = (PICTURE, 0), [(REPEATED, 2), (REPEATED, 3), (REPEATED, 4), (REPEATED, 5)]
    assert seen == ([live, live, *old] if name == "front" else [live] * 6)
    assert clock.now() - began_s == 6.0
