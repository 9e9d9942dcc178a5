"""An emulated rover on a TCP line: it sends values and pictures, and keeps each motion command."""

import base64
import io
import json
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, Self

from PIL import Image, ImageDraw

__all__ = ["Heard", "Rover"]

PROFILE = """\
urc: 1
kind: robot
name: rover
title: Rover
transports:
  wire:
    { type: tcp, host: 127.0.0.1, port: PORT, framing: { type: delimiter, tx: LF, rx: LF } }
signals:
  level: { type: integer, unit: "%", title: Battery }
  picture: { type: image, size: 2000000 }
messages:
  state: { json: { level: level, picture: picture } }
commands:
  go:
    send: "M {{ speed | round(2) }}"
    args: { speed: { min: -1, max: 1, default: 0, title: Speed } }
    hold: { repeat: 50ms, lease: 1s, release: { speed: 0 }, watchdog: none }
widgets:
  stick:
    use: joystick
    title: Drive
    bind: { moved: { command: go, args: { x: speed } } }
    options: { axes: x }
  level: { use: value, title: Battery, bind: { value: level } }
  camera: { use: camera, title: Camera, bind: { image: picture } }
interfaces:
  default:
    background: camera
    grid: |
      level .
      .     stick
"""
SIZE = (320, 240)
PICTURES = 8
PERIOD_S = 0.1
WAIT_S = 20.0


class Heard(NamedTuple):
    """A motion command, with the time of its arrival in seconds of the monotonic clock."""

    time_s: float
    speed: float


class Rover:
    """The rover, in threads of its own; it ends with the block."""

    def __init__(self) -> None:
        self.heard: list[Heard] = []
        self._changed = threading.Condition()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._lines: set[socket.socket] = set()

    def __enter__(self) -> Self:
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *error: object) -> None:
        self._listener.close()
        for line in tuple(self._lines):
            _shut(line)

    def profile(self, folder: Path) -> Path:
        """Write the rover's profile; return its file."""
        file = folder / "rover.yaml"
        port = self._listener.getsockname()[1]
        file.write_text(PROFILE.replace("PORT", str(port)), "utf-8")
        return file

    @property
    def speed(self) -> float:
        """Speed of the newest motion command."""
        return self.heard[-1].speed if self.heard else 0.0

    def wait_until_moving(self) -> None:
        """Wait for a motion command with a speed."""
        self._wait(lambda: self.speed != 0, "no motion arrived")

    def wait_until_stopped(self) -> float:
        """Wait for the stop; return the time of its arrival."""
        self._wait(lambda: self.speed == 0, "no stop arrived")
        moves = [place for place, one in enumerate(self.heard) if one.speed != 0]
        return self.heard[moves[-1] + 1].time_s if moves else 0.0

    def _wait(self, is_true: Callable[[], bool], what: str) -> None:
        with self._changed:
            assert self._changed.wait_for(is_true, WAIT_S), f"{what} within {WAIT_S:g} s"

    def _accept(self) -> None:
        with suppress(OSError):  # the listener has been closed
            while True:
                line, _ = self._listener.accept()
                self._lines.add(line)
                for work in (self._hear, self._say):
                    threading.Thread(target=work, args=(line,), daemon=True).start()

    def _hear(self, line: socket.socket) -> None:
        with suppress(OSError, ValueError), line.makefile("r", encoding="ascii") as words:
            for word, speed in (text.split() for text in words):
                assert word == "M"
                with self._changed:
                    self.heard.append(Heard(time.monotonic(), float(speed)))
                    self._changed.notify_all()
        self._lines.discard(line)
        _shut(line)

    def _say(self, line: socket.socket) -> None:
        pictures = [_picture(number) for number in range(PICTURES)]
        with suppress(OSError):  # the line has ended
            for count in range(10**9):
                state = {"level": 50 + count % 50, "picture": pictures[count % PICTURES]}
                line.sendall(json.dumps(state).encode() + b"\n")
                time.sleep(PERIOD_S)


def _picture(number: int) -> str:
    image = Image.new("RGB", SIZE, (40, 60, 80))
    left = number * SIZE[0] // PICTURES
    ImageDraw.Draw(image).rectangle((left, 40, left + 40, 200), fill=(200, 160, 40))
    file = io.BytesIO()
    image.save(file, "JPEG")
    return base64.b64encode(file.getvalue()).decode("ascii")


def _shut(line: socket.socket) -> None:
    with suppress(OSError):
        line.shutdown(socket.SHUT_RDWR)
    line.close()
