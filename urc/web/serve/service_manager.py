"""Messages that report to systemd whether the server is ready, alive or ending (sd_notify(3)).

Without systemd or under another service manager, `NOTIFY_SOCKET` is not set and no messages are
sent.

Before each heartbeat to the watchdog, the server requests its own `/healthz` over a real
connection. If the event loop is blocked or the port no longer accepts connections, the heartbeat is
not sent and systemd restarts the server. By then, the guard has already stopped the robots
(docs/motion.md).
"""

import asyncio
import logging
import os
import socket
import sys
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from typing import Final
from urllib.parse import urlsplit

__all__ = ["ServiceManager", "answers"]

log = logging.getLogger(__name__)

_SIGNS: Final = 3
"""Number of heartbeats per watchdog interval. sd_watchdog_enabled(3) recommends two. With three
heartbeats, one lost request does not end the server."""
_STATUS: Final = b"HTTP/1.1 "


class ServiceManager:
    """Sends messages to this process's service manager, if there is one.

    Args:
        environment: the environment, with `NOTIFY_SOCKET`, `WATCHDOG_USEC` and `WATCHDOG_PID`.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._place = environment.get("NOTIFY_SOCKET", "")
        if sys.platform == "win32" or not self._place.startswith(("/", "@")):
            self._place = ""
        self.watchdog_s = _watchdog_s(environment) if self._place else 0.0
        """Interval within which systemd expects a heartbeat, in seconds; 0 without a watchdog."""

    def tell(self, *lines: str) -> None:
        """Send assignments such as ``READY=1`` to systemd; log a failure instead of raising it."""
        if sys.platform == "win32" or not self._place:
            return
        # A leading @ denotes the abstract namespace (unix(7)).
        place = "\0" + self._place[1:] if self._place.startswith("@") else self._place
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as out:
                out.setblocking(False)
                out.sendto("\n".join(lines).encode(), place)
        except OSError as error:
            log.warning("cannot send messages to systemd: %s", error.strerror or error)

    async def watch(self, is_healthy: Callable[[float], Awaitable[bool]]) -> None:
        """Send heartbeats while the server is healthy; with a watchdog, never return.

        Args:
            is_healthy: function that returns whether the server answers within a given time in
                seconds.
        """
        if not self.watchdog_s:
            return
        every_s = self.watchdog_s / _SIGNS
        was_healthy = True
        while True:
            healthy = await is_healthy(every_s)
            if healthy:
                self.tell("WATCHDOG=1")
            elif was_healthy:
                log.warning("the server does not answer its own request; systemd gets no heartbeat")
            was_healthy = healthy
            await asyncio.sleep(every_s)


def _watchdog_s(environment: Mapping[str, str]) -> float:
    """Return this process's watchdog interval, in seconds; 0 if there is no watchdog."""
    if environment.get("WATCHDOG_PID", str(os.getpid())) != str(os.getpid()):
        return 0.0
    text = environment.get("WATCHDOG_USEC", "")
    return int(text) / 1e6 if text.isascii() and text.isdecimal() else 0.0


async def answers(url: str, within_s: float) -> bool:
    """Return whether a server answers a plain HTTP request for `/healthz` in time.

    Any answer counts, even a refusal due to too many connections, because a busy server is not
    broken.

    Args:
        url: address of the server. HTTPS ports also answer plain HTTP for this path.
        within_s: time limit for the answer, in seconds.
    """
    place = urlsplit(url)
    writer: asyncio.StreamWriter | None = None
    try:
        async with asyncio.timeout(within_s):
            reader, writer = await asyncio.open_connection(place.hostname, place.port)
            head = f"GET /healthz HTTP/1.1\r\nHost: {place.netloc}\r\nConnection: close\r\n\r\n"
            writer.write(head.encode())
            return await reader.readexactly(len(_STATUS)) == _STATUS
    except (OSError, TimeoutError, asyncio.IncompleteReadError):
        return False
    finally:
        if writer is not None:
            writer.close()
            with suppress(OSError):
                await writer.wait_closed()
