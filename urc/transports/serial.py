"""The serial transport, for a port on this machine or on a server (``socket://``, ``rfc2217://``).

The transport uses the library serialx from the extra ``serial``. For a ``socket://`` address, the
transport opens a plain TCP connection to a server that has already configured the port.
"""

import asyncio
import errno
import os
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple, cast

from urc._extras import missing
from urc.transports import _options
from urc.transports._faults import late, reason
from urc.transports._stream import StreamTransport, tune
from urc.transports._stream_dialer import StreamDialer
from urc.transports.base import (
    ConnectFailed,
    MissingPackage,
    Transport,
    TransportError,
    TransportSetup,
)

if TYPE_CHECKING:
    from urc.transports._serial_port import SerialStream

__all__ = ["SerialSettings", "SerialTransport", "from_setup"]

_PARITIES = {"none": "N", "odd": "O", "even": "E", "mark": "M", "space": "S"}
_FLOWS = ("none", "rts_cts", "xon_xoff")
_SOCKET, _RFC2217 = "socket://", "rfc2217://"


class SerialSettings(NamedTuple):
    """Settings of a serial port."""

    baud: int = 115_200
    """Bits per second."""
    data_bits: int = 8
    parity: str = "none"
    stop_bits: float = 1
    flow_control: str = "none"
    rts: bool | None = None
    """Initial level of the RTS pin; None for the default, which is high."""
    dtr: bool | None = None
    is_exclusive: bool = True
    """Whether to lock other programs out of the port."""


class SerialTransport(StreamTransport):
    """A reusable transport over one serial port."""

    def __init__(self, port: str, settings: SerialSettings) -> None:
        """Store the settings; `port` is a device path, a port name, or an address with a scheme."""
        super().__init__()
        self._port = port
        self._settings = settings
        self._reach: StreamDialer | None = None
        if port.startswith((_SOCKET, _RFC2217)):
            self._reach = StreamDialer(*_host_and_port(port))
        self._is_raw = port.startswith(_SOCKET)

    @property
    def address(self) -> str:
        """The transport's target in readable form, such as ``serial /dev/ttyUSB0``."""
        return f"serial {self._port}"

    async def open(self, timeout_s: float) -> None:
        """Open and configure the port within `timeout_s` seconds, or raise `ConnectFailed`."""
        await self.close()
        if self._is_raw and self._reach is not None:
            self._stream = await self._reach.open(timeout_s)
        else:
            self._stream = await self._open_port(timeout_s)

    async def _open_port(self, timeout_s: float) -> "SerialStream":
        from urc.transports._serial_port import FAULTS, open_port

        try:
            async with asyncio.timeout(timeout_s):
                return await open_port(self._port, _arguments_of(self._settings), tune)
        except TimeoutError as fault:
            raise ConnectFailed(late(self._shown, timeout_s)) from fault
        except FAULTS as fault:
            raise ConnectFailed(explain(self._port, self._shown, fault)) from fault

    @property
    def _shown(self) -> str:
        return self._reach.place if self._reach is not None else self._port


def from_setup(setup: TransportSetup) -> Transport:
    """Return a serial transport for a document's options.

    Raises:
        TransportError: an option is missing or invalid.
        MissingPackage: the extra is not installed.
    """
    options = setup.options
    port = _options.text("serial", options, "port").strip()
    if not port:
        raise TransportError("serial needs a port, such as /dev/ttyUSB0 or socket://HOST:PORT")
    if setup.tunnel is not None:
        raise TransportError("serial cannot be tunnelled; remove tunnel")
    if not port.startswith(_SOCKET):
        _need_serialx()
    return SerialTransport(port, _settings_of(options))


