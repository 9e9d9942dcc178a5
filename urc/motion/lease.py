"""The lease of one robot: the exclusive right of one operator to drive the robot.

Theory of operation. At most one operator holds the lease. Every change of holder and every STOP
sends a stop to the robot and increments the lease's epoch. Inputs with an older epoch are refused,
so no motion continues under an earlier lease. A holder who sends no input for `SILENT_S` seconds
loses the lease. STOP does not require a lease, and it latches: the robot does not move until an
operator resets the latch. A reset never starts motion.

The lease and the latch exist only at the robot's site. Operators of other sites have the rights of
their role, and leave when the connection between the sites ends. Delayed requests then have no
effect.
"""

from typing import Final, NamedTuple

from urc.model.driver import STOPPED
from urc.model.role import Role, includes

__all__ = ["LeaseChanged", "Operator", "Lease", "LeaseState", "LeaseRefused", "WATCHES"]

WATCHES: Final = "this page only watches"
SILENT_S: Final = 60.0
"""How long the holder can go without sending input before losing the lease, in seconds."""
SHORTEST_REQUEST_S: Final = 3.0
REQUEST_S: Final = 10.0
LONGEST_REQUEST_S: Final = 60.0


class Operator(NamedTuple):
    """A person, device or program that watches or drives a robot."""

    id: str
    """Identifier, unique among the connected operators."""
    name: str = ""
    """Name shown to other operators."""
    role: Role | None = "drive"
    """Role at the last check; None if the person has no rights."""
    who: str = ""
    """Name of the person, device or program; "" if not signed in."""
    principal: str = ""
    """Identifier of the person, device or program; "" if not signed in."""
    person: str = ""
    """Identifier of the person: a device's owner, otherwise the principal; "" if unknown."""
    way: str = ""
    """Sign-in method, such as ``passkey``."""
    place: str = ""
    """Network address; "" for this machine."""
    kind: str = ""
    """Kind of the principal: ``person``, ``device``, ``program`` or ``guest``."""
    limit: str = ""
    """Why the role is limited, as one line; "" if it is not."""


class LeaseState(NamedTuple):
    """The state of one robot's lease, as shown to every operator.

    After a restart of the server, only the latch and the counters are restored.
    """

    epoch: int = 0
    holder: Operator | None = None
    asked_by: Operator | None = None
    """Operator who has requested the lease; None without a request."""
    asked_until: float = 0.0
    latched_by: str = ""
    """Name of the operator who pressed STOP; "" if no stop is latched."""
    stops: int = 0
    """Number of STOPs so far, which a restart preserves. A request made before the last STOP is
    invalid, even after a reset."""


class LeaseChanged(NamedTuple):
    """An accepted change to the lease, with the lease's new state."""

    state: LeaseState
    must_stop: bool
    """Whether a stop must be sent before the new state takes effect."""


class LeaseRefused(NamedTuple):
    """The refusal of a requested change to the lease."""

    message: str
    """Reason to display, including the holder's name if the holder blocks the change."""


