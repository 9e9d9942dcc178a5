"""A rover with a video, seen and driven in any browser: the stamp is read back from a screenshot.

ffmpeg films the test card of `tests.e2e.test_video_page` and sends it as H.264 over UDP.
"""

import signal
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final, NamedTuple

from PIL import Image

from tests.e2e.browsers.rover import Rover
from tests.e2e.browsers.scene import HELD_S, TRIES, Scene
from tests.e2e.browsers.window import Window
from tests.e2e.ports import free_port
from tests.e2e.test_video_page import BITS, H264, RATE, test_card

__all__ = ["MARGIN_S", "SIGHT_S", "VideoScene", "video_scene"]

SIGHT_S: Final = 0.8
"""`stop_after` of the rover: the age at which an image ends the motion, in seconds."""
MARGIN_S: Final = 0.3
"""Longest permitted time from that age until the stop, in seconds."""
PROFILE: Final = """\
urc: 1
kind: robot
name: rover
title: Rover
transports:
  wire:
    { type: tcp, host: 127.0.0.1, port: PORT, framing: { type: delimiter, tx: LF, rx: LF } }
  eye: { type: camera, url: "udp://127.0.0.1:EYE"MORE }
signals:
  level: { type: integer, unit: "%", title: Battery }
  front: { type: video, title: Front, stale_after: 2s }
messages:
  state: { from: wire, json: { level: level } }
  front: { from: eye, raw: front }
commands:
  go:
    to: wire
    send: "M {{ speed | round(2) }}"
    args: { speed: { min: -1, max: 1, default: 0, title: Speed } }
    hold:
      { repeat: 50ms, lease: 1s, release: { speed: 0 }, watchdog: none,
        sees: front, slow_after: 400ms, stop_after: 800ms }
widgets:
  front: { use: camera, title: Front, bind: { image: front } }
  stick:
    use: joystick
    title: Drive
    bind: { moved: { command: go, args: { x: speed } } }
    options: { axes: x }
interfaces:
  default:
    grid: |
      front front stick
"""
PLACE: Final = """(() => {
  const canvas = document.querySelector(".camera canvas");
  const { x, y, width, height } = canvas.getBoundingClientRect();
  return [x, y, width, height, canvas.width, canvas.height, innerWidth];
})()"""
SHOWN: Final = """(() => {
  const { state, frozen } = document.querySelector(".camera")?.dataset ?? {};
  return state === "live" && frozen !== "yes"
    && document.querySelector(".camera canvas").width === 320;
})()"""
TOO_OLD: Final = """document.querySelector(".joystick-note").textContent.includes("too old")"""


class Card(NamedTuple):
    """What a screenshot shows of the test card."""

    number: int
    colours: list[tuple[int, int, int]]
    """Colours of the three bars, from left to right."""


class FilmedRover(Rover):
    """A rover whose motion needs the video of its camera."""

    def __init__(self, eye: int, more: str = "") -> None:
        super().__init__()
        self._eye = eye
        self._more = more

    def profile(self, folder: Path) -> Path:
        """Write the rover's profile; return its file."""
        file = folder / "rover.yaml"
        port = self._listener.getsockname()[1]
        text = PROFILE.replace("PORT", str(port)).replace("EYE", str(self._eye))
        file.write_text(text.replace("MORE", self._more), "utf-8")
        return file


class VideoScene(Scene):
    """The page of a rover with a video, and the program that films."""

    def __init__(
        self, window: Window, rover: FilmedRover, folder: Path, command: Sequence[str]
    ) -> None:
        self._command = command
        self._film = subprocess.Popen(command, stdin=subprocess.DEVNULL)
        self._file = folder / "page.png"
        super().__init__(window, rover, folder)

    def close(self) -> None:
        """End the server and the film."""
        super().close()
        self._film.kill()
        self._film.wait()

    def card(self) -> Card:
        """Return the test card, as a screenshot of the whole page shows it."""
        x, y, width, height, columns, rows, wide = self.window.evaluate(PLACE)
        self.window.screenshot(self._file)
        with Image.open(self._file) as picture:
            page = picture.convert("RGB")
        ratio, scale = page.width / wide, min(width / columns, height / rows)
        left, top = x + (width - scale * columns) / 2, y + (height - scale * rows) / 2

        def at(column: int, row: int) -> tuple[int, int, int]:
            place = round(ratio * (left + scale * column)), round(ratio * (top + scale * row))
            red, green, blue = page.getpixel(place)  # type: ignore[misc]
            return red, green, blue

        bits = [at(16 + 32 * bit, 60)[1] > 128 for bit in range(BITS)]
        number = sum(2**bit for bit, is_set in enumerate(bits) if is_set)
        return Card(number, [at(53 + 106 * place, 160) for place in range(3)])

    # -- what an operator sees and does

    def sees_the_present(self) -> None:
        """The stamp grows with the time, and the colours are right."""
        self.until(SHOWN)
        time.sleep(1.0)  # what waited meanwhile comes in a burst
        began_s, first, since_s = time.monotonic(), self.card(), time.monotonic()
        time.sleep(1.0)
        least_s = time.monotonic() - since_s
        second, most_s = self.card(), time.monotonic() - began_s
        for card in (first, second):
            for place, colour in enumerate(card.colours):
                assert colour[place] > 190, card
                assert sum(colour) - colour[place] < 130, card
        shown = (second.number - first.number) % 2**BITS
        # A screenshot takes up to seconds, and shows any moment of them.
        most = RATE * most_s + RATE / 2
        assert RATE * least_s - RATE / 2 <= shown <= most, f"{shown} images in {most_s:.2f} s"

    def is_locked_by_a_freeze(self) -> float:
        """Freeze the film while driving; return the time until the rover's stop, in seconds."""
        self.until(SHOWN)
        for _ in range(TRIES):
            self.push()
            time.sleep(HELD_S / 2)
            since_s = time.monotonic()
            self._film.send_signal(signal.SIGSTOP)
            try:
                late_s = self.rover.wait_until_stopped() - since_s
                if late_s > 0:  # otherwise, a busy machine has ended the gesture before
                    self.until(TOO_OLD)
                    return late_s
            finally:
                self._film.send_signal(signal.SIGCONT)
                self.window.release()
        raise AssertionError(f"a held stick stopped: {self.said()}")

    def restarts_film(self) -> None:
        """End the film, wait until the page says that its image is old, and start another film."""
        self._film.kill()
        self._film.wait()
        self.until(f"!{SHOWN}")
        self._film = subprocess.Popen(self._command, stdin=subprocess.DEVNULL)


@contextmanager
def video_scene(
    window: Window, folder: Path, codec: Sequence[str] = H264, more: str = ""
) -> Iterator[VideoScene]:
    """Serve the rover with its film, and open its page.

    Args:
        window: the browser.
        folder: place of the profile and the data.
        codec: ffmpeg's arguments for the codec.
        more: further keys of the camera's transport, such as ``, transcode: h264``.
    """
    eye = free_port()
    with (
        FilmedRover(eye, more) as rover,
        closing(VideoScene(window, rover, folder, test_card(eye, *codec))) as scene,
    ):
        scene.open()
        yield scene
