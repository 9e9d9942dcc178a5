"""The third-party servers of these tests are frozen and ended, whatever they are doing."""

import signal
import sys
from pathlib import Path

import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.hostile import until
from tests.e2e.transports.processes import Server

pytestmark = pytest.mark.anyio

CLONE_VFORK = 0x4000

# As a shell does for each command: the parent sleeps in the system, where nothing but its end
# wakes it, until the child has become another program.  This child never does.
STARTS_ONE_FOR_EVER = f"""
import ctypes, socket, sys
door = socket.create_server(("127.0.0.1", int(sys.argv[1])))
libc = ctypes.CDLL(None)
stack = ctypes.create_string_buffer(65536)
top = ctypes.c_void_p((ctypes.addressof(stack) + len(stack)) & ~15)
libc.clone(libc.pause, top, {CLONE_VFORK | signal.SIGCHLD}, None)
"""


async def test_a_server_that_is_starting_somebody_is_frozen_and_ended(tmp_path: Path) -> None:
    """Its child is frozen before it has become another program; the parent waits for ever."""
    port = free_port()
    command = [sys.executable, "-c", STARTS_ONE_FOR_EVER, str(port)]
    server = Server(command, port, tmp_path / "log")
    await server.start()
    try:
        await until(lambda: len(server.pids) > 1)
        server.stop()
    finally:
        server.kill()
