"""Try-out of the parser: the frames in pasted bytes and each frame's consumers.

Layer 5, pure. The module builds separate readers and never uses a live robot. As in the engine, the
first matching message consumes an unsolicited frame. The try-out has no pending request, so the
result also lists matching replies.
"""

import json
import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from urc.config.messaging import MESSAGING
from urc.model.driver import Driver, Reply, TransportSpec
from urc.model.payload import Envelope, ReadSpec
from urc.model.sequence import ExpectStep, all_steps
from urc.patterns import Pattern
from urc.problems import UrcError
from urc.protocol.forms.table import build_reader
from urc.protocol.forms.topics import context_of, frame_of, namespace_of, topic_of
from urc.protocol.framing.base import FrameFault
from urc.protocol.framing.table import build_framing
from urc.protocol.readings.readings import Readings
from urc.protocol.requests.reply_match import CompiledReply, Expectation, Matcher
from urc.protocol.values.payload import BadItem, BadText, Frame

__all__ = ["MOST_BYTES", "ParseResult", "ParsedPiece", "FrameConsumer", "pasted_bytes", "try_out"]

MOST_BYTES = 64 * 1024
MOST_PIECES = 200
"""Maximum number of frames in the result of one try-out."""
MOST_REASONS = 30
_ESCAPES = {"n": b"\n", "r": b"\r", "t": b"\t", "0": b"\0", "e": b"\x1b", "\\": b"\\"}
_ESCAPE = re.compile(r"\\(x[0-9A-Fa-f]{2}|.|$)", re.DOTALL)


class FrameConsumer(NamedTuple):
    """The consumer of a frame: a message, a reply or an error reply."""

    kind: str
    """Kind of the consumer: ``message``, ``reply`` or ``refusal`` (an error reply)."""
    names: tuple[str, ...]
    """Names of the messages or replies; several replies may match one frame."""
    fields: Mapping[str, object]
    samples: tuple[tuple[str, object, str], ...]
    """Signal, value, alarm."""
    refused: tuple[str, ...]
    """Invalid values, each with the reason; for an error reply, the error text."""


class ParsedPiece(NamedTuple):
    """One frame, or bytes outside any frame."""

    start: int
    """Offset of the frame's first byte in the input."""
    end: int
    data: bytes
    """Payload of the frame, excluding the delimiter, length field and checksum."""
    fault: str
    """Reason why the bytes are not a frame; "" if they are a frame."""
    takers: tuple[FrameConsumer, ...] = ()
    reasons: tuple[str, ...] = ()
    """For each candidate, the reason why it does not match; empty if a candidate matches."""


class ParseResult(NamedTuple):
    """The result of a try-out."""

    size: int
    pieces: tuple[ParsedPiece, ...]
    left: int
    """Number of bytes in an incomplete frame at the end."""
    more: int
    """Number of frames beyond the limit `MOST_PIECES`, which are not parsed."""


class _Candidate(NamedTuple):
    """A message or reply that can match a frame."""

    kind: str
    name: str
    read: ReadSpec
    matcher: Matcher
    expectation: Expectation | None


def pasted_bytes(text: str, *, is_hex: bool, encoding: str) -> bytes:
    r"""Return the bytes represented by pasted text.

    Args:
        text: the input.
        is_hex: whether the text consists of pairs of hex digits; blanks, commas, colons and ``0x``
            between the pairs are ignored. Other text may contain the escapes ``\n \r \t \0 \e \\``
            and ``\xHH``.
        encoding: character encoding of non-hex text.

    Raises:
        UrcError: the text is invalid or too long; the message contains the position.
    """
    data = _from_hex(text) if is_hex else _from_text(text, encoding)
    if len(data) > MOST_BYTES:
        raise UrcError(f"the input has {len(data)} bytes; at most {MOST_BYTES} are parsed")
    return data


