"""A drive of the playground's robot over the page's protocol, without a browser."""

import asyncio
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from playground.port import PortSocket
from playground.robot import Playground
from urc.images import media_type
from urc.wire.picture import read_picture

__all__ = ["drive"]

TICK_S = 0.05
COMMAND = "drive"


class Page:
    """What a page of the dashboard receives, and what it says."""

    def __init__(self) -> None:
        self.line: PortSocket | None = None
        self.names: list[str] = []
        self.values: dict[str, Any] = {}
        self.lease: dict[str, Any] = {}
        self.beat = 0
        self.refused: list[str] = []
        self.pictures: list[bytes] = []
        self.links: list[dict[str, Any]] = []
        self._number = 0

    def text(self, data: str) -> None:
        """Note a message."""
        said = json.loads(data)
        match said["t"]:
            case "hello":
                self.names = said["names"]
            case "v":
                self.values |= zip((self.names[one] for one in said["i"]), said["v"], strict=True)
            case "lease":
                self.lease = said
            case "beat":
                self.beat = said["n"]
            case "links":
                self.links = said["links"]
            case "refused":
                self.refused.append(said["message"])

    def binary(self, data: bytes) -> None:
        """Note a picture."""
        found = read_picture(data)
        assert found is not None
        self.pictures.append(found.data)

    def closed(self, code: int, reason: str) -> None:
        """Fail: no test closes the socket."""
        raise AssertionError(f"closed: {code} {reason}")

    def say(self, **message: object) -> None:
        """Say something to the server."""
        assert self.line is not None
        self.line.take(json.dumps(message))

    async def hold(self, seconds: float, **arguments: float) -> None:
        """Hold the control, with a tick as often as a page samples at least."""
        for _ in range(round(seconds / TICK_S)):
            self._number += 1
            counters = {"epoch": self.lease["epoch"], "number": self._number, "echo": self.beat}
            # The page's own order of keys, which the server reads without a parser.
            self.line_take({"t": "tick", "command": COMMAND, "arguments": arguments, **counters})
            await asyncio.sleep(TICK_S)

    def line_take(self, message: dict[str, object]) -> None:
        """Say a message in the form of `JSON.stringify`."""
        assert self.line is not None
        self.line.take(json.dumps(message, separators=(",", ":")))


async def until(is_so: Callable[[], object]) -> None:
    """Wait until a condition holds; raise TimeoutError after a minute."""
    async with asyncio.timeout(60):
        while not is_so():  # noqa: ASYNC110  # the page has no events
            await asyncio.sleep(0.02)


async def drive(text: str, folder: Path) -> dict[str, Any]:
    """Drive a robot, let go, press STOP and try to drive again; return what the page was told."""
    playground, page = Playground(folder), Page()
    name = await playground.open(text)
    assert f"/ws?robot={name}" in playground.page("")
    page.line = playground.connect(f"ws://page/ws?robot={name}", page)
    told: dict[str, Any] = {}
    await until(lambda: page.links and page.links[0]["state"] == "live" and page.lease)
    page.say(t="show", signals=["picture"])
    await until(lambda: page.pictures)
    told["picture"] = media_type(page.pictures[-1])

    page.say(t="drive", verb="take")
    await until(lambda: page.lease["holder"])
    async with asyncio.timeout(60):
        while not page.values.get("speed"):  # a pause of the machine ends a gesture
            await page.hold(0.1, speed=0, turn=0)  # neutral first
            await page.hold(0.5, speed=0.3, turn=0)
    told["driven_m_s"] = page.values["speed"]
    seen = len(page.pictures)
    await until(lambda: len(page.pictures) > seen + 1)
    told["pictures_later"] = len(page.pictures) - seen
    page.say(t="release", command=COMMAND)
    await until(lambda: page.values["speed"] == 0)
    told["let_go_m_s"] = page.values["speed"]

    page.say(t="stop")
    await until(lambda: page.lease["latched"])
    told["latched"] = page.lease["latched"] != ""
    page.refused.clear()
    await page.hold(0.5, speed=0.3, turn=0)
    told["refused_after_stop"] = page.refused != [] or page.lease["holder"] is None
    told["stopped_m_s"] = page.values["speed"]
    await until(lambda: page.lease["holder"] is None)
    edited = text.replace("title: TurtleBot 4\n", "title: Edited robot\n", 1)
    async with asyncio.timeout(60):
        # The stop may still be due.
        while await playground.open(edited) is None:  # noqa: ASYNC110  # a rest has no event
            await asyncio.sleep(0.02)
    told["shows_edit"] = "Edited robot" in playground.page("")
    page.line.hang_up()
    others = asyncio.all_tasks() - {asyncio.current_task()}
    for task in others:
        task.cancel()
    await asyncio.wait(others, timeout=5)
    return told
