"""Audit log queries from pages and programs.

Layer 5. Pure.
"""

from collections.abc import Mapping

from urc.problems import UrcError
from urc.runtime.audit_search import MOST, AuditQuery

__all__ = ["PARAMETERS", "BadQuery", "query_of"]

PARAMETERS = ("robot", "who", "what", "text", "since", "until", "before", "last")
USUAL = 200
_LONGEST = 200
_MOST_KINDS = 20
_HIGHEST = 2**62


class BadQuery(UrcError):
    """A parameter of the audit log query has an invalid value."""


def query_of(given: Mapping[str, str], robots: frozenset[str] | None) -> AuditQuery:
    """Return the audit log query that a request contains.

    Args:
        given: the query parameters.
        robots: robots whose entries the visitor may see; None for all entries.

    Raises:
        BadQuery: a value is too long, not a number, or out of range.
    """
    for name in PARAMETERS:
        if len(given.get(name, "")) > _LONGEST:
            raise BadQuery(f"expected at most {_LONGEST} characters for {name!r}")
    what = tuple(one for one in given.get("what", "").split(",") if one)
    if len(what) > _MOST_KINDS:
        raise BadQuery(f"expected at most {_MOST_KINDS} kinds for 'what'")
    return AuditQuery(
        robots=robots,
        robot=given.get("robot", ""),
        who=given.get("who", "").strip(),
        what=what,
        text=given.get("text", "").strip(),
        since=_time(given, "since", 0.0),
        until=_time(given, "until", float("inf")),
        before=_number(given, "before", 0, _HIGHEST),
        last=_number(given, "last", USUAL, MOST),
    )


def _time(given: Mapping[str, str], name: str, usual: float) -> float:
    text = given.get(name, "")
    try:
        found = float(text) if text else usual
    except ValueError:
        found = -1.0
    if not found >= 0.0 or (text and found == float("inf")):
        raise BadQuery(f"expected seconds since 1970 for {name!r}, found {text!r}")
    return found


def _number(given: Mapping[str, str], name: str, usual: int, most: int) -> int:
    text = given.get(name, "")
    if not text:
        return usual
    found = int(text) if text.isascii() and text.isdigit() else 0
    if not 1 <= found <= most:
        raise BadQuery(f"expected a number from 1 to {most} for {name!r}, found {text!r}")
    return found
