"""An operator at a page: real touches and key presses, counted, and the server's news."""

import json
import time
from typing import Any

from playwright.async_api import Locator, Page, WebSocket

from tests.e2e.motion.driving import Fingers

__all__ = ["DECISION_S", "KEY_S", "TOUCH_S", "OperatorInput", "Told"]

DECISION_S, TOUCH_S, KEY_S = 1.35, 1.10, 0.28
"""Times of the keystroke-level model (Card, Moran and Newell, 1980), in seconds: the choice of the
next step (M), pointing at a target (P), and a key press of an average typist (K)."""

SWIPE_STEPS, REST_MS = 8, 150
UNCOVERED = """(el) => {
  const { left, right, top, bottom } = el.getBoundingClientRect();
  const [x, y] = [(left + right) / 2, (top + bottom) / 2];
  const found = document.elementFromPoint(x, y);
  return found !== null && (el.contains(found) || found.contains(el)) ? [x, y] : null;
}"""
FOCUSED = "(el) => el.contains(document.activeElement)"


class Told:
    """What a server and its page have told each other.

    These are the newest values by signal, the lease, the arguments of the newest tick, and the
    number of ticks.
    """

    def __init__(self, page: Page) -> None:
        self.values: dict[str, Any] = {}
        self.lease: dict[str, Any] = {}
        self.wanted: dict[str, Any] = {}
        self.ticks = 0
        self._names: list[str] = []
        page.on("websocket", self._watch)

    def _watch(self, line: WebSocket) -> None:
        if "/ws/pictures" in line.url:
            return
        line.on("framereceived", self._take)
        line.on("framesent", self._note)

    def _note(self, frame: str | bytes) -> None:
        message: dict[str, Any] = json.loads(frame) if isinstance(frame, str) else {"t": "bytes"}
        if message["t"] == "tick":
            self.wanted = message["arguments"]
            self.ticks += 1

    def _take(self, frame: str | bytes) -> None:
        message: dict[str, Any] = json.loads(frame) if isinstance(frame, str) else {"t": "image"}
        if message["t"] == "hello":
            self._names = message["names"]
        elif message["t"] == "v":
            for index, value in zip(message["i"], message["v"], strict=True):
                self.values[self._names[index]] = value
        elif message["t"] == "lease":
            self.lease = message


class OperatorInput:
    """The fingers and keys of an operator on one page."""

    def __init__(self, page: Page, fingers: Fingers) -> None:
        self.page = page
        self._fingers = fingers
        self.touches = 0
        """Fingers put down: taps and holds."""
        self.swipes = 0
        self.keys = 0
        self._decisions = 0
        self._began_s = time.monotonic()

    def begin(self) -> None:
        """Begin a task: count from zero."""
        self.touches = self.swipes = self.keys = self._decisions = 0
        self._began_s = time.monotonic()

    def account(self) -> dict[str, float]:
        """Return the counts, the machine's seconds, and the seconds of the model."""
        machine_s = time.monotonic() - self._began_s
        hand_s = TOUCH_S * (self.touches + self.swipes) + KEY_S * self.keys
        return {
            "touches": self.touches,
            "swipes": self.swipes,
            "keys": self.keys,
            "machine_s": round(machine_s, 1),
            "model_s": round(machine_s + hand_s + DECISION_S * self._decisions, 1),
        }

    def decide(self) -> None:
        """Count a look at the page with a choice."""
        self._decisions += 1

    async def touch(self, target: Locator, *, finger: int = 1) -> tuple[float, float]:
        """Put a finger on a target, which must be uncovered on the screen; return the place."""
        self.decide()
        await target.wait_for(state="visible")
        place = await target.evaluate(UNCOVERED)
        assert place is not None, f"covered, or off the screen: {target}"
        self.touches += 1
        await self._fingers.put(finger, *place)
        return place[0], place[1]

    async def tap(self, target: Locator, *, finger: int = 1) -> None:
        """Tap a target."""
        await self.touch(target, finger=finger)
        await self._fingers.lift(finger)

    async def hold(self, target: Locator, *, up: float, finger: int = 1) -> None:
        """Put a finger on a stick and push it; the finger stays."""
        x, y = await self.touch(target, finger=finger)
        for share in (0.5, 1.0):
            await self._fingers.put(finger, x, y - up * share)

    async def lift(self, finger: int = 1) -> None:
        """Lift a finger."""
        await self._fingers.lift(finger)

    async def swipe(self, x: float, y: float, up: float) -> None:
        """Move the content up with a finger that goes up from a place and then rests."""
        self.decide()
        self.swipes += 1
        for step in range(SWIPE_STEPS + 1):
            await self._fingers.put(1, x, y - up * step / SWIPE_STEPS)
        await self.page.wait_for_timeout(REST_MS)  # a finger that rests throws nothing
        await self._fingers.put(1, x, y - up)
        await self._fingers.lift(1)

    async def press(self, key: str) -> None:
        """Press a key."""
        self.keys += 1
        await self.page.keyboard.press(key)

    async def tab_to(self, target: Locator, *, back: bool = False) -> None:
        """Press Tab until a target has the focus."""
        self.decide()
        for _ in range(80):
            if await target.evaluate(FOCUSED):
                return
            await self.press("Shift+Tab" if back else "Tab")
        raise AssertionError(f"not reached with Tab: {target}")

    async def hold_key(self, key: str) -> None:
        """Press a key, which stays down."""
        self.decide()
        self.keys += 1
        await self.page.keyboard.down(key)

    async def lift_key(self, key: str) -> None:
        """Lift a key."""
        await self.page.keyboard.up(key)
