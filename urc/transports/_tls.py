"""TLS over any stream: a socket, or a tunnelled connection.

The standard library's TLS implementation uses two memory buffers, which are connected to the
underlying stream. The minimum version is TLS 1.2, and certificates are verified unless verification
is disabled.
"""

import asyncio
import ssl
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Self, TypeVar

from urc.transports import _options
from urc.transports._faults import HUNG_UP, reason
from urc.transports.base import (
    ByteStream,
    ConnectFailed,
    PeerClosed,
    SupportsEnd,
    TransportError,
    ends_of,
    reset,
    unsent_of,
)

__all__ = ["Tls"]

_T = TypeVar("_T")

_READ_BYTES = 65536
_PEM = "-----BEGIN"
_EXPIRED, _NOT_YET = 10, 9
_WRONG_NAME = (62, 64)
_UNKNOWN = (2, 18, 19, 20, 21)
"""OpenSSL error numbers (``X509_V_ERR_…``) for invalid certificates."""


class Tls:
    """The TLS settings of a connection, from the option ``tls``."""

    def __init__(
        self, context: ssl.SSLContext, server_name: str = "", *, is_server: bool = False
    ) -> None:
        """Store the settings.

        The peer's certificate must match `server_name`, or the host if `server_name` is empty.
        """
        self._context = context
        self._server_name = server_name
        self._is_server = is_server

    @classmethod
    def of(cls, kind: str, option: object, *, is_server: bool = False) -> Self | None:
        """Return the TLS settings from the option, or None if TLS is off.

        Args:
            kind: the transport's type, for error messages.
            option: ``true``, ``false``, None, or a mapping with ``ca``, ``cert``, ``key``,
                ``server_name`` and ``verify``. The values of ``ca``, ``cert`` and ``key`` are file
                names or PEM text.
            is_server: whether the robot connects to URC, so that URC is the TLS server and presents
                its certificate.

        Raises:
            TransportError: an option or a file is invalid.
        """
        if option is None or option is False:
            return None
        if option is True:
            option = {}
        if not isinstance(option, Mapping):
            raise TransportError(
                f"{kind}: tls must be true, false or a mapping of options, not {option!r}"
            )
        context = _context_of(f"{kind}, tls", option, is_server=is_server)
        return cls(context, _options.text(kind, option, "server_name"), is_server=is_server)

    async def secure(self, stream: ByteStream, host: str, place: str) -> ByteStream:
        """Perform the TLS handshake over `stream`; close the stream on failure or cancellation.

        Raises:
            ConnectFailed: the peer is not trusted or does not speak TLS.
        """
        name = None if self._is_server else self._server_name or host
        try:
            secured = _TlsStream(stream, self._context, name)
            await secured.shake_hands()
        except ssl.SSLError as fault:
            await stream.abort()
            raise ConnectFailed(_explain(place, name or "", fault)) from fault
        except (PeerClosed, ValueError) as fault:
            await stream.abort()
            raise ConnectFailed(f"no TLS connection to {place} ({fault})") from fault
        except BaseException:
            await stream.abort()
            raise
        return secured


class _TlsStream:
    """An encrypted `ByteStream` over another stream."""

    def __init__(self, stream: ByteStream, context: ssl.SSLContext, name: str | None) -> None:
        self._stream = stream
        self._arrived = ssl.MemoryBIO()
        self._leaving = ssl.MemoryBIO()
        self._tls = context.wrap_bio(
            self._arrived, self._leaving, server_side=name is None, server_hostname=name
        )
        self._turn = asyncio.Lock()
        """Lock that keeps TLS records in the order in which they were encrypted."""

    async def shake_hands(self) -> None:
        while True:
            try:
                self._tls.do_handshake()
            except ssl.SSLWantReadError:
                await self._flush()
                self._arrived.write(await self._stream.read())
            except ssl.SSLError:
                await self._flush()  # the alert, which tells the other side the reason
                raise
            else:
                await self._flush()
                return

    async def read(self) -> bytes:
        while True:
            data = self._decrypted()
            if self._leaving.pending:
                await self._flush()  # the reply to a key update
            if data:
                return data
            self._arrived.write(await self._stream.read())

    async def write(self, data: bytes) -> None:
        _guarded(lambda: self._tls.write(data))
        await self._flush()

    async def abort(self) -> None:
        await self._stream.abort()

    def ends(self) -> tuple[str, str]:
        return ends_of(self._stream)

    def unsent(self) -> int:
        return self._leaving.pending + unsent_of(self._stream)

    async def reset(self) -> None:
        await reset(self._stream)

    def end(self, why: str) -> None:
        if isinstance(self._stream, SupportsEnd):
            self._stream.end(why)

    async def _flush(self) -> None:
        async with self._turn:
            if data := self._leaving.read():
                await self._stream.write(data)

    def _decrypted(self) -> bytes:
        """Return the data decrypted so far, possibly b""."""
        parts: list[bytes] = []
        while True:
            try:
                part = self._tls.read(_READ_BYTES)
            except ssl.SSLWantReadError:
                break
            except ssl.SSLError as fault:
                if parts:
                    break  # reported by the next call
                if isinstance(fault, ssl.SSLZeroReturnError):
                    raise PeerClosed(HUNG_UP) from fault
                raise PeerClosed(f"the connection broke (TLS: {_words(fault)})") from fault
            if not part:
                if not parts:
                    raise PeerClosed(HUNG_UP)
                break
            parts.append(part)
        return b"".join(parts)


