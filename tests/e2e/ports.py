"""Ports that nobody else takes between the moment a test asks for one and the moment it listens.

A port that the system chose and that was closed again may be the next one it chooses for somebody
else: another test's server, or the near end of any connection. So these lie below all that the
system chooses from, and each process of a run has its own.
"""

import os
import re
import socket
from collections.abc import Iterator
from contextlib import suppress
from itertools import cycle
from pathlib import Path

__all__ = ["free_pair", "free_port"]

_FIRST = 10_000
_SYSTEMS_OWN = Path("/proc/sys/net/ipv4/ip_local_port_range")
_PROCESSES = 16
"""Of one run of pytest, at most, that have a share of their own."""


def free_port() -> int:
    """Return a port that nobody has, for TCP and for UDP, on any address of this machine."""
    for _ in range(_SHARE):
        port = next(_PORTS)
        if _is_free(port, socket.SOCK_STREAM) and _is_free(port, socket.SOCK_DGRAM):
            return port
    raise AssertionError("there is no free port")


def free_pair() -> int:
    """Return a port that nobody has, and whose next port nobody has either."""
    first = free_port()
    while (second := free_port()) != first + 1:
        first = second
    return first


def _is_free(port: int, kind: socket.SocketKind) -> bool:
    with socket.socket(socket.AF_INET, kind) as probe, suppress(OSError):
        probe.bind(("", port))
        return True
    return False


def _first_of_the_system() -> int:
    """Return the lowest port that the system gives away by itself."""
    try:
        return int(_SYSTEMS_OWN.read_text("ascii").split()[0])
    except OSError:
        return 49_152  # as IANA has it, and most systems


def _share() -> Iterator[int]:
    """Go round and round through the ports of this process, beginning anywhere."""
    found = re.search(r"\d+", os.environ.get("PYTEST_XDIST_WORKER", ""))
    number = int(found[0]) % _PROCESSES if found else 0
    first = _FIRST + number * _SHARE
    begin = os.getpid() * 37 % _SHARE  # two runs at once do not meet at once
    return cycle([*range(first + begin, first + _SHARE), *range(first, first + begin)])


_SHARE = max(1000, (_first_of_the_system() - _FIRST) // _PROCESSES)
_PORTS = _share()
