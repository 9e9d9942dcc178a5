"""The Telnet protocol without a socket: separation of text from negotiation, and replies.

Pure. Options are negotiated with the Q method (RFC 1143), which prevents loops: replies are sent
only for changes. URC never withdraws an agreed option, so the six states of the Q method reduce to
the three states of `_Side`. URC replies with a refusal to every request for an unknown option,
because servers negotiate in several rounds and wait for the last reply.
"""

import re
from collections.abc import Callable
from typing import Final

__all__ = ["BINARY", "ECHO", "NAWS", "SGA", "TTYPE", "TelnetNegotiation"]

BINARY: Final = 0
"""Transmit all byte values unchanged, including NUL and CR (RFC 856)."""
ECHO: Final = 1
"""The side that offers the option echoes received characters (RFC 857)."""
SGA: Final = 3
"""Suppress Go Ahead, which enables full-duplex operation (RFC 858)."""
TTYPE: Final = 24
"""Report the terminal type on request (RFC 1091)."""
NAWS: Final = 31
"""Report the window size of the terminal (RFC 1073)."""

_SE, _SB, _WILL, _WONT, _DO, _DONT, _IAC = 240, 250, 251, 252, 253, 254, 255
_CR: Final = 13
_SEND, _IS = b"\x01", b"\x00"
_IAC_BYTE: Final = b"\xff"
_LONGEST_DETAIL: Final = 256
"""Maximum stored length of a subnegotiation, in bytes; all supported subnegotiations are shorter.
"""
_BARE_CR: Final = re.compile(rb"\r(?![\n\0])")

_Step = Callable[[bytes, int], int]


class _Side:
    """The options of one side: local (requested by DO) or remote (offered by WILL)."""

    def __init__(self, agree: int, refuse: int, allowed: frozenset[int]) -> None:
        self._agree, self._refuse, self._allowed = agree, refuse, allowed
        self.active: set[int] = set()
        self._asked: set[int] = set()

    def request(self, option: int) -> bytes:
        """Return the request to enable `option`."""
        if option in self.active or option in self._asked:
            return b""
        self._asked.add(option)
        return bytes((_IAC, self._agree, option))

    def told_on(self, option: int) -> bytes:
        """Return the reply to a request or offer that enables `option`."""
        if option in self.active:
            return b""
        if option in self._asked:
            self._asked.discard(option)
            self.active.add(option)
            return b""
        if option in self._allowed:
            self.active.add(option)
            return bytes((_IAC, self._agree, option))
        return bytes((_IAC, self._refuse, option))

    def told_off(self, option: int) -> bytes:
        """Return the reply to a request or announcement that disables `option`."""
        self._asked.discard(option)
        if option not in self.active:
            return b""
        self.active.discard(option)
        return bytes((_IAC, self._refuse, option))


