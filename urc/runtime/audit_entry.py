"""One entry of the audit log, and its link in the hash chain.

Layer 4. Pure. Each link is the hash of the previous link and the entry. The first 13 columns are
those of version 1; links of version 1 do not cover the later columns.
"""

import hashlib
import json
import math
from typing import Final, NamedTuple

__all__ = ["AuditEntry", "COLUMNS", "FIRST_COLUMNS", "VERSION", "cleaned", "link", "shown"]

VERSION: Final = 2
"""Version of the links that this version of URC writes."""
FIRST_COLUMNS: Final = 13
"""Number of columns, from the first, that a link of version 1 covers."""
_LONGEST_TEXT: Final = 1000


class AuditEntry(NamedTuple):
    """One entry. The caller must remove secrets from all strings."""

    at: float
    """UTC time of the event by this machine's clock, in seconds since 1970."""
    robot: str
    """Name of the robot; "" for a server event."""
    what: str
    """Kind of event, such as ``moved``, ``STOP`` or ``signed in``."""
    who: str = ""
    """Name of the person, device or program that caused the event; without a sign-in, the name of
    the page."""
    role: str = ""
    client: str = ""
    """Identifier of the page's connection to the server, or of a sign-in."""
    epoch: int = 0
    """Epoch of the robot's lease when the event occurred."""
    command: str = ""
    """Name of the command, or of the action on a person, a package or a recording."""
    arguments: str = ""
    """Arguments as JSON."""
    data: str = ""
    """Sent bytes in hex, or the hash of a long payload; see `shown`."""
    outcome: str = ""
    """Result as text for display."""
    times: int = 1
    """Number of identical events that this entry represents."""
    lasted_s: float = 0.0
    principal: str = ""
    """Identifier of the person, device or program; "" if not signed in."""
    kind: str = ""
    """Kind of the principal: ``person``, ``device``, ``program`` or ``guest``."""
    way: str = ""
    """Sign-in method, such as ``passkey`` or ``token``."""
    place: str = ""
    """Network address of the page or program."""


COLUMNS: Final = AuditEntry._fields


def link(before: str, entry: AuditEntry, version: int = VERSION) -> str:
    """Return the link of an entry; `before` is the previous link, or "" for the first entry."""
    covered = entry if version > 1 else entry[:FIRST_COLUMNS]
    text = before + json.dumps(covered, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def shown(data: bytes, most: int = 64) -> str:
    """Return `data` in hex, or its size and hash if it has more than `most` bytes."""
    if len(data) <= most:
        return data.hex()
    return f"{len(data)} bytes, sha256 {hashlib.sha256(data).hexdigest()}"


def cleaned(entry: AuditEntry) -> AuditEntry:
    """Return an entry that the file can store unchanged: short UTF-8 strings and finite numbers."""
    return AuditEntry._make(
        _text(one) if isinstance(one, str) else _number(one) if isinstance(one, float) else one
        for one in entry._replace(at=float(entry.at), lasted_s=float(entry.lasted_s))
    )


def _text(text: str) -> str:
    return text[:_LONGEST_TEXT].encode("utf-8", "replace").decode()


def _number(number: float) -> float:
    return number if math.isfinite(number) else 0.0
