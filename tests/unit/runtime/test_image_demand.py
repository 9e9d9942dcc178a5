"""Topics of images: paused while nobody looks, and never at the price of a living connection."""

import asyncio
from pathlib import Path
from typing import NamedTuple

import pytest

from urc.config.load import load_profile
from urc.model.driver import Driver
from urc.model.payload import Envelope
from urc.model.values import Sample
from urc.runtime.hub import Hub, LinkState, LinkStatus
from urc.runtime.image_demand import PAUSE_AFTER_S, ImageDemand, low_streams, pausable_topics
from urc.runtime.image_viewers import GLANCE_S, low_stream
from urc.runtime.registries import built_in_catalog
from urc.testing.clock import FakeClock, settle
from urc.transports.base import LOW_STREAM

pytestmark = pytest.mark.anyio

ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
transports:
  ros: { type: ros, host: 127.0.0.1, stale_after: 3s }
signals:
  x: { unit: m }
  front: { type: image }
  rear: { type: image }
messages:
  odometry:
    subscribe: { topic: /odom, type: nav_msgs/Odometry }
    json: { x: pose.pose.position.x }
  front: { subscribe: { topic: /front, type: sensor_msgs/CompressedImage }, json: { front: data } }
  rear: { subscribe: { topic: /rear, type: sensor_msgs/CompressedImage }, json: { rear: data } }
"""


def driver_of(folder: Path, text: str = ROVER) -> Driver:
    file = folder / "rover.yaml"
    file.write_text(text, "utf-8")
    return load_profile(file, built_in_catalog()).driver


class Desk(NamedTuple):
    """A demand with the envelopes that it has sent."""

    demand: ImageDemand
    hub: Hub
    clock: FakeClock
    sent: list[str]

    async def after(self, seconds: float, *arrived: str) -> list[str]:
        """Let time pass, a check at each half second; return what was sent meanwhile."""
        self.sent.clear()
        for _ in range(round(seconds * 2)):
            await self.clock.advance(0.5)
            now_s = self.clock.now()
            self.hub.publish(Sample(name, 1.0, now_s) for name in arrived)
            self.demand.check()
        return list(self.sent)

    def link(self, state: LinkState) -> None:
        self.hub.set_link(LinkStatus("ros", state, "ros x", self.clock.now()))


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    driver, clock = driver_of(tmp_path), FakeClock()
    hub, sent = Hub(driver.signals), list[str]()

    def send(transport: str, envelope: Envelope) -> None:
        sent.append(f"{envelope.verb} {envelope.attributes['topic']}")

    desk = Desk(ImageDemand(pausable_topics(driver, {}), hub, send, clock), hub, clock, sent)
    desk.link("live")
    return desk


async def test_an_image_that_nobody_looks_at_is_paused(desk: Desk) -> None:
    with desk.hub.viewers.viewing(["front"]):
        assert await desk.after(1, "x") == []
        assert await desk.after(10, "x") == ["unsubscribe /rear"]


async def test_an_image_is_resumed_as_soon_as_somebody_looks(desk: Desk) -> None:
    await desk.after(5, "x")
    with desk.hub.viewers.viewing(["rear"]):
        assert await desk.after(0.5, "x") == ["subscribe /rear"]
        assert await desk.after(20, "x") == []


async def test_two_viewers_of_an_image_leave_one_by_one(desk: Desk) -> None:
    desk.hub.viewers.add(["front", "rear"])
    desk.hub.viewers.add(["rear"])
    desk.hub.viewers.remove(["front", "rear"])
    assert await desk.after(10, "x") == ["unsubscribe /front"]
    desk.hub.viewers.remove(["rear"])
    assert await desk.after(10, "x") == ["unsubscribe /rear"]


async def test_cameras_may_be_swapped_quickly(desk: Desk) -> None:
    """Each swap would otherwise cost the robot a new subscription."""
    for name in ("front", "rear") * 5:
        with desk.hub.viewers.viewing([name]):
            assert await desk.after(PAUSE_AFTER_S / 2, "x") == []


async def test_a_recording_looks_at_all_images(desk: Desk) -> None:
    with desk.hub.tap():
        assert await desk.after(10, "x") == []
    assert await desk.after(10, "x") == ["unsubscribe /front", "unsubscribe /rear"]


async def test_a_glance_keeps_an_image_for_a_while(desk: Desk) -> None:
    """The menu asks for the image of a card every few seconds."""
    desk.hub.viewers.glance("front", desk.clock.now())
    assert await desk.after(GLANCE_S - 1, "x") == ["unsubscribe /rear"]
    assert await desk.after(10, "x") == ["unsubscribe /front"]


async def test_the_only_topic_with_data_is_never_paused(desk: Desk) -> None:
    """A robot without odometry would else count as silent."""
    assert await desk.after(20) == []


async def test_a_connection_that_falls_silent_gets_all_its_topics_back_for_good(desk: Desk) -> None:
    await desk.after(5, "x")
    desk.link("silent")
    assert sorted(await desk.after(1)) == ["subscribe /front", "subscribe /rear"]
    desk.link("live")
    assert await desk.after(20, "x") == []


async def test_a_new_connection_starts_with_all_topics_and_is_paused_again(desk: Desk) -> None:
    await desk.after(5, "x")
    await desk.clock.advance(1)
    desk.link("lost")
    assert await desk.after(5) == []
    desk.link("live")
    assert await desk.after(5, "x") == ["unsubscribe /front", "unsubscribe /rear"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("json: { front: data }", "json: { front: data, x: size }"),
        ("signals:", 'signals:\n  seen: { type: boolean, value: "front is not none" }'),
        ("front: { type: image }", "front: { type: image, stale_after: 10m }"),
        (", stale_after: 3s", ", stale_after: 60s"),
    ],
)
def test_a_topic_that_is_needed_otherwise_stays(tmp_path: Path, old: str, new: str) -> None:
    """It also sets a number, a formula needs the image, or the old image would look live."""
    text = ROVER.replace(old, new)
    found = pausable_topics(driver_of(tmp_path, text), {})
    assert "/front" not in (found["ros"].images if found else {})


async def test_a_robot_without_images_needs_no_task() -> None:
    hub = Hub({})
    await ImageDemand({}, hub, lambda transport, envelope: None, FakeClock()).run()


async def test_a_viewer_is_noticed_at_once(desk: Desk) -> None:
    await desk.after(5, "x")
    desk.sent.clear()
    running = asyncio.create_task(desk.demand.run())
    await settle()
    desk.hub.viewers.add(["front"])
    await settle()
    running.cancel()
    assert desk.sent == ["subscribe /front"]


CAMERA = """
urc: 1
kind: robot
name: eye
title: Eye
transports:
  eye: { type: camera, url: "rtsp://127.0.0.1/cam" }
