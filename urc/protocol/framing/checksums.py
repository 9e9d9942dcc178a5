"""Checksums over part of a frame, verified on receipt and written on transmission.

Pure. `urc._checksum_math` computes the checksums. Every operation on a checksum takes time linear
in the size of the frame.
"""

import binascii
from collections.abc import Callable

from urc._checksum_math import build_algorithm
from urc.model.framing import ByteRange, ChecksumSpec, Salt
from urc.problems import UrcError

__all__ = ["BadFrame", "Checksum", "cut"]


class BadFrame(UrcError):
    """Received bytes are not a valid frame, or a payload cannot become a frame."""

    def __init__(self, code: str, message: str, *, closes: bool = False) -> None:
        super().__init__(message)
        self.code = code
        self.closes = closes
        """Whether the invalid frame requires closing the connection."""


class Checksum:
    """A checksum at a fixed position in a frame."""

    def __init__(self, spec: ChecksumSpec) -> None:
        self.spec = spec
        self.size = spec.size
        self._compute = build_algorithm(spec.algorithm, is_big=spec.is_big)
        self._salt = _salter(spec.salt)

    def check(self, frame: bytes) -> None:
        """Verify the checksum of a received frame; raise `BadFrame` if the checksum is wrong."""
        place = self._place(frame)
        right = self.right(frame, self._window(frame, place))
        if right is not None:
            self.compare(frame[place : place + self.size], right)

    def write(self, frame: bytearray) -> None:
        """Write the checksum into the frame; raise `BadFrame` if the frame is too short."""
        place = self._place(frame)
        right = self.right(frame, self._window(frame, place))
        if right is None:
            raise self.saltless(frame)
        frame[place : place + self.size] = right

    def right(self, frame: bytes | bytearray, window: bytes) -> bytes | None:
        """Return the bytes of the checksum that `frame` should have, computed over `window`.

        Return None if the salt table has no row for the frame but permits such frames; the receiver
        then skips the check.
        """
        data = window
        if self.spec.is_from_hex:
            data = _from_hex(data)
        if self.spec.before:
            data = self.spec.before + data
        if self._salt is not None:
            salt = self._salt(frame)
            if salt is None:
                return None
            data += salt
        return self._spelt(self._compute(data))

    def compare(self, found: bytes, right: bytes) -> None:
        """Raise `BadFrame` if `found` differs from `right`, ignoring the case of hex digits."""
        spelling = self.spec.spelling
        if found == right or (spelling[0] in "hH" and found.upper() == right.upper()):
            return
        raise self.wrong(
            f"the frame has the checksum {_shown(found, spelling)},"
            f" expected {_shown(right, spelling)}; dropped"
        )

    def wrong(self, message: str) -> BadFrame:
        """Return the error for a received frame with a wrong checksum."""
        return BadFrame("bad-checksum", message, closes=self.spec.closes)

    def saltless(self, frame: bytes | bytearray) -> BadFrame:
        """Return the error for an outgoing frame that has no row in the salt table."""
        number = self.spec.salt.number(frame)
        return BadFrame("no-salt", f"the salt table of the checksum has no row {number}")

    def _place(self, frame: bytes | bytearray) -> int:
        place = self.spec.at if self.spec.at >= 0 else len(frame) + self.spec.at
        if place < 0 or place + self.size > len(frame):
            raise BadFrame("short-frame", f"{len(frame)} bytes are too few to hold the checksum")
        return place

    def _window(self, frame: bytes | bytearray, place: int) -> bytes:
        """Return the checksum input, with zeros in place of the checksum itself."""
        start, data = cut(frame, self.spec.over)
        stop = start + len(data)
        first, last = max(start, place), min(stop, place + self.size)
        if first < last:
            data = data[: first - start] + bytes(last - first) + data[last - start :]
        return data

    def _spelt(self, number: int) -> bytes:
        spec = self.spec
        if spec.spelling == "dec":
            return b"%0*d" % (self.size, number)
        data = number.to_bytes((spec.bits + 7) // 8, "big" if spec.is_big else "little")
        if spec.spelling == "raw":
            return data
        digits = data.hex()
        return (digits if spec.spelling == "hex" else digits.upper()).encode()


def cut(frame: bytes | bytearray, window: ByteRange) -> tuple[int, bytes]:
    """Return start offset and bytes of `window`; raise `BadFrame` if `frame` is too short."""
    start, stop, _ = slice(window.start, window.stop).indices(len(frame))
    if start > stop:
        raise BadFrame("short-frame", f"{len(frame)} bytes are too few for the checksum")
    return start, bytes(frame[start:stop])


def _from_hex(digits: bytes) -> bytes:
    try:
        return binascii.unhexlify(digits)
    except binascii.Error:
        raise BadFrame(
            "bad-checksum", "the checksum covers hex digits, found other bytes"
        ) from None


def _salter(salt: Salt) -> Callable[[bytes | bytearray], bytes | None] | None:
    if salt.constant:
        constant = salt.constant
        return lambda _: constant
    if not salt.table:
        return None

    def choose(frame: bytes | bytearray) -> bytes | None:
        number = salt.number(frame)
        found = None if number is None else salt.table.get(number)
        if found is not None or (number is not None and salt.otherwise == "pass"):
            return found
        # An empty code drops the frame silently: see `SKIPPED`.
        code = "" if salt.otherwise == "skip" and number is not None else "no-salt"
        raise BadFrame(code, f"the salt table of the checksum has no row {number}")

    return choose


def _shown(data: bytes, spelling: str) -> str:
    return data.hex(" ") if spelling == "raw" else ascii(data.decode("latin-1"))
