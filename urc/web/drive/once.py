"""Commands that are given once, beside those that are held: who may give them, and what STOP does.

Floor 5. The lease of section 6 is for what a hand holds. What is given once needs none; but a page
that only watches gives nothing, and what moves something by itself (``moves``) is neither begun
against a stop, nor against whoever drives. The engine refuses it while a stop is latched, too: what
waits on a line, or in a question, must not go out after it.
"""

import asyncio
from collections.abc import Callable, Mapping

from urc.model.codec import Payload
from urc.model.driver import Command, Driver
from urc.model.values import NOTHING
from urc.motion.lease import WATCHES, Client
from urc.protocol.encode import BadArgument, check_arguments
from urc.protocol.reins import Pull
from urc.runtime.clock import Clock
from urc.runtime.motion import MotionDesk
from urc.runtime.session import CommandFailed
from urc.runtime.trail import Trail
from urc.web.drive.seat import Drivable

__all__ = ["HELD", "NotAdmitted", "Once", "can_move", "needs_holding"]

AGAIN_S = 1.0
"""After so long a stop that has not reached the robot is given again."""
_STOP = Client("", "STOP")
HELD = "this command moves the robot for as long as it is held, and nothing here can hold it"


class NotAdmitted(CommandFailed):
    """A command of which nothing is asked of the robot."""


def can_move(driver: Driver) -> bool:
    """Return whether anything of the robot moves, and so STOP is shown and latches."""
    return any(one.hold is not None or one.moves or one.stops for one in driver.commands.values())


def needs_holding(driver: Driver, command: str) -> bool:
    """Return whether the command is motion: given once, it would never be stopped."""
    known = driver.commands.get(command)
    return known is not None and known.hold is not None


def _moves(command: Command, arguments: Mapping[str, object]) -> bool:
    """Return whether it moves something with what a page gives, as the robot is given it."""
    if command.moves_if is None:
        return command.moves
    try:
        return command.moves_with(check_arguments(command, arguments))
    except BadArgument:
        return False  # nothing is sent of it; the engine says what is wrong


class Once:
    """Those of one robot."""

    def __init__(
        self, driver: Driver, desk: Callable[[], MotionDesk], clock: Clock, trail: Trail
    ) -> None:
        """Prepare; `desk` returns the one that counts now."""
        self.driver = driver
        self._desk = desk
        self._clock = clock
        self._trail = trail
        self._session: Drivable | None = None
        self.on_stopped: Callable[[], None] = _nobody
        """Called at each press of STOP."""
        self._pressed = asyncio.Event()

    def admit(
        self, client: Client, command: str, arguments: Mapping[str, object], stops: int | None
    ) -> None:
        """Raise `NotAdmitted` while this screen may not give a command or sequence."""
        is_held = needs_holding(self.driver, command)
        reason = HELD if is_held else self.refusal(client, command, arguments, stops)
        if reason:
            raise NotAdmitted("refused", reason)

    def refusal(
        self,
        client: Client,
        command: str,
        arguments: Mapping[str, object] = NOTHING,
        stops: int | None = None,
    ) -> str:
        """Return why this screen may not give a command or sequence now, or "".

        Args:
            client: the screen.
            command: what it gives.
            arguments: with these.
            stops: how many it knew of when it was wished; None: it is wished now.
        """
        known = self.driver.commands.get(command)
        if known is not None and _moves(known, arguments):
            return self._desk().lease.hindrance(client, stops)
        return WATCHES if client.role == "viewer" else ""

    def pull_refusal(self, client: Client, sequence: str, what: Pull) -> str:
        """Return why this screen may not do that with a sequence; whoever drives may end any."""
        if what in ("pause", "abort"):
            return WATCHES if client.role == "viewer" else ""
        return self.refusal(client, sequence)

    # -- the session

    async def serve(self, session: Drivable) -> None:
        """Let STOP reach a session; one that is latched, or still owed, does at once."""
        self._session = session
        self._pressed.clear()
        if self._desk().lease.latched or self._desk().owed:
            self.stopped()
        try:
            async with asyncio.TaskGroup() as group:
                giving: asyncio.Task[None] | None = None
                while True:
                    await self._pressed.wait()
                    self._pressed.clear()
                    if giving is not None:
                        giving.cancel()  # each press is a stop of its own
                    giving = group.create_task(self._give_stops(session))
        finally:
            self._session = None

    def stopped(self) -> None:
        """Take note that STOP was pressed."""
        self.on_stopped()
        if self._session is not None:
            self._session.latch(self._desk().lease.latched)
            self._pressed.set()

    def reset(self) -> None:
        """Take note that nothing is stopped any more."""
        if self._session is not None:
            self._session.latch("")

    async def _give_stops(self, session: Drivable) -> None:
        """Give the commands that stop the robot until it has heard of each."""
        while owed := self._desk().owed:
            async with asyncio.TaskGroup() as group:
                for command in owed:
                    group.create_task(self._give_stop(session, command))
            if self._desk().owed:
                await self._clock.sleep(AGAIN_S)

    async def _give_stop(self, session: Drivable, command: str) -> None:
        sent: list[Payload] = []
        outcome, is_heard = "done", True
        try:
            await session.command(command, {}, on_sent=sent.append)
        except CommandFailed as failed:
            outcome = f"{failed.code}: {failed.message}"
            # What the robot refuses it has heard. After a reset nobody wants another one.
            is_heard = failed.code == "refused" or (bool(sent) and not self._desk().lease.latched)
        if sent:
            self._trail.ran(_STOP, command, {}, outcome, sent[-1])
        if is_heard:
            self._desk().given(command)


def _nobody() -> None:
    """Nobody wants to know."""
