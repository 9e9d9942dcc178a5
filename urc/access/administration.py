"""Administration of access: overview, roles, invitations, tokens, guest links and revocation.

Layer 4. Each function runs in one transaction of an `AccessStore`, so two administrators cannot
undo each other's changes. The functions block for a few milliseconds, so servers call them in a
thread.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterable
from typing import Final, NamedTuple

from urc.access.directory import Directory, Kind, Principal, SignIn, Way
from urc.access.grants import AccessError, Grant
from urc.access.lifetimes import LONGEST_GUEST_S
from urc.access.store import AccessStore, Invitation

__all__ = [
    "KEYS",
    "PrincipalStatus",
    "add_guest",
    "add_token",
    "change_grants",
    "end_after_restore",
    "end_sign_ins",
    "invite_person",
    "newest_time",
    "overview",
    "principal_named",
    "replace_passphrase",
]

KEYS: Final[frozenset[Way]] = frozenset(("pairing", "token"))
"""Sign-in methods whose secret is a device's key or a program's token."""


class PrincipalStatus(NamedTuple):
    """A person, device, program or guest, with its credentials and sign-ins."""

    principal: Principal
    owner: str = ""
    """Name of the device's owner; "" if there is no owner."""
    has_passphrase: bool = False
    passkeys: int = 0
    """Number of passkeys."""
    accounts: int = 0
    """Number of accounts at identity providers (OpenID Connect)."""
    invited_until: float | None = None
    """UTC time at which the newest invitation expires, in seconds; None if there is no
    invitation."""
    sign_ins: int = 0
    """Number of active sign-ins."""
    used_at: float | None = None
    """UTC time of the last use, in seconds since 1970; None if never used."""


def overview(store: AccessStore, now: float, *kinds: Kind) -> list[PrincipalStatus]:
    """Return all principals of the given kinds, sorted by kind and name.

    Args:
        store: the store.
        now: UTC time in seconds since 1970.
        kinds: the kinds to include; all kinds by default.
    """
    with store.transaction() as base:
        directory = store.directory()
        known = {row[0] for row in base.execute("SELECT principal FROM passphrases")}
        keys = Counter(row[0] for row in base.execute("SELECT principal FROM passkeys"))
        accounts = Counter(
            row[0] for row in base.execute("SELECT principal FROM external_accounts")
        )
        invited = dict(
            base.execute(
                "SELECT owner, max(ends_at) FROM invitations"
                " WHERE kind = 'person' AND ends_at > ? GROUP BY owner",
                (now,),
            ).fetchall()
        )
    chosen = [one for one in directory.principals.values() if not kinds or one.kind in kinds]
    return [
        _status(directory, one, now)._replace(
            has_passphrase=one.id in known,
            passkeys=keys[one.id],
            accounts=accounts[one.id],
            invited_until=invited.get(one.id),
        )
        for one in sorted(chosen, key=lambda one: (one.kind, one.name.casefold()))
    ]


def _status(directory: Directory, one: Principal, now: float) -> PrincipalStatus:
    owner = directory.principals.get(one.owner)
    own = [each for each in directory.sign_ins.values() if each.principal == one.id]
    return PrincipalStatus(
        one,
        owner.name if owner else "",
        sign_ins=sum(not each.is_over(now) for each in own),
        used_at=max((each.used_at for each in own if _was_used(each)), default=None),
    )


def _was_used(one: SignIn) -> bool:
    """Return whether a sign-in has been used; a new browser sign-in already counts as used."""
    return one.way not in KEYS or one.used_at > one.created_at


def principal_named(directory: Directory, kind: Kind, name: str) -> Principal | None:
    """Return the principal with this kind and name, ignoring case; None if there is no match."""
    wanted = " ".join(name.split()).casefold()
    found = (one for one in directory.principals.values() if one.kind == kind)
    return next((one for one in found if one.name.casefold() == wanted), None)


def change_grants(
    store: AccessStore, principal: str, change: Callable[[tuple[Grant, ...]], Iterable[Grant]]
) -> tuple[Grant, ...]:
    """Apply `change` to a principal's grants, store the result and return it.

    Raises:
        AccessError: the principal is unknown.
    """
    with store.transaction():
        found = store.directory().principals.get(principal)
        if found is None:
            raise AccessError("this entry was already removed")
        grants = tuple(dict.fromkeys(change(found.grants)))
        store.set_grants(principal, grants)
    return grants


