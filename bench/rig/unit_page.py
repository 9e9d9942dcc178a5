"""A page without a browser that notes when each access unit of one video is complete.

    python -m bench.rig.unit_page PORT KEY ROBOT SIGNAL

It reads /ws/pictures as the page's worker does, part by part, and confirms as asked. A line on
standard input ends the page. It then prints the times in ns of the monotonic clock, keyed by the
name from `bench.rig.rtsp_tap.named`.
"""

import json
import select
import sys
import time

from bench.line_page import PicturePage, Plan, WatchingPage
from bench.rig.rtsp_tap import named
from urc._h264 import nal_units
from urc.wire.picture import VIDEO, VIDEO_HEADER

WAIT_NS = 200_000_000
_LAST = 1


class UnitPage(PicturePage):
    """The socket for images, with times."""

    def __init__(self, plan: object, key: str) -> None:
        self.times_ns: dict[str, int] = {}
        self._now_ns = 0
        self._message = b""
        super().__init__(plan, key)  # type: ignore[arg-type]

    def hear(self) -> None:
        """Note the time before anything else."""
        self._now_ns = time.monotonic_ns()
        super().hear()

    def _part(self, part: bytes) -> None:
        super()._part(part)
        self._message += part[1:]
        if not part[0] & _LAST:
            return
        message, self._message = self._message, b""
        if message[0] == VIDEO:
            head = VIDEO_HEADER.unpack_from(message)
            data = message[VIDEO_HEADER.size + head[1] :]
            self.times_ns[named(nal_units(data))] = self._now_ns


class TimedPage(WatchingPage):
    """The page."""

    pictures_page = UnitPage


def main() -> int:
    """Show the video until a line comes."""
    port, key, robot, signal = sys.argv[1:]
    page = TimedPage(Plan("127.0.0.1", int(port), robot, key, "apart", [signal], drives=False))
    spare = page.spare
    if not isinstance(spare, UnitPage):
        raise SystemExit("the page got no socket for images")
    while not spare.times_ns and not page.is_closed:
        page.wait(time.monotonic_ns() + WAIT_NS)
    print("ready", flush=True)
    while not page.is_closed and not select.select([sys.stdin], [], [], 0)[0]:
        page.say({"t": "ping", "c": 0})
        page.wait(time.monotonic_ns() + WAIT_NS)
    print("times", json.dumps(spare.times_ns).replace(" ", ""), flush=True)
    return int(page.is_closed)


if __name__ == "__main__":
    sys.exit(main())