class TelnetNegotiation:
    """The protocol state of one end of a Telnet connection."""

    def __init__(
        self,
        *,
        ours: frozenset[int] = frozenset((SGA, BINARY, TTYPE, NAWS)),
        theirs: frozenset[int] = frozenset((SGA, BINARY, ECHO)),
        terminal: str = "VT100",
        columns: int = 80,
        rows: int = 24,
    ) -> None:
        """Create the protocol state for a new connection, with no option enabled.

        Args:
            ours: local options that URC enables on request.
            theirs: remote options that URC permits.
            terminal: terminal type to report on request.
            columns: the terminal's width in characters, 1 to 65535.
            rows: the terminal's height in characters.
        """
        self._ours = _Side(_WILL, _WONT, ours)
        self._theirs = _Side(_DO, _DONT, theirs)
        self._terminal = terminal.encode("ascii", "replace")
        self._size = columns.to_bytes(2, "big") + rows.to_bytes(2, "big")
        self._step: _Step = self._text
        self._verb = 0
        self._detail = bytearray()
        self._found: list[bytes] = []
        self._answers: list[bytes] = []

    @property
    def ours(self) -> frozenset[int]:
        """Options that are enabled on the local side."""
        return frozenset(self._ours.active)

    @property
    def theirs(self) -> frozenset[int]:
        """Options that are enabled on the remote side."""
        return frozenset(self._theirs.active)

    def requests(self, *, ours: tuple[int, ...] = (), theirs: tuple[int, ...] = ()) -> bytes:
        """Return the bytes that request the options `ours` and `theirs`."""
        wishes = [self._ours.request(option) for option in ours]
        return b"".join(wishes + [self._theirs.request(option) for option in theirs])

    def receive(self, data: bytes) -> tuple[bytes, bytes]:
        """Return the text in `data` and the replies to the commands in `data`.

        A command may be split at any byte between two calls. Commands such as Interrupt Process or
        Synch are irrelevant to drivers and are dropped.
        """
        if self._step == self._text and _IAC not in data:
            return self._as_meant(data), b""
        at = 0
        while at < len(data):
            at = self._step(data, at)
        found, answers = b"".join(self._found), b"".join(self._answers)
        self._found.clear()
        self._answers.clear()
        return found, answers

    def encode(self, data: bytes) -> bytes:
        """Return `data` in encoded form: a single CR becomes CR NUL, and byte 255 is doubled."""
        # Searching for a number is ten times as fast as searching for a byte string.
        if _CR in data and BINARY not in self._ours.active:
            data = _BARE_CR.sub(b"\r\0", data)
        return data.replace(_IAC_BYTE, b"\xff\xff") if _IAC in data else data

    def _as_meant(self, text: bytes) -> bytes:
        """Return text without NUL characters, which appear only after a CR or as padding."""
        return text if BINARY in self._theirs.active else text.translate(None, b"\0")

    # -- states of the parser; each consumes bytes from `at` and returns the next offset

    def _text(self, data: bytes, at: int) -> int:
        end = data.find(_IAC_BYTE, at)
        if end < 0:
            end = len(data)
        else:
            self._step = self._command
        self._found.append(self._as_meant(data[at:end]))
        return end + 1

    def _command(self, data: bytes, at: int) -> int:
        self._verb = data[at]
        self._step = self._text
        if self._verb == _IAC:
            self._found.append(_IAC_BYTE)
        elif self._verb == _SB:
            self._detail.clear()
            self._step = self._subnegotiation
        elif _WILL <= self._verb <= _DONT:
            self._step = self._option
        return at + 1

    def _option(self, data: bytes, at: int) -> int:
        option = data[at]
        self._step = self._text
        side = self._theirs if self._verb in (_WILL, _WONT) else self._ours
        told = side.told_on if self._verb in (_WILL, _DO) else side.told_off
        answer = told(option)
        self._answers.append(answer)
        if answer and option == NAWS and NAWS in self._ours.active and side is self._ours:
            self._answers.append(self._subnegotiated(NAWS, self._size))
        return at + 1

    def _subnegotiation(self, data: bytes, at: int) -> int:
        end = data.find(_IAC_BYTE, at)
        if end < 0:
            end = len(data)
        else:
            self._step = self._subnegotiation_command
        room = _LONGEST_DETAIL - len(self._detail)
        self._detail += data[at:end][: max(0, room)]
        return end + 1

    def _subnegotiation_command(self, data: bytes, at: int) -> int:
        if data[at] == _IAC:
            self._step = self._subnegotiation
            if len(self._detail) < _LONGEST_DETAIL:
                self._detail += _IAC_BYTE
            return at + 1
        self._step = self._text
        if data[at] == _SE:
            self._answers.append(self._answer_to(bytes(self._detail)))
            return at + 1
        return self._command(data, at)  # the end is missing: the new command takes precedence

    def _answer_to(self, detail: bytes) -> bytes:
        asks_terminal = detail == bytes((TTYPE,)) + _SEND
        if asks_terminal and TTYPE in self._ours.active:
            return self._subnegotiated(TTYPE, _IS + self._terminal)
        return b""

    def _subnegotiated(self, option: int, detail: bytes) -> bytes:
        content = bytes((option,)) + detail
        return b"\xff\xfa" + content.replace(_IAC_BYTE, b"\xff\xff") + b"\xff\xf0"
