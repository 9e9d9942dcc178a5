"""Requests and responses for signing in with passkeys and for managing one's own passkeys.

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
    """The result of a WebAuthn ceremony in the browser."""

    response: dict[str, Any]
    """Credential in the JSON form of WebAuthn."""
    name: str = ""
    """Name that the person gives to a new passkey."""


class PasskeyChoice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Request to remove a passkey."""

    id: str


class PasskeyName(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Request to rename a passkey."""

    id: str
    name: str


class PasskeyLine(msgspec.Struct, frozen=True):
    """One passkey in the list of a person's passkeys."""

    id: str
    name: str
    host: str
    """Host name for which browsers offer the passkey."""
    created_at: float
    """UTC time at which the passkey was added, in seconds since 1970."""
    used_at: float | None
    """UTC time of the last sign-in, in seconds since 1970; null before the first sign-in."""


class PasskeyList(msgspec.Struct, frozen=True):
    """All passkeys of a person."""

    passkeys: list[PasskeyLine]


class ProviderAddress(msgspec.Struct, frozen=True):
    """URL of the identity provider's page, which the browser opens next."""

    url: str
