"""The processes that encode the video of emulated cameras."""

import asyncio
import os
from contextlib import suppress
from pathlib import Path
from typing import Final

__all__ = ["WAIT_S", "encoders", "until_encoders"]

WAIT_S: Final = 30.0


def encoders() -> list[int]:
    """Return the encoding processes that this test has started."""
    found = []
    for folder in Path("/proc").iterdir():
        with suppress(OSError, IndexError):
            if folder.name.isdigit() and b"video_process" in (folder / "cmdline").read_bytes():
                rest = (folder / "stat").read_bytes().rpartition(b")")[2].split()
                if int(rest[1]) == os.getpid() and rest[0] != b"Z":
                    found.append(int(folder.name))
    return found


async def until_encoders(count: int) -> list[int]:
    """Wait until so many encoding processes run."""
    async with asyncio.timeout(WAIT_S):
        while len(encoders()) != count:  # noqa: ASYNC110 - another process tells nobody
            await asyncio.sleep(0.05)
    return encoders()
