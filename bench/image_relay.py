"""Images to twenty pages: URC beside ``send_bytes`` for each page, and beside base64 in JSON.

All three serve with the same uvicorn, in this process, and are woken by the same robot, which is
another one, as are the pages. What counts is the processor time of this process for each image that
reached a page.
"""

import asyncio
import base64
import json
from collections.abc import Sequence
from functools import partial

from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket, WebSocketDisconnect

from bench.harness import Goal, Result, compare_all
from bench.watching import cost_s, speaking
from urc._loop import run as run_loop
from urc.model.interface import WidgetUse
from urc.model.values import Sample, Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS
from urc.web.app import Robot, build_app

__all__ = ["run"]

CLIENTS = 20
IMAGE = b"\xff\xd8\xff" + bytes(range(256)) * 156
"""About 40 kB that begin as a JPEG."""
RATE_HZ = 30
IMAGES, IMAGES_IF_FULL = 30, 90
ROUNDS, ROUNDS_IF_FULL = 5, 9
BYTES_GOAL, JSON_GOAL = 1.0, 0.2


class Naive:
    """The least that sends images to pages: each page's task sends the newest by itself."""

    def __init__(self, *, is_json: bool) -> None:
        self.is_json = is_json
        self.image = b""
        self.news = asyncio.Condition()
        self.app: ASGIApp = Starlette(routes=[WebSocketRoute("/ws", self.page)])

    async def page(self, line: WebSocket) -> None:
        """Send every image to one page."""
        await line.accept()
        try:
            while True:
                async with self.news:
                    await self.news.wait()
                if not self.image:
                    return
                if self.is_json:
                    data = base64.b64encode(self.image).decode()
                    await line.send_text(json.dumps({"t": "image", "data": data}))
                else:
                    await line.send_bytes(self.image)
        except WebSocketDisconnect:
            return

    async def put(self, image: bytes) -> None:
        """Take the newest; an empty one ends the pages."""
        self.image = image
        async with self.news:
            self.news.notify_all()


def run(*, full: bool) -> Sequence[Result]:
    """Compare the three ways, at 20 pages."""
    images = IMAGES_IF_FULL if full else IMAGES
    return compare_all(
        [
            (
                Goal("image relay / send_bytes for each page", BYTES_GOAL),
                lambda: run_loop(_naive(images, is_json=False)),
            ),
            (
                Goal("image relay / base64 in JSON", JSON_GOAL),
                lambda: run_loop(_naive(images, is_json=True)),
            ),
        ],
        lambda: run_loop(_urc(images)),
        rounds=ROUNDS_IF_FULL if full else ROUNDS,
    )


async def _naive(images: int, *, is_json: bool) -> float:
    naive = Naive(is_json=is_json)

    said = asyncio.Event()

    async def passing_on() -> None:
        for _ in range(images):
            await said.wait()
            said.clear()
            await naive.put(IMAGE)

    async with speaking(images, RATE_HZ) as line:

        async def play() -> None:
            passing = asyncio.create_task(passing_on())
            await line.heard(lambda _: said.set())
            await passing
            await naive.put(b"")

        spent_s, tally = await cost_s(naive.app, "/ws", CLIENTS, [], play)
    return _each(spent_s, [size for _, size in tally], len(IMAGE) * (4 / 3 if is_json else 1))


async def _urc(images: int) -> float:
    use = WidgetUse("cam", "camera", {"image": "cam"})
    robot = FakeRobot(dashboard_profile(signals={"cam": Signal("cam", "image")}, uses=[use]))
    app = build_app({"puppet": Robot(robot.profile, {}, robot.open)}, access=ACCESS)

    def tell(_: int) -> None:
        robot.hub.put((Sample("cam", IMAGE, robot.clock.now()),))

    async with speaking(images, RATE_HZ) as line:
        hear = partial(line.heard, tell)
        spent_s, tally = await cost_s(app, "/ws?robot=puppet", CLIENTS, ["cam"], hear)
    return _each(spent_s, [size for _, size in tally], len(IMAGE))


def _each(spent_s: float, sizes: list[int], image: float) -> float:
    """Return the time for one image at one page; most of what a page got must be images."""
    delivered = sum(size // int(image) for size in sizes)
    if delivered == 0:
        raise SystemExit("bench: no image arrived")
    return spent_s / delivered
