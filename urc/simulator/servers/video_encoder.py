"""The simulator's end of the process that encodes the images of an emulated camera."""

import asyncio
from typing import Final, NamedTuple

from urc._helper_process import end_helper, start_helper
from urc.problems import UrcError
from urc.simulator.servers.video_process import FAULT, KEYFRAME, ORDER, RECORD

__all__ = ["EncodedUnit", "EncoderFault", "VideoEncoder"]

FIRST_S: Final = 20.0
"""Maximum time for the first image, in seconds; the library loads slowly on small computers."""
_IMAGE_S: Final = 5.0
_END_S: Final = 5.0
_MAX_UNIT_BYTES: Final = 8_388_608


class EncoderFault(UrcError):
    """Raised if the process cannot encode an image; the message is for people."""


class EncodedUnit(NamedTuple):
    """One access unit."""

    is_key: bool
    """Whether decoding can start with this image."""
    data: bytes
    """The access unit with start codes; a keyframe contains its parameter sets."""


class VideoEncoder:
    """An encoder in a process of its own, which starts with the first image."""

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._limit_s = FIRST_S

    async def encode(self, image: bytes, *, is_key: bool = False) -> EncodedUnit:
        """Return an image as an access unit.

        Args:
            image: JPEG or PNG.
            is_key: whether the image must become a keyframe.

        Raises:
            EncoderFault: the process failed. The next call starts a new one.
        """
        try:
            async with asyncio.timeout(self._limit_s):
                process = self._process or await self._started()
                head, content = await _exchanged(process, image, is_key=is_key)
        except (TimeoutError, OSError, asyncio.IncompleteReadError) as fault:
            await self.close()
            raise EncoderFault("the process that encodes the video has failed") from fault
        except asyncio.CancelledError:
            await self.close()  # the answer to this image would be taken for the next one's
            raise
        if head == FAULT:
            await self.close()
            raise EncoderFault(f"the video cannot be encoded ({content.decode(errors='replace')})")
        self._limit_s = _IMAGE_S
        return EncodedUnit(head == KEYFRAME, content)

    async def close(self) -> None:
        """End the process; the method may be called twice.

        After a cancelled call, the next call waits for the end of the process.
        """
        process = self._process
        if process is None:
            return
        await end_helper(process, _END_S)
        self._process, self._limit_s = None, FIRST_S

    async def _started(self) -> asyncio.subprocess.Process:
        self._process = await start_helper("urc.simulator.servers.video_process")
        return self._process


async def _exchanged(
    process: asyncio.subprocess.Process, image: bytes, *, is_key: bool
) -> tuple[bytes, bytes]:
    """Send an image to the process; return the kind and the content of its answer."""
    if process.stdin is None or process.stdout is None:
        raise OSError("the process has no pipes")
    process.stdin.write(ORDER.pack(len(image), is_key) + image)
    await process.stdin.drain()
    size, kind = RECORD.unpack(await process.stdout.readexactly(RECORD.size))
    if size > _MAX_UNIT_BYTES:
        raise OSError("the process sent an invalid record")
    return kind, await process.stdout.readexactly(size)
