"""Visits: people and programs of other sites, whose rights last as long as their site renews them.

Layer 4. Pure. A visit exists only in memory. It has a role for each robot that its site has named
in a signed assertion.
"""

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
    role: Role
    place: str = ""
    """Network address of the visitor at the other site."""


class _Known(NamedTuple):
    principal: Principal
    sign_in: SignIn
    roles: dict[str, tuple[Role, float]]
    """Role for each robot, and the UTC time at which it ends."""


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
        roles = dict(known.roles) if known is not None else {}
        before = roles.get(visit.robot)
        roles[visit.robot] = (visit.role, ends_at)
        name = f"{visit.name} ({visit.site})" if visit.name else visit.site
        grants = tuple(Grant(role, robot) for robot, (role, _) in roles.items())
        end = max(until for _, until in roles.values())
        principal = Principal(principal_id, visit.kind, name, grants, ends_at=end)
        sign_in = SignIn(
            key, principal_id, "site", key.encode(), now, now, end, None, visit.place, visit.site
        )
        self._known[key] = _Known(principal, sign_in, roles)
        while len(self._known) > MAX_VISITS:
            self._known.pop(next(iter(self._known)))
        # A longer visit changes the directory too, because the directory contains its end.
        is_changed = before != roles[visit.robot]
        person = principal_id
        return Identity(principal_id, key, name, visit.kind, "site", person), is_changed

    def end(self, now: float) -> bool:
        """Remove ended visits and ended roles; return whether there were any."""
        is_changed = False
        for key, known in tuple(self._known.items()):
            roles = {robot: one for robot, one in known.roles.items() if one[1] > now}
            if roles == known.roles:
                continue
            is_changed = True
            if roles:
                grants = tuple(Grant(role, robot) for robot, (role, _) in roles.items())
                principal = known.principal._replace(grants=grants)
                self._known[key] = _Known(principal, known.sign_in, roles)
            else:
                del self._known[key]
        return is_changed

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
