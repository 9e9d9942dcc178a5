"""TCP to a robot, or from one (``mode: listen``), with TLS where it is asked for."""

from collections.abc import Callable

from urc.transports import _options
from urc.transports._listen import TcpListener
from urc.transports._reach import Reach
from urc.transports._stream import READ_AHEAD_BYTES, Stream, StreamLine
from urc.transports._tls import Tls
from urc.transports.base import Carrier, Setup, Transport, TransportError

__all__ = ["READ_AHEAD_BYTES", "TcpTransport", "from_setup"]

_LOOPBACK = "127.0.0.1"


class TcpTransport(StreamLine):
    """One TCP connection, opened as often as it is needed."""

    def __init__(
        self,
        host: str,
        port: int,
        *,
        via: Carrier | None = None,
        tls: Tls | None = None,
        read_ahead_bytes: int = READ_AHEAD_BYTES,
    ) -> None:
        """Prepare a line to `host` (name or address), `port` 1..65535. Nothing is opened yet."""
        super().__init__()
        self._reach = Reach(host, port, via=via, tls=tls, read_ahead_bytes=read_ahead_bytes)

    @property
    def address(self) -> str:
        """Where it leads, for people: ``tcp 192.168.1.5:6789``."""
        return f"tcp {self._reach.place}"

    async def open(self, timeout_s: float) -> None:
        """Connect, or raise `ConnectFailed` within `timeout_s` seconds.

        Every address of a name is tried in turn, each with a fair share of the time that is left.
        """
        await self.close()
        self._stream = await self._reach.open(timeout_s)

    # -- a `Prompt`

    def offer(self, data: bytes) -> bool:
        """Hand `data` over if nothing waits before it; return whether it was taken."""
        stream = self._stream
        return type(stream) is Stream and stream.offer(data)

    @property
    def is_clogged(self) -> bool:
        """Whether some of what was taken waits for the kernel; `send` waits for it."""
        stream = self._stream
        return type(stream) is Stream and not stream.is_writable

    def divert(self, sink: Callable[[bytes], bool]) -> None:
        """Let `sink` have what arrives, before `receive`, until the line is closed."""
        if isinstance(self._stream, Stream):
            self._stream.sink = sink


def from_setup(setup: Setup) -> Transport:
    """Make a transport out of a document's options.

    ``host`` and ``port`` lead to the robot; with ``mode: listen`` it comes to ``bind`` (loopback
    unless told otherwise) and ``port``, and ``host`` is who may come, unless ``from: any``.

    Raises:
        TransportError: an option is missing or not usable.
    """
    options = setup.options
    mode = _options.choice("tcp", options, "mode", ("connect", "listen"), "connect")
    port = _options.port("tcp", options)
    if mode == "connect":
        if "bind" in options or "from" in options:
            raise TransportError("tcp takes bind and from with mode: listen only")
        host = _options.host("tcp", options)
        tls = Tls.of("tcp", options.get("tls"))
        return TcpTransport(host, port, via=setup.via, tls=tls)
    if setup.via is not None:
        raise TransportError("tcp cannot listen through another transport; leave via or mode out")
    bind = _options.text("tcp", options, "bind", _LOOPBACK)
    only = _options.text("tcp", options, "host")
    who = _options.choice("tcp", options, "from", ("any", "host"), "host" if only else "any")
    if who == "host" and not only:
        raise TransportError("tcp listens for one host only, and needs it as host")
    tls = Tls.of("tcp", options.get("tls"), is_server=True)
    return TcpListener(bind, port, only=only if who == "host" else "", tls=tls)