def try_out(
    driver: Driver,
    settings: Mapping[str, object],
    transport: str,
    data: bytes,
    topic: str = "",
) -> ParseResult:
    """Return the frames in `data` and their consumers.

    Args:
        driver: the loaded driver.
        settings: value of every setting.
        transport: name of the receiving transport.
        data: bytes from the robot; on a message transport, the body of one message.
        topic: topic of the message; "" for a reply to a request.

    Raises:
        UrcError: the transport is unknown, or the body is not valid JSON on a JSON transport.
    """
    spec = driver.transports.get(transport)
    if spec is None:
        raise UrcError(
            f"there is no transport {transport!r}; known transports: {_all(driver.transports)}"
        )
    asked = _candidates(driver, spec, settings)
    if spec.type in MESSAGING:
        frame = frame_of(_envelope(spec, data, topic), spec.encoding)
        takers, reasons = _take(frame, asked, spec, settings)
        return ParseResult(len(data), (ParsedPiece(0, len(data), data, "", takers, reasons),), 0, 0)
    pieces: list[ParsedPiece] = []
    cut, left, more = _cut(spec, data)
    for start, end, found in cut:
        if isinstance(found, FrameFault):
            pieces.append(
                ParsedPiece(start, end, data[start:end], f"{found.code}: {found.message}")
            )
            continue
        takers, reasons = _take(Frame(found, spec.encoding), asked, spec, settings)
        pieces.append(ParsedPiece(start, end, found, "", takers, reasons))
    return ParseResult(len(data), tuple(pieces), left, more)


def _cut(
    spec: TransportSpec, data: bytes
) -> tuple[list[tuple[int, int, bytes | FrameFault]], int, int]:
    """Return the frames and faults, the number of bytes left, and the number of further frames."""
    decoder = build_framing(spec.framing).decoder()
    decoder.push(data, 0.0)
    cut: list[tuple[int, int, bytes | FrameFault]] = []
    at = more = 0
    while (found := decoder.next(0.0)) is not None:
        end = max(at, len(data) - decoder.pending)
        if len(cut) < MOST_PIECES:
            cut.append((at, end, found))
        else:
            more += 1
        at = end
    if decoder.deadline is not None:  # a timeout ends the frame, and no more bytes follow
        for late in decoder.tick(decoder.deadline):
            end = max(at, len(data) - decoder.pending)
            cut.append((at, end, late))
            at = end
    return cut, decoder.pending, more


def _envelope(spec: TransportSpec, data: bytes, topic: str) -> Envelope:
    body: object = data
    if spec.type == "ros":  # ROS messages are structured data; all others are bytes
        try:
            body = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise UrcError(f"expected JSON for a {spec.type} message: {error}") from None
    if topic:
        return Envelope("message", {"topic": topic}, body)
    return Envelope("response", {"id": 1, "ok": True}, body)


def _take(
    frame: Frame, asked: list[_Candidate], spec: TransportSpec, settings: Mapping[str, object]
) -> tuple[tuple[FrameConsumer, ...], tuple[str, ...]]:
    takers: list[FrameConsumer] = []
    for one in asked:
        if one.kind == "message" and any(taker.kind == "message" for taker in takers):
            continue  # the first match consumes the frame
        taker = _taken(_anew(frame), one)
        if taker is not None:
            _add(takers, taker)
    reasons: tuple[str, ...] = ()
    if not takers:
        told = [f"{one.name}: {_why_not(_anew(frame), one, spec, settings)}" for one in asked]
        reasons = tuple(told[:MOST_REASONS]) or (f"the driver expects no data on {spec.name}",)
    return tuple(takers), reasons


def _add(takers: list[FrameConsumer], taker: FrameConsumer) -> None:
    """Add a consumer to the list; merge equal consumers."""
    for place, other in enumerate(takers):
        if other._replace(names=()) == taker._replace(names=()) and taker.kind != "message":
            takers[place] = other._replace(names=(*other.names, *taker.names))
            return
    takers.append(taker)


def _taken(frame: Frame, one: _Candidate) -> FrameConsumer | None:
    if one.expectation is None:
        found = one.matcher.read(frame)
    else:
        offer = one.expectation.offer(frame)
        if offer is None:
            return None
        if offer.refusal:
            return FrameConsumer("refusal", (one.name,), {}, (), (offer.refusal,))
        found = offer.fields
    if found is None:
        return None
    samples, refused = one.matcher.decode(found, 0.0)
    told = tuple((each.signal, each.value, each.alarm) for each in samples)
    return FrameConsumer(one.kind, (one.name,), dict(found), told, tuple(refused))


