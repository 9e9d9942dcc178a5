"""Visits: people and programs of other sites, whose rights last as long as their site renews them.

Layer 4. Pure. A visit exists only in memory. It has a role for each robot that its site has named
in a signed assertion.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

from urc.access.directory import Identity, Kind, Principal, SignIn
from urc.access.grants import Grant
from urc.model.role import Role

__all__ = ["MAX_VISITS", "Visit", "Visits"]

MAX_VISITS: Final = 1000
"""Maximum number of visits; above the limit, the oldest ends."""


class Visit(NamedTuple):
    """One person or program of another site, and one robot of this site."""

    site: str
    principal: str
    """Identifier at the other site."""
    name: str
    kind: Kind
    sign_in: str
    """Identifier of the sign-in at the other site."""
    robot: str
    role: Role | None
    """Role that this site grants now; None for no right."""
    place: str = ""
    """Network address of the visitor at the other site."""
    proposed: Role = "watch"
    """Role that the other site proposes."""
    limit: str = ""
    """Why the role is lower than proposed, as one line; "" if it is not."""
    id: str = ""
    """Identifier of the visit in the audit logs of both sites; "" if unknown."""


class _Known(NamedTuple):
    principal: Principal
    sign_in: SignIn
    visits: dict[str, tuple[Visit, float]]
    """Visit for each robot, and the UTC time at which it ends."""

    @property
    def grants(self) -> tuple[Grant, ...]:
        """The visitor's current grants."""
        found = ((one.role, robot) for robot, (one, _) in self.visits.items())
        return tuple(Grant(role, robot) for role, robot in found if role is not None)


class Visits:
    """All current visits."""

    def __init__(self) -> None:
        self._known: dict[str, _Known] = {}

    def renew(self, visit: Visit, now: float, ends_at: float) -> tuple[Identity, bool]:
        """Add or prolong a visit.

        Args:
            visit: the visitor and the robot.
            now: UTC time in seconds since 1970.
            ends_at: UTC time at which the role for the robot ends.

        Returns:
            The visitor's identity, and whether the directory is out of date.
        """
        key = f"{visit.site}/{visit.sign_in}"
        principal_id = f"{visit.site}/{visit.principal}"
        known = self._known.pop(key, None)
        visits = dict(known.visits) if known is not None else {}
        before = visits.get(visit.robot)
        visits[visit.robot] = (visit, ends_at)
        name = f"{visit.name} ({visit.site})" if visit.name else visit.site
        end = max(until for _, until in visits.values())
        principal = Principal(principal_id, visit.kind, name, ends_at=end)
        sign_in = SignIn(
            key, principal_id, "site", key.encode(), now, now, end, None, visit.place, visit.site
        )
        self._known[key] = _granted(_Known(principal, sign_in, visits))
        while len(self._known) > MAX_VISITS:
            self._known.pop(next(iter(self._known)))
        # A longer visit changes the directory too, because the directory contains its end.
        is_changed = before != visits[visit.robot]
        person = principal_id
        who = Identity(principal_id, key, name, visit.kind, "site", person, visit.id)
        return who, is_changed

    def end(self, now: float) -> bool:
        """Remove ended visits and ended roles; return whether there were any."""
        is_changed = False
        for key, known in tuple(self._known.items()):
            visits = {robot: one for robot, one in known.visits.items() if one[1] > now}
            if visits == known.visits:
                continue
            is_changed = True
            if visits:
                self._known[key] = _granted(known._replace(visits=visits))
            else:
                del self._known[key]
        return is_changed

    def judge(self, judged: Callable[[Visit], Visit]) -> list[Visit]:
        """Replace each visit by `judged` of it; return the visits that have changed.

        Args:
            judged: function that returns the visit with the role that this site grants now.
        """
        changed = []
        for key, known in tuple(self._known.items()):
            visits = {robot: (judged(one), end) for robot, (one, end) in known.visits.items()}
            if visits != known.visits:
                before = known.visits
                changed += [one for robot, (one, _) in visits.items() if before[robot][0] != one]
                self._known[key] = _granted(known._replace(visits=visits))
        return changed

    def limit(self, sign_in: str, robot: str) -> str:
        """Return why a visitor's role for a robot is lower than proposed; "" if it is not."""
        known = self._known.get(sign_in)
        found = known.visits.get(robot) if known is not None else None
        return found[0].limit if found is not None else ""

    def end_site(self, site: str) -> bool:
        """Remove all visits of a site; return whether there were any."""
        ended = [key for key, one in self._known.items() if one.sign_in.agent == site]
        for key in ended:
            del self._known[key]
        return bool(ended)

    @property
    def principals(self) -> dict[str, Principal]:
        """All visitors by id; a visitor with several sign-ins has the rights of the newest."""
        return {one.principal.id: one.principal for one in self._known.values()}

    @property
    def sign_ins(self) -> dict[str, SignIn]:
        """The visitors' sign-ins by id. No secret opens them."""
        return {one.sign_in.id: one.sign_in for one in self._known.values()}


def _granted(known: _Known) -> _Known:
    """Return a visitor whose principal has the grants of the visits."""
    return known._replace(principal=known.principal._replace(grants=known.grants))
