"""Clients that wait for the same: what is new is written to all of them in one short loop.

Floor 5. In that loop nothing of a client is touched but the number of its socket. All else that
belongs to it lies somewhere in memory, and fetching that costs as much as writing the frame.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple, Protocol

from urc.web.feed.picture_shelf import Looks

__all__ = ["NO_NUMBER", "Crowd", "Known", "Listener", "Place", "Write"]

NO_NUMBER: Final = -1
"""Of a line that cannot be written to by number."""

Write = Callable[[int, bytes], int]
"""Writes to a file by its number, without waiting; returns how many bytes were taken."""


class Listener(Protocol):
    """Somebody who wants to know that there is something new."""

    def wake(self) -> None:
        """Take a look, soon. Must return at once."""


class Known(NamedTuple):
    """How far somebody has got."""

    revision: int = 0
    """Hub revision up to which it has the values."""
    links: int = 0
    """Number of the link state it has."""
    progress: int = 0
    """Number of the state of the sequences it has."""
    notes: int = 0
    """Log lines it has, or was told it lost."""
    joined: int = 0
    """Hub revision at which it came; 0 once it has what came before."""


def _nowhere(frame: bytes) -> None:
    """Nobody takes it: a place without a number is never written to."""


@dataclass(slots=True)
class Place:
    """One client's; in a crowd, what counts is what the crowd knows and has seen."""

    known: Known = field(default_factory=Known)
    looks: Looks = field(default_factory=Looks)
    number: int = NO_NUMBER
    """Of its socket."""
    finish: Callable[[bytes], None] = _nowhere
    """Takes over what the kernel did not take of a frame."""
    listener: Listener | None = None
    crowd: "Crowd | None" = None


class Crowd:
    """Those of one robot that show the same images, and have got equally far."""

    def __init__(self, place: Place, write: Write) -> None:
        self.known = place.known
        self.looks = place.looks.copy()
        self._write = write
        self._places: dict[int, Place] = {}
        self._numbers: tuple[int, ...] = ()

    @property
    def is_empty(self) -> bool:
        """Whether nobody is in it."""
        return not self._places

    @property
    def places(self) -> tuple[Place, ...]:
        """Those in it."""
        return tuple(self._places.values())

    def fits(self, place: Place) -> bool:
        """Return whether somebody lacks just what all here lack."""
        return place.known == self.known and place.looks.is_like(self.looks)

    def add(self, place: Place) -> None:
        """Take somebody in; it must fit."""
        place.crowd = self
        self._places[place.number] = place
        self._numbers = tuple(self._places)

    def remove(self, place: Place) -> None:
        """Let somebody go, with what it has got here."""
        place.crowd = None
        place.known, place.looks = self.known, self.looks.copy()
        del self._places[place.number]
        self._numbers = tuple(self._places)

    def send(self, frame: bytes) -> None:
        """Write whole frames to everybody."""
        write, size = self._write, len(frame)
        for number in self._numbers:
            try:
                sent = write(number, frame)
            except OSError:  # full, or gone: whoever takes over learns which
                sent = 0
            if sent != size:
                self._places[number].finish(frame[sent:])
