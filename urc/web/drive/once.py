"""Commands that are given once, beside those that are held: who may give them, and what STOP does.

Floor 5. The lease of section 6 is for what a hand holds. What is given once needs none; but a page
that only watches gives nothing, and what moves something by itself (``moves``) is neither begun
against a stop, nor against whoever drives. The engine refuses it while a stop is latched, too: what
waits on a line, or in a question, must not go out after it.
"""

from collections.abc import Callable

from urc.model.driver import Driver
from urc.motion.lease import WATCHES, Client, Lease
from urc.protocol.reins import Pull
from urc.runtime.session import CommandFailed
from urc.web.drive.seat import Drivable

__all__ = ["HELD", "NotAdmitted", "Once", "can_move", "needs_holding"]

HELD = "this command moves the robot for as long as it is held, and nothing here can hold it"


class NotAdmitted(CommandFailed):
    """A command of which nothing is asked of the robot."""


def can_move(driver: Driver) -> bool:
    """Return whether anything of the robot moves, and so STOP is shown and latches."""
    return any(one.hold is not None or one.moves for one in driver.commands.values())


def needs_holding(driver: Driver, command: str) -> bool:
    """Return whether the command is motion: given once, it would never be stopped."""
    known = driver.commands.get(command)
    return known is not None and known.hold is not None


class Once:
    """Those of one robot."""

    def __init__(self, driver: Driver, lease: Callable[[], Lease]) -> None:
        """Prepare; `lease` returns the one that counts now."""
        self.driver = driver
        self._lease = lease
        self._session: Drivable | None = None

    def admit(self, client: Client, command: str) -> None:
        """Raise `NotAdmitted` while this screen may not give a command or sequence."""
        reason = HELD if needs_holding(self.driver, command) else self.refusal(client, command)
        if reason:
            raise NotAdmitted("refused", reason)

    def refusal(self, client: Client, command: str) -> str:
        """Return why this screen may not give a command or sequence now, or ""."""
        known = self.driver.commands.get(command)
        if known is not None and known.moves:
            return self._lease().hindrance(client)
        return WATCHES if client.role == "viewer" else ""

    def pull_refusal(self, client: Client, sequence: str, what: Pull) -> str:
        """Return why this screen may not do that with a sequence; whoever drives may end any."""
        if what in ("pause", "abort"):
            return WATCHES if client.role == "viewer" else ""
        return self.refusal(client, sequence)

    # -- the session

    def attach(self, session: Drivable) -> None:
        """Take a session; a stop that is latched holds in it."""
        self._session = session
        if self._lease().latched:
            self.stopped()

    def detach(self) -> None:
        """Take note that the session is over."""
        self._session = None

    def stopped(self) -> None:
        """Take note that STOP was pressed."""
        if self._session is not None:
            self._session.latch(self._lease().latched)

    def reset(self) -> None:
        """Take note that nothing is stopped any more."""
        if self._session is not None:
            self._session.latch("")