def invite_person(
    store: AccessStore, name: str, grants: Collection[Grant], *, now: float, ends_at: float
) -> tuple[Principal, str]:
    """Invite a person to choose a passphrase; return the person and a one-time code.

    A new person is added with `grants`. The new invitation replaces the person's previous
    invitation.

    Args:
        store: the store.
        name: the person's name.
        grants: grants for a new person; empty for an existing person.
        now: UTC time in seconds since 1970.
        ends_at: UTC time at which the code expires.

    Raises:
        AccessError: the name is invalid, an existing person is given grants, or a new person is
            given no grants.
    """
    with store.transaction() as base:
        person = principal_named(store.directory(), "person", name)
        if person is None and not grants:
            raise AccessError(f"no person has the name {name!r}; a new person needs a role")
        if person is not None and grants:
            raise AccessError(f"{person.name!r} already exists; change this person's roles instead")
        if person is None:
            person = store.add("person", name, grants, now=now)
        base.execute("DELETE FROM invitations WHERE kind = 'person' AND owner = ?", (person.id,))
        invitation = Invitation("person", person.name, person.grants, person.id, ends_at)
        return person, store.invite(invitation, now=now)


def replace_passphrase(store: AccessStore, person: str, kept: str) -> int:
    """Set a person's passphrase; return the number of ended sign-ins.

    The person's browser sign-ins and invitations end, because a stolen sign-in or invitation may be
    the reason for the change. Paired devices stay signed in.

    Args:
        store: the store.
        person: the person's id.
        kept: hash of the new passphrase.

    Raises:
        AccessError: the person is unknown.
    """
    with store.transaction() as base:
        store.set_passphrase(person, kept)
        base.execute("DELETE FROM invitations WHERE kind = 'person' AND owner = ?", (person,))
        return end_sign_ins(store, lambda one, _: one.principal == person and one.way not in KEYS)


def add_token(
    store: AccessStore,
    name: str,
    grants: Iterable[Grant],
    *,
    now: float,
    ends_at: float | None,
    commands: Iterable[str] = (),
) -> tuple[Principal, str]:
    """Add a program; return the program and its token.

    Args:
        store: the store.
        name: the program's name.
        grants: the token's grants.
        now: UTC time in seconds since 1970.
        ends_at: UTC time at which the token expires; None for no expiry.
        commands: commands that the program may send; empty for all commands of its role.

    Raises:
        AccessError: the name is invalid or in use, the token has no grants, or its expiry is in the
            past.
    """
    grants = tuple(grants)
    if not grants:
        raise AccessError("a token needs a role")
    if ends_at is not None and ends_at <= now:
        raise AccessError("the token's expiry time is in the past")
    with store.transaction():
        program = store.add("program", name, grants, now=now, commands=commands, ends_at=ends_at)
        _, token = store.open_sign_in(program.id, "token", now=now, ends_at=ends_at)
    return program, token


def add_guest(
    store: AccessStore, name: str, robot: str, *, now: float, ends_at: float
) -> tuple[Principal, str]:
    """Add a guest who may watch one robot; return the guest and the secret of the guest link.

    Several browsers can use the same link.

    Args:
        store: the store.
        name: the guest's name.
        robot: the robot's name in URLs.
        now: UTC time in seconds since 1970.
        ends_at: UTC time at which the link expires.

    Raises:
        AccessError: the name is invalid or in use, or `ends_at` is in the past or too late.
    """
    if not now < ends_at <= now + LONGEST_GUEST_S:
        days = LONGEST_GUEST_S / 86400
        raise AccessError(f"a guest link lasts at most {days:.0f} days")
    with store.transaction():
        guest = store.add("guest", name, [Grant("watch", robot)], now=now, ends_at=ends_at)
        _, secret = store.open_sign_in(guest.id, "link", now=now, ends_at=ends_at)
    return guest, secret


def end_sign_ins(store: AccessStore, is_chosen: Callable[[SignIn, Principal], bool]) -> int:
    """End all sign-ins for which `is_chosen` returns true; return the number of ended sign-ins."""
    with store.transaction() as base:
        directory = store.directory()
        chosen = [
            (one.id,)
            for one in directory.sign_ins.values()
            if is_chosen(one, directory.principals[one.principal])
        ]
        base.executemany("DELETE FROM sign_ins WHERE id = ?", chosen)
    return len(chosen)


def end_after_restore(store: AccessStore, *, ends_keys: bool) -> int:
    """End restored codes and browser sign-ins; return the number of ended sign-ins.

    After the backup was made, codes may have been used and browser sign-ins revoked. All codes and
    browser sign-ins therefore end. People keep their passphrases.

    Args:
        store: the restored store.
        ends_keys: whether to remove all devices, programs and guests as well.
    """
    with store.transaction() as base:
        base.execute("DELETE FROM invitations")
        ended = end_sign_ins(store, lambda one, _: ends_keys or one.way not in KEYS)
        if ends_keys:
            base.execute("DELETE FROM principals WHERE kind <> 'person'")
    return ended


def newest_time(store: AccessStore) -> float:
    """Return the newest UTC time in the store, in seconds since 1970; 0 for an empty store."""
    directory = store.directory()
    people = (one.created_at for one in directory.principals.values())
    return max([0.0, *people, *(one.used_at for one in directory.sign_ins.values())])
