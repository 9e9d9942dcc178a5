"""The times at which each robot was last used and last sent data, stored across restarts.

Layer 4. The store keeps the times in memory. The method `save` writes a small file and may block,
so the server calls `save` in a thread. Losing the file changes only the order of the robots in the
menu.
"""

import logging
import threading
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import msgspec

from urc.private_files import put_private

__all__ = ["FILE", "MOST_ROBOTS", "NO_CONTACT", "ContactStore", "ContactTimes"]

FILE: Final = "contact-times.json"
"""Name of the file in the data folder."""
MOST_ROBOTS: Final = 1000
"""Maximum number of robots in the file; the robots with the oldest times are dropped."""
_MOST_BYTES: Final = 1 << 20

log = logging.getLogger(__name__)


class ContactTimes(NamedTuple):
    """The times at which a robot was last used and last sent data."""

    used_at: float | None = None
    """UTC time at which a page or program last used the robot, in seconds since 1970; None means
    never."""
    seen_at: float | None = None
    """UTC time at which a connection to the robot was last live, in seconds since 1970; None means
    never."""

    @property
    def newest(self) -> float:
        """The later of the two times; 0 if there was no contact."""
        return max(self.used_at or 0.0, self.seen_at or 0.0)


NO_CONTACT: Final = ContactTimes()
"""The times of a robot that has never had contact."""
_Name = Annotated[str, msgspec.Meta(max_length=300)]


class _Stored(msgspec.Struct, frozen=True):
    """The content of the file."""

    robots: dict[_Name, tuple[float | None, float | None]] = {}
    format: Annotated[int, msgspec.Meta(ge=1, le=1)] = 1


class ContactStore:
    """The contact times of all robots of a server.

    Emulated robots have separate times: `key` distinguishes them from real robots with the same
    name.
    """

    def __init__(self, file: Path | None = None) -> None:
        """Read the file, which is empty if missing or damaged; with None, nothing is stored."""
        self._file = file
        self._times: dict[str, ContactTimes] = {}
        self._is_changed = False
        self._lock = threading.Lock()
        """Lock held while the file is written, so that two threads do not write it at the same
        time."""
        if file is not None:
            self._load(file)

    @staticmethod
    def key(robot: str, *, is_emulated: bool) -> str:
        """Return a robot's key in the store."""
        return f"emulated/{robot}" if is_emulated else robot

    def of(self, key: str) -> ContactTimes:
        """Return a robot's times; an unknown robot has no times."""
        return self._times.get(key, NO_CONTACT)

    def note(self, key: str, now: float, *, is_used: bool, is_seen: bool) -> None:
        """Record that a robot is in use or sending data at the time `now`.

        Args:
            key: the result of `key`.
            now: UTC time in seconds since 1970.
            is_used: whether a page or program uses the robot.
            is_seen: whether a connection to the robot is live.
        """
        if not (is_used or is_seen):
            return
        times = self.of(key)
        self._times[key] = ContactTimes(
            now if is_used else times.used_at, now if is_seen else times.seen_at
        )
        self._is_changed = True
        if len(self._times) > MOST_ROBOTS:
            del self._times[min(self._times, key=lambda each: self._times[each].newest)]

    def save(self) -> None:
        """Write the file if a time has changed; log any failure and retry on the next call.

        The call blocks. This method can run in another thread while the event loop records further
        times.
        """
        if self._file is None:
            return
        with self._lock:
            if not self._is_changed:
                return
            self._is_changed = False
            data = msgspec.json.encode(_Stored({name: (*one,) for name, one in self._copy()}))
            try:
                put_private(self._file, data)
            except OSError as error:
                self._is_changed = True
                log.warning("%s: %s", self._file, error.strerror or error)

    def _copy(self) -> list[tuple[str, ContactTimes]]:
        return list(self._times.items())  # one step of the interpreter: no lock is needed

    def _load(self, file: Path) -> None:
        try:
            with file.open("rb") as opened:
                stored = msgspec.json.decode(opened.read(_MOST_BYTES + 1), type=_Stored)
        except FileNotFoundError:
            return
        except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            log.warning("%s cannot be read (%s): the order of the menu is reset", file, error)
            return
        newest = sorted(
            ((name, ContactTimes(*times)) for name, times in stored.robots.items()),
            key=lambda one: one[1].newest,
            reverse=True,
        )
        self._times = dict(newest[:MOST_ROBOTS])
