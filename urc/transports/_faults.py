"""One shape of sentence for whatever goes wrong on a line, whichever transport it is."""

import errno
import socket

from urc.problems import printable
from urc.transports.own_doors import OwnDoor

__all__ = ["CLOSED", "HUNG_UP", "broke", "explain", "late", "one_line", "place_of", "reason"]

CLOSED = "the line is closed"
"""By us."""
HUNG_UP = "the robot closed the line"


_SHOWN = 200


def one_line(said: str, most: int = _SHOWN) -> str:
    """Return what the other side said as part of a line for people.

    Control characters are written as escapes, and what is longer than `most` characters is cut.
    """
    text = printable(" ".join(said[: 4 * most].split()))
    return text if len(text) <= most else f"{text[: most - 1]}…"


def place_of(host: str, port: int) -> str:
    """Return a host and port as people write them."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def late(place: str, timeout_s: float) -> str:
    """Say that nobody answered in time."""
    return f"no answer from {place} within {timeout_s:g} s"


def broke(fault: BaseException) -> str:
    """Say that an open line broke, and why."""
    return f"the line broke ({reason(fault)})"


def explain(host: str, place: str, fault: OSError | UnicodeError) -> str:
    """Return one line about why a line to `place` could not be opened."""
    if isinstance(fault, OwnDoor):
        return f"{place}: {fault.strerror}"
    if isinstance(fault, socket.gaierror | UnicodeError):
        return f"no such host {host!r}"
    if isinstance(fault, ConnectionRefusedError):
        return f"nothing listens on {place} (connection refused)"
    if isinstance(fault, TimeoutError):
        return f"no answer from {place}"
    if fault.errno in (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ENETDOWN):
        return f"no way to {place} from this network ({reason(fault)})"
    return f"cannot connect to {place} ({reason(fault)})"


def reason(fault: BaseException) -> str:
    """Return the system's words for `fault`, in lower case, without the number."""
    text = getattr(fault, "strerror", None) or str(fault) or type(fault).__name__
    return one_line(str(text).lower())
