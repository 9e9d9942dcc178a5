"""The lease of one robot: who may drive it.

Theory of operation. One client holds the lease or nobody does. Every change of the holder, and
every stop, raises the epoch and begins with a stop on the wire; whatever carries an older epoch is
refused, so that nobody drives on by accident. A holder who goes silent loses the lease. STOP needs
no lease and latches: nothing moves until somebody resets it on purpose, and a reset moves nothing.
"""

from typing import Final, Literal, NamedTuple

from urc.model.driver import STOPPED

__all__ = ["LeaseChanged", "Operator", "Lease", "LeaseState", "LeaseRefused", "Role", "WATCHES"]

Role = Literal["viewer", "driver", "engineer", "admin"]
_RANK: Final = {"viewer": 0, "driver": 1, "engineer": 2, "admin": 3}
WATCHES: Final = "this page only watches"
SILENT_S: Final = 60.0
"""A holder who does not touch anything for this long gives the lease back."""
SHORTEST_REQUEST_S: Final = 3.0
REQUEST_S: Final = 10.0
LONGEST_REQUEST_S: Final = 60.0


class Operator(NamedTuple):
    """Somebody at a screen."""

    id: str
    """Unique while connected."""
    name: str = ""
    """For the others."""
    role: Role = "driver"


class LeaseState(NamedTuple):
    """What everybody may see, and what survives a restart."""

    epoch: int = 0
    holder: Operator | None = None
    asked_by: Operator | None = None
    """Who wants it next."""
    asked_until: float = 0.0
    latched_by: str = ""
    """Who pressed STOP; "" while nothing is latched."""
    stops: int = 0
    """How often STOP was pressed in this run of the server: what was wished before the last time is
    over, also when it was reset since."""


class LeaseChanged(NamedTuple):
    """The lease is another one now."""

    state: LeaseState
    must_stop: bool
    """A stop goes out before anything of the new state does."""


class LeaseRefused(NamedTuple):
    """Nothing was changed."""

    message: str
    """Why, for people; names the holder where that is the reason."""


class Lease:
    """The lease of one robot."""

    def __init__(self, state: LeaseState | None = None) -> None:
        """Go on from `state`, as kept over a restart: the latch holds, the holder does not."""
        kept = state or LeaseState()
        self.state = LeaseState(kept.epoch + 1, latched_by=kept.latched_by, stops=kept.stops)
        self._touched_at = 0.0

    @property
    def deadline(self) -> float | None:
        """When `expire` has something to do; None when time alone changes nothing."""
        if self.state.holder is None:
            return None
        silent_at = self._touched_at + SILENT_S
        return min(silent_at, self.state.asked_until) if self.state.asked_by else silent_at

    def refusal(self, client: str, epoch: int) -> str:
        """Return why motion of a client is refused, or ""."""
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
        """Return why a client may not begin what moves by itself, or "".

        It needs no lease: nothing is held. But it goes neither against a stop, nor against whoever
        drives.

        Args:
            client: who gives it.
            stops: of the state in which it was wished; None: it is wished now.
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
        """Why nothing moves until somebody resets it, or ""."""
        by = self.state.latched_by
        return f"stopped by {by}: reset it first" if by else ""

    def touch(self, now: float) -> None:
        """Take note that the holder is at work."""
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
        """Ask the holder for the lease; without an answer in time it is handed over."""
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
        """Let the holder hand the lease over, or keep it."""
        state = self.state
        if state.holder is None or state.holder.id != client or state.asked_by is None:
            return LeaseRefused("nobody asks you for the controls")
        if is_granted:
            return self._grant(state.asked_by, now)
        self.state = state._replace(asked_by=None, asked_until=0.0)
        return LeaseChanged(self.state, must_stop=False)

    def force(self, client: Operator, now: float) -> LeaseChanged | LeaseRefused:
        """Take the lease from whoever holds it; that is for engineers."""
        if _RANK[client.role] < _RANK["engineer"]:
            return LeaseRefused("taking the controls by force needs an engineer")
        if self.state.latched_by:
            return LeaseRefused(self.latched)
        return self._grant(client, now)

    def leave(self, client: str) -> LeaseChanged | None:
        """Take note that a client gave the lease back, or is gone; None when it had no part."""
        state = self.state
        if state.holder is not None and state.holder.id == client:
            self.state = self._next(latched_by=state.latched_by)
            return LeaseChanged(self.state, must_stop=True)
        if state.asked_by is not None and state.asked_by.id == client:
            self.state = state._replace(asked_by=None, asked_until=0.0)
            return LeaseChanged(self.state, must_stop=False)
        return None

    def stop(self, by: str) -> LeaseChanged:
        """Stop and latch: never refused."""
        state = self.state
        by = state.latched_by or by
        self.state = self._next(latched_by=by)._replace(stops=state.stops + 1)
        return LeaseChanged(self.state, must_stop=True)

    def reset(self, client: Operator) -> LeaseChanged | LeaseRefused:
        """Let the robot be driven again, by whoever takes the lease next; starts nothing."""
        if _RANK[client.role] < _RANK["driver"]:
            return LeaseRefused("viewers can stop the robot, and cannot reset it")
        if not self.state.latched_by:
            return LeaseRefused("nothing is stopped")
        self.state = self._next()
        return LeaseChanged(self.state, must_stop=False)

    def expire(self, now: float) -> LeaseChanged | None:
        """Do what time alone does: hand over to who asked, take it from who went silent."""
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
        """Return a later epoch, in which nobody has asked for anything yet."""
        return LeaseState(
            self.state.epoch + 1, holder, latched_by=latched_by, stops=self.state.stops
        )


def _called(client: Operator) -> str:
    return client.name or "somebody else"
