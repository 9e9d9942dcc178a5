"""The newest image of each signal, encoded once for all who look at it.

Floor 5. Nothing is queued: a client takes an image when its line is free, and then the newest one.
What came meanwhile, that client has never heard of.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from urc.model.values import Sample, Signal
from urc.runtime.clock import Clock
from urc.runtime.hub import Hub
from urc.web.wire.picture import as_frame, encode_picture

__all__ = ["Encoded", "Looks", "PictureShelf", "is_picture"]

SHARED_FOR_S = 0.05
"""How long an encoded image is handed out: the age in it is that of its encoding, and an image of
some ten kilobytes is not worth making anew for a few milliseconds."""


class Encoded(NamedTuple):
    """An image, ready for any client."""

    frame: bytes
    """The whole WebSocket frame."""
    sample: Sample
    number: int
    """Grows with each new image of any signal."""
    made_s: float


@dataclass(slots=True)
class Looks:
    """What one client shows, and what it has of it."""

    names: tuple[str, ...] = ()
    seen: dict[str, int] = field(default_factory=dict)
    """Signal → number of the image that it has."""
    turn: int = 0
    """Whose turn it is, so that one fast camera leaves room for another."""

    def show(self, names: Iterable[str]) -> None:
        """Take what the page shows from now on; what it stops showing, it has to be sent anew."""
        self.names = tuple(dict.fromkeys(names))
        self.seen = {name: number for name, number in self.seen.items() if name in self.names}


def is_picture(signal: Signal | None) -> bool:
    """Return whether a signal's values go as binary messages."""
    return signal is not None and signal.type in ("image", "blob")


class PictureShelf:
    """What the clients of one session share."""

    def __init__(self, hub: Hub, clock: Clock) -> None:
        self._hub = hub
        self._clock = clock
        self._encoded: dict[str, Encoded] = {}
        self._count = 0

    def take(self, looks: Looks) -> Encoded | None:
        """Return an image that the client shows and has not got, or None; it counts as sent."""
        count = len(looks.names)
        for step in range(count):
            name = looks.names[(looks.turn + step) % count]
            made = self._newest(name)
            if made is not None and looks.seen.get(name) != made.number:
                looks.turn = (looks.turn + step + 1) % count
                looks.seen[name] = made.number
                return made
        return None

    def _newest(self, name: str) -> Encoded | None:
        sample = self._hub.latest(name)
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
        message = encode_picture(index, sample.value, round(age_s * 1000), round(now_s * 1000))
        made = self._encoded[name] = Encoded(as_frame(message), sample, number, now_s)
        return made
