"""An engine under test: a clock of its own, a transport that always connects, and a memory.

Floor 4, no I/O and no asyncio. Everything that the engine does is kept until a test asks for it.
"""

import json
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final, Literal

from urc.model.codec import NUMBERED, Counted, Envelope, Payload
from urc.model.driver import Command, Driver, Poll
from urc.model.profile import Fed
from urc.model.values import Reading, Sample, Value
from urc.problems import UrcError
from urc.protocol.answer import Matcher
from urc.protocol.encode import BadArgument
from urc.protocol.engine import Engine
from urc.protocol.events import (
    Close,
    Event,
    Failed,
    Fault,
    Open,
    Replied,
    Request,
    Samples,
    Send,
)
from urc.protocol.exchange import LineEvent
from urc.protocol.fresh import FIXED_UNIX_S, Fresh, fixed_bytes
from urc.protocol.messages import Messages
from urc.protocol.readings import Decode

__all__ = ["Exercised", "Kind", "Trial", "encoded"]

Kind = Literal["command", "poll", "message"]
Exercised = tuple[Kind, str]
"""What a test can exercise: what it is, and its name."""
_TWO_PEOPLE: Final = ("who wrote the test", "who runs it")
"""A test is about the wire: whatever must be confirmed is."""
_BRINGS_OBJECTS: Final = frozenset(("rosbridge",))
"""Types of transports whose messages are data; the others bring bytes."""
_MOST_TICKS: Final = 20_000
"""Deadlines that may pass while a test waits."""


class _Watched(Engine):
    """An engine that remembers which commands it ran, and which messages frames were."""

    def __init__(self, driver: Driver, settings: Mapping[str, Value], fresh: Fresh) -> None:
        super().__init__(driver, settings, fresh=fresh)
        self.used: set[Exercised] = set()
        for name, line in self.lines.items():
            names = [one.name for one in driver.messages.values() if one.transport == name]
            line.inbox.messages = Messages(
                [
                    Matcher(one.reader, partial(self._decode, message, one.decode))
                    for message, one in zip(names, line.inbox.messages.declared, strict=True)
                ]
            )

    def _decode(
        self, name: str, decode: Decode, found: Mapping[str, object], now: float
    ) -> tuple[list[Sample], list[str]]:
        self.used.add(("message", name))
        return decode(found, now)

    def run(self, command: str, *given: Any, **beside: Any) -> list[LineEvent]:
        self.used.add(("command", command))
        return super().run(command, *given, **beside)


