"""An engine under test, with a simulated clock and transports that always connect.

Layer 4. The module uses neither I/O nor asyncio. All of the engine's output is collected for the
test.
"""

import json
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final, Literal

from urc.model.driver import Command, Driver, Poll
from urc.model.payload import NUMBERED, CountedFrame, Envelope, Payload
from urc.model.profile import Fed
from urc.model.values import Reading, Sample, Value
from urc.problems import UrcError
from urc.protocol.engine import Engine
from urc.protocol.events import (
    Close,
    Event,
    Failed,
    MotionRefused,
    Open,
    Replied,
    Request,
    Samples,
    Send,
    Violation,
)
from urc.protocol.forms.topics import namespace_of
from urc.protocol.readings.readings import Decode
from urc.protocol.requests.encode import BadArgument
from urc.protocol.requests.exchange import LineEvent
from urc.protocol.requests.messages import Messages
from urc.protocol.requests.reply_match import Matcher
from urc.protocol.values.time_and_nonce import FIXED_UNIX_S, TimeAndNonce, fixed_bytes
from urc.ros_names import resolved_name

__all__ = ["Exercised", "Kind", "TestEngine", "encoded"]

Kind = Literal["command", "poll", "message"]
Exercised = tuple[Kind, str]
"""Kind and name of a command, poll or message that a test can use."""
_TWO_PEOPLE: Final = ("author of the test", "operator")
"""Names of two people who confirm every command, so that tests can run any command."""
_BRINGS_OBJECTS: Final = frozenset(("ros",))
"""Transport types whose messages are objects; all other types transfer bytes."""
_MOST_TICKS: Final = 20_000
"""Maximum number of deadlines to handle during one wait in a test."""


