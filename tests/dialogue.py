"""A conversation with an engine, made from a document: what is said, what is sent, what is told."""

import os
import tempfile
from pathlib import Path

from urc.config.load import check
from urc.model.driver import Driver
from urc.model.values import Value
from urc.problems import to_text
from urc.protocol.engine import Engine
from urc.protocol.events import (
    Close,
    Event,
    Failed,
    MotionEvent,
    MotionReady,
    MotionRefused,
    NumbersUsed,
    Open,
    Replied,
    Request,
    Samples,
    Send,
    Violation,
)
from urc.registry import Registries, Table
from urc.runtime.registries import built_in_catalog

__all__ = ["Dialogue", "driver_of"]

HEAD = """
urc: 1
kind: driver
name: talker
"""
WIRE = """
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    framing: { type: delimiter, tx: LF, rx: LF }
    timeouts: { connect: 1s, reply: 500ms }
"""


def driver_of(text: str) -> Driver:
    """Return the driver in a document; without `transports` it has one, called wire.

    Keys of that transport may be given in lines that begin with ``wire:``, such as
    ``wire: min_gap: 100ms``.
    """
    lines = text.splitlines()
    own = "".join(f"    {line[5:].strip()}\n" for line in lines if line.startswith("wire:"))
    rest = "\n".join(line for line in lines if not line.startswith("wire:"))
    head = HEAD if "transports:" in rest else HEAD + WIRE + own
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "talker.yaml"
        path.write_text(head + rest, "utf-8")
        catalog = built_in_catalog()
        lines_to = Table("urc.transports", {"tcp": "x:x", "pigeon": "x:x"})
        checked = check(os.fspath(path), Registries(lines_to, catalog.framings))
    if checked.profile is None:
        raise AssertionError("\n".join(map(to_text, checked.problems)))
    return checked.profile.driver


class Dialogue:
    """One engine, and everything that it said."""

    def __init__(self, text: str, settings: dict[str, Value] | None = None) -> None:
        self.engine = Engine(driver_of(text), settings or {})
        self.now = 0.0
        self.outcomes: dict[int, str] = {}
        """Request → ``done``, or the code of its failure."""
        self.messages: list[str] = []
        """What failures and faults say."""
        self.values: dict[str, object] = {}
        """Newest reading of each signal."""
        self.replies: dict[int, dict[str, object]] = {}
        self.faults: list[str] = []
        self.links: list[str] = []
        """``open`` and ``close``, with the reason."""
        self.motion: list[MotionEvent] = []
        """Events of held commands."""
        self._sent: list[str] = []
        self._requests = 0

    @property
    def sent(self) -> list[str]:
        """The frames sent since this was last asked."""
        sent, self._sent = self._sent, []
        return sent

    def connect(self, *transports: str) -> "Dialogue":
        """Let every persistent line, or those named, be connected."""
        self.take(self.engine.tick(self.now))
        for name in transports or ("wire",):
            self.take(self.engine.start(name, self.now))
        return self

    def says(self, *frames: str, on: str = "wire") -> None:
        """Let the robot say `frames`, all in one chunk."""
        data = "".join(f"{frame}\n" for frame in frames).encode("latin-1")
        self.take(self.engine.receive(on, data, self.now))

    def raw(self, data: bytes, on: str = "wire") -> None:
        """Let bytes come in."""
        self.take(self.engine.receive(on, data, self.now))

    def run(self, command: str, **arguments: Value) -> int:
        """Run a command; return its number."""
        self._requests += 1
        request = Request(self._requests, command, arguments)
        self.take(self.engine.command(request, self.now))
        return self._requests

    def at(self, time: float) -> "Dialogue":
        """Let time pass, stopping wherever the engine wants to be called."""
        for _ in range(1000):
            deadline = self.engine.deadline
            if deadline is None or deadline > time:
                self.now = time
                return self
            self.now = max(self.now, deadline)
            self.take(self.engine.tick(self.now))
        raise AssertionError("the engine wants to be called for ever")

    def take(self, events: list[Event]) -> None:
        """Note what the engine says."""
        for event in events:
            match event:
                case Send(_, data):
                    self._sent.append(data.decode("latin-1").removesuffix("\n"))
                case Samples(_, samples):
                    self.values |= {one.signal: one.value for one in samples}
                case Replied(number, _, values):
                    self._end(number, "done")
                    self.replies[number] = dict(values)
                case Failed(number, _, code, message):
                    self._end(number, code)
                    self.messages.append(message)
                case NumbersUsed() | MotionReady() | MotionRefused():
                    self.motion.append(event)
                case Violation(_, code, message):
                    self.faults.append(code)
                    self.messages.append(message)
                case Open(name):
                    self.links.append(f"open {name}")
                case Close(name, reason):
                    self.links.append(f"close {name}: {reason}" if reason else f"close {name}")

    def _end(self, number: int, outcome: str) -> None:
        if number in self.outcomes:
            raise AssertionError(f"request {number} ended twice")
        self.outcomes[number] = outcome
