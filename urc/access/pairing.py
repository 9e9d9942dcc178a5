"""One-time codes for pairing devices, and for invited people to choose a passphrase.

Layer 4. Each function runs in one transaction. The code therefore stays valid after an error, such
as a name that is already in use. The functions block for a few milliseconds.
"""

import hashlib
from typing import Final, NamedTuple

from urc.access.administration import principal_named, replace_passphrase
from urc.access.directory import Directory, Kind, Principal, SignIn
from urc.access.grants import AccessError
from urc.access.lifetimes import DEVICE, PERSON
from urc.access.store import AccessStore, Invitation

__all__ = [
    "UNKNOWN_CODE",
    "NewSignIn",
    "Origin",
    "check_number",
    "free_name",
    "join",
    "pair",
]

UNKNOWN_CODE: Final = "this code is unknown, already used, or expired"


class Origin(NamedTuple):
    """Origin of a request, as shown in the list of sign-ins."""

    place: str = ""
    """Network address."""
    agent: str = ""
    """Names of the browser and the operating system."""


UNKNOWN_ORIGIN: Final = Origin()


class NewSignIn(NamedTuple):
    """A new sign-in with its principal, and with its secret, which the store does not contain."""

    principal: Principal
    sign_in: SignIn
    secret: str


def pair(
    store: AccessStore, code: str, name: str, *, now: float, origin: Origin = UNKNOWN_ORIGIN
) -> NewSignIn:
    """Add a device with an invitation's code; return the sign-in that is the device's key.

    Args:
        store: the store.
        code: the code.
        name: name chosen on the device, used if the invitation has no name.
        now: UTC time in seconds since 1970.
        origin: network address and browser of the request.

    Raises:
        AccessError: the code is unknown, or the name is invalid or in use.
    """
    with store.transaction():
        invitation = _redeemed(store, code, now, "device")
        wanted = invitation.name or name
        device = store.add("device", wanted, invitation.grants, now=now, owner=invitation.owner)
        sign_in, secret = store.open_sign_in(
            device.id, "pairing", now=now, ends_at=DEVICE.ends_at(now), idle_s=DEVICE.idle_s,
            place=origin.place, agent=origin.agent,
        )  # fmt: skip
    return NewSignIn(device, sign_in, secret)


def join(
    store: AccessStore, code: str, kept: str, *, now: float, origin: Origin = UNKNOWN_ORIGIN
) -> NewSignIn:
    """Set an invited person's passphrase and sign the person in.

    Args:
        store: the store.
        code: the code from the person's invitation.
        kept: hash of the passphrase.
        now: UTC time in seconds since 1970.
        origin: network address and browser of the request.

    Raises:
        AccessError: the code is unknown, or the person was removed.
    """
    with store.transaction():
        invitation = _redeemed(store, code, now, "person")
        person = store.directory().principals.get(invitation.owner)
        if person is None:
            raise AccessError("that person was removed")
        replace_passphrase(store, person.id, kept)
        sign_in, secret = store.open_sign_in(
            person.id, "passphrase", now=now, ends_at=PERSON.ends_at(now), idle_s=PERSON.idle_s,
            place=origin.place, agent=origin.agent,
        )  # fmt: skip
    return NewSignIn(person, sign_in, secret)


def check_number(sign_in: SignIn) -> str:
    """Return the four digits that both screens show after a pairing, such as ``47 19``.

    The user compares the digits. If another device has used the code first, its digits differ.
    """
    number = int.from_bytes(hashlib.sha256(b"urc pairing " + sign_in.digest).digest()[:4], "big")
    return f"{number // 100 % 100:02} {number % 100:02}"


def free_name(directory: Directory, wanted: str) -> str:
    """Return `wanted`, or a similar name such as ``Phone 2`` if a device already has that name."""
    number, name = 1, wanted
    while principal_named(directory, "device", name) is not None:
        number += 1
        name = f"{wanted} {number}"
    return name


def _redeemed(store: AccessStore, code: str, now: float, kind: Kind) -> Invitation:
    found = store.redeem(code, now)
    if found is None or found.kind != kind:
        # The error rolls back the caller's transaction, so a code of the other kind stays valid.
        raise AccessError(UNKNOWN_CODE)
    return found
