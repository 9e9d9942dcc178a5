"""The engine's side of the guard: keeps it running, and remembers what it must stop.

Theory of operation. The guard is a process of its own. It says ten times a second that it is alive;
when it is silent for half a second, or gone, it is killed for good and another is started at once.
Only a machine that gives it no time to run is no fault of its own: another one would have none.
That one knows nothing: it is told the lines, the terms of everything armed, and what was moving,
of which it opens the lines and writes the stop before anything else. Nothing moves on by itself.
"""

import asyncio
import logging
import os
import socket
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

from urc.guard import wire
from urc.guard.pipe import Pipe
from urc.guard.process import CAN_INHERIT, Door, Standing, launch, reap, standing
from urc.guard.side import Client, LineSpec, LocalGuard

__all__ = ["CAN_GUARD", "Client", "Guard", "LineSpec", "LocalGuard"]

CAN_GUARD: Final = CAN_INHERIT or os.name == "nt"
"""Whether this system can run the guard as a process of its own."""
_LOOK_S: Final = 0.1
_SILENT_LOOKS: Final = 5
_MOST_KEPT_LOOKS: Final = 15
"""Silence that is put down to a busy machine, at most."""
_START_LOOKS: Final = 100
"""A machine that is busy may take long until Python runs."""
_STEADY_S: Final = 0.5
"""A guard that lives this long, or has opened a line, was started well."""
_AT_ONCE: Final = 3
_AGAIN_S: Final = 1.0
"""Guards that end at once are started anew so often right away, and then at this pace."""
_FINISH_S: Final = 3.0
_DIED: Final = "the guard of this line ended; it is started anew"

log = logging.getLogger(__name__)


