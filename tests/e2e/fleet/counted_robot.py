"""A robot in the test's process that counts what reaches it, and its document."""

import socketserver
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

__all__ = ["NAME", "CountedRobot"]

NAME: Final = "cart"
_WAIT_S: Final = 10.0
_DOCUMENT: Final = """\
urc: 1
kind: robot
name: cart
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: PORT
    framing: { type: delimiter, tx: LF, rx: LF }
    stale_after: 60s
signals:
  speed: { type: number, unit: m/s }
messages:
  said: { regex: '^v (?P<speed>[0-9.]+)$' }
commands:
  horn:
    send: "horn"
  drive:
    args: { speed: { type: number, min: 0, max: 1, default: 0 } }
    send: "drive {{ speed }}"
    hold: { repeat: 50ms, release: { speed: 0 } }
polls:
  - { every: 200ms, send: "v?" }
"""


class CountedRobot:
    """A robot that honks and drives; it answers the question for its speed."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.heard: list[str] = []
        """All lines so far, without the question for the speed."""

    @classmethod
    @contextmanager
    def running(cls) -> Iterator["CountedRobot"]:
        """Run the robot on a free port of this computer while the context is open."""

        class Talk(socketserver.StreamRequestHandler):
            def handle(self) -> None:
                for line in self.rfile:
                    text = line.decode().strip()
                    if text == "v?":
                        self.wfile.write(b"v 0\n")
                    else:
                        robot.heard.append(text)

        with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Talk) as server:
            server.daemon_threads = True
            robot = cls(server.server_address[1])
            thread = threading.Thread(target=server.serve_forever)
            thread.start()
            try:
                yield robot
            finally:
                server.shutdown()
                thread.join()

    def document(self, folder: Path) -> str:
        """Write the robot's document, and return its path."""
        file = folder / f"{NAME}.yaml"
        file.write_text(_DOCUMENT.replace("PORT", str(self.port)), encoding="utf-8")
        return str(file)

    def hears(self, *lines: str) -> None:
        """Wait until the robot has heard as many lines, and check that it has heard these."""
        end_s = time.monotonic() + _WAIT_S
        while len(self.heard) < len(lines) and time.monotonic() < end_s:
            time.sleep(0.01)
        assert self.heard == [*lines]
