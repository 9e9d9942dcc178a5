"""A small file for the parts of a lease that survive a restart: latch, counters and pending stop.

Writing the file can be slow, and fails on a full disk. A stop must not wait for the file. A thread
therefore writes the newest state, and failures are reported without an exception.
"""

import asyncio
import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from urc.motion.lease import LeaseState
from urc.private_files import put_private

__all__ = ["Latch", "LatchStore"]

RETRY_S = 5.0
_MOST_BYTES = 4096
_LONGEST_NAME = 200
_BEFORE = ", before a restart"
_UNREADABLE = "URC, because the record of the last stop cannot be read"

log = logging.getLogger(__name__)


class Latch(NamedTuple):
    """The stored state."""

    state: LeaseState
    is_owed: bool = False
    """Whether the last stop has not yet reached the robot."""


_UNKNOWN = Latch(LeaseState(latched_by=_UNREADABLE), is_owed=True)


class LatchStore:
    """The stored latch of one robot.

    Call `load` before the first `save`; call `save` on the event loop.
    """

    def __init__(self, folder: Path, robot: str) -> None:
        """Set the path of the file, without reading or writing the file."""
        self._file = folder / f"{robot}.latch.json"
        self._newest: Latch | None = None
        self._writing: asyncio.Task[None] | None = None
        self._again: asyncio.TimerHandle | None = None
        self.fault = ""
        """Reason why the newest state cannot be stored, or ""."""
        self.on_fault: Callable[[str], None] = _untold
        """Callback that receives each new `fault`, or "" once the state can be stored again."""

    def load(self) -> Latch:
        """Return the stored state.

        An unreadable or invalid file counts as latched with a pending stop, because the true state
        is unknown. In a valid file, a missing entry ``owed`` means that a latched stop is pending.
        Page numbers restart at 1 with each server, so page names from earlier runs get a mark.
        """
        try:
            with self._file.open("rb") as file:
                found = json.loads(file.read(_MOST_BYTES))
            epoch, by = found["epoch"], found["latched_by"]
            if type(epoch) is int and epoch >= 0 and type(by) is str:
                # An earlier reset must not undo a STOP of this run that has the same number.
                stops = found.get("stops", 0)
                stops = stops if type(stops) is int and stops >= 0 else 0
                state = LeaseState(epoch, latched_by=_of_before(by[:_LONGEST_NAME]), stops=stops)
                return Latch(state, found.get("owed", by != "") is not False)
        except FileNotFoundError:
            return Latch(LeaseState())
        except (OSError, ValueError, KeyError, TypeError) as error:
            log.warning("%s cannot be read (%s): the robot stays stopped", self._file, error)
            return _UNKNOWN
        log.warning("%s is not a valid stop record: the robot stays stopped", self._file)
        return _UNKNOWN

    def save(self, kept: Latch) -> None:
        """Schedule the writing of `kept` and return immediately; only the newest state is written.

        A failed write is retried every few seconds.
        """
        self._newest = kept
        if self._again is not None:
            self._again.cancel()
            self._again = None
        if self._writing is None or self._writing.done():
            self._writing = asyncio.get_running_loop().create_task(self._write())

    async def settle(self) -> None:
        """Wait until the newest state is written, or the write has failed."""
        if self._writing is not None:
            await self._writing

    async def _write(self) -> None:
        while self._newest is not None:
            kept, self._newest = self._newest, None
            try:
                await asyncio.to_thread(self._replace, kept)
            except OSError as error:
                self._report(error.strerror or str(error))
                if self._newest is None:
                    loop = asyncio.get_running_loop()
                    self._again = loop.call_later(RETRY_S, self.save, kept)
            else:
                self._report("")

    def _report(self, fault: str) -> None:
        if fault == self.fault:
            return
        self.fault = fault
        if fault:
            log.warning("a restart would lose the latched STOP: %s", fault)
        self.on_fault(fault)

    def _replace(self, kept: Latch) -> None:
        """Replace the file atomically, so that a crash leaves either the old or the new content."""
        by = kept.state.latched_by[:_LONGEST_NAME]
        epoch, stops = kept.state.epoch, kept.state.stops
        found = {"epoch": epoch, "latched_by": by, "owed": kept.is_owed, "stops": stops}
        put_private(self._file, json.dumps(found).encode())


def _of_before(by: str) -> str:
    return by if by in ("", _UNREADABLE) or by.endswith(_BEFORE) else by + _BEFORE


def _untold(fault: str) -> None:
    """Ignore a fault."""