def _guarded(work: Callable[[], _T]) -> _T:
    try:
        return work()
    except ssl.SSLError as fault:
        raise PeerClosed(f"the connection broke (TLS: {_words(fault)})") from fault


def _context_of(where: str, options: Mapping[str, object], *, is_server: bool) -> ssl.SSLContext:
    side = ssl.Purpose.CLIENT_AUTH if is_server else ssl.Purpose.SERVER_AUTH
    authority = _options.text(where, options, "ca")
    is_checked = _options.flag(where, options, "verify", default=True)
    try:
        context = ssl.create_default_context(side)
        if authority:
            if not is_server:
                context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # trust this authority only
            context.load_verify_locations(cadata=_pem(authority))
    except (OSError, ValueError) as fault:
        raise TransportError(f"{where}: cannot use ca ({reason(fault)})") from fault
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    if not is_checked:
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
    elif is_server and authority:
        context.verify_mode = ssl.CERT_REQUIRED
    _load_own(where, context, options, is_server=is_server)
    return context


def _load_own(
    where: str, context: ssl.SSLContext, options: Mapping[str, object], *, is_server: bool
) -> None:
    """Load the client's or the server's certificate, if the options contain a certificate."""
    certificate = _options.text(where, options, "cert")
    key = _options.text(where, options, "key")
    if not certificate:
        if is_server or key:
            raise TransportError(f"{where}: cert must contain a certificate")
        return
    try:
        # The library reads only from files, but a key may be a secret setting. The key is therefore
        # on disk only during the call, in a private folder.
        with tempfile.TemporaryDirectory(prefix="urc-") as folder:
            files = [Path(folder, name) for name in ("cert", "key")]
            files[0].write_text(_pem(certificate), "ascii")
            files[1].write_text(_pem(key or certificate), "ascii")
            context.load_cert_chain(files[0], files[1], password=_no_password)
    except (OSError, ValueError) as fault:
        raise TransportError(f"{where}: cannot use cert and key ({_words(fault)})") from fault


def _no_password() -> str:
    raise ValueError("the key is protected by a password; use an unprotected key")


def _pem(given: str) -> str:
    """Return the content of the named file, or the given text if it is not a file name."""
    return given if _PEM in given else Path(given).expanduser().read_text("ascii")


def _explain(place: str, name: str, fault: ssl.SSLError) -> str:
    """Return a one-line message about a failed TLS handshake with `place`."""
    if isinstance(fault, ssl.SSLCertVerificationError):
        code = fault.verify_code
        if code == _EXPIRED:
            return f"the certificate of {place} has expired"
        if code == _NOT_YET:
            return (
                f"the certificate of {place} is not valid yet; check the clocks of both computers"
            )
        if code in _WRONG_NAME:
            return f"the certificate of {place} is not for {name!r}; see tls.server_name"
        if code in _UNKNOWN:
            return f"the certificate of {place} is from an unknown authority; see tls.ca"
        return f"the certificate of {place} is not valid ({fault.verify_message})"
    if fault.reason in ("WRONG_VERSION_NUMBER", "HTTP_REQUEST", "PACKET_LENGTH_TOO_LONG"):
        return f"{place} does not speak TLS"
    return f"no TLS connection to {place} ({_words(fault)})"


def _words(fault: BaseException) -> str:
    """Return OpenSSL's error text without numbers and source lines."""
    if isinstance(fault, ssl.SSLError) and fault.reason:
        return str(fault.reason).replace("_", " ").lower()
    return reason(fault)
