"""Helper processes: modules of URC that run a library written in C outside the server's process.

The server writes records to the process's standard input, and reads records from its standard
output. The process ends with its standard input.
"""

import asyncio
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from io import RawIOBase
from typing import Any, Final

__all__ = ["end_helper", "read_exactly", "start_helper"]

_OUTPUT_BYTES: Final = 2**18
"""Number of unread output bytes at which the server stops reading from the process."""


async def start_helper(
    module: str, *arguments: str, descriptors: Iterable[int] = ()
) -> asyncio.subprocess.Process:
    """Start a module of URC as a process with pipes; its error messages are dropped.

    Args:
        module: name of the module, such as ``urc.transports.camera_process``.
        arguments: command-line arguments, which every user of this computer can read.
        descriptors: file descriptors that the process inherits; no effect on Windows.

    Raises:
        OSError: the system cannot start the process.
    """
    # Ctrl-C in a terminal is meant for the server, which then ends the process.
    more: dict[str, Any] = {"start_new_session": True}
    if sys.platform == "win32":
        more = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    elif descriptors:
        more["pass_fds"] = tuple(descriptors)
    # -P: nothing is imported from the current folder.
    return await asyncio.create_subprocess_exec(
        *(sys.executable, "-P", "-m", module, *arguments),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        limit=_OUTPUT_BYTES,
        **more,
    )


async def end_helper(process: asyncio.subprocess.Process, within_s: float) -> None:
    """Kill a process, and wait at most `within_s` seconds for its end.

    If the wait is cancelled, a second call continues it.
    """
    with suppress(ProcessLookupError):
        process.kill()
    with suppress(TimeoutError):
        async with asyncio.timeout(within_s):
            await process.wait()
    if process.stdin is not None:
        process.stdin.close()


def read_exactly(source: RawIOBase, size: int) -> bytes | None:
    """Return exactly `size` bytes of a process's standard input; None at its end."""
    data = bytearray()
    while len(data) < size:
        piece = source.read(size - len(data))
        if not piece:
            return None
        data += piece
    return bytes(data)
