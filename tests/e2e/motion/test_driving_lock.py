"""Driving by a camera, in a real browser: an old image slows the robot, and then stops it.

The declared ages are those of `SIGHT`; the robot must stop at most `MARGIN_S` after the second one.
"""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from statistics import median
from typing import Final

import pytest
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import WAIT_S, until
from tests.e2e.motion.carts import Cart, served
from tests.e2e.motion.driving import (
    PUSH_S,
    STOP,
    Wire,
    driven,
    fresh,
    is_motion,
    number,
    push,
    push_until,
)
from tests.e2e.ports import free_port
from tests.e2e.test_video_page import H264, test_card
from tests.e2e.transports.programs import program
from urc.model.driver import Command
from urc.model.exchange import Hold, Sight
from urc.model.interface import OutputBinding, WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import Sample, Signal
from urc.motion.hold_to_run import LONGEST_LEASE_S
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.show.demos import colour_bars

pytestmark = pytest.mark.anyio

MARGIN_S: Final = 0.3
SIGHT: Final = Sight("front", 1.2, 0.4)
STICK: Final = "[data-cell='1'] .joystick-pad"
NOTE: Final = "[data-cell='1'] .joystick-note"
OVERRIDE: Final = "[data-verb='override']"
CAMERA: Final = WidgetUse("front", "camera", {"image": "front"}, title="Front")
DRIVE: Final = WidgetUse(
    "stick", "joystick", {}, {"moved": "drive"}, {"axes": "x", "expo": 0.0, "dead_zone": 0.0},
    title="Throttle", given={"moved": OutputBinding({"speed": "x"})},
)  # fmt: skip
SPARE: Final = WidgetUse("spare", "battery", {"level": "battery"})


class Seeing(Wire):
    """A robot whose one command needs the images of its camera, 20 a second."""

    def __init__(self, *, has_camera: bool = True, frozen_after_s: float = 0.0) -> None:
        # The longest lease, so that a page that stalls for a moment does not end the motion first.
        hold = Hold(0.02, {"speed": 0.0}, LONGEST_LEASE_S, sight=SIGHT)
        arguments = {"speed": number("speed", -2.0, 2.0)}
        drive = Command("drive", "wire", WriteSpec("text", {}), arguments, hold=hold)
        front = Signal("front", "image", frozen_after_s=frozen_after_s)
        signals = {"front": front, "battery": Signal("battery", "integer")}
        uses = (CAMERA if has_camera else SPARE, DRIVE)
        profile = dashboard_profile(uses=uses, commands={"drive": drive}, signals=signals)
        FakeRobot.__init__(self, profile)
        self.is_filming = True
        self.is_repeating = False
        self.seen_s = 0.0
        """Time of the newest image that is no repetition."""

    def wait_s(self) -> float:
        """Return the time until the next image, in seconds."""
        return 0.05

    def is_lost(self) -> bool:
        """Return whether the network loses the next image."""
        return False

    async def film(self) -> None:
        """Publish images for as long as the camera films."""
        images = [colour_bars(64, 48), colour_bars(64, 64)]
        while True:
            await asyncio.sleep(self.wait_s())
            if self.is_filming and not self.is_lost():
                now_s = self.clock.now()
                if not self.is_repeating:
                    images.reverse()
                    self.seen_s = now_s
                self.hub.publish([Sample("front", images[0], now_s)])

    def speeds_since(self, count: int) -> list[float]:
        """Return the speeds of the frames after the first `count`."""
        texts = [one for one in self.line.texts[count:] if is_motion(one, "drive")]
        return [float(one.split("speed=")[1]) for one in texts]


@asynccontextmanager
async def filmed(
    new_page: PageMaker,
    data: Path | None = None,
    *,
    has_camera: bool = True,
    frozen_after_s: float = 0.0,
    seeing: Seeing | None = None,
) -> AsyncIterator[tuple[Seeing, Page]]:
    """Serve the robot and its film; give it, and its page when it can be driven."""
    seeing = seeing or Seeing(has_camera=has_camera, frozen_after_s=frozen_after_s)
    async with driven(data, seeing) as (robot, address):
        assert isinstance(robot, Seeing)
        film = asyncio.create_task(robot.film())
        try:
            page = await fresh(new_page)
            await page.goto(address)
            await page.wait_for_function(
                "() => document.querySelector('[data-who]').textContent.match(/driv/)"
            )
            if has_camera:
                await page.wait_for_function(
                    "() => document.querySelector('.camera canvas').width === 64"
                )
            yield robot, page
        finally:
            film.cancel()
            await asyncio.wait((film,))


