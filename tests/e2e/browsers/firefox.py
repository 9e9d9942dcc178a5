"""Firefox without windows, driven over WebDriver BiDi by Puppeteer.

Debian has no geckodriver, which Selenium needs for Firefox, and Playwright sends orders that the
ESR does not know.
"""

import json
import os
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO, Any, cast

from scripts.needs import NEEDS
from tests.e2e.browsers.window import Window

__all__ = ["firefox_window"]

ANSWER_S = 70.0
"""Above the limit in ``firefox.mjs``, whose message says more."""
END_S = 10.0
_PROGRAM = Path(__file__).with_name("firefox.mjs")
_FIREFOX, _NODE = (
    next(need for need in NEEDS if need.name == name) for name in ("firefox", "node")
)


class FirefoxWindow(Window):
    """The one page of a Firefox, behind a program that takes orders."""

    name = "Firefox"

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._orders = cast("IO[str]", process.stdin)
        self._answers: SimpleQueue[str] = SimpleQueue()
        threading.Thread(target=self._read, args=(process.stdout,), daemon=True).start()
        self.version = str(self._order("version")).partition("/")[2]

    def goto(self, address: str) -> None:
        self._order("goto", address)

    def evaluate(self, expression: str) -> Any:
        return self._order("evaluate", expression)

    def press(self, x: float, y: float) -> None:
        self._order("press", x, y)

    def move(self, x: float, y: float) -> None:
        self._order("move", x, y)

    def release(self) -> None:
        self._order("release")

    def resize(self, width: int, height: int) -> tuple[int, int]:
        self._order("resize", width, height)
        wide, high = self.evaluate("[innerWidth, innerHeight]")
        return wide, high

    def screenshot(self, file: Path) -> None:
        self._order("screenshot", str(file))

    def faults(self) -> list[str]:
        return list(self._order("faults"))

    def _order(self, name: str, *arguments: object) -> Any:
        self._orders.write(json.dumps({"do": name, "with": arguments}) + "\n")
        self._orders.flush()
        try:
            line = self._answers.get(timeout=ANSWER_S)
        except Empty:
            raise AssertionError(f"Firefox: no answer to {name} within {ANSWER_S:g} s") from None
        answer = json.loads(line)
        if "error" in answer:
            raise AssertionError(f"Firefox: {name}{arguments}: {answer['error']}")
        return answer["value"]

    def _read(self, answers: IO[str]) -> None:
        for line in answers:
            self._answers.put(line)
        self._answers.put('{"error": "the program has ended"}')


@contextmanager
def firefox_window(width: int = 1280, height: int = 800) -> Iterator[Window]:
    """Start a Firefox with one page of that size; it ends with the block."""
    node, firefox = _NODE.find() or "node", _FIREFOX.find() or "firefox-esr"
    with tempfile.TemporaryDirectory() as home:
        process = subprocess.Popen(
            [node, str(_PROGRAM), firefox, str(width), str(height)],
            env=os.environ | {"HOME": home},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            start_new_session=True,
        )
        try:
            yield FirefoxWindow(process)
        finally:
            _end(process)


def _end(process: "subprocess.Popen[str]") -> None:
    with suppress(BrokenPipeError):  # it has already ended
        cast("IO[str]", process.stdin).close()
    with suppress(subprocess.TimeoutExpired):
        process.wait(END_S)
    with suppress(ProcessLookupError):  # the usual case: the browser has ended with its program
        os.killpg(process.pid, 9)
    process.wait()
    cast("IO[str]", process.stdout).close()
