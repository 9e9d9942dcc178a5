"""Byte stuffing by declaration: bytes that mean something to the framing, hidden in its frames.

Floor 3, pure. Three ways cover what robots do: an escape byte before the byte it stands for
(HDLC and PPP: 7D and the byte xor 20; a table, as SLIP has one), an escape byte that is doubled
(DLE DLE), and a byte put in behind a sequence (FF FF FD is followed by one more FD).
"""

import re
from collections.abc import Mapping
from typing import Final, NoReturn

from urc.model.framing import EscapeSpec
from urc.protocol.checksums import BadFrame

__all__ = ["Stuffing", "Unstuffer"]

_ANY: Final = range(256)


class Stuffing:
    """One way of stuffing, in both directions; each takes linear time."""

    def __init__(self, spec: EscapeSpec) -> None:
        self.spec = spec
        self.escape = bytes((spec.byte,))
        self.is_doubled = not spec.after and spec.table.get(spec.byte) == spec.byte
        """Whether the escape byte itself may be the begin of a mark."""
        self.meant = _meant(spec)
        """Byte behind the escape → byte that both stand for."""
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
        """Return `data` as it goes over the line."""
        if self.spec.after:
            return data.replace(self._plain, self._plain + self._inserted)
        written = self._written
        return self._hidden.sub(lambda found: written[found[0]], data)

    def unstuff(self, data: bytes) -> bytes:
        """Return what `data` stands for; raise `BadFrame` where it stands for nothing."""
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
        text = f"{shown.hex(' ')} is not stuffed as this framing says; the frame is dropped"
        raise BadFrame("bad-stuffing", text)


def _meant(spec: EscapeSpec) -> Mapping[int, int]:
    if spec.xor is not None:
        # Any byte may be hidden; who sends chooses which ones are.
        return {second: second ^ spec.xor for second in _ANY}
    return {second: plain for plain, second in spec.table.items()}


class Unstuffer:
    """Takes the stuffing out of bytes that are still coming in, one after another."""

    def __init__(self, stuffing: Stuffing) -> None:
        self._stuffing = stuffing
        self.plain = bytearray()
        self._is_escaped = False
        self._tail = b""
        """Newest bytes, as long as the sequence behind which a byte is put in."""

    def take(self, byte: int) -> bool:
        """Take one byte of the line; return False when it cannot stand here."""
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
        """Whether the byte that comes next belongs to what was taken."""
        return self._is_escaped