class Lease:
    """The lease of one robot."""

    def __init__(self, state: LeaseState | None = None) -> None:
        """Restore a lease stored before a restart: keep the latch and drop the holder."""
        kept = state or LeaseState()
        self.state = LeaseState(kept.epoch + 1, latched_by=kept.latched_by, stops=kept.stops)
        self._touched_at = 0.0

    @property
    def deadline(self) -> float | None:
        """Time at which `expire` next changes the lease; None if no change is pending."""
        if self.state.holder is None:
            return None
        silent_at = self._touched_at + SILENT_S
        return min(silent_at, self.state.asked_until) if self.state.asked_by else silent_at

    def refusal(self, client: str, epoch: int) -> str:
        """Return why motion requested by `client` is refused; "" if the motion is permitted."""
        state = self.state
        if state.latched_by:
            return self.latched
        if state.holder is None:
            return "Take control first"
        if state.holder.id != client:
            return f"{_called(state.holder)} has the controls"
        if epoch != state.epoch:
            return "Control changed hands meanwhile"
        return ""

    def interlock(self, client: Operator, stops: int | None = None) -> str:
        """Return why autonomous motion is refused; "" if the motion is permitted.

        Autonomous motion does not need a lease, because no control is held. A latched stop or
        another operator's lease prevents autonomous motion.

        Args:
            client: the operator who issues the command.
            stops: number of STOPs at the time of the request; None for a request made now.
        """
        state = self.state
        if not includes(client.role, "drive"):
            return client.limit or WATCHES
        if state.latched_by:
            return self.latched
        if stops is not None and stops != state.stops:
            return STOPPED
        if state.holder is not None and state.holder.id != client.id:
            return f"{_called(state.holder)} has the controls"
        return ""

    @property
    def latched(self) -> str:
        """Message about the latched stop; "" if no stop is latched."""
        by = self.state.latched_by
        return f"Stopped by {by}. Reset to drive again." if by else ""

    def touch(self, now: float) -> None:
        """Record an input from the holder, which renews the lease."""
        self._touched_at = now

    def acquire(self, client: Operator, now: float) -> LeaseChanged | LeaseRefused:
        """Grant the lease to `client` if no other operator holds the lease."""
        state = self.state
        if not includes(client.role, "drive"):
            return LeaseRefused("watchers cannot drive")
        if state.latched_by:
            return LeaseRefused(self.latched)
        if state.holder is not None and state.holder.id != client.id:
            return LeaseRefused(f"{_called(state.holder)} has the controls")
        return self._grant(client, now)

    def request(
        self, client: Operator, now: float, for_s: float = REQUEST_S
    ) -> LeaseChanged | LeaseRefused:
        """Ask the holder for the lease and grant it after `for_s` seconds without an answer."""
        state = self.state
        if state.holder is None or state.holder.id == client.id:
            return self.acquire(client, now)
        if not includes(client.role, "drive"):
            return LeaseRefused("watchers cannot drive")
        if state.asked_by is not None and state.asked_by.id != client.id:
            return LeaseRefused(f"{_called(state.asked_by)} has already asked for control")
        for_s = min(max(for_s, SHORTEST_REQUEST_S), LONGEST_REQUEST_S)
        self.state = state._replace(asked_by=client, asked_until=now + for_s)
        return LeaseChanged(self.state, must_stop=False)

    def answer(self, client: str, now: float, *, is_granted: bool) -> LeaseChanged | LeaseRefused:
        """Hand over or keep the lease, according to the holder's answer."""
        state = self.state
        if state.holder is None or state.holder.id != client or state.asked_by is None:
            return LeaseRefused("No screen is asking you for control")
        if is_granted:
            return self._grant(state.asked_by, now)
        self.state = state._replace(asked_by=None, asked_until=0.0)
        return LeaseChanged(self.state, must_stop=False)

    def force(self, client: Operator, now: float) -> LeaseChanged | LeaseRefused:
        """Take the lease from its holder. The operator needs the role ``maintain``."""
        if not includes(client.role, "maintain"):
            return LeaseRefused("Taking over needs the role maintain")
        if self.state.latched_by:
            return LeaseRefused(self.latched)
        return self._grant(client, now)

    def leave(self, client: str) -> LeaseChanged | None:
        """Remove the holder or the requester of the lease; return None for any other client."""
        state = self.state
        if state.holder is not None and state.holder.id == client:
            self.state = self._next(latched_by=state.latched_by)
            return LeaseChanged(self.state, must_stop=True)
        if state.asked_by is not None and state.asked_by.id == client:
            self.state = state._replace(asked_by=None, asked_until=0.0)
            return LeaseChanged(self.state, must_stop=False)
        return None

    def stop(self, by: str) -> LeaseChanged:
        """Stop the robot and latch the stop. A stop is never refused."""
        state = self.state
        by = state.latched_by or by
        self.state = self._next(latched_by=by)._replace(stops=state.stops + 1)
        return LeaseChanged(self.state, must_stop=True)

    def reset(self, client: Operator, stops: int | None = None) -> LeaseChanged | LeaseRefused:
        """Reset the latch, so that operators can drive the robot again.

        A reset neither starts motion nor undoes a newer STOP. `stops` is the number of STOPs known
        to `client`; None stands for the current number. A client of another site must name it,
        because its reset may be late.
        """
        if not includes(client.role, "drive"):
            return LeaseRefused("watchers can stop the robot, but cannot reset it")
        if not self.state.latched_by:
            return LeaseRefused("nothing is stopped")
        if stops is None and client.way == "site":
            return LeaseRefused("A reset from another site must contain the number of STOPs")
        if stops is not None and stops != self.state.stops:
            return LeaseRefused("STOP was pressed again: reset it again")
        self.state = self._next()
        return LeaseChanged(self.state, must_stop=False)

    def expire(self, now: float) -> LeaseChanged | None:
        """Apply timeouts: grant the lease to the requester, or withdraw a silent holder's lease."""
        state = self.state
        if state.holder is None:
            return None
        if state.asked_by is not None and now >= state.asked_until:
            return self._grant(state.asked_by, now)
        if now >= self._touched_at + SILENT_S:
            return self.leave(state.holder.id)
        return None

    def _grant(self, client: Operator, now: float) -> LeaseChanged:
        self._touched_at = now
        self.state = self._next(holder=client)
        return LeaseChanged(self.state, must_stop=True)

    def _next(self, holder: Operator | None = None, latched_by: str = "") -> LeaseState:
        """Return a lease state with the next epoch and without a requester."""
        return LeaseState(
            self.state.epoch + 1, holder, latched_by=latched_by, stops=self.state.stops
        )


def _called(client: Operator) -> str:
    return client.name or "somebody else"
