"""What an operator does on the page of a rover, in any browser; each step fails if it fails."""

import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from tests.e2e.browsers.rover import Rover
from tests.e2e.browsers.window import Window
from tests.e2e.processes import UrcProcess
from urc.access.grants import parse_grant
from urc.access.store import AccessStore

__all__ = ["LEASE_S", "NARROW", "THEMES", "Scene", "until"]

WAIT_S = 30.0
LEASE_S = 1.0
"""Lease of the rover's motion command: a later stop is not that of the release."""
TRIES = 3
"""A busy machine may end a gesture, as it ends one of an operator."""
HELD_S = 1.5
PUSH = 60
THEMES = ("light", "dark", "sunlight", "night")
NARROW = (390, 844)
STICK = ".joystick-pad"
STOP = "[data-stop-button]"
RESET = "[data-verb='reset']"
LIVE = "document.querySelector('[data-badge]')?.dataset.state === 'good'"
PICTURE = "document.querySelector('.camera')?.dataset.state === 'live'"
# Mean colour of the camera's left half: it changes with each picture of the rover.
COLOUR = """(() => {
  const canvas = document.querySelector(".camera canvas");
  const [width, height] = [Math.ceil(canvas.width / 2), canvas.height];
  const pen = new OffscreenCanvas(width, height).getContext("2d");
  pen.drawImage(canvas, 0, 0);
  const { data } = pen.getImageData(0, 0, width, height);
  let sum = 0;
  for (let at = 0; at < data.length; at += 4) sum += data[at];
  return Math.round((400 * sum) / data.length);
})()"""
LEVEL = "document.querySelector('[data-cell] .value')?.textContent ?? ''"
WIDTHS = "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"


