"""Requests and responses about people, devices, tokens and sign-ins, in camel case.

Layer 5. Pure. Times are UTC, in seconds since 1970.
"""

from typing import Annotated, Literal

import msgspec

__all__ = [
    "AccountInfo",
    "AddPerson",
    "CodeInfo",
    "CodeRequest",
    "GuestRequest",
    "GuestResult",
    "JoinRequest",
    "NewToken",
    "PairRequest",
    "PairResult",
    "PairingCode",
    "PairingRequest",
    "PairingState",
    "PassphraseRequest",
    "PeopleMessage",
    "PrincipalChoice",
    "PrincipalInfo",
    "PrincipalList",
    "RenameRequest",
    "RobotLink",
    "RolesRequest",
    "SecretLink",
    "SignInChoice",
    "SignInInfo",
    "SignInList",
    "SignInRequest",
    "SignInResult",
    "TokenRequest",
]

_Short = Annotated[str, msgspec.Meta(max_length=300)]
_Roles = Annotated[tuple[_Short, ...], msgspec.Meta(max_length=100)]
_Passphrase = Annotated[str, msgspec.Meta(max_length=1000)]


class PeopleMessage(msgspec.Struct, frozen=True, rename="camel", forbid_unknown_fields=True):
    """The base class of all messages in this module."""


class SignInRequest(PeopleMessage, frozen=True):
    """Request to sign a person in."""

    name: _Short
    passphrase: _Passphrase


class SignInResult(PeopleMessage, frozen=True):
    """The identity of a browser after a sign-in, or after a sign-out."""

    name: str
    """Name of the person or device; "" after a sign-out."""


class CodeRequest(PeopleMessage, frozen=True):
    """Question about a code of a pairing or an invitation; the code stays valid."""

    code: _Short


class CodeInfo(PeopleMessage, frozen=True):
    """The right that a code gives."""

    kind: str
    """``device`` or ``person``."""
    name: str
    """Name of the device or person; "" lets the device choose its name."""
    suggested: str
    """Free name for a device, such as “Chrome on Android”."""
    owner: str
    """Name of the person whose device pairs; "" without one."""
    roles: tuple[str, ...]
    """Rights, such as ``drive@cart``."""
    ends_at: float


class PairRequest(PeopleMessage, frozen=True):
    """Request to pair the browser as a device."""

    code: _Short
    name: _Short


class RobotLink(PeopleMessage, frozen=True):
    """A robot that the new device may open."""

    title: str
    url: str


class PairResult(PeopleMessage, frozen=True):
    """The new device."""

    name: str
    check: str
    """Digits to compare by eye with the other screen."""
    robots: tuple[RobotLink, ...]


class JoinRequest(PeopleMessage, frozen=True):
    """Request of an invited person to set a passphrase."""

    code: _Short
    passphrase: _Passphrase


class PairingRequest(PeopleMessage, frozen=True):
    """Request for a code that pairs one device."""

    name: _Short = ""
    """Name of the device; "" lets the device choose."""
    owner: _Short = ""
    """Id of the person whose device pairs; "" for a device with roles of its own."""
    roles: _Roles = ()


class PairingCode(PeopleMessage, frozen=True):
    """A code that pairs one device."""

    id: str
    """Identifier of the pairing; no secret."""
    link: str
    """Address with the code in its fragment."""
    qr: str
    """The link as a QR code: a ``data:`` address of an image."""
    code: str
    fingerprint: str
    """Fingerprint of the local certificate authority; "" without one."""
    is_reachable: bool
    """Whether other devices can open the link."""
    lasts_s: float
    """Remaining validity, in seconds."""


class PairingState(PeopleMessage, frozen=True):
    """The state of a pairing."""

    state: Literal["waiting", "paired", "over"]
    name: str = ""
    """Name of the paired device."""
    device: str = ""
    """Id of the paired device."""
    check: str = ""
    """Digits to compare by eye with the new device."""


class PrincipalInfo(PeopleMessage, frozen=True):
    """A person, device, program or guest."""

    id: str
    kind: str
    name: str
    owner: str
    """Name of the person whose device this is, or ""."""
    roles: tuple[str, ...]
    commands: tuple[str, ...]
    """Commands that a program may give; empty: all of its role."""
    has_passphrase: bool
    passkeys: int
    accounts: int
    """Number of accounts at identity providers."""
    invited_until: float | None
    sign_ins: int
    used_at: float | None
    created_at: float
    ends_at: float | None


class PrincipalList(PeopleMessage, frozen=True):
    """People, devices, programs or guests, sorted by name."""

    entries: tuple[PrincipalInfo, ...]


class SignInInfo(PeopleMessage, frozen=True):
    """The sign-in of one browser, the key of a device, or a token."""

    id: str
    principal: str
    name: str
    kind: str
    way: str
    agent: str
    """Browser and system in words."""
    place: str
    """Network address at the sign-in."""
    created_at: float
    used_at: float
    ends_at: float | None
    """Time of the end without further use."""
    is_own: bool
    """Whether the request itself uses this sign-in."""


class SignInList(PeopleMessage, frozen=True):
    """Sign-ins, the most recently used first."""

    entries: tuple[SignInInfo, ...]


class AddPerson(PeopleMessage, frozen=True):
    """Request to add a person."""

    name: _Short
    roles: _Roles


class PrincipalChoice(PeopleMessage, frozen=True):
    """A person, device, program or guest."""

    id: _Short


class RenameRequest(PeopleMessage, frozen=True):
    """A person, device, program or guest, and its new name."""

    id: _Short
    name: _Short


class RolesRequest(PeopleMessage, frozen=True):
    """A person, device, program or guest, and its new rights."""

    id: _Short
    roles: _Roles
    """All rights from now on, such as ``drive@#lab``; empty: none."""


class TokenRequest(PeopleMessage, frozen=True):
    """Request for a token."""

    name: _Short
    roles: _Roles
    commands: _Roles = ()
    """Commands that the program may give; empty: all of its role."""
    days: Annotated[float, msgspec.Meta(gt=0, le=3650)] | None = 90
    """Validity in days; null: no end."""


class NewToken(PeopleMessage, frozen=True):
    """A new token, which is shown once."""

    name: str
    token: str
    ends_at: float | None


class GuestRequest(PeopleMessage, frozen=True):
    """Request for a link that lets guests watch one robot."""

    name: _Short
    robot: _Short
    hours: Annotated[float, msgspec.Meta(gt=0, le=720)] = 24


class SecretLink(PeopleMessage, frozen=True):
    """A link with a secret in its fragment."""

    link: str
    qr: str
    """The link as a QR code: a ``data:`` address of an image."""
    ends_at: float
    is_reachable: bool
    """Whether other devices can open the link."""


class SignInChoice(PeopleMessage, frozen=True):
    """A sign-in."""

    id: _Short


class GuestResult(PeopleMessage, frozen=True):
    """The page of a guest."""

    url: str


class AccountInfo(PeopleMessage, frozen=True):
    """The own account of a signed-in person, device or guest."""

    name: str
    kind: str
    roles: tuple[str, ...]
    has_passphrase: bool
    is_local: bool
    """Whether the browser holds the start key."""
    may_pair: bool
    """Whether a device of this person can be paired."""
    devices: tuple[PrincipalInfo, ...]
    sign_ins: tuple[SignInInfo, ...]


class PassphraseRequest(PeopleMessage, frozen=True):
    """Request to change the own passphrase."""

    current: _Passphrase
    """Present passphrase; "" if none is set."""
    passphrase: _Passphrase
