"""All shipped robots, each emulated by `urc demo`, in the window of any browser."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.e2e.browsers.scene import LIVE, until
from tests.e2e.browsers.window import Window
from tests.e2e.keys import with_key
from tests.e2e.processes import ROOT, UrcProcess

__all__ = ["ROBOTS", "Demo", "demo_in"]

ROBOTS = sorted(file.stem for file in (ROOT / "robots").glob("*.yaml"))
READY_S = 60.0
WHOLE = "[...document.querySelectorAll('[data-cell]')].every((one) => one.dataset.error === '')"


class Demo:
    """The dashboard of `urc demo`, with a browser that has its key."""

    def __init__(self, window: Window, address: str) -> None:
        self.window = window
        self._address = address

    def open_empty(self) -> None:
        """Open a page of the server with a word of text."""
        self.window.goto(f"{self._address}healthz")

    def open(self, robot: str) -> None:
        """Open the page of a robot; wait until it is live, and every widget in its place."""
        self.window.goto(f"{self._address}robots/{robot}/?interface=default")
        until(lambda: bool(self.window.evaluate(f"{LIVE} && {WHOLE}")), f"{robot} is live")


@contextmanager
def demo_in(window: Window, data: Path) -> Iterator[Demo]:
    """Start `urc demo`, and hand its key to the browser.

    Args:
        window: the browser.
        data: data folder of the demo, without the user's latched stops.
    """
    process = UrcProcess(("demo", "--no-browser", "--port", "0"), {"URC_DATA_DIR": str(data)})
    try:
        address = process.wait_for(r"dashboard (http://\S+)", READY_S)[1]
        window.goto(with_key(address))
        window.evaluate("localStorage.setItem('urc-hints', 'seen')")
        yield Demo(window, address)
    finally:
        process.kill()
