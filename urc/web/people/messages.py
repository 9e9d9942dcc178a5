"""Requests and responses about people, devices, tokens and sign-ins.

Layer 5. Pure. The field names are in camel case. Times are UTC, in seconds since 1970.
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
    """Request to sign a person in with a name and a passphrase."""

    name: _Short
    passphrase: _Passphrase


class SignInResult(PeopleMessage, frozen=True):
    """The identity that a browser has after a sign-in or a sign-out."""

    name: str
    """Name of the person or device; "" after a sign-out."""


class CodeRequest(PeopleMessage, frozen=True):
    """Request for information about a pairing code or invitation; the code stays valid."""

    code: _Short


class CodeInfo(PeopleMessage, frozen=True):
    """The rights that a pairing or invitation code grants."""

    kind: str
    """``device`` or ``person``."""
    name: str
    """Name of the device or person; "" if the device chooses its name."""
    suggested: str
    """Suggested name for the device, not in use yet, such as “Chrome on Android”."""
    owner: str
    """Name of the device's owner; "" if it has no owner."""
    roles: tuple[str, ...]
    """Grants of the device or person, such as ``drive@cart``."""
    ends_at: float
    """Time at which the code becomes invalid, in seconds since 1970 (UTC)."""


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
    """Check number, to compare with the number on the other screen."""
    robots: tuple[RobotLink, ...]


class JoinRequest(PeopleMessage, frozen=True):
    """Request by an invited person to set a passphrase."""

    code: _Short
    passphrase: _Passphrase


class PairingRequest(PeopleMessage, frozen=True):
    """Request for a code to pair one device."""

    name: _Short = ""
    """Name of the device; "" if the device chooses its name."""
    owner: _Short = ""
    """Id of the device's owner; "" for a device with its own roles."""
    roles: _Roles = ()


class PairingCode(PeopleMessage, frozen=True):
    """A code for pairing one device."""

    id: str
    """Identifier of the pairing, which is not secret."""
    link: str
    """Link with the code in its fragment."""
    qr: str
    """QR code for the link, as the ``data:`` URL of an image."""
    code: str
    fingerprint: str
    """Fingerprint of the local certificate authority; "" if there is no authority."""
    is_reachable: bool
    """Whether other devices can open the link."""
    lasts_s: float
    """Time until the code expires, in seconds."""


class PairingState(PeopleMessage, frozen=True):
    """The state of a pairing, as shown to the administrator who created its code."""

    state: Literal["waiting", "paired", "over"]
    name: str = ""
    """Name of the paired device."""
    device: str = ""
    """Id of the paired device."""
    check: str = ""
    """Check number, to compare with the number on the new device."""


class PrincipalInfo(PeopleMessage, frozen=True):
    """A person, device, program or guest."""

    id: str
    kind: str
    name: str
    owner: str
    """Name of the device's owner; "" if it has no owner."""
    roles: tuple[str, ...]
    commands: tuple[str, ...]
    """Commands that the program may send; empty permits all commands of its role."""
    has_passphrase: bool
    passkeys: int
    accounts: int
    """Number of the person's accounts at identity providers."""
    invited_until: float | None
    sign_ins: int
    """Number of open sign-ins."""
    used_at: float | None
    """Time of the last request with an open sign-in, in seconds since 1970 (UTC); null if
    unused."""
    created_at: float
    """Time of creation, in seconds since 1970 (UTC)."""
    ends_at: float | None
    """Time at which the access ends, in seconds since 1970 (UTC); null for never."""


class PrincipalList(PeopleMessage, frozen=True):
    """People, devices, programs or guests, sorted by name."""

    entries: tuple[PrincipalInfo, ...]


class SignInInfo(PeopleMessage, frozen=True):
    """A browser's sign-in, a device's key, or a token."""

    id: str
    principal: str
    name: str
    kind: str
    way: str
    agent: str
    """Browser and operating system, such as “Chrome on Android”."""
    place: str
    """Network address from which the sign-in was opened."""
    created_at: float
    """Time of the sign-in, in seconds since 1970 (UTC)."""
    used_at: float
    """Time of the last request with this sign-in, in seconds since 1970 (UTC)."""
    ends_at: float | None
    """UTC end time without further use, in seconds since 1970; null if the sign-in never ends."""
    is_own: bool
    """Whether the current request uses this sign-in."""


class SignInList(PeopleMessage, frozen=True):
    """Sign-ins, most recently used first."""

    entries: tuple[SignInInfo, ...]


class AddPerson(PeopleMessage, frozen=True):
    """Request to add a person."""

    name: _Short
    roles: _Roles


class PrincipalChoice(PeopleMessage, frozen=True):
    """A person, device, program or guest."""

    id: _Short


class RenameRequest(PeopleMessage, frozen=True):
    """Request to rename a person, device, program or guest."""

    id: _Short
    name: _Short


class RolesRequest(PeopleMessage, frozen=True):
    """Request to replace the rights of a person, device or program."""

    id: _Short
    roles: _Roles
    """All new grants, such as ``drive@#lab``; empty removes all rights."""


class TokenRequest(PeopleMessage, frozen=True):
    """Request to add a program and create its token."""

    name: _Short
    roles: _Roles
    commands: _Roles = ()
    """Commands that the program may send; empty permits all commands of its role."""
    days: Annotated[float, msgspec.Meta(gt=0, le=3650)] | None = 90
    """Validity in days; null for unlimited validity."""


class NewToken(PeopleMessage, frozen=True):
    """A new token, which is shown only once."""

    name: str
    token: str
    """Secret of the program; the server shows it only once."""
    ends_at: float | None
    """Time at which the token becomes invalid, in seconds since 1970 (UTC); null for never."""


class GuestRequest(PeopleMessage, frozen=True):
    """Request for a guest link to one robot."""

    name: _Short
    robot: _Short
    hours: Annotated[float, msgspec.Meta(gt=0, le=720)] = 24
    """Time until the guests' access ends, in hours."""


class SecretLink(PeopleMessage, frozen=True):
    """A link with a secret in its fragment."""

    link: str
    qr: str
    """QR code for the link, as the ``data:`` URL of an image."""
    ends_at: float
    is_reachable: bool
    """Whether other devices can open the link."""


class SignInChoice(PeopleMessage, frozen=True):
    """A sign-in."""

    id: _Short


class GuestResult(PeopleMessage, frozen=True):
    """The page that a newly admitted guest opens."""

    url: str


class AccountInfo(PeopleMessage, frozen=True):
    """A signed-in visitor's own account."""

    name: str
    kind: str
    roles: tuple[str, ...]
    has_passphrase: bool
    is_local: bool
    """Whether the visitor is the local user."""
    may_pair: bool
    """Whether this person can pair devices."""
    devices: tuple[PrincipalInfo, ...]
    sign_ins: tuple[SignInInfo, ...]


class PassphraseRequest(PeopleMessage, frozen=True):
    """Request to change one's own passphrase."""

    current: _Passphrase
    """Current passphrase; "" if no passphrase is set."""
    passphrase: _Passphrase
