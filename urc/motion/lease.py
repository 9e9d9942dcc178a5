"""The lease of one robot: the right of one operator to drive it.

Theory of operation. At most one operator holds the lease. Every change of the holder, and every
stop, raises the epoch and begins with a stop on the wire. Inputs with an older epoch are refused,
so that no motion continues by accident. A silent holder loses the lease. STOP needs no lease, and
it latches: nothing moves until an operator resets it on purpose. A reset starts no motion.
"""

from typing import Final, Literal, NamedTuple

from urc.model.driver import STOPPED

__all__ = ["LeaseChanged", "Operator", "Lease", "LeaseState", "LeaseRefused", "Role", "WATCHES"]

Role = Literal["viewer", "driver", "engineer", "admin"]
_RANK: Final = {"viewer": 0, "driver": 1, "engineer": 2, "admin": 3}
WATCHES: Final = "this page only watches"
SILENT_S: Final = 60.0
"""Time without input after which the holder loses the lease, in seconds."""
SHORTEST_REQUEST_S: Final = 3.0
REQUEST_S: Final = 10.0
LONGEST_REQUEST_S: Final = 60.0


class Operator(NamedTuple):
    """A person at a page."""

    id: str
    """Unique while connected."""
    name: str = ""
    """Name for other operators."""
    role: Role = "driver"


class LeaseState(NamedTuple):
    """The public state of a lease. It survives a restart."""

    epoch: int = 0
    holder: Operator | None = None
    asked_by: Operator | None = None
    """Operator who asks for the lease."""
    asked_until: float = 0.0
    latched_by: str = ""
    """Name of the operator who pressed STOP; "" without a latch."""
    stops: int = 0
    """Number of stops in this run of the server. A request from before the last stop is void, even
    after a reset."""


class LeaseChanged(NamedTuple):
    """The lease changed."""

    state: LeaseState
    must_stop: bool
    """Whether a stop must go out before the new state takes effect."""


class LeaseRefused(NamedTuple):
    """The lease did not change."""

    message: str
    """Reason for people; it names the holder when the holder is the reason."""


