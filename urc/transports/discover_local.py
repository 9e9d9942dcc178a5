"""Detection of listening ports by connecting briefly to each port, without sending data."""

import asyncio
from collections.abc import Iterable
from contextlib import suppress

__all__ = ["listening"]

CONNECT_S = 1.0
"""Timeout for connecting to a port, in seconds; short, because this machine replies at once."""
_AT_ONCE = 16


async def listening(places: Iterable[tuple[str, int]]) -> list[tuple[str, int]]:
    """Return the `places` (host and port) that accept connections, in their original order."""
    turns = asyncio.Semaphore(_AT_ONCE)

    async def is_there(place: tuple[str, int]) -> bool:
        async with turns:
            try:
                async with asyncio.timeout(CONNECT_S):
                    _, writer = await asyncio.open_connection(*place)
            except (OSError, UnicodeError):
                return False
            writer.transport.abort()
            with suppress(OSError):
                await writer.wait_closed()
            return True

    every = list(dict.fromkeys(places))
    found = await asyncio.gather(*map(is_there, every))
    return [place for place, is_found in zip(every, found, strict=True) if is_found]
