"""Which commands, polls and messages of a document its own tests exercise.

Floor 4, pure. What no test exercises is no finding: a person decides what is worth a test.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final, Literal, NamedTuple

from urc.model.codec import ReadSpec
from urc.model.driver import Driver, Reply
from urc.model.profile import DocumentTest, Fed, pieces_of
from urc.model.values import Value
from urc.problems import UrcError
from urc.protocol.forms import BadText, CodecContext, Frame, Reader, build_reader
from urc.protocol.framing import build_framing

__all__ = ["Coverage", "Exercised", "Listener", "measure", "summary"]

Kind = Literal["command", "poll", "message"]
Exercised = tuple[Kind, str]
"""One of them: what it is, and its name."""
_KINDS: Final[tuple[Kind, ...]] = ("command", "poll", "message")
_NAMED_MOST: Final = 3
"""Names in the summary; more of them are counted."""


class Coverage(NamedTuple):
    """What the tests of one document exercise."""

    file: str
    total: int
    untested: tuple[Exercised, ...]
    """Commands, then polls, then messages, in the order of the document."""


class Listener:
    """Knows which messages the bytes that a test feeds are.

    An engine does not say which message a frame was: on the wire, nobody would ask.
    """

    def __init__(self, driver: Driver, settings: Mapping[str, Value]) -> None:
        self._driver = driver
        self._settings = settings
        self._messages: dict[str, list[tuple[str, Reader]]] = {}

    def exercised(self, test: DocumentTest) -> set[Exercised]:
        """Return what a test asks, and the messages that it feeds."""
        reply: Reply | None = None
        asked: set[Exercised] = set()
        command = test.run
        if isinstance(test.reply_to, int):
            poll = self._driver.polls[test.reply_to]
            reply = poll.reply
            asked.add(("poll", poll.name))
            if poll.run:
                asked.add(("command", poll.run))
        elif test.reply_to is not None:
            command = test.reply_to
        if command is not None:
            reply = self._driver.commands[command].reply
            asked.add(("command", command))
        heard: set[Exercised] = set()
        for transport, fed in test.feed.items():
            try:
                for piece in pieces_of(fed):
                    heard |= set(self._heard(transport, piece, reply))
            except (UrcError, UnicodeEncodeError):
                continue  # the test itself tells of it
        return asked | heard

    def _heard(self, transport: str, text: Fed, reply: Reply | None) -> Iterator[Exercised]:
        spec = self._driver.transports[transport]
        data = text.encode(spec.encoding) if isinstance(text, str) else text
        answer = None if reply is None else self._reader(reply.read, spec.encoding)
        decoder = build_framing(spec.framing).decoder()
        frames = decoder.feed(data, 0.0)
        if decoder.deadline is not None:  # a frame that silence ends
            frames = [*frames, *decoder.tick(decoder.deadline)]
        for payload in frames:
            if not isinstance(payload, bytes):
                continue
            frame = Frame(payload, spec.encoding)
            if answer is not None and _reads(answer, frame):
                answer = None  # it was the reply, and there is one
                continue
            for name, reader in self._readers(transport):
                if _reads(reader, frame):
                    yield "message", name
                    break

    def _readers(self, transport: str) -> list[tuple[str, Reader]]:
        if transport not in self._messages:
            encoding = self._driver.transports[transport].encoding
            self._messages[transport] = [
                (name, self._reader(message.read, encoding))
                for name, message in self._driver.messages.items()
                if message.transport == transport
            ]
        return self._messages[transport]

    def _reader(self, read: ReadSpec, encoding: str) -> Reader:
        return build_reader(read, CodecContext(encoding, self._settings))


def _reads(reader: Reader, frame: Frame) -> bool:
    try:
        return reader.read(frame) is not None
    except BadText:
        return False


def measure(file: str, driver: Driver, exercised: Iterable[Exercised]) -> Coverage:
    """Return what of a driver is exercised, and what is not."""
    declared: list[Exercised] = [
        *(("command", name) for name in driver.commands),
        *(("poll", poll.name) for poll in driver.polls),
        *(("message", name) for name in driver.messages),
    ]
    done = set(exercised)
    return Coverage(file, len(declared), tuple(one for one in declared if one not in done))


def summary(coverages: Iterable[Coverage]) -> str:
    """Return what has no test in a few words, or ""."""
    untested = [one for coverage in coverages for one in coverage.untested]
    if not untested:
        return ""
    if len(untested) <= _NAMED_MOST:
        return "no test of " + ", ".join(f"{kind} {name}" for kind, name in untested)
    counts = {kind: sum(one[0] == kind for one in untested) for kind in _KINDS}
    return "no test of " + ", ".join(
        f"{count} {kind}{'' if count == 1 else 's'}" for kind, count in counts.items() if count
    )
