"""Lines on standard input, typed or written by a program, while a verb runs."""

import asyncio
import os
import stat
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Final, TextIO

__all__ = ["typed_lines"]

_LONGEST: Final = 4096
"""Bytes of a line; longer lines are dropped."""
_MOST_WAITING: Final = 64
"""Unread lines; beyond this number the newest are dropped."""


async def typed_lines(stream: TextIO | None) -> AsyncIterator[str]:
    """Yield the lines of a stream until it ends; at once nothing where it cannot be read.

    In the background of a terminal nothing is read: the terminal would stop the process.

    Args:
        stream: a pipe or terminal, None where there is none.
    """
    try:
        handle = -1 if stream is None else stream.fileno()
    except (OSError, ValueError):
        return
    if stream is None or handle < 0:
        return
    if stat.S_ISREG(os.fstat(handle).st_mode):
        for text in await asyncio.to_thread(stream.readlines, _MOST_WAITING * _LONGEST):
            yield text.rstrip("\n")
        return
    loop, lines = asyncio.get_running_loop(), asyncio.Queue[str | None](_MOST_WAITING)
    rest = bytearray()

    def read() -> None:
        if not _is_ours(handle):
            return
        try:
            data = os.read(handle, _LONGEST)
        except OSError:
            data = b""
        *whole, last = (bytes(rest) + data).split(b"\n")
        rest[:] = last[:_LONGEST]
        for line in whole if data else [*whole, last]:
            with suppress(asyncio.QueueFull):
                lines.put_nowait(line.decode("utf-8", "replace"))
        if not data:
            loop.remove_reader(handle)
            with suppress(asyncio.QueueFull):
                lines.put_nowait(None)

    try:
        loop.add_reader(handle, read)
    except (NotImplementedError, OSError, ValueError):
        return  # a system whose loop watches sockets only
    try:
        while (line := await lines.get()) is not None:
            yield line
    finally:
        loop.remove_reader(handle)


def _is_ours(handle: int) -> bool:
    """Return whether reading is allowed: a terminal belongs to the process in its foreground."""
    try:
        return not os.isatty(handle) or os.tcgetpgrp(handle) == os.getpgrp()
    except (AttributeError, OSError):
        return True
