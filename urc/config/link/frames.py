"""Checks whether the framing can carry constant frames.

URC checks frames with expressions later, when it builds them.
"""

from collections.abc import Iterable
from typing import cast

from urc.config.node import Node, Problems
from urc.config.parse.form import write_form
from urc.expressions import ExpressionError, Template
from urc.model.driver import Driver, FramingSpec, TransportSpec
from urc.model.framing import FrameLayout
from urc.model.payload import WriteSpec, each_of

__all__ = ["check_frames"]


def check_frames(part: Node, driver: Driver, problems: Problems) -> None:
    """Report constant text under ``send:`` that does not form exactly one frame."""
    for name, inner in part.named("commands").items():
        command = driver.commands.get(name)
        if command is not None:
            _check(inner, command.send, driver.transports.get(command.transport), problems)
    for inner, poll in zip(part.listed("polls"), driver.polls, strict=True):
        _check(inner, poll.send, driver.transports.get(poll.transport), problems)


def _check(part: Node, send: WriteSpec, spec: TransportSpec | None, problems: Problems) -> None:
    written = part.get("send")
    if spec is None or written is None:
        return
    places = written.items() if send.form == "frames" else [written]
    for place, one in zip(places, each_of(send), strict=True):
        _check_one(place, one, spec, problems)


def _check_one(part: Node, send: WriteSpec, spec: TransportSpec, problems: Problems) -> None:
    inner, form = write_form(part)
    if send.form == "text":
        _check_end(inner, problems)
        data = _text(form.templates(inner, send), spec.encoding)
    else:
        data = _bytes(send)
    if data is None:
        return
    framing = spec.framing.sent or spec.framing
    layout = cast("FrameLayout | None", framing.options.get("layout")) or FrameLayout()
    for mark in _marks(framing, layout):
        if mark and mark in data:
            problems.error(
                inner,
                "contains-delimiter",
                f"{_what(send)} {_shown(mark)} inside, but the framing already adds it:"
                " the robot would receive two frames",
                hint="remove this part: the framing adds the start and end of each frame",
            )
            return
    wanted = None if layout.size is None else layout.size - layout.head - layout.tail
    if wanted is not None and wanted != len(data):
        problems.error(
            inner,
            "wrong-size",
            f"{_what(send)} {len(data)} bytes, but a frame of this transport has exactly {wanted}",
        )


def _text(templates: Iterable[tuple[Node, Template]], encoding: str) -> bytes | None:
    """Return the bytes of constant text; None for variable or invalid text."""
    found = [template for _, template in templates]
    if len(found) != 1 or not found[0].is_constant:
        return None
    try:
        return found[0].render({}).encode(encoding)
    except (ExpressionError, UnicodeEncodeError):
        return None


def _bytes(send: WriteSpec) -> bytes | None:
    """Return the bytes of constant ``hex`` or ``bytes``; None for variable bytes."""
    pieces = cast("tuple[object, ...]", send.options.get("pieces", (None,)))
    fixed = [one for one in pieces if isinstance(one, bytes)]
    return b"".join(fixed) if len(fixed) == len(pieces) else None


def _what(send: WriteSpec) -> str:
    return "the text has" if send.form == "text" else "the frame has"


def _check_end(part: Node, problems: Problems) -> None:
    """Warn about text that ends with a backslash and a letter instead of a control character."""
    if isinstance(part.data, str) and part.data.endswith(("\\n", "\\r")):
        problems.warn(
            part,
            "literal-backslash",
            f"the text ends with the 2 characters {part.data[-2:]}, not with a control character",
            hint='remove both characters: the framing adds the end; "\\r" in double quotes is a CR',
        )


def _marks(framing: FramingSpec, layout: FrameLayout) -> tuple[bytes, ...]:
    if framing.type == "brackets":
        return layout.start, layout.end
    if framing.type in ("delimiter", "regex"):
        return (cast("bytes", framing.options.get("tx", b"")),)
    return ()


def _shown(mark: bytes) -> str:
    return {b"\n": "LF", b"\r": "CR", b"\r\n": "CRLF"}.get(mark, ascii(mark.decode("latin-1")))
