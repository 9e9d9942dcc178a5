"""The newest image of each signal, encoded once for all pages.

Layer 5. Images are never queued. When a client's socket is free, the client receives the newest
image and skips older images.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from urc.model.values import BINARY_TYPES, Sample, Signal
from urc.runtime.clock import Clock
from urc.runtime.hub import Hub
from urc.web.wire.picture import as_frame, encode_picture

__all__ = ["EncodedImage", "ImageSubscription", "ImageCache", "is_picture"]

SHARED_FOR_S = 0.05
"""Maximum age at which an encoded image is reused, in seconds. The message contains the image's age
at the time of encoding. A reused message therefore states an age up to 50 ms too low; this small
error does not justify another copy of several kilobytes."""


class EncodedImage(NamedTuple):
    """An encoded image, which can be sent to any client."""

    frame: bytes
    """The complete WebSocket frame."""
    sample: Sample
    number: int
    """Number of the image, counted across all signals."""
    made_s: float


@dataclass(slots=True)
class ImageSubscription:
    """The images that one client shows and the newest images sent to this client."""

    names: tuple[str, ...] = ()
    seen: dict[str, int] = field(default_factory=dict)
    """Number of the last image sent to the client, keyed by signal."""
    turn: int = 0
    """Round-robin position among the images; prevents a fast camera from blocking other cameras."""

    def show(self, names: Iterable[str]) -> None:
        """Set the images shown by the client; a previously hidden image is sent again."""
        self.names = tuple(dict.fromkeys(names))
        self.seen = {name: number for name, number in self.seen.items() if name in self.names}


def is_picture(signal: Signal | None) -> bool:
    """Return whether the values of a signal are sent as binary messages."""
    return signal is not None and signal.type in BINARY_TYPES


class ImageCache:
    """The encoded images of one session, shared by all its clients."""

    def __init__(self, hub: Hub, clock: Clock) -> None:
        self._hub = hub
        self._clock = clock
        self.stills: dict[str, Sample] = {}
        """Newest JPEG image of each video that some page cannot decode."""
        self.repeated: set[str] = set()
        """Videos among `stills` whose camera repeats the image."""
        self._encoded: dict[str, EncodedImage] = {}
        self._count = 0

    def next_image(self, subscription: ImageSubscription) -> EncodedImage | None:
        """Return a new image for the client and mark the image as sent; None if no image is new."""
        count = len(subscription.names)
        for step in range(count):
            name = subscription.names[(subscription.turn + step) % count]
            made = self._newest(name)
            if made is not None and subscription.seen.get(name) != made.number:
                subscription.turn = (subscription.turn + step + 1) % count
                subscription.seen[name] = made.number
                return made
        return None

    def _newest(self, name: str) -> EncodedImage | None:
        signal = self._hub.signals.get(name)
        is_video = signal is not None and signal.type == "video"
        sample = self.stills.get(name) if is_video else self._hub.latest(name)
        if sample is None or not isinstance(sample.value, bytes):
            return None
        known, now_s = self._encoded.get(name), self._clock.now()
        if known is None or known.sample is not sample:
            if known is None and not is_picture(self._hub.signals.get(name)):
                return None
            self._count += 1
            number = self._count
        elif now_s - known.made_s > SHARED_FOR_S:
            number = known.number
        else:
            return known
        age_s, index = now_s - sample.time_s, self._hub.index[name]
        message = encode_picture(
            *(index, sample.value, number, round(age_s * 1000), round(now_s * 1000)),
            is_repeated=name in (self.repeated if is_video else self._hub.repeated),
        )
        made = self._encoded[name] = EncodedImage(as_frame(message), sample, number, now_s)
        return made
