"""Requests and responses of the pages for sign-in and for one's own passkeys.

Layer 5. Pure.
"""

from typing import Any

import msgspec

__all__ = [
    "PasskeyAnswer",
    "PasskeyChoice",
    "PasskeyLine",
    "PasskeyList",
    "PasskeyName",
    "ProviderAddress",
]


class PasskeyAnswer(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The result of a ceremony in the browser."""

    response: dict[str, Any]
    """The credential, in the JSON form of WebAuthn."""
    name: str = ""
    """Name of a new passkey."""


class PasskeyChoice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A passkey to remove."""

    id: str


class PasskeyName(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A passkey, and its new name."""

    id: str
    name: str


class PasskeyLine(msgspec.Struct, frozen=True):
    """One passkey in a list."""

    id: str
    name: str
    host: str
    """Host name for which browsers offer it."""
    created_at: float
    """UTC time in seconds since 1970."""
    used_at: float | None
    """UTC time of the last sign-in; null before the first."""


class PasskeyList(msgspec.Struct, frozen=True):
    """All passkeys of a person."""

    passkeys: list[PasskeyLine]


class ProviderAddress(msgspec.Struct, frozen=True):
    """The page of the identity provider to which the browser goes."""

    url: str
