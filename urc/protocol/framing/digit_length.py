"""Length fields with a variable number of digits: ``#3512``, ``512:``.

Pure. The payload starts after the last digit or the terminator; the length and `adjust` count from
this position.
"""

from urc.model.framing import LengthSpec
from urc.protocol.framing.checksums import BadFrame

__all__ = ["DigitLength"]


class DigitLength:
    """A length field in ASCII digits, with a leading digit count or a terminator."""

    def __init__(self, spec: LengthSpec) -> None:
        self._spec = spec
        self._base = 10 if spec.spelling == "dec" else 16
        self.end = spec.offset + (spec.size + 1 if spec.is_counted else 1 + len(spec.until))
        """Number of frame bytes that must be present before the length field can be read."""

    def total(self, data: bytes | bytearray, at: int) -> int | None:
        """Return the size of the frame at `at`, in bytes; negative if invalid, None if unknown."""
        digits = self._digits(data, at)
        if digits is None:
            return None
        number = _number(bytes(data[digits]), self._base)
        behind = digits.stop - at + len(self._spec.until)
        return -1 if number < 0 else behind + number * self._spec.unit + self._spec.adjust

    def head(self, frame: bytes) -> int:
        """Return the offset of the payload in a complete frame."""
        digits = self._digits(frame, 0)
        if digits is None:
            raise BadFrame("short-frame", f"{len(frame)} bytes are too few to hold the length")
        end: int = digits.stop
        return end + len(self._spec.until)

    def before(self, payload: bytes, tail: int) -> bytes:
        """Return the length field for a payload and a trailer of `tail` bytes.

        Raises:
            BadFrame: the length field cannot represent the size.
        """
        spec = self._spec
        number, left = divmod(len(payload) + tail - spec.adjust, spec.unit)
        if left or number < 0:
            raise BadFrame("wrong-size", f"the length field cannot hold {len(payload)} bytes")
        text = b"%d" % number if self._base == 10 else b"%x" % number
        text = text.upper() if spec.spelling == "HEX" else text
        count = b"%d" % len(text) if self._base == 10 else b"%X" % len(text)
        if len(text) > spec.size if spec.until else len(count) > spec.size:
            raise BadFrame("wrong-size", f"the length field cannot hold {number}")
        return text + spec.until if spec.until else count.rjust(spec.size, b"0") + text

    def _digits(self, data: bytes | bytearray, at: int) -> slice | None:
        """Return the range of the digits, which may be empty; None if the digits are incomplete."""
        spec = self._spec
        first = at + spec.offset
        if spec.until:
            found = data.find(spec.until, first, first + spec.size + len(spec.until))
            if found >= 0:
                return slice(first, found)
            return slice(first, first) if len(data) - first > spec.size else None
        start = first + spec.size
        if len(data) < start:
            return None
        count = _number(bytes(data[first:start]), self._base)
        if count <= 0:
            return slice(start, start)
        return slice(start, start + count) if len(data) >= start + count else None


def _number(digits: bytes, base: int) -> int:
    """Return the number that the digits spell; -1 for an invalid number."""
    if not digits.isalnum() or len(digits) > 16:
        return -1
    try:
        return int(digits, base)
    except ValueError:
        return -1
