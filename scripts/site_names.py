"""Links to the reference from names in code style: commands, variables, codes and keys."""

import re
from collections import Counter
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from docutils.nodes import make_id

__all__ = ["Place", "place_of"]

REFERENCE = Path(__file__).resolve().parents[1] / "docs" / "reference"
KEYS = (
    *("hold", "hysteresis", "idempotent", "retries", "coalesce", "reconnect", "timeouts"),
    *("keepalive", "duplex", "baud", "overrides", "failsafe", "requires", "confirm", "extends"),
)
"""Keys without an underscore that have no other meaning on the pages. Other keys, such as `speed`
and `open`, are also arguments, widgets or words of other languages."""
_COMMAND = re.compile(r"urc ([a-z-]+)\b")


class Place(NamedTuple):
    """The target of a link: a page's path without its extension, and an anchor on that page."""

    page: str
    anchor: str


def place_of(literal: str) -> Place | None:
    """Return the place in the reference that a literal links to; None for no link."""
    found = names().get(literal.rstrip(":"))
    if found is None and (command := _COMMAND.match(literal)):
        found = names().get(f"urc {command[1]}")
    return found


@cache
def names() -> Mapping[str, Place]:
    """Return each name's place in the reference; a key of several definitions has no place."""
    found: dict[str, Place] = {}
    for page in ("cli", "environment", "codes"):
        found |= {one: Place(f"reference/{page}", make_id(one)) for one in headings(page, "##+")}
    pages = [f"keys/{file.stem}" for file in sorted((REFERENCE / "keys").glob("*.md"))]
    keys = [(one, page) for page in pages for one in headings(page, "##+")]
    owners = Counter(one.rpartition(".")[2] for one, _ in keys if "." in one)
    for one, page in keys:
        owner, _, key = one.rpartition(".")
        is_clear = "_" in key and owners[key] == 1
        if is_clear or (key in KEYS and not owner):
            found.setdefault(key, Place(f"reference/{page}", make_id(one)))
    return found


def headings(page: str, level: str) -> list[str]:
    """Return the headings of a reference page, at the levels that a pattern selects."""
    text = (REFERENCE / f"{page}.md").read_text("utf-8")
    return re.findall(rf"^{level} (.+)$", text, re.MULTILINE)
