"""What a person does on the page of a robot: reads, fills in forms, says yes, holds, lets go."""

import asyncio
import json
import re
import time
from collections.abc import Callable, Mapping
from typing import Any

from playwright.async_api import Locator, Page, WebSocket, expect

from tests.e2e.dashboards import WAIT_S
from urc.model.driver import Command
from urc.model.values import Reading

__all__ = ["Readings", "fill", "give", "held", "open_form", "until"]

AGAIN_S = 0.2
"""How often what the robot does not allow yet is tried again."""


async def until(is_true: Callable[[], bool], what: Callable[[], str]) -> None:
    """Wait for something that comes over several sockets and processes; `what` says what is not."""
    end_s = time.monotonic() + 2 * WAIT_S
    while not is_true():
        assert time.monotonic() < end_s, what()
        await asyncio.sleep(0.02)


class _Parts:
    """Joins the parts of messages on the page's socket for images."""

    def __init__(self, take: Callable[[bytes], None]) -> None:
        self._take = take
        self._waiting = b""

    def take(self, frame: str | bytes) -> None:
        """Take a part; its first byte has the lowest bit set in a message's last part."""
        assert isinstance(frame, bytes)
        self._waiting += frame[1:]
        if frame[0] & 1:
            self._take(self._waiting)
            self._waiting = b""


class Readings:
    """What the page is told over its socket: newest values, and how many pictures came."""

    def __init__(self, page: Page) -> None:
        self.values: dict[str, Any] = {}
        self.pictures: dict[str, set[int]] = {}
        """Signal → the hashes of the different pictures that came."""
        self._names: list[str] = []
        page.on("websocket", self._listen)

    async def until_picture(self, signal: str) -> None:
        """Wait until one of that signal has come."""
        await until(lambda: bool(self.pictures.get(signal)), lambda: f"no image of {signal} came")

    def _listen(self, line: WebSocket) -> None:
        if "/ws/pictures" in line.url:
            line.on("framereceived", _Parts(self._take).take)
        elif "/ws" in line.url and "/dev" not in line.url:
            line.on("framereceived", self._take)

    def _take(self, frame: str | bytes) -> None:
        if isinstance(frame, bytes):
            name = self._names[int.from_bytes(frame[2:4], "big")]
            self.pictures.setdefault(name, set()).add(hash(frame[16:]))
            return
        message = json.loads(frame)
        if message["t"] == "hello":
            self._names = message["names"]
        elif message["t"] == "v":
            for index, value in zip(message["i"], message["v"], strict=True):
                self.values[self._names[index]] = value


async def open_form(page: Page, command: str) -> Locator:
    """Return the form of a command on the interface for finding faults."""
    form = page.locator(f"[data-command='{command}']")
    if await form.get_attribute("open") is None:
        await form.locator("summary").click()
    return form


async def fill(form: Locator, arguments: Mapping[str, Reading]) -> None:
    """Fill in the arguments, each as its field takes it."""
    for name, value in arguments.items():
        field = form.locator("label.dev-field", has_text=re.compile(rf"^{re.escape(name)} \("))
        await field.wait_for()  # a form is made a moment after it is opened
        text = json.dumps(value) if not isinstance(value, str) else value
        choice = field.locator("select")
        if await choice.count():
            await choice.select_option(label=text)
        else:
            await field.locator("input").fill(text)


async def give(page: Page, command: Command, arguments: Mapping[str, Reading]) -> None:
    """Send a command from its form; say yes when asked, and try again while it is not allowed."""
    form = await open_form(page, command.name)
    await fill(form, arguments)
    said = form.locator(".dev-result")
    end_s = time.monotonic() + 3 * WAIT_S
    text = ""
    while time.monotonic() < end_s:
        await form.locator("form").evaluate("(form) => form.requestSubmit()")
        text = await _answered(page, form, said, end_s)
        if text.startswith("✓"):
            return
        await asyncio.sleep(AGAIN_S)
    raise AssertionError(f"{command.name}: {text}")


async def _answered(page: Page, form: Locator, said: Locator, end_s: float) -> str:
    text = ""
    while time.monotonic() < end_s:
        text = (await said.text_content() or "").strip()
        if text.startswith(("✓", "▲")) and not await form.locator(".urc-ask").count():
            return text
        await form.evaluate(AGREE)
        await asyncio.sleep(0.05)
    return text


AGREE = """(form) => {
  const slide = form.querySelector(".urc-ask [role='slider']");
  const key = { key: "ArrowRight", code: "ArrowRight", bubbles: true };
  slide?.dispatchEvent(new KeyboardEvent("keydown", key));
  [...form.querySelectorAll(".urc-ask button")].find((one) => one.textContent === "Yes")?.click();
}"""
"""Say yes, by key where it is slid; a question that nobody can have read yet takes no answer."""


async def held(
    page: Page, what: Locator, is_moving: Callable[[], bool], *, right: float = 0, up: float = 0
) -> None:
    """Press on something, push it if told so, and let go once the robot has been told to move.

    A first touch may only take the controls, and what is not allowed yet is tried again.
    """
    # Not where the bar with STOP lies above it.
    await what.evaluate("(el) => el.scrollIntoView({ block: 'center' })")
    end_s = time.monotonic() + 2 * WAIT_S
    while True:
        # A busy machine may lose its robot for a moment; the card's buttons lie over the widgets.
        await expect(page.locator(".urc-lost")).to_be_hidden(timeout=2_000 * WAIT_S)
        box = await what.bounding_box()
        assert box is not None
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        await page.mouse.move(x, y)
        await page.mouse.down()
        try:
            await page.mouse.move(x + right, y - up, steps=3)
            for _ in range(200):
                if is_moving():
                    return
                await asyncio.sleep(0.02)
        finally:
            await page.mouse.up()
        said = await page.locator("[data-who], [data-note], .dev-result").all_inner_texts()
        assert time.monotonic() < end_s, f"it never moved: {said}"
        await asyncio.sleep(AGAIN_S)