class Guard(Client):
    """The guard as a process."""

    def __init__(self, lines: Sequence[LineSpec], *, is_inherited: bool = CAN_INHERIT) -> None:
        """Prepare; nothing is started yet.

        Args:
            lines: as above.
            is_inherited: whether the process inherits its pipe; else it comes to a door.
        """
        super().__init__(lines)
        self._is_inherited = is_inherited
        self._door: Door | None = None
        self._entering: asyncio.Task[None] | None = None
        self._encoder = wire.encoder()
        self._decoder = wire.decoder_of_server()
        self._pipe: Pipe | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._is_up = asyncio.Event()
        self._is_finishing = False
        self._gone = asyncio.Event()
        self._look: asyncio.TimerHandle | None = None
        self._look_s = 0.0
        self._silent_looks = self._kept_looks = 0
        self._standing = Standing()
        self._was_heard = self._has_served = False
        self._started_s = 0.0
        self._short_lives = 0
        self._reaping: set[asyncio.Task[None]] = set()

    @property
    def pid(self) -> int:
        """Number of the process; 0 while there is none."""
        return 0 if self._process is None else self._process.pid

    def start(self) -> None:
        """Start the process; it takes what it is told as soon as it runs."""
        loop = asyncio.get_running_loop()
        self._started_s = loop.time()
        try:
            self._process, line = launch(is_inherited=self._is_inherited)
        except OSError as fault:
            log.error("the guard cannot be started (%s)", fault)
            self._is_up.clear()
            self._look = loop.call_later(_AGAIN_S, self.start)
            return
        self._was_heard = self._has_served = False
        self._silent_looks = self._kept_looks = 0
        if isinstance(line, Door):
            self._is_up.clear()
            self._door = line
            self._entering = loop.create_task(self._admit(line))
        else:
            self._begin(line)

    async def _admit(self, door: Door) -> None:
        try:
            line = await door.admitted()
        except (OSError, TimeoutError) as fault:
            log.error("the guard did not come to its door (%s)", fault)
            self._died()
        else:
            self._begin(line)

    def _begin(self, line: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        self._pipe = Pipe(
            line,
            self._encoder,
            self._decoder,
            take=self._hear,
            settle=_nothing,
            gone=self._died,
        )
        self._brief()
        self._is_up.set()
        self._look_s = loop.time() + _LOOK_S
        self._look = loop.call_at(self._look_s, self._watch)

    async def finish(self) -> None:
        """Let the guard stop everything and end; within 3 s it has."""
        self._is_finishing = True
        if self._look is not None:
            self._look.cancel()
        if self._entering is not None and not self._entering.done():
            self._entering.cancel()
            await asyncio.wait({self._entering})
            if self._door is not None:
                self._door.close()  # it may not even have begun to wait there
            if self._process is not None:
                self._process.kill()  # nothing is open, nothing moves
        if self._pipe is not None:
            self._pipe.end()
            is_idle = not any(held.may_move for held in self._held.values())
            if is_idle and not self._was_heard and self._process is not None:
                self._process.kill()  # it has hardly begun: nothing is open, nothing moves
            with suppress(TimeoutError):
                async with asyncio.timeout(_FINISH_S):
                    await self._gone.wait()
        if self._pipe is not None:  # it did not end in time
            self._pipe.close()
            self._pipe = None
        for transport in self.transports.values():
            transport.lost("the session was closed")
        process, self._process = self._process, None
        if process is not None:
            await reap(process)
        if self._reaping:
            await asyncio.wait(self._reaping)

    def _brief(self) -> None:
        """Tell a new guard what it must know; what may move is stopped first."""
        for spec in self._lines:
            self._post(spec.make)
        for control, held in self._held.items():
            if held.may_move:
                held.is_armed = False
                self._post(wire.Owe(held.line, control, held.terms))
                held.number = 0
            elif held.is_armed:
                self._post(wire.Arm(held.line, control, held.terms))

    def _hear(self, said: wire.FromGuard) -> None:
        self._silent_looks = self._kept_looks = 0
        self._was_heard = True
        self._has_served |= isinstance(said, wire.Opened)
        self._take(said, 0 if self._pipe is None else self._pipe.taken_bytes)

    def _watch(self) -> None:
        """Look whether the guard is alive."""
        loop = asyncio.get_running_loop()
        if loop.time() - self._look_s < _LOOK_S and not self._is_kept():  # else it was we who slept
            self._silent_looks += 1
        limit = _SILENT_LOOKS if self._was_heard else _START_LOOKS
        if self._silent_looks > limit and self._pipe is not None:
            log.error("the guard has been silent for %g s", limit * _LOOK_S)
            self._pipe.close()
            self._died()
            return
        self._look_s = loop.time() + _LOOK_S
        self._look = loop.call_at(self._look_s, self._watch)

    def _is_kept(self) -> bool:
        """Return whether a guard that is silent would run, and the system has not let it."""
        if not self._silent_looks or self._kept_looks >= _MOST_KEPT_LOOKS:
            return False
        before, self._standing = self._standing, standing(self.pid)
        is_kept = self._standing.wants_to_run and (
            self._standing.ran_s - before.ran_s < _LOOK_S / 2
        )
        self._kept_looks += is_kept
        return is_kept

    def _died(self) -> None:
        """Start another one, unless it was to end."""
        self._gone.set()
        self._pipe = None
        if self._look is not None:
            self._look.cancel()
        if self._is_finishing:
            return
        process, self._process = self._process, None
        if process is not None:
            with suppress(ProcessLookupError):
                process.kill()  # never two of them on one line
            task = asyncio.get_running_loop().create_task(reap(process))
            self._reaping.add(task)
            task.add_done_callback(self._reaping.discard)
        log.error("the guard ended; another one is started, and stops what moved")
        loop = asyncio.get_running_loop()
        is_short = loop.time() - self._started_s < _STEADY_S and not self._has_served
        self._short_lives = self._short_lives + 1 if is_short else 0
        self._gone.clear()
        if self._short_lives < _AT_ONCE:
            self.start()
        else:
            self._is_up.clear()
            self._look = loop.call_later(_AGAIN_S, self.start)
        for transport in self.transports.values():
            transport.lost(_DIED)

    def _post(self, said: wire.ToGuard) -> None:
        if self._pipe is not None:
            self._pipe.post(said)

    def _pass_newest(self, slot: str, said: wire.ToGuard) -> None:
        if self._pipe is not None:
            self._pipe.post(said, slot=slot)

    def _pass_stop(self, said: wire.Stop) -> None:
        if self._pipe is not None:
            self._pipe.post(said, is_urgent=True)

    def _drop(self, control: str) -> None:
        if self._pipe is not None:
            self._pipe.drop(control)

    async def _ready(self) -> None:
        await self._is_up.wait()


def _nothing() -> None:
    """Nothing is to be done after what came together."""
