"""Error messages about connections, worded in the same way for all transports."""

import errno
import socket

from urc.problems import printable
from urc.transports.own_listeners import OwnAddressError

__all__ = ["CLOSED", "HUNG_UP", "broke", "explain", "late", "one_line", "place_of", "reason"]

CLOSED = "the connection is closed"
"""The message for a connection that URC has closed."""
HUNG_UP = "the robot closed the connection"


_SHOWN = 200


def one_line(said: str, most: int = _SHOWN) -> str:
    """Return text from a remote host as a single line, for use in a message.

    Control characters are escaped, and text longer than `most` characters is truncated.
    """
    text = printable(" ".join(said[: 4 * most].split()))
    return text if len(text) <= most else f"{text[: most - 1]}…"


def place_of(host: str, port: int) -> str:
    """Return a host and port as ``HOST:PORT``, with brackets around an IPv6 address."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def late(place: str, timeout_s: float) -> str:
    """Return the message for a robot at `place` that has not answered within `timeout_s`."""
    return f"no answer from {place} within {timeout_s:g} s"


def broke(fault: BaseException) -> str:
    """Return the message for a broken connection, with the reason."""
    return f"the connection broke ({reason(fault)})"


def explain(host: str, place: str, fault: OSError | UnicodeError) -> str:
    """Return the message for a failed connection to `place`, with the reason."""
    if isinstance(fault, OwnAddressError):
        return f"{place}: {fault.strerror}"
    if isinstance(fault, socket.gaierror | UnicodeError):
        return f"no such host {host!r}"
    if isinstance(fault, ConnectionRefusedError):
        return f"nothing listens on {place} (connection refused)"
    if isinstance(fault, TimeoutError):
        return f"no answer from {place}"
    if fault.errno in (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ENETDOWN):
        return f"no route to {place} from this network ({reason(fault)})"
    return f"cannot connect to {place} ({reason(fault)})"


def reason(fault: BaseException) -> str:
    """Return the operating system's error text in lower case, without the error number."""
    text = getattr(fault, "strerror", None) or str(fault) or type(fault).__name__
    return one_line(str(text).lower())
