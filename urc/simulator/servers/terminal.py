"""The terminal of a simulated shell, with input echo and normalised line endings.

A terminal program sends CR, while a driver may send LF. Real terminals accept both CR and LF.
"""

from typing import Final

from urc.model.driver import TransportSpec

__all__ = ["TerminalInput", "echo_of"]

_LINE_ENDS: Final = (b"\r", b"\n", b"\r\n")


class TerminalInput:
    """The input of one client, converted to the driver's line endings."""

    def __init__(self, spec: TransportSpec) -> None:
        """Use the line ending of `spec`'s framing; without a line ending, keep all bytes."""
        framing = spec.framing.sent or spec.framing
        end = framing.options.get("tx") if framing.type == "delimiter" else None
        self._end = end if isinstance(end, bytes) and end in _LINE_ENDS else b""
        self._was_cr = False

    def read(self, data: bytes) -> bytes:
        """Return `data` with every CR, LF or CR LF replaced by the driver's line ending."""
        if not self._end or not data:
            return data
        if self._was_cr and data[:1] == b"\n":
            data = data[1:]  # the second half of a split line ending
            self._was_cr = False
            if not data:
                return b""
        self._was_cr = data[-1:] == b"\r"
        return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\n", self._end)


def echo_of(data: bytes) -> bytes:
    """Return the bytes that the terminal echoes for typed input."""
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\n", b"\r\n")
