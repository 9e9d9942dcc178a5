"""Message types for the developer page's WebSocket.

Layer 5. Messages are JSON text in both directions; bytes are encoded as base64. Messages from the
server to the page, listed by their tag ``t``::

    hello    once, first
    profile  the profile, its state and its problems
    rows     traffic and notes, oldest first; a gap in the numbers shows dropped rows
    tried    the reply to `ParseRequest`
    shown    the reply to `PreviewRequest`
    pong, error   as on the dashboard's WebSocket

Messages from the page to the server: ``ping``, ``try`` and ``show``.
"""

import json
from collections.abc import Iterable, Mapping

import msgspec

from urc.model.driver import Argument, Command, Driver
from urc.model.payload import Envelope
from urc.problems import Problem, to_text
from urc.web.dev.preview import Preview, PreviewLine
from urc.web.dev.rows import SHOWN_BYTES, TrafficRow, fill, grouped
from urc.web.dev.tryout import FrameConsumer, ParsedPiece, ParseResult
from urc.web.wire.messages import Ping, decoded
from urc.web.wire.text import cut, encoded, milliseconds
from urc.wire.server_messages import Outbound

__all__ = [
    "Inbound",
    "PreviewRequest",
    "TopicsRequest",
    "ParseRequest",
    "decode",
    "encode_hello",
    "encode_profile",
    "encode_rows",
    "encode_shown",
    "encode_tried",
]

MOST_PROBLEMS = 100


class ParseRequest(
    msgspec.Struct, tag_field="t", tag="try", forbid_unknown_fields=True, frozen=True
):
    """A request to parse pasted text."""

    id: int
    transport: str
    text: str
    hex: bool = False
    topic: str = ""


_Scalar = bool | int | float | str


class PreviewRequest(
    msgspec.Struct, tag_field="t", tag="show", forbid_unknown_fields=True, frozen=True
):
    """A request to preview a command."""

    id: int
    command: str
    arguments: dict[str, bool | int | float | str | tuple[_Scalar, ...] | None] = {}


class TopicsRequest(
    msgspec.Struct, tag_field="t", tag="topics", forbid_unknown_fields=True, frozen=True
):
    """A request to send the robot's topics from now on, or to stop sending them."""

    shown: bool


Inbound = Ping | ParseRequest | PreviewRequest | TopicsRequest
_decoder: msgspec.json.Decoder[Inbound] = msgspec.json.Decoder(Inbound)


def decode(text: str | bytes) -> Inbound:
    """Return the decoded message; raise `BadMessage` with the reason if the text is invalid."""
    return decoded(_decoder, text)


# -- to the page


class _Hello(Outbound, tag="hello", omit_defaults=False, frozen=True):
    robot: str
    now: int


class _Rows(Outbound, tag="rows", omit_defaults=False, frozen=True):
    first: int
    now: int
    rows: list[TrafficRow]
    """Rows of the traffic log, with ages in milliseconds; see `encode_rows`."""


class _Found(msgspec.Struct, frozen=True):
    severity: str
    text: str
    """Text of the problem in the format of `urc validate`: headline, source line, caret and
    hint."""


class _Argument(msgspec.Struct, frozen=True):
    name: str
    type: str
    items: str
    title: str
    unit: str
    min: float | None
    max: float | None
    choices: tuple[object, ...]
    default: object
    required: bool


class _Command(msgspec.Struct, frozen=True):
    name: str
    title: str
    transport: str
    held: bool
    steps: int
    arguments: list[_Argument]


class _TransportRow(msgspec.Struct, frozen=True):
    name: str
    type: str
    framing: str
    encoding: str
    messages: bool
    """Whether the transport carries messages instead of bytes."""


class _Profile(Outbound, tag="profile", omit_defaults=False, frozen=True):
    edition: int
    state: str
    file: str
    told: str
    problems: list[_Found]
    lines: list[_TransportRow]
    commands: list[_Command]


class _Taker(msgspec.Struct, frozen=True):
    kind: str
    names: tuple[str, ...]
    fields: dict[str, str]
    samples: list[tuple[str, str, str]]
    refused: tuple[str, ...]


class _FramePiece(msgspec.Struct, frozen=True):
    start: int
    end: int
    data: bytes
    fault: str
    takers: list[_Taker]
    reasons: tuple[str, ...]


class _Tried(Outbound, tag="tried", omit_defaults=False, frozen=True):
    id: int
    error: str = ""
    size: int = 0
    left: int = 0
    more: int = 0
    pieces: tuple[_FramePiece, ...] = ()