class Trial:
    """One test at work.

    Raises:
        UrcError: from every method, for what cannot be done; the message is for people.
    """

    def __init__(
        self, driver: Driver, settings: Mapping[str, Value], polls: Sequence[Poll] = ()
    ) -> None:
        """Prepare.

        Args:
            driver: with the polls that the test is about.
            settings: value of every setting.
            polls: all polls there are.
        """
        self.driver = driver
        self.settings = settings
        self.polls = polls
        self.engine = _Watched(
            driver, settings, Fresh(lambda: FIXED_UNIX_S + self.now, fixed_bytes)
        )
        self.now = 0.0
        """Seconds on the test's own clock."""
        self.samples: dict[str, Sample] = {}
        self.fresh: set[str] = set()
        """Signals that were set since `forget`."""
        self.fed: dict[str, bytes] = {}
        """Transport → all that the robot said on it since it was connected."""
        self.sent: dict[str, list[Payload]] = {}
        """Transport → what was sent and not yet looked at."""
        self.failures: list[str] = []
        self.ended: list[Replied | Failed] = []
        """Commands that are over, as long as nobody asked about them."""
        self.closed: set[str] = set()
        """Transports that were closed from this side, as long as nobody asked."""
        self._requests = 0
        self.engine.motions.on_refused = self._refused
        self._numbers: dict[str, list[object]] = {}
        """Transport → numbers of the requests that no response answers so far."""

    @property
    def used(self) -> set[Exercised]:
        """The commands, polls and messages that were used."""
        return self.engine.used

    def begin(self) -> None:
        """Connect every line that stays open."""
        self.perform(self.engine.tick(self.now))
        for name, spec in self.driver.transports.items():
            if spec.connection == "persistent":
                self.connect(name)

    def connect(self, transport: str) -> None:
        """Let a line be connected."""
        self.fed.pop(transport, None)
        self._numbers.pop(transport, None)
        self.perform(self.engine.start(transport, self.now))

    def close(self, transport: str) -> None:
        """Let the robot end a connection."""
        self.perform(self.engine.closed(transport, "", self.now))

    def leave(self) -> None:
        """Let the operator go."""
        self.perform(self.engine.finish(self.now))

    def run(self, command: str, arguments: Mapping[str, Reading]) -> None:
        """Run a command; one that is held is given once, as the first frame of a gesture is."""
        self._requests += 1
        known = self.driver.commands.get(command)
        if known is not None and known.hold is not None:
            self._give(known, arguments)
            return
        request = Request(self._requests, command, arguments, confirmed_by=_TWO_PEOPLE)
        self.perform(self.engine.command(request, self.now))

    def _give(self, command: Command, arguments: Mapping[str, Reading]) -> None:
        """Send a frame of motion: it passes the queue, waits for no answer, and may be refused."""
        name, number = command.name, self._requests
        self.used.add(("command", name))
        try:
            made = self.engine.motions.motion_frame(name, arguments, self.now, _TWO_PEOPLE)
        except UrcError as error:
            code = "bad-argument" if isinstance(error, BadArgument) else "not-allowed"
            self._failed(Failed(number, name, code, str(error)))
            return
        data = made.numbered.data if isinstance(made, Counted) else made
        if data == b"":
            text = "it waits for an answer that the robot owes"
            self._failed(Failed(number, name, "not-allowed", text))
            return
        self.perform([Send(command.transport, data), Replied(number, name, {})])

    def _refused(self, command: str, why: str) -> None:
        """Take note that the robot refuses motion."""
        self._failed(Failed(self._requests, command, "refused", why))

    def _failed(self, failed: Failed) -> None:
        self.failures.append(f"{failed.code}: {failed.message}")
        self.ended.append(failed)

    def feed(self, transport: str, piece: Fed) -> None:
        """Let the robot say something."""
        data: Payload
        if isinstance(piece, Envelope):
            data = self._envelope(transport, piece)
            self.fed.setdefault(transport, b"")
        else:
            data = encoded(piece, self.driver, transport)
            self.fed[transport] = self.fed.get(transport, b"") + data
        self.perform(self.engine.receive(transport, data, self.now))

    def _envelope(self, transport: str, piece: Envelope) -> Envelope:
        """Return what the transport would bring: an answer has the number of its request."""
        body = piece.body
        if body is not None and self.driver.transports[transport].type not in _BRINGS_OBJECTS:
            body = body if isinstance(body, bytes) else json.dumps(body).encode()
        attributes = dict(piece.attributes)
        if piece.verb in ("response", "feedback"):
            numbers = self._numbers.get(transport, [])
            if not numbers:
                raise UrcError(f"{transport}: nothing waits for this {piece.verb}")
            number = numbers.pop(0) if piece.verb == "response" else numbers[0]
            attributes = {"ok": True, **attributes, "id": number}
        return Envelope(piece.verb, attributes, body)

    def fall_silent(self) -> None:
        """Let as much time pass as ends a frame that silence ends."""
        for name in self.fed:
            due = self.engine.lines[name].inbox.decoder.deadline
            if due is not None:
                self.now = max(self.now, due)
                self.perform(self.engine.tick(self.now))

    def wait(self, seconds: float) -> None:
        """Let time pass, and everything happen that is due in it."""
        end = self.now + seconds
        for _ in range(_MOST_TICKS):
            if not self.pass_to_deadline(end):
                self.now = end
                return
        raise UrcError(f"more than {_MOST_TICKS} things are due within {seconds:g} s")

    def pass_to_deadline(self, end: float = float("inf")) -> bool:
        """Let time pass to the next thing that is due until `end`; return whether there is one."""
        due = self.engine.deadline
        if due is None or due > end:
            return False
        self.now = max(self.now, due)
        self.perform(self.engine.tick(self.now))
        return True

    def perform(self, events: list[Event]) -> None:
        """Do what a link would do."""
        for poll in self.driver.polls:
            if self.engine.lines[poll.transport].has(poll.name) or poll.reply is None:
                self.used.add(("poll", poll.name))
        for event in events:
            match event:
                case Open(transport):
                    self.connect(transport)
                case Send(transport, data):
                    self.sent.setdefault(transport, []).append(data)
                    if isinstance(data, Envelope) and data.verb in NUMBERED:
                        number = data.attributes.get("id")  # motion by requests has none
                        self._numbers.setdefault(transport, []).append(number)
                case Samples(_, samples):
                    self.samples.update((sample.signal, sample) for sample in samples)
                    self.fresh.update(sample.signal for sample in samples)
                case Fault(_, code, message):
                    self.failures.append(f"{code}: {message}")
                case Failed():
                    self._failed(event)
                case Replied():
                    self.ended.append(event)
                case Close(transport, reason):
                    self.closed.add(transport)
                    if reason:
                        self.failures.append(f"closed: {reason}")

    def forget(self) -> None:
        """Begin to keep anew which signals are set."""
        self.fresh.clear()


def encoded(text: str | bytes, driver: Driver, transport: str) -> bytes:
    """Return text in the encoding of its line; raise `UrcError` when it cannot be written."""
    if isinstance(text, bytes):
        return text
    spec = driver.transports[transport]
    try:
        return text.encode(spec.encoding)
    except UnicodeEncodeError as error:
        wrong = text[error.start : error.end]
        raise UrcError(f"{spec.name}: {wrong!r} cannot be written in {spec.encoding}") from error