def _why_not(
    frame: Frame, one: _Candidate, spec: TransportSpec, settings: Mapping[str, object]
) -> str:
    """Return the reason why a frame does not match a reader, for display."""
    read = one.read
    if read.topic is not None and (topic := _topic(read, spec, settings)) != frame.topic:
        came = "a reply" if frame.topic is None else repr(frame.topic)
        return f"expected the topic {topic!r}, found {came}"
    context = context_of(spec, settings)
    try:
        found = build_reader(read._replace(when=None), context).read(frame)
    except (BadItem, BadText) as error:
        return str(error)
    if found is not None and read.when is not None:
        return f"the condition under 'when' is false: {read.when.source}"
    pattern = read.options.get("pattern")
    if isinstance(pattern, Pattern):
        return f"the pattern {pattern.source} does not match"
    if read.lines is not None:
        return "the multiline reply is incomplete"
    return f"the frame cannot be decoded as {read.form}"


def _topic(read: ReadSpec, spec: TransportSpec, settings: Mapping[str, object]) -> str:
    return topic_of(read, settings, namespace_of(spec, settings))


def _candidates(
    driver: Driver, spec: TransportSpec, settings: Mapping[str, object]
) -> list[_Candidate]:
    readings = Readings(driver.signals, {"settings": settings})
    context = context_of(spec, settings)

    def matcher(read: ReadSpec) -> Matcher:
        return Matcher(build_reader(read, context), readings.decoder(read.fields))

    found = [
        _Candidate("message", f"message {one.name}", one.read, matcher(one.read), None)
        for one in driver.messages.values()
        if one.transport == spec.name
    ]
    for name, reply in _replies(driver, spec):
        mine = matcher(reply.read)
        faults = tuple((matcher(one.read), one.text) for one in reply.faults)
        expectation = Expectation(CompiledReply(mine, 0.0, reply.errors, faults, reply.read.lines))
        found.append(_Candidate("reply", name, reply.read, mine, expectation))
    return found


def _replies(driver: Driver, spec: TransportSpec) -> Iterator[tuple[str, Reply]]:
    """Yield each named reply that a driver can expect on a transport, also in stages and steps."""
    asked = [(f"reply to {one.name}", one.transport, one.reply) for one in driver.commands.values()]
    asked += [
        (f"reply to poll {one.name}", one.transport, one.reply)
        for one in driver.polls
        if not one.run
    ]
    for name, transport, reply in asked:
        if transport != spec.name or reply is None:
            continue
        reply = reply.with_errors(spec.errors, spec.faults)
        yield name, reply
        for number, stage in enumerate(reply.stages, 2):
            yield f"{name}, stage {number}", Reply(stage.read, stage.errors, faults=stage.faults)
    scripts = [(f"on_connect of {one.name}", one.on_connect) for one in driver.transports.values()]
    scripts += [(f"steps of {one.name}", one.steps) for one in driver.commands.values()]
    for name, script in scripts:
        for step in all_steps(script):
            if isinstance(step, ExpectStep) and step.transport == spec.name:
                yield name, Reply(step.read, step.errors, faults=step.faults)


def _anew(frame: Frame) -> Frame:
    """Return a copy of the frame without its cached results."""
    other = Frame(frame.payload, frame.encoding)
    other.topic = frame.topic
    return other


def _from_hex(text: str) -> bytes:
    digits = re.sub(r"0[xX]|[\s,:;]", " ", text).split()
    for number, word in enumerate(digits, 1):
        if len(word) % 2 or not re.fullmatch(r"[0-9A-Fa-f]+", word):
            raise UrcError(f"expected pairs of hex digits; group {number} is {word[:20]!r}")
    return bytes.fromhex("".join(digits))


def _from_text(text: str, encoding: str) -> bytes:
    data = bytearray()
    at = 0
    try:
        for match in _ESCAPE.finditer(text):
            data += text[at : match.start()].encode(encoding)
            at = match.end()
            word = match[1]
            if len(word) == 3:
                data.append(int(word[1:], 16))
            elif word in _ESCAPES:
                data += _ESCAPES[word]
            else:
                known = r"\n \r \t \0 \e \\ and \xHH"
                raise UrcError(f"character {match.start() + 1}: expected {known}, found \\{word}")
        return bytes(data + text[at:].encode(encoding))
    except UnicodeEncodeError as error:
        wrong = text[error.start : error.end]
        raise UrcError(f"{wrong!r} cannot be encoded as {encoding}") from None


def _all(names: Mapping[str, object]) -> str:
    return ", ".join(names) or "none"
