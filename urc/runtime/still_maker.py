"""JPEG images of videos, made for pages that cannot decode the videos.

Layer 4. Some browsers lack the codec of a camera, and no browser decodes videos on a page without
HTTPS. For these pages alone, a process decodes the video and makes at most ten images a second. The
process ends with the last of these pages.
"""

import asyncio
import logging
from collections.abc import Callable
from importlib.util import find_spec
from typing import Final

from urc._extras import missing
from urc._helper_process import end_helper, start_helper
from urc.runtime.still_process import MADE, TAKEN, Still

__all__ = ["StillMaker"]

_LARGEST: Final = 16_777_216
_WAITING_BYTES: Final = 1_048_576
"""Number of unwritten bytes at which access units are dropped until the next keyframe."""
_AGAIN_S: Final = 2.0

log = logging.getLogger(__name__)


class StillMaker:
    """The process that makes the JPEG images of one video, restarted if it ends."""

    def __init__(
        self, name: str, made: Callable[[str, Still], None], frozen_after_s: float = 0.0
    ) -> None:
        """Create a maker; `start` runs the process.

        Args:
            name: name of the signal.
            made: function that receives the name and an image.
            frozen_after_s: time in seconds after which equal images count as one; 0 means never.
        """
        self._name = name
        self._made = made
        self._frozen_after_s = frozen_after_s
        self._process: asyncio.subprocess.Process | None = None
        self._task: asyncio.Task[None] | None = None
        self._needs_key = True

    def start(self) -> None:
        """Start the process in the background."""
        self._task = asyncio.create_task(self._run())

    def take(self, value: bytes, *, is_key: bool) -> None:
        """Pass an access unit to the process, unless the process is too slow. Never waits."""
        pipe = self._process.stdin if self._process is not None else None
        if pipe is None or pipe.is_closing():
            self._needs_key = True
            return
        if is_key:
            self._needs_key = False
        if pipe.transport.get_write_buffer_size() > _WAITING_BYTES:
            self._needs_key = True
        if not self._needs_key:
            pipe.write(TAKEN.pack(len(value)) + value)

    async def stop(self) -> None:
        """End the process. The method never raises."""
        task, self._task = self._task, None
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    async def _run(self) -> None:
        if find_spec("av") is None:
            log.warning("%s", missing(f"{self._name}: JPEG images of a video need", "av", "video"))
            return
        while True:
            try:
                await self._serve()
            except (OSError, asyncio.IncompleteReadError, ValueError) as fault:
                log.warning("%s: the process that makes JPEG images ended (%s)", self._name, fault)
            await asyncio.sleep(_AGAIN_S)

    async def _serve(self) -> None:
        process = await start_helper("urc.runtime.still_process", f"{self._frozen_after_s}")
        self._process, self._needs_key = process, True
        try:
            while process.stdout is not None:
                head = await process.stdout.readexactly(MADE.size)
                size, time_s, is_repeated = MADE.unpack(head)
                if size > _LARGEST:
                    raise ValueError("an image is too large")
                image = await process.stdout.readexactly(size)
                self._made(self._name, Still(time_s, image, is_repeated))
        finally:
            self._process = None
            await end_helper(process, 1.0)