class _RecordingEngine(Engine):
    """An engine that records its commands and the messages of decoded frames."""

    def __init__(self, driver: Driver, settings: Mapping[str, Value], fresh: TimeAndNonce) -> None:
        super().__init__(driver, settings, fresh=fresh)
        self.used: set[Exercised] = set()
        for name, line in self.lines.items():
            names = [one.name for one in driver.messages.values() if one.transport == name]
            line.receiver.messages = Messages(
                [
                    Matcher(one.reader, partial(self._decode, message, one.decode))
                    for message, one in zip(names, line.receiver.messages.declared, strict=True)
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


class TestEngine:
    """One running test.

    Raises:
        UrcError: an action is impossible; any method may raise this error, and the message is for
            display.
    """

    def __init__(
        self, driver: Driver, settings: Mapping[str, Value], polls: Sequence[Poll] = ()
    ) -> None:
        """Prepare the test.

        Args:
            driver: driver with only the polls that the test names.
            settings: a value for every setting.
            polls: all polls of the document.
        """
        self.driver = driver
        self.settings = settings
        self.polls = polls
        self.engine = _RecordingEngine(
            driver, settings, TimeAndNonce(lambda: FIXED_UNIX_S + self.now, fixed_bytes)
        )
        self.now = 0.0
        """Simulated time, in seconds."""
        self.samples: dict[str, Sample] = {}
        self.fresh: set[str] = set()
        """Names of the signals set since the last call to `forget`."""
        self.fed: dict[str, bytes] = {}
        """All bytes that the test has fed since the connection was opened, by transport."""
        self.sent: dict[str, list[Payload]] = {}
        """Sent payloads that no check has read yet, by transport."""
        self.failures: list[str] = []
        self.ended: list[Replied | Failed] = []
        """Finished commands that no check has read yet."""
        self.closed: set[str] = set()
        """Transports that the engine has closed and that no check has read yet."""
        self._requests = 0
        self._numbers: dict[str, list[object]] = {}
        """Numbers of the unanswered requests, by transport."""

    @property
    def used(self) -> set[Exercised]:
        """Commands, polls and messages used by the test."""
        return self.engine.used

    def connect_lines(self) -> None:
        """Connect every persistent transport."""
        self.perform(self.engine.tick(self.now))
        for name, spec in self.driver.transports.items():
            if spec.connection == "persistent":
                self.connect(name)

    def connect(self, transport: str) -> None:
        """Connect a transport."""
        self.fed.pop(transport, None)
        self._numbers.pop(transport, None)
        self.perform(self.engine.start(transport, self.now))

    def close(self, transport: str) -> None:
        """Close a connection as if the robot had closed it."""
        self.perform(self.engine.closed(transport, "", self.now))

    def leave(self) -> None:
        """Start an orderly close of all connections."""
        self.perform(self.engine.finish(self.now))

    def run(self, command: str, arguments: Mapping[str, Reading]) -> None:
        """Run a command; for a held command, send the first frame of a gesture."""
        self._requests += 1
        known = self.driver.commands.get(command)
        if known is not None and known.hold is not None:
            self._send(known, arguments)
            return
        request = Request(self._requests, command, arguments, confirmed_by=_TWO_PEOPLE)
        self.perform(self.engine.command(request, self.now))

    def _send(self, command: Command, arguments: Mapping[str, Reading]) -> None:
        """Send a motion frame, which bypasses the queue and waits for no reply."""
        name, number = command.name, self._requests
        self.used.add(("command", name))
        try:
            made = self.engine.motions.motion_frame(name, arguments, self.now, _TWO_PEOPLE)
        except UrcError as error:
            code = "bad-argument" if isinstance(error, BadArgument) else "not-allowed"
            self._failed(Failed(number, name, code, str(error)))
            return
        data = made.numbered.data if isinstance(made, CountedFrame) else made
        if data == b"":
            text = "the command is waiting for an outstanding reply"
            self._failed(Failed(number, name, "not-allowed", text))
            return
        self.perform([Send(command.transport, data), Replied(number, name, {})])

    def _failed(self, failed: Failed) -> None:
        self.failures.append(f"{failed.code}: {failed.message}")
        self.ended.append(failed)

    def feed(self, transport: str, piece: Fed) -> None:
        """Pass data to the engine as if the robot had sent it."""
        data: Payload
        if isinstance(piece, Envelope):
            data = self._envelope(transport, piece)
            self.fed.setdefault(transport, b"")
        else:
            data = encoded(piece, self.driver, transport)
            self.fed[transport] = self.fed.get(transport, b"") + data
        self.perform(self.engine.receive(transport, data, self.now))

    def _envelope(self, transport: str, piece: Envelope) -> Envelope:
        """Return the message as a transport delivers it.

        A response includes its request's number. Relative names of ROS are in the namespace.
        """
        body = piece.body
        if body is not None and self.driver.transports[transport].type not in _BRINGS_OBJECTS:
            body = body if isinstance(body, bytes) else json.dumps(body).encode()
        attributes = dict(piece.attributes)
        namespace = namespace_of(self.driver.transports[transport], self.settings)
        for name in ("topic", "action"):
            if isinstance(attributes.get(name), str):
                attributes[name] = resolved_name(str(attributes[name]), namespace)
        if piece.verb in ("response", "feedback"):
            numbers = self._numbers.get(transport, [])
            if not numbers:
                raise UrcError(f"{transport}: no pending request for this {piece.verb}")
            number = numbers.pop(0) if piece.verb == "response" else numbers[0]
            attributes = {"ok": True, **attributes, "id": number}
        return Envelope(piece.verb, attributes, body)

    def fall_silent(self) -> None:
        """On each transport with fed data, advance the time until silence ends the frame."""
        for name in self.fed:
            due = self.engine.lines[name].receiver.decoder.deadline
            if due is not None:
                self.now = max(self.now, due)
                self.perform(self.engine.tick(self.now))

    def wait(self, seconds: float) -> None:
        """Advance the simulated time and handle all due deadlines."""
        end = self.now + seconds
        for _ in range(_MOST_TICKS):
            if not self.pass_to_deadline(end):
                self.now = end
                return
        raise UrcError(f"more than {_MOST_TICKS} deadlines are due within {seconds:g} s")

    def pass_to_deadline(self, end: float = float("inf")) -> bool:
        """Advance to the next deadline up to `end`; return False if there is no such deadline."""
        due = self.engine.deadline
        if due is None or due > end:
            return False
        self.now = max(self.now, due)
        self.perform(self.engine.tick(self.now))
        return True

    def perform(self, events: list[Event]) -> None:
        """Execute events as a dispatcher would."""
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
                        number = data.attributes.get("id")  # motion requests have no number
                        self._numbers.setdefault(transport, []).append(number)
                case Samples(_, samples):
                    self.samples.update((sample.signal, sample) for sample in samples)
                    self.fresh.update(sample.signal for sample in samples)
                case Violation(_, code, message):
                    self.failures.append(f"{code}: {message}")
                case Failed():
                    self._failed(event)
                case MotionRefused(_, command, why):
                    self._failed(Failed(self._requests, command, "refused", why))
                case Replied():
                    self.ended.append(event)
                case Close(transport, reason):
                    self.closed.add(transport)
                    if reason:
                        self.failures.append(f"closed: {reason}")

    def forget(self) -> None:
        """Forget which signals have been set so far."""
        self.fresh.clear()


def encoded(text: str | bytes, driver: Driver, transport: str) -> bytes:
    """Encode `text` for its transport; raise `UrcError` for invalid characters."""
    if isinstance(text, bytes):
        return text
    spec = driver.transports[transport]
    try:
        return text.encode(spec.encoding)
    except UnicodeEncodeError as error:
        wrong = text[error.start : error.end]
        raise UrcError(f"{spec.name}: {wrong!r} cannot be encoded in {spec.encoding}") from error
