"""Declared byte stuffing: escape sequences for bytes with a special meaning in the framing.

Pure. Three methods of byte stuffing cover the protocols of common robots. Method 1: an escape byte
precedes a replaced byte, as in HDLC and PPP (0x7D, then the byte XOR 0x20) and in SLIP (a table).
Method 2: an escape byte is doubled (DLE DLE). Method 3: an additional byte follows a sequence (FD
after FF FF FD).
"""

import re
from collections.abc import Mapping
from typing import Final, NoReturn

from urc.model.framing import EscapeSpec
from urc.protocol.framing.checksums import BadFrame

__all__ = ["Stuffing", "Unstuffer"]

_ANY: Final = range(256)


class Stuffing:
    """Encoder and decoder of declared byte stuffing; both take linear time."""

    def __init__(self, spec: EscapeSpec) -> None:
        self.spec = spec
        self.escape = bytes((spec.byte,))
        self.is_doubled = not spec.after and spec.table.get(spec.byte) == spec.byte
        """Whether the escape byte is escaped by doubling, so that it may also begin a marker."""
        self.meant = _meant(spec)
        """Decoded byte, keyed by the byte after the escape byte."""
        if spec.after:
            self._plain, self._inserted = spec.after, bytes((spec.insert,))
            self._pair = re.compile(re.escape(spec.after) + b"(.?)", re.DOTALL)
        else:
            letters = b"".join(re.escape(bytes((one,))) for one in spec.table)
            self._hidden = re.compile(b"[" + letters + b"]")
            self._pair = re.compile(re.escape(self.escape) + b"(.?)", re.DOTALL)
            self._written = {
                bytes((plain,)): self.escape + bytes((second,))
                for plain, second in spec.table.items()
            }

    def stuff(self, data: bytes) -> bytes:
        """Return `data` with byte stuffing."""
        if self.spec.after:
            return data.replace(self._plain, self._plain + self._inserted)
        written = self._written
        return self._hidden.sub(lambda found: written[found[0]], data)

    def unstuff(self, data: bytes) -> bytes:
        """Return `data` without byte stuffing; raise `BadFrame` for invalid stuffing."""
        if self.spec.after:
            return self._pair.sub(self._before, data) if self._plain in data else data
        return self._pair.sub(self._one, data) if self.escape in data else data

    def _before(self, found: "re.Match[bytes]") -> bytes:
        return self._plain if found[1] == self._inserted else self._refuse(found[0])

    def _one(self, found: "re.Match[bytes]") -> bytes:
        second = found[1]
        meant = self.meant.get(second[0]) if second else None
        return self._refuse(found[0]) if meant is None else bytes((meant,))

    @staticmethod
    def _refuse(shown: bytes) -> NoReturn:
        text = f"{shown.hex(' ')} is invalid byte stuffing for this framing; the frame is dropped"
        raise BadFrame("bad-stuffing", text)


def _meant(spec: EscapeSpec) -> Mapping[int, int]:
    if spec.xor is not None:
        # A sender may escape any byte.
        return {second: second ^ spec.xor for second in _ANY}
    return {second: plain for plain, second in spec.table.items()}


class Unstuffer:
    """An incremental decoder of byte stuffing, which processes one byte at a time."""

    def __init__(self, stuffing: Stuffing) -> None:
        self._stuffing = stuffing
        self.plain = bytearray()
        self._is_escaped = False
        self._tail = b""
        """Newest decoded bytes, to detect the sequence after which a byte is inserted."""

    def feed(self, byte: int) -> bool:
        """Process one byte; return False for an invalid byte."""
        spec = self._stuffing.spec
        if spec.after:
            if self._is_escaped:
                self._is_escaped, self._tail = False, b""
                return byte == spec.insert
            self._tail = (self._tail + bytes((byte,)))[-len(spec.after) :]
            self._is_escaped = self._tail == spec.after
            self.plain.append(byte)
            return True
        if self._is_escaped:
            self._is_escaped = False
            meant = self._stuffing.meant.get(byte)
            if meant is None:
                return False
            self.plain.append(meant)
        elif byte == spec.byte:
            self._is_escaped = True
        else:
            self.plain.append(byte)
        return True

    @property
    def is_between(self) -> bool:
        """Whether the next byte completes an escape sequence."""
        return self._is_escaped