class _FrameRow(msgspec.Struct, frozen=True):
    transport: str
    note: str = ""
    data: bytes = b""
    size: int = 0
    verb: str = ""
    address: str = ""
    more: str = ""
    text: str = ""


class _Shown(Outbound, tag="shown", omit_defaults=False, frozen=True):
    id: int
    refusal: str
    frames: list[_FrameRow]
    questions: tuple[str, ...]
    requires: tuple[str, ...]


def encode_hello(robot: str, now_s: float) -> str:
    """Return the first message of a connection."""
    return encoded(_Hello(robot, milliseconds(now_s)))


def encode_rows(rows: Iterable[TrafficRow], first: int, now_s: float) -> str:
    """Return a message with rows of the traffic log; `first` is the number of the first row."""
    aged = [
        msgspec.structs.replace(row, time_s=max(0, milliseconds(now_s - row.time_s)))
        for row in rows
    ]
    return encoded(_Rows(first, milliseconds(now_s), aged))


def encode_profile(
    driver: Driver,
    messaging: Iterable[str],
    *,
    edition: int,
    state: str,
    file: str,
    told: str,
    problems: Iterable[Problem],
) -> str:
    """Return a message with the profile and the problems of its file.

    Args:
        driver: the running driver.
        messaging: types of the transports that carry messages.
        edition: number of changes to the state that developer pages show.
        state: ``running``, ``waiting`` (a valid new version is pending) or ``broken`` (the file has
            errors).
        file: path of the robot's document.
        told: description of the last saved version and its outcome, for display.
        problems: all problems of the document.
    """
    kinds = frozenset(messaging)
    lines = [
        _TransportRow(one.name, one.type, one.framing.type, one.encoding, one.type in kinds)
        for one in driver.transports.values()
    ]
    found = [_Found(one.severity, to_text(one)) for one in problems]
    commands = [_command(one) for one in driver.commands.values()]
    return encoded(_Profile(edition, state, file, told, found[:MOST_PROBLEMS], lines, commands))


def encode_tried(number: int, finding: ParseResult | None, error: str = "") -> str:
    """Return a message with the result of a try-out."""
    if finding is None:
        return encoded(_Tried(number, cut(error)))
    pieces = tuple(_piece(one) for one in finding.pieces)
    return encoded(_Tried(number, "", finding.size, finding.left, finding.more, pieces))


def encode_shown(number: int, shown: Preview) -> str:
    """Return a message with the preview of a command."""
    frames = [_frame(one) for one in shown.frames]
    return encoded(_Shown(number, cut(shown.refusal), frames, shown.questions, shown.requires))


def _command(command: Command) -> _Command:
    return _Command(
        command.name,
        command.title,
        command.transport,
        command.hold is not None,
        len(command.steps),
        [_argument(one) for one in command.arguments.values()],
    )


def _argument(one: Argument) -> _Argument:
    return _Argument(
        one.name,
        one.type,
        one.items,
        one.title,
        one.unit,
        one.min,
        one.max,
        tuple(one.choices),
        one.default,
        one.is_required,
    )


def _piece(piece: ParsedPiece) -> _FramePiece:
    takers = [_taker(one) for one in piece.takers]
    data = piece.data[:SHOWN_BYTES]
    return _FramePiece(piece.start, piece.end, data, cut(piece.fault), takers, piece.reasons)


def _taker(taker: FrameConsumer) -> _Taker:
    fields = {name: _word(value) for name, value in taker.fields.items()}
    samples = [(name, _word(value), alarm) for name, value, alarm in taker.samples]
    return _Taker(taker.kind, taker.names, fields, samples, taker.refused)


def _word(value: object) -> str:
    if isinstance(value, (bytes, bytearray)) and len(value) > 64:
        return f"<{grouped(len(value))} bytes>"
    if isinstance(value, (Mapping, list, tuple)):
        return cut(json.dumps(value, default=repr, ensure_ascii=False))
    return cut(repr(value))


def _frame(written: PreviewLine) -> _FrameRow:
    payload = written.payload
    if written.text:
        return _FrameRow(written.transport, written.text)
    if not isinstance(payload, Envelope):
        return _FrameRow(written.transport, data=payload[:SHOWN_BYTES], size=len(payload))
    row = TrafficRow(0, 0.0, "sent", written.transport)
    fill(row, payload)
    return _FrameRow(
        written.transport, "", row.data, row.size, row.verb, row.address, row.more, row.text
    )