class Scene:
    """A rover, its server as a process, and one browser that is signed in."""

    def __init__(self, window: Window, rover: Rover, folder: Path) -> None:
        self.window = window
        self.rover = rover
        self._folder = folder
        self._data = folder / "data"
        self._profile = rover.profile(folder)
        cookie = self._sign_in()
        self._process = self._serve(0)
        self._address = self._process.wait_for(r"dashboard (http://[^/\s]+)")[1]
        window.goto(f"{self._address}/healthz")
        window.evaluate(f"document.cookie = '{cookie}; path=/'")

    def close(self) -> None:
        """End the server."""
        self._process.kill()

    def open(self) -> None:
        """Open the rover's page, without the hints of a first visit."""
        self.window.evaluate("localStorage.setItem('urc-hints', 'seen')")
        self.window.goto(f"{self._address}/robots/rover/")
        self.until(LIVE)

    def kill(self) -> None:
        """Kill the server."""
        self._process.kill()

    def restart(self) -> None:
        """Start the server again, at the same address."""
        self._process = self._serve(int(self._address.rpartition(":")[2]))
        self._process.wait_for("dashboard ")

    def until(self, expression: str) -> None:
        """Wait until an expression is true in the page."""
        until(lambda: bool(self.window.evaluate(expression)), expression)

    def centre(self, selector: str) -> tuple[float, float]:
        """Return the middle of an element."""
        x, y = self.window.evaluate(
            f"(({{ x, y, width, height }}) => [x + width / 2, y + height / 2])"
            f'(document.querySelector("{selector}").getBoundingClientRect())'
        )
        return x, y

    def tap(self, selector: str) -> None:
        """Press an element with the pointer, and release."""
        self.window.press(*self.centre(selector))
        self.window.release()

    # -- what an operator does

    def sees_pictures_and_values(self) -> None:
        """Wait for changing pictures and values."""
        self.until(PICTURE)
        for what in (COLOUR, LEVEL):
            first = self.window.evaluate(what)
            self.until(f"({what}) !== {first!r}")
        assert "%" in self.window.evaluate(LEVEL)

    def push(self) -> None:
        """Push the stick, and keep hold of it until the rover moves."""
        x, y = self.centre(STICK)
        for attempt in range(TRIES):
            self.window.press(x, y)
            self.window.move(x, y - PUSH / 2)
            self.window.move(x, y - PUSH)
            try:
                return self.rover.wait_until_moving()
            except AssertionError:
                self.window.release()
                if attempt == TRIES - 1:
                    raise
        raise AssertionError

    def let_go(self) -> float:
        """Release the stick; return the time until the rover's stop, in seconds."""
        since_s = time.monotonic()
        self.window.release()
        return self.rover.wait_until_stopped() - since_s

    def drives(self) -> float:
        """Drive for longer than the lease, and let go; return the time until the stop."""
        for _ in range(TRIES):
            self.push()
            time.sleep(HELD_S)
            late_s = self.let_go()
            if late_s > 0:  # otherwise it stopped before the release
                return late_s
        raise AssertionError(f"a held stick stopped: {self.said()}")

    def said(self) -> list[str]:
        """Return what the page says about driving."""
        texts: list[str] = self.window.evaluate(
            "[...document.querySelectorAll('[data-who], [data-note], .joystick-note, .urc-log li')]"
            ".map((one) => one.textContent.trim()).filter(Boolean)"
        )
        return texts

    def stops_and_resets(self) -> None:
        """Press STOP while driving; nothing moves before a reset."""
        self.push()
        self.window.release()
        self.tap(STOP)
        self.until("!document.querySelector('[data-latched]').hidden")
        self.rover.wait_until_stopped()
        count = len(self.rover.heard)
        x, y = self.centre(STICK)
        self.window.press(x, y)
        self.window.move(x, y - PUSH)
        time.sleep(LEASE_S / 2)
        self.window.release()
        assert not any(one.speed for one in self.rover.heard[count:]), "it moved when stopped"
        self.until(f'!document.querySelector("{RESET}").hidden')
        self.tap(RESET)
        self.until("document.querySelector('[data-latched]').hidden")
        self.drives()

    def is_lost_and_back(self) -> None:
        """Kill the server and start it: the page shows both, and drives again."""
        self.kill()
        self.until("document.querySelector('[data-badge]').dataset.state === 'bad'")
        text = self.window.evaluate("document.querySelector('[data-badge-text]').textContent")
        assert text == "No connection to URC"
        self.restart()
        self.until(LIVE)
        self.sees_pictures_and_values()
        self.drives()

    def shows_each_theme(self) -> None:
        """Choose each theme; each colours the page in its own way."""
        grounds: dict[str, Any] = {}
        self.tap("[popovertarget='device']")
        for theme in THEMES:
            self.tap(f"label:has([data-theme-choice][value='{theme}'])")
            self.until(f"document.documentElement.dataset.theme === '{theme}'")
            grounds[theme] = self.window.evaluate("getComputedStyle(document.body).backgroundColor")
        self.tap("label:has([data-theme-choice][value='light'])")
        self.tap("[popovertarget='device']")
        assert len(set(grounds.values())) == len(THEMES), grounds

    def fits(self, width: int, height: int) -> tuple[int, int]:
        """Set the size of the page, or the narrowest above it; nothing scrolls sideways."""
        size = self.window.resize(width, height)
        self.until(f"innerWidth === {size[0]}")
        content, shown = self.window.evaluate(WIDTHS)
        assert content <= shown, f"{content} px wide on {shown} px"
        return size

    # -- inside

    def _serve(self, port: int) -> UrcProcess:
        arguments = ("serve", str(self._profile), "--port", str(port))
        return UrcProcess((*arguments, "--data-dir", str(self._data)), {})

    def _sign_in(self) -> str:
        """Return a cookie that is valid after a restart of the server."""
        with closing(AccessStore(self._data)) as store:
            now = time.time()
            person = store.add("person", "Ada", [parse_grant("drive")], now=now)
            _, secret = store.open_sign_in(person.id, "passphrase", now=now)
            return f"urc-sign-in-{store.instance()}={secret}"


def until(is_true: Callable[[], bool], what: str) -> None:
    """Wait for something that a browser shows."""
    end_s = time.monotonic() + WAIT_S
    while not is_true():
        assert time.monotonic() < end_s, f"not within {WAIT_S:g} s: {what}"
        time.sleep(0.05)