class Lease:
    """The lease of one robot."""

    def __init__(self, state: LeaseState | None = None) -> None:
        """Start from `state`, as stored before a restart: the latch stays, the holder does not."""
        kept = state or LeaseState()
        self.state = LeaseState(kept.epoch + 1, latched_by=kept.latched_by, stops=kept.stops)
        self._touched_at = 0.0

    @property
    def deadline(self) -> float | None:
        """Time of the next change by `expire`; None without one."""
        if self.state.holder is None:
            return None
        silent_at = self._touched_at + SILENT_S
        return min(silent_at, self.state.asked_until) if self.state.asked_by else silent_at

    def refusal(self, client: str, epoch: int) -> str:
        """Return the reason to refuse motion of a client, or ""."""
        state = self.state
        if state.latched_by:
            return self.latched
        if state.holder is None:
            return "nobody has the controls: take them first"
        if state.holder.id != client:
            return f"{_called(state.holder)} has the controls"
        if epoch != state.epoch:
            return "the controls were taken anew meanwhile"
        return ""

    def interlock(self, client: Operator, stops: int | None = None) -> str:
        """Return the reason to refuse autonomous motion, or "".

        Autonomous motion needs no lease, because no control is held. A latched stop and the lease
        of another operator prevent it.

        Args:
            client: the operator who gives the command.
            stops: number of stops at the time of the request; None: requested now.
        """
        state = self.state
        if _RANK[client.role] < _RANK["driver"]:
            return WATCHES
        if state.latched_by:
            return self.latched
        if stops is not None and stops != state.stops:
            return STOPPED
        if state.holder is not None and state.holder.id != client.id:
            return f"{_called(state.holder)} has the controls"
        return ""

    @property
    def latched(self) -> str:
        """Message about the latched stop, or ""."""
        by = self.state.latched_by
        return f"stopped by {by}: reset it first" if by else ""

    def touch(self, now: float) -> None:
        """Record an input of the holder."""
        self._touched_at = now

    def acquire(self, client: Operator, now: float) -> LeaseChanged | LeaseRefused:
        """Give a free lease to `client`."""
        state = self.state
        if _RANK[client.role] < _RANK["driver"]:
            return LeaseRefused("viewers cannot drive")
        if state.latched_by:
            return LeaseRefused(self.latched)
        if state.holder is not None and state.holder.id != client.id:
            return LeaseRefused(f"{_called(state.holder)} has the controls")
        return self._grant(client, now)

    def request(
        self, client: Operator, now: float, for_s: float = REQUEST_S
    ) -> LeaseChanged | LeaseRefused:
        """Ask the holder for the lease; after a timeout, the lease is handed over."""
        state = self.state
        if state.holder is None or state.holder.id == client.id:
            return self.acquire(client, now)
        if _RANK[client.role] < _RANK["driver"]:
            return LeaseRefused("viewers cannot drive")
        if state.asked_by is not None and state.asked_by.id != client.id:
            return LeaseRefused(f"{_called(state.asked_by)} asks for the controls already")
        for_s = min(max(for_s, SHORTEST_REQUEST_S), LONGEST_REQUEST_S)
        self.state = state._replace(asked_by=client, asked_until=now + for_s)
        return LeaseChanged(self.state, must_stop=False)

    def answer(self, client: str, now: float, *, is_granted: bool) -> LeaseChanged | LeaseRefused:
        """Hand the lease over, or keep it, as the holder answers."""
        state = self.state
        if state.holder is None or state.holder.id != client or state.asked_by is None:
            return LeaseRefused("nobody asks you for the controls")
        if is_granted:
            return self._grant(state.asked_by, now)
        self.state = state._replace(asked_by=None, asked_until=0.0)
        return LeaseChanged(self.state, must_stop=False)

    def force(self, client: Operator, now: float) -> LeaseChanged | LeaseRefused:
        """Take the lease from its holder. Only engineers may."""
        if _RANK[client.role] < _RANK["engineer"]:
            return LeaseRefused("taking the controls by force needs an engineer")
        if self.state.latched_by:
            return LeaseRefused(self.latched)
        return self._grant(client, now)

    def leave(self, client: str) -> LeaseChanged | None:
        """Remove a client as the holder or asker; return None if it is neither."""
        state = self.state
        if state.holder is not None and state.holder.id == client:
            self.state = self._next(latched_by=state.latched_by)
            return LeaseChanged(self.state, must_stop=True)
        if state.asked_by is not None and state.asked_by.id == client:
            self.state = state._replace(asked_by=None, asked_until=0.0)
            return LeaseChanged(self.state, must_stop=False)
        return None

    def stop(self, by: str) -> LeaseChanged:
        """Stop and latch. This is never refused."""
        state = self.state
        by = state.latched_by or by
        self.state = self._next(latched_by=by)._replace(stops=state.stops + 1)
        return LeaseChanged(self.state, must_stop=True)

    def reset(self, client: Operator) -> LeaseChanged | LeaseRefused:
        """Reset the latch: the next holder can drive the robot. Nothing starts to move."""
        if _RANK[client.role] < _RANK["driver"]:
            return LeaseRefused("viewers can stop the robot, and cannot reset it")
        if not self.state.latched_by:
            return LeaseRefused("nothing is stopped")
        self.state = self._next()
        return LeaseChanged(self.state, must_stop=False)

    def expire(self, now: float) -> LeaseChanged | None:
        """Apply timeouts: hand the lease to the asker, or take it from a silent holder."""
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
        """Return the state of the next epoch, without an asker."""
        return LeaseState(
            self.state.epoch + 1, holder, latched_by=latched_by, stops=self.state.stops
        )


def _called(client: Operator) -> str:
    return client.name or "somebody else"
