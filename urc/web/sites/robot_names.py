"""Names of robots of other sites: ``ROBOT@SITE``.

Layer 5. Pure.
"""

from typing import NamedTuple
from urllib.parse import parse_qsl, quote, unquote, urlencode

__all__ = ["FarName", "far_name", "far_query", "far_target"]

_AT = "@"
_API = "/api/v1/robots/"
_PAGES = "/robots/"


class FarName(NamedTuple):
    """A robot of another site."""

    robot: str
    """Name at its site."""
    site: str

    def __str__(self) -> str:
        """Return the name in URLs of this server."""
        return f"{self.robot}{_AT}{self.site}"


def far_name(name: str) -> FarName | None:
    """Return the robot and site in a name; None for a robot of this server."""
    robot, at, site = name.rpartition(_AT)
    return FarName(robot, site) if at and robot and site else None


def far_target(path: str) -> tuple[FarName, str] | None:
    """Return the robot and the path at its site, if a request must be passed to another site.

    Args:
        path: decoded path of the request.
    """
    for prefix in (_API, _PAGES):
        if path.startswith(prefix):
            name, slash, rest = path.removeprefix(prefix).partition("/")
            found = far_name(name)
            if found is not None and (prefix == _API or rest == "card"):
                return found, f"{prefix}{quote(found.robot, safe='')}{slash}{quote(rest)}"
    return None


def far_query(query: bytes) -> tuple[FarName, str] | None:
    """Return the robot and the query at its site, if a socket must be passed to another site."""
    pairs = parse_qsl(query.decode("latin-1"), keep_blank_values=True)
    found = next((far_name(unquote(value)) for name, value in pairs if name == "robot"), None)
    if found is None:
        return None
    return found, urlencode([(key, found.robot if key == "robot" else one) for key, one in pairs])
