"""The rules of a site for visitors from other sites.

Layer 4. Pure. The visitor's own site states name and network address; this site trusts it.
"""

import ipaddress
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, tzinfo
from typing import Final, Literal, NamedTuple

from urc._addresses import unmapped
from urc.model.role import ROLES, Role

__all__ = ["DAYS", "OPEN", "Applicant", "Decision", "Hours", "Network", "SiteRule", "SiteRules"]

DAYS: Final = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
Network = ipaddress.IPv4Network | ipaddress.IPv6Network
Condition = Literal["sites", "people", "networks", "robots", "times"]
_HIGHEST: Final[Role] = "drive"
"""Highest role that any site grants a visitor."""
_TAG: Final = "#"
_OTHERS: Final[dict[Condition, str]] = {
    "sites": "is for other sites",
    "people": "is for other people",
    "networks": "is for other networks",
    "robots": "is for other robots",
}


class Hours(NamedTuple):
    """A part of the day, in minutes after midnight; an end before the begin is the next day."""

    begins: int
    """First minute, 0 to 1439."""
    ends: int
    """Minute after the last, 1 to 1440."""

    def __str__(self) -> str:
        """Return the hours as in the file: ``07:00-18:00``."""
        return "-".join(f"{one // 60:02}:{one % 60:02}" for one in self)


class Applicant(NamedTuple):
    """A visitor of another site who wants to use a robot of this site."""

    site: str
    name: str
    is_guest: bool
    """Whether the visitor has not signed in."""
    place: str
    """Network address of the visitor's device; "" if unknown."""
    robot: str
    tags: Collection[str] = ()
    """Tags of the robot."""

    def __str__(self) -> str:
        """Return the visitor's name with the site."""
        return f"{self.name} ({self.site})"


class Decision(NamedTuple):
    """The role that a site grants a visitor now, with the reason."""

    role: Role | None
    """None refuses the visitor."""
    rule: str = ""
    """Name of the rule that decided; "" if none applied."""
    reason: str = ""
    """Why the visitor may not drive, as one line; "" if the visitor may, or did not ask to."""


@dataclass(frozen=True, slots=True)
class SiteRule:
    """A role, and the conditions under which it applies; an empty condition is always met."""

    name: str
    role: Role | None
    sites: frozenset[str] = frozenset()
    people: frozenset[str] = frozenset()
    networks: tuple[Network, ...] = ()
    robots: frozenset[str] = frozenset()
    """Names of robots, or ``#`` and a tag."""
    days: frozenset[int] = frozenset()
    """Days of the week; 0 is Monday."""
    hours: tuple[Hours, ...] = ()

    def unmet(self, who: Applicant, here: datetime) -> Iterator[Condition]:
        """Yield the conditions that are not met at the local time `here`."""
        if self.sites and who.site not in self.sites:
            yield "sites"
        if self.people and (who.is_guest or who.name not in self.people):
            yield "people"
        if self.networks and not _is_inside(who.place, self.networks):
            yield "networks"
        tags = {f"{_TAG}{tag}" for tag in who.tags}
        if self.robots and not self.robots & {who.robot, *tags}:
            yield "robots"
        if not self._is_time(here):
            yield "times"

    @property
    def has_times(self) -> bool:
        """Whether the rule has days or hours."""
        return bool(self.days or self.hours)

    @property
    def times(self) -> str:
        """Days and hours as text, such as ``mon, tue 07:00-18:00``; "" for always."""
        days = ", ".join(DAYS[one] for one in sorted(self.days))
        return " ".join(filter(None, (days, ", ".join(map(str, self.hours)))))

    def _is_time(self, here: datetime) -> bool:
        minute = here.hour * 60 + here.minute
        for begins, ends in self.hours or (Hours(0, 24 * 60),):
            is_over_night = ends <= begins
            if begins <= minute and (is_over_night or minute < ends) and self._is_day(here):
                return True
            yesterday = here - timedelta(days=1)
            if is_over_night and minute < ends and self._is_day(yesterday):
                return True
        return False

    def _is_day(self, here: datetime) -> bool:
        return not self.days or here.weekday() in self.days


@dataclass(frozen=True, slots=True)
class SiteRules:
    """All rules of a site; the first rule that applies decides."""

    rules: tuple[SiteRule, ...] = ()
    otherwise: Role | None = None
    """Highest role of visitors to whom no rule applies; None refuses them."""
    zone: tzinfo = UTC
    """Time zone of the rules' days and hours."""
    zone_name: str = ""
    fault: str = ""
    """Why the rules cannot be used, as one line; every visitor is then refused."""

    def decided(self, who: Applicant, proposed: Role, now: float, site: str) -> Decision:
        """Return the role that this site grants.

        Args:
            who: the visitor and the robot.
            proposed: role that the visitor's site proposes.
            now: UTC time in seconds since 1970.
            site: name of this site, for messages.
        """
        if self.fault:
            text = f"the rules of the site {site} cannot be read, so it admits no visitors"
            return Decision(None, reason=text)
        here = datetime.fromtimestamp(now, UTC).astimezone(self.zone)
        missed: list[tuple[SiteRule, list[Condition]]] = []
        rule = None
        for one in self.rules:
            unmet = [*one.unmet(who, here)]
            if not unmet:
                rule = one
                break
            missed.append((one, unmet))
        limit = rule.role if rule is not None else self.otherwise
        wanted = _lower(proposed, _HIGHEST)
        role = _lower(limit, wanted) if limit is not None else None
        name = rule.name if rule is not None else ""
        if role == wanted:
            return Decision(role, name)
        return Decision(role, name, f"{self._refusal(name, role, who, site)}{self._near(missed)}")

    def _refusal(self, rule: str, role: Role | None, who: Applicant, site: str) -> str:
        by = f"the rule “{rule}” of" if rule else "no other rule applies, so"
        what = "lets" if role is not None else "refuses"
        only = " only watch" if role is not None else ""
        return f"{by} the site {site} {what} {who}{only}"

    def _near(self, missed: list[tuple[SiteRule, list[Condition]]]) -> str:
        """Return a hint at the rule that would have allowed driving with the fewest changes."""
        near = [one for one in missed if one[0].role == _HIGHEST]
        if not near:
            return ""
        rule, unmet = min(near, key=lambda one: len(one[1]))
        if unmet == ["times"]:
            zone = f" ({self.zone_name})" if self.zone_name else ""
            return f"; the rule “{rule.name}” applies {rule.times}{zone}"
        first = next(one for one in unmet if one != "times")
        return f"; the rule “{rule.name}” {_OTHERS[first]}"


OPEN: Final = SiteRules(otherwise=_HIGHEST)
"""The rules of a site without a file: visitors may drive if their site proposes it."""


def _lower(one: Role, other: Role) -> Role:
    return min(one, other, key=ROLES.index)


def _is_inside(place: str, networks: tuple[Network, ...]) -> bool:
    try:
        address = unmapped(ipaddress.ip_address(place))
    except ValueError:  # unknown, or not a network address
        return False
    return any(address in network for network in networks)
