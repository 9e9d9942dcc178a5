"""A channel that starts, watches and restarts a guard in a separate process.

Theory of operation. The guard sends a heartbeat ten times a second. A guard that has ended, or that
has been silent for half a second, is replaced immediately; a silent guard is killed first. A guard
that waits for processor time is not replaced, because a new guard would also wait. A new guard has
no state, so the client initialises it first.

The first guard of a channel waits for its turn (`urc.guard.start_turns`), unless a stop must be
sent. A guard that replaces another guard does not wait.
"""

import asyncio
import logging
import os
import socket
import subprocess
import time
from contextlib import suppress
from typing import Final

from urc.guard import messages
from urc.guard.channel import ChannelListener
from urc.guard.pipe import Pipe
from urc.guard.process import CAN_INHERIT, GuardAcceptor, ProcessState, launch, reap, standing
from urc.guard.start_turns import StartTurns, start_turns

__all__ = ["CAN_GUARD", "PipeChannel"]

CAN_GUARD: Final = CAN_INHERIT or os.name == "nt"
"""Whether this system can run the guard as a separate process."""
_LOOK_S: Final = 0.1
_SILENT_LOOKS: Final = 5
_MOST_KEPT_LOOKS: Final = 15
"""Maximum number of checks for which a silent guard may wait for processor time."""
_START_LOOKS: Final = 100
"""Maximum number of checks before the first heartbeat; high, because Python may start slowly."""
_STEADY_S: Final = 0.5
"""Time for which a guard must run to count as successfully started, in seconds. A guard that has
opened a connection also counts as successfully started."""
_AT_ONCE: Final = 3
"""Number of short-lived guards that are replaced immediately. The replacement of further
short-lived guards is delayed by `_AGAIN_S` seconds."""
_AGAIN_S: Final = 1.0
_FINISH_S: Final = 3.0
_DIED: Final = "the guard of this connection ended; a new guard is starting"

log = logging.getLogger(__name__)


