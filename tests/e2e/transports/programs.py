"""Programs of others as counterparts: started on loopback, ready when they listen, always gone."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

__all__ = ["listens", "program"]

READY_S = 30.0


@asynccontextmanager
async def program(*command: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """Run a program and all that it starts for the length of the context."""
    process = await asyncio.create_subprocess_exec(
        *command,
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        await process.wait()


async def listens(place: int | Path) -> None:
    """Wait until somebody listens on a TCP port of loopback, or a file is there."""
    async with asyncio.timeout(READY_S):
        # Another process tells nobody when it is ready.
        while not (_takes_calls(place) if isinstance(place, int) else place.exists()):  # noqa: ASYNC110
            await asyncio.sleep(0.02)


def _takes_calls(port: int) -> bool:
    """Look without calling: some programs take one call and end."""
    here = f"{port:04X}"
    rows = Path("/proc/net/tcp").read_text("ascii").splitlines()[1:]
    rows += Path("/proc/net/tcp6").read_text("ascii").splitlines()[1:]
    return any(row.split()[1].endswith(f":{here}") and row.split()[3] == "0A" for row in rows)