signals:
  picture: { type: video, stale_after: AGE }
messages:
  picture: { raw: picture }
"""


@pytest.mark.parametrize(("age", "is_paused"), [("2s", True), ("60s", False)])
async def test_a_camera_without_viewers_is_paused_as_a_whole(
    age: str, is_paused: bool, tmp_path: Path
) -> None:
    """It delivers nothing else, so its silence says nothing. Old images never look live."""
    driver, clock = driver_of(tmp_path, CAMERA.replace("AGE", age)), FakeClock()
    hub, sent = Hub(driver.signals), list[str]()
    topics = pausable_topics(driver, {})
    demand = ImageDemand(topics, hub, lambda _, envelope: sent.append(envelope.verb), clock)
    hub.set_link(LinkStatus("eye", "live", "camera", clock.now()))
    for _ in range(10):
        demand.check()
        await clock.advance(1.0)
    assert sent == (["unsubscribe"] if is_paused else [])
    with hub.viewers.viewing(["picture"]):
        demand.check()
        assert sent == (["unsubscribe", "subscribe"] if is_paused else [])


TWO_STREAMS = """
urc: 1
kind: robot
name: eye
title: Eye
transports:
  eye:
    type: camera
    streams: { high: "rtsp://10.0.0.2/1", low: "rtsp://10.0.0.2/2" }
signals:
  picture: { type: video, stale_after: 2s }
messages:
  picture: { raw: picture }
"""


async def test_a_low_stream_is_open_only_while_a_page_shows_it(tmp_path: Path) -> None:
    """Not for a recording, nor at the start of a connection."""
    driver, clock = driver_of(tmp_path, TWO_STREAMS), FakeClock()
    assert low_streams(driver) == {"eye": {"picture"}}
    hub, sent = Hub(driver.signals), list[str]()

    def send(transport: str, envelope: Envelope) -> None:
        sent.append(f"{envelope.verb} {envelope.attributes['topic']}")

    desk = Desk(ImageDemand(pausable_topics(driver, {}), hub, send, clock), hub, clock, sent)
    hub.set_link(LinkStatus("eye", "live", "camera x", clock.now()))
    with hub.tap():
        assert await desk.after(10) == []
    with hub.viewers.viewing(["picture", low_stream("picture")]):
        assert await desk.after(1) == [f"subscribe {LOW_STREAM}"]
        hub.set_link(LinkStatus("eye", "live", "camera x", clock.now()))
        assert await desk.after(1) == [f"subscribe {LOW_STREAM}"]
    with hub.viewers.viewing([low_stream("picture")]):
        assert await desk.after(10) == ["unsubscribe "]
    assert await desk.after(10) == [f"unsubscribe {LOW_STREAM}"]
