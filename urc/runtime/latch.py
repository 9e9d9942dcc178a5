"""What of a lease survives a restart: latch, epoch, and whether the robot heard. One small file.

Writing may take long, or fail on a full disk; stopping waits for neither. So the newest state is
written by a thread of its own turn, and what could not be written is told, not raised.
"""

import asyncio
import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from urc.motion.lease import LeaseState
from urc.private_files import put_private

__all__ = ["Latch", "LatchFile"]

RETRY_S = 5.0
_MOST_BYTES = 4096
_LONGEST_NAME = 200
_BEFORE = ", before a restart"
_UNREADABLE = "URC, whose record of the last stop cannot be read"

log = logging.getLogger(__name__)


class Latch(NamedTuple):
    """What is kept."""

    state: LeaseState
    is_owed: bool = False
    """Whether the robot has not heard of the last stop yet."""


_UNKNOWN = Latch(LeaseState(latched_by=_UNREADABLE), is_owed=True)


class LatchFile:
    """The file of one robot. `keep` from the event loop; `load` before it."""

    def __init__(self, folder: Path, robot: str) -> None:
        """Choose the file; nothing is read or written yet."""
        self._file = folder / f"{robot}.latch.json"
        self._newest: Latch | None = None
        self._writing: asyncio.Task[None] | None = None
        self._again: asyncio.TimerHandle | None = None
        self.fault = ""
        """Why the newest state could not be kept; "" when it is, or will be."""
        self.on_fault: Callable[[str], None] = _untold
        """Told every new `fault`, and "" when all is well again."""

    def load(self) -> Latch:
        """Return what was kept.

        A file that cannot be read, or holds anything else, means latched: nobody knows what was.
        A robot of which it does not say that it has heard of a latched stop hears it once more.
        Screens are numbered from one in each run: whoever stopped it is told as of another one.
        """
        try:
            with self._file.open("rb") as file:
                found = json.loads(file.read(_MOST_BYTES))
            epoch, by = found["epoch"], found["latched_by"]
            if type(epoch) is int and epoch >= 0 and type(by) is str:
                state = LeaseState(epoch=epoch, latched_by=_of_before(by[:_LONGEST_NAME]))
                return Latch(state, found.get("owed", by != "") is not False)
        except FileNotFoundError:
            return Latch(LeaseState())
        except (OSError, ValueError, KeyError, TypeError) as error:
            log.warning("%s cannot be read (%s): the robot stays stopped", self._file, error)
            return _UNKNOWN
        log.warning("%s is no record of a stop: the robot stays stopped", self._file)
        return _UNKNOWN

    def keep(self, kept: Latch) -> None:
        """Write `kept` soon; only the newest counts. Returns at once.

        What could not be written is tried again every few seconds.
        """
        self._newest = kept
        if self._again is not None:
            self._again.cancel()
            self._again = None
        if self._writing is None or self._writing.done():
            self._writing = asyncio.get_running_loop().create_task(self._write())

    async def settle(self) -> None:
        """Wait until the newest state is written, or could not be."""
        if self._writing is not None:
            await self._writing

    async def _write(self) -> None:
        while self._newest is not None:
            kept, self._newest = self._newest, None
            try:
                await asyncio.to_thread(self._replace, kept)
            except OSError as error:
                self._tell(error.strerror or str(error))
                if self._newest is None:
                    loop = asyncio.get_running_loop()
                    self._again = loop.call_later(RETRY_S, self.keep, kept)
            else:
                self._tell("")

    def _tell(self, fault: str) -> None:
        if fault == self.fault:
            return
        self.fault = fault
        if fault:
            log.warning("the stop latch cannot be kept over a restart: %s", fault)
        self.on_fault(fault)

    def _replace(self, kept: Latch) -> None:
        """Put a whole new file in the place of the old one: a crash leaves one of the two."""
        by = kept.state.latched_by[:_LONGEST_NAME]
        text = json.dumps({"epoch": kept.state.epoch, "latched_by": by, "owed": kept.is_owed})
        put_private(self._file, text.encode())


def _of_before(by: str) -> str:
    return by if by in ("", _UNREADABLE) or by.endswith(_BEFORE) else by + _BEFORE


def _untold(fault: str) -> None:
    """Nobody wants to know."""