class PipeChannel:
    """The channel to a guard in a separate process."""

    def __init__(self, listener: ChannelListener, *, is_inherited: bool = CAN_INHERIT) -> None:
        """Create the channel; `start` starts the guard.

        Args:
            listener: the client.
            is_inherited: whether the guard process inherits its end of the pipe instead of
                connecting to a port.
        """
        self._listener = listener
        self._is_inherited = is_inherited
        self._door: GuardAcceptor | None = None
        self._entering: asyncio.Task[None] | None = None
        self._encoder = messages.encoder()
        self._decoder = messages.decoder_of_server()
        self._pipe: Pipe | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._turns: StartTurns | None = None
        self._is_up = asyncio.Event()
        self._is_finishing = False
        self._gone = asyncio.Event()
        self._look: asyncio.TimerHandle | None = None
        self._look_s = 0.0
        self._silent_looks = self._kept_looks = 0
        self._standing = ProcessState()
        self._was_heard = self._has_served = False
        self._started_s = 0.0
        self._short_lives = 0
        self._reaping: set[asyncio.Task[None]] = set()
        self._ending: asyncio.Task[None] | None = None

    @property
    def pid(self) -> int:
        """The guard's process ID; 0 if there is no process."""
        return 0 if self._process is None else self._process.pid

    # -- messages

    def post(self, message: messages.ToGuard, *, slot: str = "", is_urgent: bool = False) -> None:
        """Send a message; drop the message if no guard runs. See `urc.guard.channel.Channel`."""
        if self._pipe is not None:
            self._pipe.post(message, slot=slot, is_urgent=is_urgent)
        elif is_urgent and self._turns is not None:
            self._turns.hurry(self)  # the first messages to the new guard contain the stop

    def drop(self, slot: str) -> None:
        """Discard a slot's unsent message."""
        if self._pipe is not None:
            self._pipe.drop(slot)

    async def ready(self) -> None:
        """Wait until a guard has been initialised."""
        await self._is_up.wait()

    def now(self) -> float:
        """Return this machine's monotonic time in seconds, shared with the guard process."""
        return time.monotonic()

    def _handle(self, message: messages.FromGuard) -> None:
        self._silent_looks = self._kept_looks = 0
        if not self._was_heard:
            self._was_heard = True
            self._end_turn()
        self._has_served |= isinstance(message, messages.LineOpened)
        self._listener.handle(message, 0 if self._pipe is None else self._pipe.taken_bytes)

    # -- from start to end

    def start(self) -> None:
        """Start the guard when its turn comes, and initialise it; requires a running event loop."""
        self._turns = start_turns()
        self._turns.take(self, self._launch)

    def _end_turn(self) -> None:
        if self._turns is not None:
            self._turns.end(self)

    def _launch(self) -> None:
        loop = asyncio.get_running_loop()
        self._started_s = loop.time()
        try:
            self._process, line = launch(is_inherited=self._is_inherited)
        except OSError as fault:
            log.error("the guard cannot be started (%s)", fault)
            self._is_up.clear()
            self._look = loop.call_later(_AGAIN_S, self._launch)
            loop.call_soon(self._end_turn)  # later, because the next start may fail too
            return
        self._was_heard = self._has_served = False
        self._silent_looks = self._kept_looks = 0
        if isinstance(line, GuardAcceptor):
            self._is_up.clear()
            self._door = line
            self._entering = loop.create_task(self._admit(line))
        else:
            self._begin(line)

    async def _admit(self, door: GuardAcceptor) -> None:
        try:
            line = await door.admitted()
        except (OSError, TimeoutError) as fault:
            log.error("the guard did not connect to the server (%s)", fault)
            self._died()
        else:
            self._begin(line)

    def _begin(self, line: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        self._pipe = Pipe(
            line,
            self._encoder,
            self._decoder,
            take=self._handle,
            settle=_nothing,
            gone=self._died,
        )
        for message in self._listener.briefing():
            self._pipe.post(message)
        self._is_up.set()
        self._look_s = loop.time() + _LOOK_S
        self._look = loop.call_at(self._look_s, self._watch)

    async def finish(self) -> None:
        """Stop all controls and end the guard within 3 s, even if the caller is cancelled."""
        self._is_finishing = True
        if self._ending is None or self._ending.done():
            self._ending = asyncio.get_running_loop().create_task(self._end())
        await asyncio.shield(self._ending)

    async def _end(self) -> None:
        self._end_turn()
        if self._look is not None:
            self._look.cancel()
        if self._entering is not None and not self._entering.done():
            self._entering.cancel()
            await asyncio.wait({self._entering})
            if self._door is not None:
                self._door.close()  # the task may not have begun to wait yet
            if self._process is not None:
                self._process.kill()  # no connection is open, nothing moves
        if self._pipe is not None:
            self._pipe.end()
            is_idle = not self._listener.may_move
            if is_idle and not self._was_heard and self._process is not None:
                self._process.kill()  # it has just started: no connection is open, nothing moves
            with suppress(TimeoutError):
                async with asyncio.timeout(_FINISH_S):
                    await self._gone.wait()
        if self._pipe is not None:  # the guard did not end in time
            self._pipe.close()
            self._pipe = None
        self._listener.lost("the session was closed")
        process, self._process = self._process, None
        if process is not None:
            await reap(process)
        if self._reaping:
            await asyncio.wait(self._reaping)

    # -- the watch

    def _watch(self) -> None:
        """Check the guard's heartbeat every `_LOOK_S` seconds."""
        loop = asyncio.get_running_loop()
        # A late check is ignored, because this process slept and heartbeats may be unread.
        if loop.time() - self._look_s < _LOOK_S and not self._is_kept():
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
        """Return whether a silent guard is waiting for processor time."""
        if not self._silent_looks or self._kept_looks >= _MOST_KEPT_LOOKS:
            return False
        before, self._standing = self._standing, standing(self.pid)
        is_kept = self._standing.wants_to_run and (
            self._standing.ran_s - before.ran_s < _LOOK_S / 2
        )
        self._kept_looks += is_kept
        return is_kept

    def _died(self) -> None:
        """Start a new guard, unless `finish` was called."""
        self._gone.set()
        self._pipe = None
        if self._look is not None:
            self._look.cancel()
        if self._is_finishing:
            return
        self._bury()
        log.error("the guard ended; a new guard is starting and will stop the robot")
        loop = asyncio.get_running_loop()
        is_short = loop.time() - self._started_s < _STEADY_S and not self._has_served
        self._short_lives = self._short_lives + 1 if is_short else 0
        self._gone.clear()
        if self._short_lives < _AT_ONCE:
            self._launch()
        else:
            self._is_up.clear()
            self._look = loop.call_later(_AGAIN_S, self._launch)
        self._listener.lost(_DIED)

    def _bury(self) -> None:
        """Kill the process, so that two guards never own the same connection."""
        process, self._process = self._process, None
        if process is not None:
            with suppress(ProcessLookupError):
                process.kill()
            task = asyncio.get_running_loop().create_task(reap(process))
            self._reaping.add(task)
            task.add_done_callback(self._reaping.discard)


def _nothing() -> None:
    """Do nothing, because the engine handles each message separately."""
