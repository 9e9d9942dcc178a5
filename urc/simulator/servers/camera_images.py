"""The images of an emulated camera, encoded once for all receivers of its video.

An image is encoded only while a receiver is ready and the robot sends video. The process that
encodes ends a few seconds after the last image.
"""

import asyncio
import logging
from collections.abc import Callable
from typing import Final, Protocol

from urc.simulator.servers.base import ServerContext
from urc.simulator.servers.coloured_picture import picture
from urc.simulator.servers.video_encoder import EncodedUnit, EncoderFault, VideoEncoder

__all__ = ["IMAGE_EVERY_S", "CameraImages", "Receiver"]

IMAGE_EVERY_S: Final = 0.05
"""Time between two images, in seconds, half as long as between two new images of a world. Readers
deliver an image when the next one begins, and need several images to detect the format."""
KEPT_S: Final = 5.0
"""Time without images after which the encoding process ends, in seconds."""
RETRY_S: Final = 10.0
"""Time after a failure before the encoding process starts again, in seconds."""

log = logging.getLogger(__name__)


class Receiver(Protocol):
    """A receiver of an emulated camera's video."""

    needs_key: bool
    """Whether the next image must be a keyframe."""

    def is_ready(self) -> bool:
        """Return whether the receiver takes images at present."""

    def take(self, image: EncodedUnit) -> None:
        """Receive an image; the first one after `needs_key` is a keyframe."""


class CameraImages:
    """Encodes the images of one emulated camera, and gives them to all receivers.

    Args:
        context: context of the camera's server.
        encoder: encoder of the images.
        clock: function that returns monotonic time in seconds.
    """

    def __init__(
        self, context: ServerContext, encoder: VideoEncoder, clock: Callable[[], float]
    ) -> None:
        self.receivers: set[Receiver] = set()
        self._context = context
        self._encoder = encoder
        self._clock = clock
        self._image_s = clock()
        """Time of the last image."""
        self._retry_s = clock()

    async def run(self) -> None:
        """Encode images until cancelled."""
        try:
            while True:
                due_s = self._clock() + IMAGE_EVERY_S
                await self.step()
                await asyncio.sleep(max(0.0, due_s - self._clock()))
        finally:
            await self._encoder.close()

    async def step(self) -> None:
        """Encode one image if a receiver wants it."""
        ready = [one for one in self.receivers if one.is_ready()]
        image = self._image() if ready and self._clock() >= self._retry_s else None
        if image is None:
            if self._clock() - self._image_s >= KEPT_S:
                await self._encoder.close()
            return
        self._image_s = self._clock()
        try:
            is_key = any(one.needs_key for one in ready)
            encoded = await self._encoder.encode(image, is_key=is_key)
        except EncoderFault as fault:
            self._retry_s = self._clock() + RETRY_S
            log.warning("transport %s: %s", self._context.name, fault)
            return
        for one in ready:
            one.needs_key = one.needs_key and not encoded.is_key
            if not one.needs_key:
                one.take(encoded)

    def _image(self) -> bytes | None:
        """Return the image to send; None while the robot sends none."""
        image = self._context.video()
        return picture(self._context.now()) if image == b"" else image
