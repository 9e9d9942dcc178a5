"""Text and bytes of a ``struct:``: their size, their end, their constants."""

from urc.config.parse.bytes import parse_bytes
from urc.config.part import Findings, Part
from urc.model.binary import Extent, Item

__all__ = ["parse_content"]


def parse_content(part: Part, item: Item, encoding: str, findings: Findings) -> Item | None:
    """Return `item`, of text or bytes, with its constant, its padding and what ends it."""
    own = part.text("encoding")
    until = _bytes(part.get("until"), own or encoding, findings)
    const = _bytes(part.get("const"), own or encoding, findings)
    if const is not None:
        for key in ("size", "until", "pad", "value", "count"):
            if key in part.data:
                text = f"'{key}' means nothing for a constant"
                findings.error(part, "misplaced-key", text, at=key, key=True)
                return None
        return item._replace(const=const, size=Extent("fixed", len(const)), encoding=own)
    if (item.size is None) == (until is None):
        if item.size is None and ("size" in part.data or "until" in part.data):
            return None  # it was reported
        key = "until" if until is not None else ""
        findings.error(
            part,
            "misplaced-key" if key else "missing-key",
            "both 'size' and 'until' say where it ends" if key else "nothing says where it ends",
            at=key,
            key=True,
            hint="'size: 8', 'size: u8' with its length in front, 'size: rest', or 'until: NUL'",
        )
        return None
    is_fixed = item.size is not None and item.size.kind == "fixed"
    if "pad" in part.data and not is_fixed:
        text = "'pad' means nothing where the size is not fixed"
        findings.error(part, "misplaced-key", text, at="pad", key=True)
        return None
    return item._replace(until=until or b"", pad=part.integer("pad") or 0, encoding=own)


def _bytes(part: Part | None, encoding: str, findings: Findings) -> bytes | None:
    found = parse_bytes(part, encoding, findings) if part is not None else None
    if part is not None and found == b"":
        findings.error(part, "wrong-size", "at least one byte is expected")
        return None
    return found
