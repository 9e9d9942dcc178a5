"""Checksums after variable-length text.

Pure. On sending, a `ChecksumTrailer` adds the checksum to the content between a frame's markers; on
receipt, it removes the checksum. After the checksum is removed, all other declared parts of the
content have fixed positions.
"""

from urc.model.framing import TrailerSpec
from urc.protocol.framing.checksums import BadFrame, Checksum, cut

__all__ = ["ChecksumTrailer"]


class ChecksumTrailer:
    """A checksum of variable position: after a frame's text, or after each line of the text."""

    def __init__(self, spec: TrailerSpec, start: bytes) -> None:
        self._spec = spec
        self._before = b"" if spec.each else start
        """Bytes of the frame before the text; all positions include these bytes."""
        self._checksum = Checksum(spec.checksum)
        self._size = self._checksum.size

    def take_off(self, text: bytes) -> bytes:
        """Return `text` without checksums; raise `BadFrame` for a wrong or missing checksum."""
        spec = self._spec
        if not spec.each:
            return self._checked(text)
        lines = text.split(spec.each)
        return spec.each.join(
            line if place < spec.skip or not line else self._checked(line)
            for place, line in enumerate(lines)
        )

    def put_on(self, text: bytes) -> bytes:
        """Return `text` with checksums; raise `BadFrame` if a checksum cannot be computed."""
        spec = self._spec
        if not spec.each:
            return self._encode_frame(text)
        lines = text.split(spec.each)
        return spec.each.join(
            line if place < spec.skip or not line else self._encode_frame(line)
            for place, line in enumerate(lines)
        )

    def _checked(self, text: bytes) -> bytes:
        found = self._parted(text)
        if found is None:
            return text
        content, digits = found
        right = self._right(content)
        if right is None:
            return content
        if not self._spec.is_padded and digits.isalnum() and len(digits) <= self._size:
            digits = digits.lstrip(b"0") or b"0"
        self._checksum.compare(digits, right)
        return content

    def _parted(self, text: bytes) -> tuple[bytes, bytes] | None:
        """Return the content and the checksum; None if an optional checksum is missing."""
        spec, size = self._spec, self._size
        if not spec.mark:
            if len(text) < size:
                raise BadFrame("short-frame", f"{len(text)} bytes are too few for the checksum")
            return text[:-size], text[-size:]
        if spec.checksum.spelling == "raw":
            # Raw bytes may contain the separator: only its position is reliable.
            content, digits = text[: -size - len(spec.mark)], text[-size:]
            is_marked = text[:-size].endswith(spec.mark)
        else:
            content, mark, digits = text.rpartition(spec.mark)
            is_marked = bool(mark)
        if is_marked:
            return content, digits
        if spec.is_optional:
            return None
        mark_text = ascii(spec.mark.decode("latin-1"))
        raise self._checksum.wrong(f"the frame has no {mark_text} followed by a checksum; dropped")

    def _encode_frame(self, text: bytes) -> bytes:
        right = self._right(text)
        if right is None:
            raise self._checksum.saltless(self._before + text)
        return text + self._spec.mark + right

    def _right(self, content: bytes) -> bytes | None:
        frame = self._before + content
        _, window = cut(frame, self._spec.checksum.over)
        right = self._checksum.right(frame, window)
        if right is None or self._spec.is_padded:
            return right
        return right.lstrip(b"0") or b"0"
