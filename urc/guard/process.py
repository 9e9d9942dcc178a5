"""Functions that start the guard process, read its state and end the process."""

import asyncio
import hmac
import os
import secrets
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any, Final, NamedTuple

from urc.transports.own_listeners import OWN_DOORS

__all__ = ["CAN_INHERIT", "DOOR", "GuardAcceptor", "launch", "reap", "standing"]

CAN_INHERIT: Final = os.name == "posix"
"""Whether this system can pass an open socket to another process."""
DOOR: Final = "door:"
"""Prefix of the command-line argument that contains the port, on systems where the guard connects
to the server."""
TOKEN_BYTES: Final = 64
_LOOPBACK: Final = "127.0.0.1"
_ADMIT_S: Final = 10.0
_SAY_S: Final = 1.0


class GuardAcceptor:
    """A local port to which the guard connects, on systems without inherited sockets.

    Any program on this machine can connect to the port. Only the guard receives the token, on its
    standard input. Connections without the token are closed.
    """

    def __init__(self) -> None:
        self._listener = socket.create_server((_LOOPBACK, 0))
        self._listener.setblocking(False)
        self.token = secrets.token_hex(TOKEN_BYTES // 2).encode()

    @property
    def port(self) -> int:
        """Number of the local TCP port to which the guard connects."""
        return int(self._listener.getsockname()[1])

    async def admitted(self) -> socket.socket:
        """Return the guard's connection; raise `TimeoutError` after 10 s without a connection."""
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(_ADMIT_S):
                while True:
                    line, _ = await loop.sock_accept(self._listener)
                    if await self._is_guard(line):
                        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                        return line
                    line.close()
        finally:
            self.close()

    async def _is_guard(self, line: socket.socket) -> bool:
        line.setblocking(False)
        loop, said = asyncio.get_running_loop(), b""
        try:
            async with asyncio.timeout(_SAY_S):
                while len(said) < TOKEN_BYTES:
                    data = await loop.sock_recv(line, TOKEN_BYTES - len(said))
                    if not data:
                        return False
                    said += data
        except (OSError, TimeoutError):
            return False
        except BaseException:
            line.close()
            raise
        return hmac.compare_digest(said, self.token)

    def close(self) -> None:
        """Close the port; a second call does nothing."""
        self._listener.close()


def launch(
    *, is_inherited: bool = CAN_INHERIT
) -> tuple["subprocess.Popen[bytes]", socket.socket | GuardAcceptor]:
    """Start the guard; return its process with either this end of the pipe or the acceptor."""
    return _heir() if is_inherited else _visitor()


def _heir() -> tuple["subprocess.Popen[bytes]", socket.socket]:
    ours, theirs = socket.socketpair()
    try:
        place = str(theirs.fileno())
        process = _started(place, pass_fds=(theirs.fileno(),), stdin=subprocess.DEVNULL)
    except BaseException:
        ours.close()
        raise
    finally:
        theirs.close()
    return process, ours


def _visitor() -> tuple["subprocess.Popen[bytes]", GuardAcceptor]:
    door = GuardAcceptor()
    try:
        process = _started(f"{DOOR}{door.port}", stdin=subprocess.PIPE)
        assert process.stdin is not None  # noqa: S101 - it was asked for
        with process.stdin as told:
            told.write(door.token)  # not an argument: every user can read arguments
    except BaseException:
        door.close()
        raise
    return process, door


def _started(place: str, **more: Any) -> "subprocess.Popen[bytes]":
    # Ctrl-C in a terminal is meant for the server, which then ends the guard.
    if sys.platform == "win32":
        more["creationflags"] = subprocess.CREATE_NEW_PROCESS_GROUP
    else:
        more["process_group"] = 0
    # -P: nothing is imported from the current folder.
    command = [sys.executable, "-P", "-m", "urc.guard", place, *OWN_DOORS.words()]
    return subprocess.Popen(command, **more)  # noqa: S603 - our own interpreter and module


class ProcessState(NamedTuple):
    """A process's state, as reported by the system."""

    wants_to_run: bool = False
    """Whether the process is running or waiting for a processor or a disk; false for a sleeping or
    stopped process.
    """
    ran_s: float = 0.0
    """Processor time that the first thread has used, in seconds."""


def standing(process: int, proc: Path = Path("/proc")) -> ProcessState:
    """Return a process's state from ``/proc``; without ``/proc``, return a default state."""
    try:
        # The name before the state may contain any characters, including brackets and spaces.
        state = (proc / str(process) / "stat").read_text("latin-1").rpartition(")")[2].split()[0]
        ran_ns = (proc / str(process) / "schedstat").read_text("ascii").split()[0]
        return ProcessState(state in "RD", int(ran_ns) / 1e9)
    except (OSError, ValueError, IndexError):
        return ProcessState()


async def reap(process: "subprocess.Popen[bytes]") -> None:
    """Wait up to 1 s for a process to end, then kill it."""
    for _ in range(100):
        if process.poll() is not None:
            return
        await asyncio.sleep(0.01)
    process.kill()
    while process.poll() is None:  # noqa: ASYNC110 - a killed process is gone in a moment
        await asyncio.sleep(0.01)
