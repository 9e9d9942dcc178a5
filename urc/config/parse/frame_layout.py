"""Parser for frame layouts: positions of start, length field, payload, checksum and end.

Positions are byte offsets from the start of the frame; delimiters and byte stuffing do not count.
"""

from typing import Any, Final, NamedTuple

from urc.config.node import Node, Problems
from urc.config.parse.bytes import parse_bytes
from urc.config.parse.checksum import DeclaredChecksum, parse_checksum
from urc.model.framing import (
    ByteRange,
    ChecksumSpec,
    Digits,
    FrameLayout,
    LengthSpec,
    TrailerSpec,
)

__all__ = ["MARKED", "checksums_of", "parse_layout"]

MARKED: Final = ("fixed", "length", "brackets")
"""Framing types with start, length or end bytes."""
_SPELT: Final = ("delimiter", "brackets", "idle", "datagram")
"""Framing types that allow `decode`, with which frames consist of hex or base64 digits."""


class _BareLayout(NamedTuple):
    """A frame layout without its checksum."""

    start: bytes
    end: bytes
    size: int | None
    length: LengthSpec | None


def parse_layout(part: Node, encoding: str, problems: Problems, longest: int) -> FrameLayout:
    """Return the layout of the framing at `part`; report invalid values and use defaults."""
    kind = part.text("type")
    start = end = b""
    if kind in MARKED:
        start_key, end_key = ("open", "close") if kind == "brackets" else ("start", "end")
        start = parse_bytes(part.get(start_key), encoding, problems) or b""
        end = parse_bytes(part.get(end_key), encoding, problems) or b""
        if kind == "brackets":
            _check_marks(part, problems)
    size = part.integer("size") if kind == "fixed" else None
    length = _parse_length(part.must("length"), encoding, problems) if kind == "length" else None
    frame = _BareLayout(start, end, size, length)
    if length is not None:
        _check_length(part.must("length"), start, length, problems)
        if length.is_loose:
            _check_loose(part, problems)
    found = [parse_checksum(one, encoding, problems) for one in checksums_of(part)]
    written = [one for one in found if one is not None]
    trailing = [one for one in written if one.trailer is not None]
    digits = _digits(part, problems)
    if trailing:
        _check_trail(part, trailing[0], len(written), problems)
        layout = FrameLayout(
            start, end, len(start), len(end), trailer=_trail_of(trailing[0], start)
        )
    else:
        layout = _placed(part, frame, written, problems)
    _check_size(part, layout, longest, problems)
    return layout._replace(digits=digits)


def _digits(part: Node, problems: Problems) -> Digits:
    """Return the encoding under `decode`, in which digits represent the bytes of a frame."""
    digits: Any = part.text("decode") if part.text("type") in _SPELT else ""
    if digits and "escape" in part.data:
        text = "'escape' has no effect with 'decode', because digits need no escaping"
        problems.error(part, "misplaced-key", text, at="escape", key=True)
    return digits  # type: ignore[no-any-return]  # the schema has the words


def _check_trail(part: Node, written: DeclaredChecksum, count: int, problems: Problems) -> None:
    key = "after" if "after" in written.part.data else "each"
    kind = part.text("type")
    if kind in ("fixed", "length"):
        problems.error(
            written.part,
            "misplaced-key",
            f"'{key}' needs text frames, but frames of type {kind!r} have fixed positions",
            at=key,
            key=True,
            hint="set the position of the checksum with 'at'",
        )
    elif count > 1:
        text = f"a checksum with '{key}' must be the only checksum of its frame"
        problems.error(written.part, "misplaced-key", text, at=key, key=True)


def _trail_of(written: DeclaredChecksum, start: bytes) -> TrailerSpec:
    trailer = written.trailer
    if trailer is None:
        raise AssertionError("a checksum at a fixed position has no trailer")
    over = written.over
    if not isinstance(over, ByteRange):
        over = ByteRange(len(start) if over == "payload" and not trailer.each else 0)
    checksum = _spec_of(written, over, -written.size)
    return TrailerSpec(
        checksum, trailer.mark, trailer.is_padded, trailer.is_optional, trailer.each, trailer.skip
    )


def checksums_of(part: Node) -> list[Node]:
    """Return all checksums of the framing at `part`, which may declare one or several."""
    inner = part.get("checksum") if part.text("type") != "xml" else None
    if inner is None:
        return []
    return inner.items() if isinstance(inner.data, list) else [inner]


def _check_marks(part: Node, problems: Problems) -> None:
    for key in ("open", "close"):
        inner = part.must(key)
        if inner.data in ("", []):
            problems.error(
                inner,
                "empty-mark",
                f"'{key}' is empty, so it cannot mark a frame",
                hint="write the bytes of the mark, such as '<' or STX",
            )


