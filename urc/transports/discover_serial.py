"""The serial ports of this machine, listed by serialx (extra ``serial``)."""

from importlib.util import find_spec
from typing import NamedTuple

from urc._extras import missing
from urc.transports.base import TransportError

__all__ = ["SerialPort", "serial_ports"]


class SerialPort(NamedTuple):
    """One port."""

    device: str
    usb: str
    """USB vendor and product identifiers, such as ``2341:0043``; "" for non-USB devices."""
    product: str
    serial_number: str


def serial_ports() -> list[SerialPort]:
    """Return all serial ports of the system, with USB devices first.

    Raises:
        TransportError: the library is missing, or the system cannot list its ports.
    """
    if find_spec("serialx") is None:
        raise TransportError(missing("serial ports need", "serialx", "serial"))
    import serialx

    try:
        ports = serialx.list_serial_ports()
    except OSError as fault:
        why = (fault.strerror or str(fault)).lower()
        raise TransportError(f"the serial ports cannot be listed ({why})") from fault
    found = [
        SerialPort(
            str(port.device),
            f"{port.vid:04x}:{port.pid:04x}"
            if port.vid is not None and port.pid is not None
            else "",
            " ".join(filter(None, (port.manufacturer, port.product))),
            port.serial_number or "",
        )
        for port in ports
    ]
    return sorted(found, key=lambda port: (not port.usb, port.device))
