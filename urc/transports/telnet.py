"""The Telnet transport: a byte stream with option negotiation.

The underlying connection is either a TCP connection from this machine or a tunnelled connection.
"""

import asyncio
import socket
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any, Final, NamedTuple

from urc.transports import _options
from urc.transports._faults import late
from urc.transports._stream import StreamTransport, adopt
from urc.transports.base import (
    ByteStream,
    ConnectFailed,
    PeerClosed,
    TransportError,
    TransportSetup,
    Tunnel,
    reset,
    unsent_of,
)
from urc.transports.telnet_protocol import BINARY, ECHO, NAWS, SGA, TTYPE, TelnetNegotiation
from urc.transports.topic_socket import Address

__all__ = ["TelnetTransport", "TelnetOptions", "from_setup"]

DEFAULT_PORT: Final = 23
_QUICKACK: Final = getattr(socket, "TCP_QUICKACK", None)
_COLUMNS: Final = 240
"""Reported terminal width, in characters; wide enough to keep shells from wrapping long lines."""
_LONGEST_NAME: Final = 40
_SMALL_BYTES: Final = 1024
"""Size in bytes below which URC acknowledges a received segment immediately."""


class TelnetOptions(NamedTuple):
    """The Telnet options that URC requests or allows."""

    is_first: bool = False
    """Whether URC starts the negotiation; if false, URC only replies."""
    echo: bool = False
    """Whether the robot may echo the input that URC sends."""
    binary: bool = False
    """Whether all byte values are transmitted unchanged in both directions."""
    terminal: str = "VT100"
    """Terminal type that URC reports on request."""


class TelnetTransport(StreamTransport):
    """A reusable transport over one Telnet connection."""

    def __init__(
        self, host: str, port: int, wishes: TelnetOptions, tunnel: Tunnel | None = None
    ) -> None:
        """Store the address, the options, and the optional tunnel."""
        super().__init__()
        self._address = Address(host, port)
        self._wishes = wishes
        self._tunnel = tunnel

    @property
    def address(self) -> str:
        """The transport's target in readable form, such as ``telnet 192.168.1.5:23``."""
        return f"telnet {self._address.text}"

    async def open(self, timeout_s: float) -> None:
        """Open the connection within `timeout_s` seconds, or raise `ConnectFailed`."""
        await self.close()
        place = self._address.text
        inner: ByteStream | None = None
        try:
            async with asyncio.timeout(timeout_s):
                inner, line = await self._connect(timeout_s)
                talk, first = _begin(self._wishes)
                if first:
                    await inner.write(first)
            self._stream, inner = _TelnetStream(inner, talk, line), None
        except TimeoutError as fault:
            raise ConnectFailed(late(place, timeout_s)) from fault
        except (OSError, UnicodeError) as fault:
            raise ConnectFailed(self._address.explain(fault)) from fault
        except PeerClosed as closed:
            raise ConnectFailed(f"{place} closed the connection immediately") from closed
        finally:
            if inner is not None:
                await inner.abort()

    async def _connect(self, timeout_s: float) -> tuple[ByteStream, socket.socket | None]:
        if self._tunnel is not None:
            host, port = self._address.host, self._address.port
            return await self._tunnel.connect(host, port, timeout_s), None
        line = await self._address.dial(timeout_s)
        try:
            # A Synch is urgent data; out of band, its last byte would be missing.
            line.setsockopt(socket.SOL_SOCKET, socket.SO_OOBINLINE, 1)
            return await adopt(line), line
        except BaseException:
            line.close()
            raise


class _TelnetStream:
    """The text stream of a Telnet connection, without the negotiation."""

    def __init__(
        self, inner: ByteStream, talk: TelnetNegotiation, line: socket.socket | None
    ) -> None:
        """Run Telnet over the stream `inner`; `line` is the local socket of the stream, or None."""
        self._inner = inner
        self._talk = talk
        self._line = line
        self._put = inner.write  # used for every message, so looked up only once
        self._encode = talk.encode

    async def read(self) -> bytes:
        while True:
            data = await self._inner.read()
            if self._line is not None and len(data) < _SMALL_BYTES:
                _acknowledge(self._line)
            text, answers = self._talk.receive(data)
            if answers:
                await self._put(answers)
            if text:
                return text

    def write(self, data: bytes) -> Coroutine[Any, Any, None]:
        return self._put(self._encode(data))

    async def abort(self) -> None:
        await self._inner.abort()

    def unsent(self) -> int:
        return unsent_of(self._inner)

    async def reset(self) -> None:
        await reset(self._inner)


def _acknowledge(line: socket.socket) -> None:
    """Acknowledge received bytes immediately.

    Many Telnet servers send small segments and wait for each acknowledgement. Delayed
    acknowledgements would add 40 ms to each command. The system resets the socket option for
    immediate acknowledgements at every read.
    """
    if _QUICKACK is not None:
        with suppress(OSError):  # the connection is closing
            line.setsockopt(socket.IPPROTO_TCP, _QUICKACK, 1)


def from_setup(setup: TransportSetup) -> TelnetTransport:
    """Return a Telnet transport for a document's options; see docs/transports/telnet.md.

    Raises:
        TransportError: an option is missing or invalid.
    """
    options = {"port": DEFAULT_PORT, **setup.options}
    terminal = _options.text("telnet", options, "terminal", "VT100")
    if len(terminal) > _LONGEST_NAME or not (terminal.isascii() and terminal.isprintable()):
        raise TransportError(
            f"telnet: terminal must be a name of up to {_LONGEST_NAME} ASCII characters,"
            f" not {terminal!r}"
        )
    negotiate = _options.choice("telnet", options, "negotiate", ("full", "passive"), "passive")
    wishes = TelnetOptions(
        is_first=negotiate == "full",
        echo=_options.flag("telnet", options, "echo", default=False),
        binary=_options.flag("telnet", options, "binary", default=False),
        terminal=terminal,
    )
    host, port = _options.host("telnet", options), _options.port("telnet", options)
    return TelnetTransport(host, port, wishes, setup.tunnel)


def _begin(wishes: TelnetOptions) -> tuple[TelnetNegotiation, bytes]:
    """Return the state of a new negotiation, and the first bytes to send."""
    binary = (BINARY,) if wishes.binary else ()
    echo = (ECHO,) if wishes.echo else ()
    talk = TelnetNegotiation(
        ours=frozenset((SGA, TTYPE, NAWS, *binary)),
        theirs=frozenset((SGA, *binary, *echo)),
        terminal=wishes.terminal,
        columns=_COLUMNS,
    )
    if not wishes.is_first:
        return talk, b""
    return talk, talk.requests(ours=(SGA, *binary), theirs=(SGA, *binary, *echo))
