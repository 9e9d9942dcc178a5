"""Versions of URC at the sites of a fleet: one version of difference is accepted.

Layer 4. Pure. A version here is major and minor number, such as 0.4. Patches never matter.
"""

import re
from typing import Final, NamedTuple

__all__ = ["UNKNOWN", "SiteVersion", "parse_version", "version_refusal"]

_VERSION: Final = re.compile(r"(\d{1,4})\.(\d{1,4})(?:[.+-][0-9A-Za-z.+-]{0,32})?", re.ASCII)
_MOST_SKEW: Final = 1


class SiteVersion(NamedTuple):
    """A version of URC; versions are compared by major and minor number."""

    major: int
    minor: int

    def __str__(self) -> str:
        """Return the version as text."""
        return f"{self.major}.{self.minor}"


UNKNOWN: Final = ""
"""Version of a site whose URC is so old that it states none."""


def parse_version(text: str) -> SiteVersion | None:
    """Return the version in a text of at most 42 characters, such as ``0.4.1``; None if invalid."""
    match = _VERSION.fullmatch(text)
    return SiteVersion(int(match[1]), int(match[2])) if match else None


def version_refusal(site: str, version: str, other: str, other_version: str) -> str:
    """Return why two sites do not work together, as one line; "" if they do.

    Args:
        site: a site.
        version: its version of URC; `UNKNOWN` is accepted.
        other: the other site.
        other_version: version of URC at the other site.
    """
    if UNKNOWN in (version, other_version):
        return ""
    found, known = parse_version(version), parse_version(other_version)
    for name, one in ((site, found), (other, known)):
        if one is None:
            return f"the site {name} states no valid version of URC; update URC at the site {name}"
    if found is None or known is None or not _are_apart(found, known):
        return ""
    older = site if found < known else other
    return (
        f"URC {found} at the site {site} and URC {known} at the site {other} are more than one"
        f" version apart; update URC at the site {older}"
    )


def _are_apart(one: SiteVersion, other: SiteVersion) -> bool:
    return one.major != other.major or abs(one.minor - other.minor) > _MOST_SKEW
