"""The number in a frame that says how long it is: mapping → `LengthSpec`."""

from urc.config.parse.bytes import parse_bytes
from urc.config.part import Findings, Part
from urc.model.framing import LengthSpec

__all__ = ["check_length", "check_loose", "parse_length"]

_MOST_BYTES = 8


def parse_length(part: Part, encoding: str, findings: Findings) -> LengthSpec:
    """Return the length field at `part`; what was reported is left at a default."""
    size = part.integer("size") or 1
    spelling = part.text("as", "raw")
    flag, until = part.get("flag"), part.get("until")
    mark = None if until is None else parse_bytes(until, encoding, findings)
    if until is not None and mark == b"":
        text = "nothing cannot end a number"
        findings.error(until, "empty-mark", text, hint="name the bytes behind it, such as ':'")
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


def check_length(part: Part, start: bytes, length: LengthSpec, findings: Findings) -> None:
    """Report a field that lies on the start bytes, or that means nothing."""
    if length.offset < len(start):
        findings.error(
            part,
            "overlap",
            f"the length field at {length.offset} lies in the start bytes",
            at="offset",
            hint="places count from the first byte of the frame, start bytes included",
        )
    if length.spelling == "raw" and length.size > _MOST_BYTES:
        text = f"a number of raw bytes has {_MOST_BYTES} at most, found {length.size}"
        findings.error(part, "too-wide", text, at="size", hint="digits are said by 'as: dec'")
        return
    most = 8 * length.size if length.spelling == "raw" else 64
    if length.bits != 64 and length.bits > most:
        findings.error(part, "too-wide", f"the field has {most} bits, not {length.bits}", at="bits")
    if not length.is_loose:
        return
    key = "until" if length.until else "counted"
    if length.spelling == "raw":
        text = f"'{key}' is for a number that is spelt in digits"
        findings.error(part, "misplaced-key", text, at=key, key=True, hint="add 'as: dec'")
    for other in ("bits", "endian", "flag", *(("counted",) if length.until else ())):
        if other in part.data:
            text = f"'{other}' means nothing beside '{key}'"
            findings.error(part, "misplaced-key", text, at=other, key=True)


def check_loose(part: Part, findings: Findings) -> None:
    """Report what needs to know beforehand where the payload of such a frame begins."""
    for key in ("payload", "escape"):
        if key in part.data:
            text = f"'{key}' means nothing where the length says its own size"
            hint = "the payload is what stands between the length and the end of the frame"
            findings.error(part, "misplaced-key", text, at=key, key=True, hint=hint)
    inner = part.get("checksum")
    if inner is not None:
        for one in inner.items() if isinstance(inner.data, list) else [inner]:
            if "over" not in one.data or one.must("over").data == "payload":
                text = "where the payload begins is not known beforehand"
                hint = "say what it is taken over: 'over: frame', or from one place to another"
                findings.error(one, "misplaced-key", text, hint=hint)
