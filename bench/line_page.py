"""A page that shows videos, drives and measures: a separate program without a browser.

``python -m bench.line_page`` reads a `Plan` as JSON from standard input, prints ``ready`` once it
has the controls and an image. After a line ``count``, it prints ``images`` and the number of
complete images so far. After a line ``end``, it prints a JSON object and ends::

    trips_ms   times from a ping until its answer
    images     number of complete images
    bytes      size of these images
    stops      times that the robot was stopped, because the page heard nothing for too long

With ``way: main``, images come over the main socket, as for programs. With ``way: apart``, they
have their own socket, as for pages.
"""

import json
import select
import sys
import time
from typing import Any, NamedTuple

from bench.rig.operator_process import Page, _frame_of
from bench.rig.operator_process import Plan as PagePlan

__all__ = ["PicturePage", "Plan", "WatchingPage"]

PERIOD_NS = 50_000_000
SETTLE_S = 30.0
_LAST, _CONFIRM = 1, 2


class Plan(NamedTuple):
    """The actions of the page."""

    host: str
    port: int
    robot: str
    key: str
    way: str
    """``none`` for a page without videos, ``main`` or ``apart``."""
    signals: list[str]
    drives: bool


class PicturePage(Page):
    """The page's socket for images."""

    def __init__(self, plan: PagePlan, key: str) -> None:
        self.images = self.image_bytes = 0
        self._received = self._size = 0
        super().__init__(plan, "/ws/pictures")
        self.say({"t": "pictures", "key": key})

    def _sort(self) -> None:
        while (cut := _frame_of(self._rest)) is not None:
            kind, body, self._rest = cut
            if kind == 2:
                self._part(body)
            elif kind == 8:
                self.is_closed = True
            elif kind == 9:
                self._frame(10, body)

    def _part(self, part: bytes) -> None:
        self._received += len(part)
        self._size += len(part) - 1
        if part[0] & _LAST:
            self.images += 1
            self.image_bytes += self._size
            self._size = 0
        if part[0] & _CONFIRM:
            self._frame(1, str(self._received).encode())


class WatchingPage(Page):
    """The page."""

    pictures_page = PicturePage
    """Class of its socket for images."""

    def __init__(self, plan: Plan) -> None:
        self.trips_ms: list[float] = []
        self.stops = 0
        self.images = self.image_bytes = 0
        self.pictures = ""
        first = PagePlan(1, plan.host, plan.port, plan.robot, "", 0, key=plan.key)
        super().__init__(first)
        while not self.pictures and not self.is_closed:
            self.wait(time.monotonic_ns() + PERIOD_NS)
        if plan.way == "apart":
            self.spare = self.pictures_page(first, self.pictures)
        if plan.way != "none":
            more = {"apart": True} if plan.way == "apart" else {}
            self.say({"t": "show", "signals": plan.signals, **more})

    def _say_twice(self, message: dict[str, Any]) -> None:
        self.say(message)

    def _sort(self) -> None:
        while (cut := _frame_of(self._rest)) is not None:
            kind, body, self._rest = cut
            if kind == 1:
                self._take(json.loads(body))
            elif kind == 2:
                self.images += 1
                self.image_bytes += len(body)
            elif kind == 8:
                self.is_closed = True
            elif kind == 9:
                self._frame(10, body)

    def _take(self, message: dict[str, Any]) -> None:
        super()._take(message)
        if message["t"] == "hello":
            self.pictures = message["pictures"]
        elif message["t"] == "pong":
            self.trips_ms.append(time.monotonic_ns() / 1e6 - message["c"])

    def begin_anew(self) -> None:
        """Begin a new gesture after a stop, as an operator does."""
        self.let_go()
        self.has_let_go = False
        self.say({"t": "drive", "verb": "leave"})
        self.wait(time.monotonic_ns() + 2 * PERIOD_NS)
        self.take_controls()
        self.refusal = ""
        self.stops += 1

    @property
    def shown(self) -> tuple[int, int]:
        """Number and bytes of all images."""
        spare = self.spare
        if isinstance(spare, PicturePage):
            return spare.images, spare.image_bytes
        return self.images, self.image_bytes


def main() -> int:
    """Show and drive until standard input ends."""
    plan = Plan(**json.loads(sys.stdin.readline()))
    page = WatchingPage(plan)
    if plan.drives:
        page.take_controls()
    until_ns = time.monotonic_ns() + int(SETTLE_S * 1e9)
    while plan.way != "none" and not page.shown[0] and time.monotonic_ns() < until_ns:
        page.wait(time.monotonic_ns() + PERIOD_NS)
    print("ready", flush=True)
    next_ns = time.monotonic_ns()
    while not page.is_closed:
        if select.select([sys.stdin], [], [], 0)[0]:
            if sys.stdin.readline().strip() != "count":
                break
            print("images", page.shown[0], flush=True)
        if plan.drives and page.refusal:
            page.begin_anew()
            next_ns = time.monotonic_ns()
        if plan.drives:
            page.tick()
        page.say({"t": "ping", "c": time.monotonic_ns() / 1e6})
        next_ns = max(next_ns + PERIOD_NS, time.monotonic_ns())
        page.wait(next_ns)
    images, size = page.shown
    told = {"trips_ms": page.trips_ms, "images": images, "bytes": size, "stops": page.stops}
    print(json.dumps(told), flush=True)
    return int(page.is_closed)


if __name__ == "__main__":
    sys.exit(main())