def explain(port: str, shown: str, fault: BaseException) -> str:
    """Return a one-line message about a port that could not be opened."""
    code = getattr(fault, "errno", None) or (fault.args[0] if fault.args else None)
    if isinstance(fault, ConnectionRefusedError):
        return f"nothing listens on {shown} (connection refused)"
    if isinstance(fault, FileNotFoundError) or code in (errno.ENXIO, errno.ENODEV):
        return f"there is no {shown}; is it plugged in?"
    if isinstance(fault, PermissionError):
        return f"no permission for {shown}{_remedy(port)}"
    if code in (errno.EBUSY, errno.EAGAIN):
        return f"{shown} is in use by another program"
    if code in (errno.ENOTTY, errno.EISDIR):
        return f"{shown} is not a serial port"
    if code == errno.EINVAL:
        return f"{shown} cannot be configured; check baud, data_bits, parity and stop_bits"
    words = fault.args[1] if code is not None and len(fault.args) > 1 else reason(fault)
    return f"cannot open {shown} ({str(words).lower()})"


def _remedy(port: str) -> str:
    """Return a hint about the user group that may open the port; "" if the group is unknown."""
    if sys.platform == "win32":
        return ""
    import grp

    try:
        state = os.stat(port)
        group = grp.getgrgid(state.st_gid).gr_name
    except (OSError, KeyError):
        return ""
    if not state.st_mode & 0o060 or group == "root":
        return f"; its mode is {state.st_mode & 0o777:o}, and it belongs to the group {group!r}"
    return (
        f"; add yourself to the group {group!r}: sudo usermod -aG {group} $USER, and sign in again"
    )


def _settings_of(options: Mapping[str, object]) -> SerialSettings:
    return SerialSettings(
        baud=_number(options, "baud", 115_200, range(50, 20_000_001)),
        data_bits=_number(options, "data_bits", 8, range(5, 9)),
        parity=_options.choice("serial", options, "parity", tuple(_PARITIES), "none"),
        stop_bits=_stop_bits(options),
        flow_control=_options.choice("serial", options, "flow_control", _FLOWS, "none"),
        rts=_pin(options, "rts"),
        dtr=_pin(options, "dtr"),
        is_exclusive=_options.flag("serial", options, "exclusive", default=True),
    )


def _number(options: Mapping[str, object], key: str, default: int, among: range) -> int:
    found = options.get(key, default)
    if isinstance(found, bool) or not isinstance(found, int) or found not in among:
        limits = f"{among.start} to {among.stop - 1}"
        raise TransportError(f"serial: {key} must be an integer from {limits}, not {found!r}")
    return found


def _stop_bits(options: Mapping[str, object]) -> float:
    found = options.get("stop_bits", 1)
    if isinstance(found, bool) or found not in (1, 1.5, 2):
        raise TransportError(f"serial: stop_bits must be 1 | 1.5 | 2, not {found!r}")
    return cast("float", found)


def _pin(options: Mapping[str, object], key: str) -> bool | None:
    if options.get(key) is None:
        return None
    return _options.flag("serial", options, key, default=True)


def _arguments_of(settings: SerialSettings) -> dict[str, object]:
    """Return the settings, keyed by the names that serialx uses."""
    from serialx import PinState

    arguments: dict[str, object] = {
        "baudrate": settings.baud,
        "byte_size": settings.data_bits,
        "parity": _PARITIES[settings.parity],
        "stopbits": settings.stop_bits,
        "rtscts": settings.flow_control == "rts_cts",
        "xonxoff": settings.flow_control == "xon_xoff",
        "exclusive": settings.is_exclusive,
    }
    for name, level in (("rts", settings.rts), ("dtr", settings.dtr)):
        if level is not None:
            arguments[f"{name}_on_open"] = PinState.HIGH if level else PinState.LOW
    return arguments


def _host_and_port(address: str) -> tuple[str, int]:
    scheme, _, rest = address.partition("://")
    host, _, number = rest.partition("/")[0].rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    port = int(number) if number.isascii() and number.isdecimal() else 0
    if not host or not 1 <= port <= 65535:
        raise TransportError(
            f"serial: port must have the form {scheme}://HOST:PORT, not {address!r}"
        )
    return host, port


def _need_serialx() -> None:
    try:
        import serialx  # noqa: F401
    except ImportError as error:
        raise MissingPackage(missing("serial needs", "serialx", "serial")) from error