def _placed(
    part: Node, frame: _BareLayout, written: list[DeclaredChecksum], problems: Problems
) -> FrameLayout:
    """Return the layout with the positions of all parts resolved."""
    start, end, size, length = frame
    head, tail = len(start), len(end)
    if length is not None and length.is_loose:
        head = length.offset
    elif length is not None and length.offset == head:
        head = length.offset + length.size
    places: list[int] = []
    lasts: list[bool] = []
    for one in written:
        # Checksums at the end keep their order, so a later checksum moves earlier checksums back.
        behind = [other.size for other in written[len(places) + 1 :] if other.at is None]
        last = -len(end) - one.size - sum(behind)
        at = last if one.at is None else one.at
        if size is not None and 0 <= at == size + last:
            at = last
        if at == head:
            head += one.size
        if at == last:
            tail += one.size
        places.append(at)
        lasts.append(at == last)
    payload = part.get("payload") if part.text("type") == "length" else None
    if payload is not None:
        head, tail = _payload(payload, frame, head, tail, problems)
    layout = FrameLayout(start, end, head, tail, size, length)
    specs = []
    for one, at, is_last in zip(written, places, lasts, strict=True):
        spec = _checksum(one, at, is_last, layout)
        _check_checksum(one.part, spec, layout, problems)
        specs.append(spec)
    if not specs:
        return layout
    return layout._replace(checksum=specs[-1], checksums=tuple(specs[:-1]))


def _checksum(
    written: DeclaredChecksum, at: int, is_last: bool, layout: FrameLayout
) -> ChecksumSpec:
    # A window without an end stops before the checksum at the frame's end, or before the end bytes.
    behind = len(layout.end)
    if is_last:
        behind = -at if at < 0 else behind + written.size
    return _spec_of(written, _over(written, behind, layout), at)


def _spec_of(written: DeclaredChecksum, over: ByteRange, at: int) -> ChecksumSpec:
    return ChecksumSpec(
        written.algorithm, written.bits, over, at, written.is_big, written.spelling,
        written.salt, written.is_from_hex, written.closes, written.before,
    )  # fmt: skip


def _payload(
    part: Node, frame: _BareLayout, head: int, tail: int, problems: Problems
) -> tuple[int, int]:
    start, stop = part.integer("from"), part.integer("to")
    head = head if start is None else start
    tail = tail if stop is None else -stop
    if head < len(frame.start):
        problems.error(
            part,
            "overlap",
            f"the payload begins at byte {head}, inside the start bytes",
            at="from",
        )
    if tail < len(frame.end):
        problems.error(
            part,
            "overlap",
            f"the payload ends inside the end bytes, {tail} bytes before the end of the frame",
            at="to",
        )
    return head, tail


def _over(written: DeclaredChecksum, behind: int, layout: FrameLayout) -> ByteRange:
    stop = -behind or None
    if isinstance(written.over, ByteRange):
        return (
            written.over if written.over.stop is not None else ByteRange(written.over.start, stop)
        )
    if written.over == "frame":
        return ByteRange(0, stop)
    return ByteRange(layout.head, -layout.tail or None)


def _check_checksum(
    part: Node, checksum: ChecksumSpec, layout: FrameLayout, problems: Problems
) -> None:
    """Report a checksum or window outside the frame, and a checksum that overlaps another part."""
    at, size, frame_size = checksum.at, checksum.size, layout.size
    if at < 0 and at + size > 0:
        text = f"a checksum of {size} bytes at {at} extends beyond the end of the frame"
        problems.error(
            part, "outside-frame", text, at="at", hint=f"the last possible position is {-size}"
        )
        return
    if frame_size is not None and not -frame_size <= at <= frame_size - size:
        text = f"a checksum of {size} bytes at {at} is outside a frame of {frame_size} bytes"
        problems.error(part, "outside-frame", text, at="at" if "at" in part.data else "")
        return
    if at < 0 and at + size > -len(layout.end):
        text = f"the checksum at {at} overlaps the end bytes"
        problems.error(
            part,
            "overlap",
            text,
            at="at",
            hint=f"the last possible position is {-size - len(layout.end)}",
        )
    if 0 <= at < len(layout.start):
        text = f"the checksum at {at} overlaps the start bytes"
        problems.error(part, "overlap", text, at="at")
    length = layout.length
    if length and at >= 0 and at < length.offset + length.size and length.offset < at + size:
        problems.error(part, "overlap", f"the checksum at {at} overlaps the length field", at="at")
    _check_window(part, checksum, layout, problems)


