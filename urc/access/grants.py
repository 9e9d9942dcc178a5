"""Grants: a role for all robots, for a tag, or for one robot.

Layer 4. Pure. The text form is ``ROLE``, ``ROLE@ROBOT`` or ``ROLE@#TAG``, such as ``drive@#lab``.
"""

import json
from collections.abc import Collection, Iterable
from typing import Final, NamedTuple

from urc.model.role import ROLES, Role, includes
from urc.problems import UrcError

__all__ = [
    "ALL",
    "AccessError",
    "Grant",
    "grants_from_json",
    "grants_to_json",
    "highest",
    "parse_grant",
    "role_at",
]

ALL: Final = "*"
"""Scope of a grant for all current and future robots."""
_TAG: Final = "#"


class AccessError(UrcError):
    """Raised if a request about people, devices, programs or their credentials fails."""


class Grant(NamedTuple):
    """A role for all robots, for the robots with a tag, or for one robot."""

    role: Role
    scope: str = ALL
    """`ALL`, a robot's name, or ``#`` followed by a tag."""

    def __str__(self) -> str:
        """Return the grant in its text form."""
        return self.role if self.scope == ALL else f"{self.role}@{self.scope}"

    def covers(self, robot: str, tags: Collection[str]) -> bool:
        """Return whether the grant applies to a robot."""
        if self.scope == ALL:
            return True
        if self.scope.startswith(_TAG):
            return self.scope.removeprefix(_TAG) in tags
        return self.scope == robot


def parse_grant(text: str) -> Grant:
    """Return the grant described by `text`.

    Raises:
        AccessError: the role is unknown, the scope is empty, or ``administer`` has a scope.
    """
    role, separator, scope = text.partition("@")
    if role not in ROLES:
        raise AccessError(f"expected a role ({', '.join(ROLES)}), found {role!r} in {text!r}")
    if separator and scope in ("", _TAG):
        raise AccessError(f"expected a robot or #tag after @, found {text!r}")
    if role == "administer" and scope not in ("", ALL):
        raise AccessError(f"administer applies to all robots: write 'administer', found {text!r}")
    return Grant(role, scope or ALL)


def grants_to_json(grants: Iterable[Grant]) -> str:
    """Return grants as stored: a JSON list of their text forms."""
    return json.dumps([str(grant) for grant in grants])


def grants_from_json(text: str) -> tuple[Grant, ...]:
    """Return the grants in a JSON text from `grants_to_json`."""
    return tuple(parse_grant(each) for each in json.loads(text))


def role_at(grants: Iterable[Grant], robot: str = "", tags: Collection[str] = ()) -> Role | None:
    """Return the highest role of `grants` for a robot; if `robot` is "", for the whole server."""
    return highest(grant.role for grant in grants if grant.covers(robot, tags))


def highest(roles: Iterable[Role]) -> Role | None:
    """Return the highest of `roles`, or None if there are no roles."""
    best: Role | None = None
    for role in roles:
        if best is None or includes(role, best):
            best = role
    return best
