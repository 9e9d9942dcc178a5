"""Films of a camera for tests: the picture moves, stands still, or stands still with noise.

A real encoder encodes each image anew. The picture has shapes and the noise of a sensor, so that an
encoder has work to do.
"""

from collections.abc import Iterator
from fractions import Fraction
from itertools import count
from typing import Final, Literal

import av
import numpy as np
from numpy.typing import NDArray

__all__ = ["GROUP", "HEIGHT", "RATE", "WIDTH", "FilmKind", "encoder", "film_image", "pictures"]

WIDTH, HEIGHT, RATE = 320, 240, 30
GROUP: Final = 15
"""Number of images from one keyframe to the next."""
NOISE: Final = 2.0
"""Standard deviation of the noise of a good sensor in daylight, in steps of 256."""
FilmKind = Literal["moving", "standing", "noisy"]
"""What the camera sees: ``noisy`` is a still scene, ``standing`` is one image, again and again."""


def film_image(place: int, kind: FilmKind) -> NDArray[np.uint8]:
    """Return the image `place` of a film as RGB pixels, always the same for the same arguments."""
    noise = np.random.default_rng(0 if kind == "standing" else place)
    column, row = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    shift = 4 * place if kind == "moving" else 0
    grey = 60 + 60 * np.sin((column + shift) / 9) * np.cos(row / 13) + row / 4
    grey[80:160, 120:200] = 200
    grey += noise.normal(0.0, NOISE, grey.shape)
    return np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)


def encoder(codec: str = "libx264", *, group: int = GROUP, **options: str) -> av.VideoCodecContext:
    """Return an encoder without delay; `options` replace the defaults."""
    made = av.CodecContext.create(codec, "w")
    assert isinstance(made, av.VideoCodecContext)
    made.width, made.height, made.pix_fmt = WIDTH, HEIGHT, "yuv420p"
    made.time_base, made.framerate = Fraction(1, RATE), Fraction(RATE)
    made.gop_size = group
    made.thread_count = 1  # the same data on each machine
    more = {"x265-params": "log-level=none"} if codec == "libx265" else {}
    made.options = {"preset": "ultrafast", "tune": "zerolatency", **more, **options}
    return made


def pictures(
    kind: FilmKind, codec: str = "libx264", *, group: int = GROUP, **options: str
) -> Iterator[tuple[bool, bytes]]:
    """Yield the access units of an endless film, and whether each is a keyframe."""
    made, image = encoder(codec, group=group, **options), film_image(0, kind)
    for place in count():
        if kind != "standing":
            image = film_image(place, kind)
        frame = av.VideoFrame.from_ndarray(image, "rgb24")
        frame.pts = place
        for packet in made.encode(frame):
            yield bool(packet.is_keyframe), bytes(packet)