def _check_window(
    part: Node, checksum: ChecksumSpec, layout: FrameLayout, problems: Problems
) -> None:
    size, over = layout.size, checksum.over
    where = "over" if "over" in part.data else ""
    if size is None:
        least = layout.head + layout.tail
        if layout.length is None or over.start >= 0 or "over" not in part.data:
            return
        if -over.start > least:
            text = (
                f"the window starts {-over.start} bytes before the end, but the shortest frame"
                f" has only {least}"
            )
            problems.warn(part, "outside-frame", text, at=where)
        return
    if size < layout.head + layout.tail:
        return  # `_check_size` reports this
    start = over.start if over.start >= 0 else size + over.start
    stop = size if over.stop is None else over.stop if over.stop >= 0 else size + over.stop
    if not 0 <= start <= size or not 0 <= stop <= size:
        text = f"the window of the checksum is outside a frame of {size} bytes"
        problems.error(part, "outside-frame", text, at=where)
    elif start >= stop:
        problems.error(part, "empty-window", "the checksum covers no bytes", at=where)


def _check_size(part: Node, layout: FrameLayout, longest: int, problems: Problems) -> None:
    """Report frames that are too small for their parts, or larger than the maximum size."""
    least = layout.head + layout.tail
    if layout.size is not None and layout.size < least:
        problems.error(
            part,
            "frame-too-small",
            f"{layout.size} bytes are too few for the start, end and checksum, which take {least}",
            at="size",
        )
    elif max(least, layout.size or 0) > longest:
        problems.error(
            part,
            "frame-too-small",
            f"a frame has at least {max(least, layout.size or 0)} bytes, which is more"
            f" than the limit of {longest}",
            at="max" if "max" in part.data else "",
        )


_MOST_BYTES = 8


def _parse_length(part: Node, encoding: str, problems: Problems) -> LengthSpec:
    """Return the length field at `part`; report invalid values and use defaults."""
    size = part.integer("size") or 1
    spelling = part.text("as", "raw")
    flag, until = part.get("flag"), part.get("until")
    mark = None if until is None else parse_bytes(until, encoding, problems)
    if until is not None and mark == b"":
        text = "'until' is empty, so it cannot end the length"
        problems.error(
            until, "empty-mark", text, hint="write the bytes after the length, such as ':'"
        )
    return LengthSpec(
        offset=part.integer("offset") or 0,
        size=size,
        is_big=part.text("endian", "big") == "big",
        adjust=part.integer("adjust") or 0,
        unit=part.integer("unit") or 1,
        bits=part.integer("bits") or 64,
        spelling=spelling,  # type: ignore[arg-type]  # the schema's enum is this Literal
        is_counted=part.flag("counted", default=False),
        until=mark or b"",
        flag_at=-1 if flag is None else flag.integer("offset") or 0,
        flag_mask=0xFF if flag is None else flag.integer("mask") or 0,
    )


def _check_length(part: Node, start: bytes, length: LengthSpec, problems: Problems) -> None:
    """Report a length field that overlaps the start bytes or has keys that have no effect."""
    if length.offset < len(start):
        problems.error(
            part,
            "overlap",
            f"the length field at {length.offset} overlaps the start bytes",
            at="offset",
            hint="positions count from the first byte of the frame, including the start bytes",
        )
    if length.spelling == "raw" and length.size > _MOST_BYTES:
        text = f"a binary number has {_MOST_BYTES} bytes at most, found {length.size}"
        problems.error(part, "too-wide", text, at="size", hint="write 'as: dec' for decimal digits")
        return
    most = 8 * length.size if length.spelling == "raw" else 64
    if length.bits != 64 and length.bits > most:
        problems.error(part, "too-wide", f"the field has {most} bits, not {length.bits}", at="bits")
    if not length.is_loose:
        return
    key = "until" if length.until else "counted"
    if length.spelling == "raw":
        text = f"'{key}' requires a length in digits"
        problems.error(part, "misplaced-key", text, at=key, key=True, hint="add 'as: dec'")
    for other in ("bits", "endian", "flag", *(("counted",) if length.until else ())):
        if other in part.data:
            text = f"'{other}' has no effect with '{key}'"
            problems.error(part, "misplaced-key", text, at=other, key=True)


def _check_loose(part: Node, problems: Problems) -> None:
    """Report keys that need a fixed payload position, if the length field has a variable size."""
    for key in ("payload", "escape"):
        if key in part.data:
            text = f"'{key}' has no effect when 'until' ends the length"
            hint = "the payload starts after the length and ends with the frame"
            problems.error(part, "misplaced-key", text, at=key, key=True, hint=hint)
    inner = part.get("checksum")
    if inner is not None:
        for one in inner.items() if isinstance(inner.data, list) else [inner]:
            if "over" not in one.data or one.must("over").data == "payload":
                text = "the payload has no fixed start, so the checksum cannot cover it"
                hint = "write 'over: frame', or a window with 'from' and 'to'"
                problems.error(one, "misplaced-key", text, hint=hint)
