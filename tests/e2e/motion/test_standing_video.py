"""A video whose picture stands still, although its encoder goes on: it is marked, and stops a cart.

The encoder, the camera's process, the guard and the browser are real.
"""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final

import pytest
from playwright.async_api import Page, Route, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.motion.carts import Cart, served
from tests.e2e.motion.driving import PUSH_S, fresh, push, push_until
from tests.e2e.motion.test_driving_lock import PROFILE, moves
from tests.e2e.ports import free_port
from tests.e2e.projector import Projector, projecting
from tests.films import FilmKind

pytestmark = pytest.mark.anyio

PAD: Final = ".joystick-pad"
SAME: Final = "Camera repeats the same image"
COMPARED: Final = PROFILE.replace("stale_after: 2s", "stale_after: 2s, frozen_after: 500ms")
NO_DECODER: Final = "delete globalThis.VideoDecoder"
UNREADABLE: Final = "VideoFrame.prototype.copyTo = () => Promise.reject(new Error('opaque'));"
"""Images of some decoders for hardware cannot be copied, only drawn."""
LISTEN: Final = """
() => {
  const age = document.querySelector(".camera-age");
  globalThis.heard = [];
  const note = () => globalThis.heard.push(age.textContent);
  new MutationObserver(note).observe(age, { childList: true, characterData: true, subtree: true });
}
"""


class Unreadable:
    """Serves the script of the decoder for a browser that cannot copy its images."""

    def __init__(self) -> None:
        self.count = 0

    async def __call__(self, route: Route) -> None:
        answer = await route.fetch()
        await route.fulfill(response=answer, body=UNREADABLE + await answer.text())
        self.count += 1


@asynccontextmanager
async def projected_cart(
    new_page: PageMaker, folder: Path, kind: str = "", profile: str = COMPARED
) -> AsyncIterator[tuple[Cart, Page, Projector]]:
    """Serve a cart behind its guard with a film; give it, its page and the projector."""
    port, script = free_port(), Unreadable()
    with projecting(port) as projector:
        async with served(folder, profile.replace("EYE", str(port))) as (cart, address):
            page = await fresh(new_page)
            if kind == "no decoder":
                await page.add_init_script(NO_DECODER)
            elif kind == "unreadable":
                await page.route("**/video_worker.js*", script)
            await page.goto(address)
            await page.wait_for_function(
                "() => document.querySelector('.camera canvas')?.width >= 320"
            )
            await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
            assert script.count == (kind == "unreadable")
            yield cart, page, projector


@pytest.mark.parametrize("kind", ["decoder", "no decoder", "unreadable"])
async def test_an_encoder_that_repeats_its_picture_stops_the_cart(
    kind: str, new_page: PageMaker, tmp_path: Path
) -> None:
    """New data arrive all the time. Without a decoder, the server compares the images."""
    async with projected_cart(new_page, tmp_path, kind) as (cart, page, projector):
        age = page.locator(".camera-age")
        await push_until(lambda: moves(cart), page, PAD)
        await expect(age).not_to_contain_text(SAME)
        projector.kind = "standing"
        await until(lambda: not moves(cart))
        await expect(age).to_contain_text(SAME)
        # Late input may have ended the first push for another reason.
        await page.mouse.up()
        await push(page, PAD)
        await expect(page.locator(".joystick-note")).to_contain_text("Image too old")
        projector.kind = "moving"
        await expect(age).not_to_contain_text(SAME)
        count = len(cart.heard)
        await asyncio.sleep(0.6)
        assert cart.heard[count:] == [], "the hand that held on moves nothing"
        await page.mouse.up()
        await push_until(lambda: moves(cart), page, PAD)
        await page.mouse.up()
        await until(lambda: cart.heard[-1] == "V 0")


@pytest.mark.parametrize("scene", ["noisy", "moving"])
async def test_neither_a_moving_scene_nor_the_noise_of_a_sensor_is_marked(
    scene: FilmKind, new_page: PageMaker, tmp_path: Path
) -> None:
    """In a still scene, the robot stands still as well, and may start at any time."""
    async with projected_cart(new_page, tmp_path) as (cart, page, projector):
        projector.kind = scene
        await asyncio.sleep(PUSH_S)
        await page.evaluate(LISTEN)
        await push_until(lambda: moves(cart), page, PAD)
        await asyncio.sleep(PUSH_S)
        heard = await page.evaluate("globalThis.heard")
        assert not [text for text in heard if SAME in text]
        await page.mouse.up()


async def test_a_standing_picture_counts_as_new_without_the_key(
    new_page: PageMaker, tmp_path: Path
) -> None:
    async with projected_cart(new_page, tmp_path, profile=PROFILE) as (cart, page, projector):
        projector.kind = "standing"
        await asyncio.sleep(PUSH_S)
        await push_until(lambda: moves(cart), page, PAD)
        await asyncio.sleep(PUSH_S)
        await expect(page.locator(".camera-age")).not_to_contain_text(SAME)
        await page.mouse.up()
        await push_until(lambda: moves(cart), page, PAD)
        await page.mouse.up()