async def stopped_after(robot: Seeing) -> float:
    """Wait for the stop; return how long after the newest image it was written."""
    return await robot.until_stopped() - robot.seen_s


async def test_a_camera_that_freezes_slows_the_robot_and_stops_it_in_time(
    new_page: PageMaker,
) -> None:
    """The hand holds on: nothing moves again before a new image and a new push."""
    async with filmed(new_page) as (robot, page):
        await push_until(robot.is_moving, page, STICK)
        await asyncio.sleep(0.5)
        full = robot.speeds_since(0)[-1]
        count = len(robot.line.texts)
        robot.is_filming = False
        late_s = await stopped_after(robot)
        assert SIGHT.stop_after_s - 0.2 < late_s < SIGHT.stop_after_s + MARGIN_S
        speeds = robot.speeds_since(count)
        assert min(speeds) < 0.9 * full, "it was slower when it stopped"
        assert speeds == sorted(speeds, reverse=True), "it never grew"
        await expect(page.locator(NOTE)).to_contain_text("Image too old")
        robot.is_filming = True
        silent = len(robot.line.texts)
        await asyncio.sleep(0.6)
        assert robot.speeds_since(silent) == [], "the hand that held on moves nothing"
        await page.mouse.up()
        await push_until(robot.is_moving, page, STICK)
        await page.mouse.up()
        await robot.until_stopped()


async def test_a_camera_that_repeats_its_image_stops_the_robot(new_page: PageMaker) -> None:
    """New messages arrive all the time, and the image in them is the same."""
    async with filmed(new_page, frozen_after_s=1.0) as (robot, page):
        badge = page.locator(".camera-age")
        await push_until(robot.is_moving, page, STICK)
        robot.is_repeating = True
        late_s = await stopped_after(robot)
        assert SIGHT.stop_after_s - 0.2 < late_s < SIGHT.stop_after_s + MARGIN_S
        await expect(badge).to_contain_text("Camera repeats the same image")
        await expect(page.locator(NOTE)).to_contain_text("Image too old")
        robot.is_repeating = False
        await expect(badge).not_to_contain_text("same image")
        silent = len(robot.line.texts)
        await asyncio.sleep(0.4)
        assert robot.speeds_since(silent) == [], "the hand that held on moves nothing"
        await page.mouse.up()
        await push_until(robot.is_moving, page, STICK)
        await page.mouse.up()
        await robot.until_stopped()


async def test_repeated_images_count_as_new_without_the_key(new_page: PageMaker) -> None:
    async with filmed(new_page) as (robot, page):
        robot.is_repeating = True
        await push_until(robot.is_moving, page, STICK)
        count = len(robot.line.texts)
        await asyncio.sleep(SIGHT.stop_after_s + 0.5)
        speeds = robot.speeds_since(count)
        assert robot.is_moving()
        # The median: a machine that stops for 150 ms makes one image old, and a few frames slower.
        assert median(speeds) == max(speeds), "nor does it become slower"
        await page.mouse.up()
        await robot.until_stopped()


async def test_the_stick_says_that_it_is_slow(new_page: PageMaker) -> None:
    async with filmed(new_page) as (robot, page):
        await push_until(robot.is_moving, page, STICK)
        said = asyncio.create_task(page.wait_for_selector(f"{NOTE} >> text=of the speed"))
        robot.is_filming = False
        await said
        await robot.until_stopped()


STUCK: Final = """
() => {
  const real = globalThis.createImageBitmap;
  const never = new Promise(() => {});
  globalThis.createImageBitmap = (...args) => globalThis.isStuck ? never : real(...args);
}
"""


async def test_a_decoder_that_stands_still_stops_the_robot(new_page: PageMaker) -> None:
    """The images arrive, but the page does not show them."""
    async with filmed(new_page) as (robot, page):
        await page.evaluate(STUCK)
        await push_until(robot.is_moving, page, STICK)
        began_s = robot.clock.now()
        await page.evaluate("globalThis.isStuck = true")
        late_s = await robot.until_stopped() - began_s
        assert late_s < SIGHT.stop_after_s + MARGIN_S
        assert robot.clock.now() - robot.seen_s < 0.2, "the camera filmed on"


