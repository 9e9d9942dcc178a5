"""Starts and buries the guard's process."""

import asyncio
import socket
import subprocess
import sys

__all__ = ["launch", "reap"]


def launch() -> tuple["subprocess.Popen[bytes]", socket.socket]:
    """Start the process; return it and our end of the pipe."""
    ours, theirs = socket.socketpair()
    try:
        process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
            # -P: nothing is imported from the folder we happen to be in.
            [sys.executable, "-P", "-m", "urc.guard", str(theirs.fileno())],
            pass_fds=(theirs.fileno(),),
            stdin=subprocess.DEVNULL,
            process_group=0,  # a terminal's Ctrl-C is for the server, which tells the guard
        )
    except BaseException:
        ours.close()
        raise
    finally:
        theirs.close()
    return process, ours


async def reap(process: "subprocess.Popen[bytes]") -> None:
    """Wait for a process that ends by itself; kill one that does not."""
    for _ in range(100):
        if process.poll() is not None:
            return
        await asyncio.sleep(0.01)
    process.kill()
    while process.poll() is None:  # noqa: ASYNC110 - a killed process is gone in a moment
        await asyncio.sleep(0.01)