async def test_stop_and_release_wait_for_no_image(new_page: PageMaker) -> None:
    """At the moment of the freeze, before the image is too old."""
    async with filmed(new_page) as (robot, page):
        for way in ("release", "stop"):
            await push_until(robot.is_moving, page, STICK)
            robot.is_filming = False
            if way == "release":
                await page.mouse.up()
            else:
                await page.evaluate(
                    f"document.querySelector(`{STOP}`)"
                    ".dispatchEvent(new PointerEvent('pointerdown', {bubbles: true, button: 0}))"
                )
            assert await stopped_after(robot) < SIGHT.slow_after_s + MARGIN_S  # type: ignore[operator]
            robot.is_filming = True
        await page.mouse.up()


async def test_a_page_without_the_camera_drives_only_by_an_override(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """For some seconds; who it was stands in the audit log."""
    async with filmed(new_page, tmp_path, has_camera=False) as (robot, page):
        await push(page, STICK)
        await expect(page.locator(NOTE)).to_contain_text("No current image")
        assert robot.speeds_since(0) == []
        await page.mouse.up()
        await page.locator(OVERRIDE).click()
        await expect(page.locator("[data-who]")).to_contain_text("Blind: ")
        await push_until(robot.is_moving, page, STICK)
        await expect(page.locator(NOTE)).to_contain_text("Driving without an image")
        await robot.until_stopped()
        await page.mouse.up()
        await page.goto(page.url.replace("robots/puppet/", "audit"))
        await expect(page.locator("body")).to_contain_text("may drive without an image for 10 s")


VIDEO_STOP_S: Final = 0.8
"""`stop_after` of the cart with a video."""
PROFILE: Final = """\
  eye: { type: camera, url: "udp://127.0.0.1:EYE" }
signals:
  front: { type: video, stale_after: 2s }
messages:
  front: { raw: front, from: eye }
commands:
  drive:
    send: "V {{ speed | round(2) }}"
    to: wire
    args: { speed: { min: -1, max: 1, default: 0 } }
    hold:
      { repeat: 50ms, release: {}, watchdog: none, lease: 1s, sees: front,
        slow_after: 400ms, stop_after: 800ms }
widgets:
  front: { use: camera, bind: { image: front } }
  stick: { use: joystick, bind: { moved: { command: drive, args: { x: speed } } } }
interfaces:
  default: { grid: front stick }
"""


@asynccontextmanager
async def filmed_cart(
    new_page: PageMaker, folder: Path
) -> AsyncIterator[tuple[Cart, Page, asyncio.subprocess.Process]]:
    """Serve a cart behind its guard, with a video over UDP; give it, its page and ffmpeg."""
    port = free_port()
    async with (
        program(*test_card(port, *H264)) as ffmpeg,
        served(folder, PROFILE.replace("EYE", str(port))) as (cart, address),
    ):
        page = await fresh(new_page)
        await page.goto(address)
        await page.wait_for_function("() => document.querySelector('.camera canvas')?.width >= 320")
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
        yield cart, page, ffmpeg


def moves(cart: Cart) -> bool:
    """Return whether the cart's newest frame is motion."""
    return bool(cart.heard) and cart.heard[-1] not in ("V 0", "V 0.0")


async def push_on(cart: Cart, page: Page) -> None:
    """Drive until a film that goes on has stopped nothing for a while; repeat a lost gesture."""
    async with asyncio.timeout(WAIT_S):
        while True:
            await push_until(lambda: moves(cart), page, ".joystick-pad")
            await asyncio.sleep(PUSH_S)
            if moves(cart):
                return
            await page.mouse.up()


@pytest.mark.needs("ffmpeg")
async def test_a_video_that_freezes_stops_a_cart_behind_its_guard(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """H.264 over UDP, and the real ways of both: the camera's process, and the guard."""
    async with filmed_cart(new_page, tmp_path) as (cart, page, ffmpeg):
        await push_on(cart, page)
        os.kill(ffmpeg.pid, signal.SIGSTOP)
        began_s = asyncio.get_running_loop().time()
        await until(lambda: not moves(cart))
        assert asyncio.get_running_loop().time() - began_s < VIDEO_STOP_S + MARGIN_S
        await expect(page.locator(".joystick-note")).to_contain_text("Image too old")
        os.kill(ffmpeg.pid, signal.SIGCONT)
        count = len(cart.heard)
        await asyncio.sleep(1.0)
        assert cart.heard[count:] == [], "the hand that held on moves nothing"
        await page.mouse.up()
        await push_until(lambda: moves(cart), page, ".joystick-pad")
        await page.mouse.up()
        await until(lambda: cart.heard[-1] == "V 0")
