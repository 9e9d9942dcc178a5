"""Accounts at identity providers and proxies, and the people to whom they belong.

Layer 4. An account is identified by its issuer and subject, never by its name. Names can change,
and another person on this server may have the same name. The functions block for a few
milliseconds, so servers call them in a thread.

Theory of operation. Each sign-in replaces the grants of the previous sign-in with grants from the
current claims. Grants from an administrator remain. All of the person's rights, including those of
devices and passkeys, end with the sign-in. The next sign-in renews the rights. An account that its
provider has blocked therefore loses all access.
"""

import sqlite3
from collections.abc import Iterable
from typing import Final, NamedTuple
from urllib.parse import urlsplit

from urc.access.administration import principal_named
from urc.access.directory import Principal
from urc.access.grants import AccessError, Grant, grants_from_json, grants_to_json
from urc.access.store import LONGEST_NAME, AccessStore

__all__ = ["ExternalAccount", "admit_account", "admit_named"]

_MOST_NAMESAKES: Final = 100
_PROXY: Final = "proxy:"
"""Issuer prefix for people added by a proxy; provider addresses start with http instead."""


class ExternalAccount(NamedTuple):
    """An account that its issuer has confirmed for one sign-in."""

    issuer: str
    """Address of the identity provider that manages the account."""
    subject: str
    """The account's identifier at its issuer; never reused for another account."""
    name: str
    """Display name."""
    grants: tuple[Grant, ...]
    """Grants that the claims of this sign-in give to the account."""
    ends_at: float
    """Latest UTC time at which the sign-in ends, in seconds since 1970."""


def admit_account(store: AccessStore, account: ExternalAccount, now: float) -> Principal:
    """Return an account's person with updated grants; add a person for a new account.

    Args:
        store: the store.
        account: the account.
        now: UTC time in seconds since 1970.

    Raises:
        AccessError: the account has no grants. Even then, grants from the account's earlier
            sign-ins are removed.
    """
    with store.transaction() as base:
        row = base.execute(
            "SELECT principal, grants FROM external_accounts WHERE issuer = ? AND subject = ?",
            (account.issuer, account.subject),
        ).fetchone()
        if row is not None:
            person = _renewed(store, row[0], grants_from_json(row[1]), account.grants)
            if person.grants:
                person = _extended(base, person, account.ends_at)
        elif account.grants:
            name = _free_name(store, account)
            person = store.add("person", name, account.grants, now=now, ends_at=account.ends_at)
        else:
            person = None
        if person is not None:
            _keep(base, account, person.id)
    if person is None or not person.grants:
        raise AccessError(f"the account {account.name!r} has no role here: ask an administrator")
    return person


def admit_named(
    store: AccessStore,
    name: str,
    new_grants: Iterable[Grant],
    *,
    proxy: str,
    now: float,
    ends_at: float,
) -> Principal:
    """Return the person with this name; add a missing person if `new_grants` is not empty.

    Args:
        store: the store.
        name: name confirmed by a trusted proxy.
        new_grants: grants for a new person; if empty, the person must already exist.
        proxy: the proxy's name.
        now: UTC time in seconds since 1970.
        ends_at: UTC time at which the sign-in ends. For a person added by a proxy, all rights also
            end at this time.

    Raises:
        AccessError: no person has this name, or the name is invalid.
    """
    grants = tuple(new_grants)
    with store.transaction() as base:
        person = principal_named(store.directory(), "person", name)
        if person is None and grants:
            person = store.add("person", name, grants, now=now, ends_at=ends_at)
            issuer = f"{_PROXY}{proxy}"
            _keep(base, ExternalAccount(issuer, person.id, name, grants, ends_at), person.id)
        elif person is not None and _is_of_proxy(base, person.id):
            person = _extended(base, person, ends_at)
    if person is None:
        raise AccessError(f"no person has the name {name!r}: ask an administrator")
    return person


def _renewed(
    store: AccessStore, principal: str, before: Iterable[Grant], present: Iterable[Grant]
) -> Principal:
    person = store.directory().principals[principal]
    by_hand = [grant for grant in person.grants if grant not in set(before)]
    grants = tuple(dict.fromkeys([*by_hand, *present]))
    if grants != person.grants:
        store.set_grants(principal, grants)
    return person._replace(grants=grants)


def _extended(base: sqlite3.Connection, person: Principal, ends_at: float) -> Principal:
    """Extend a person's rights to `ends_at`, unless the rights already end later."""
    ends_at = max(ends_at, person.ends_at or 0.0)
    base.execute("UPDATE principals SET ends_at = ? WHERE id = ?", (ends_at, person.id))
    return person._replace(ends_at=ends_at)


def _is_of_proxy(base: sqlite3.Connection, principal: str) -> bool:
    found = base.execute(
        "SELECT 1 FROM external_accounts WHERE principal = ? AND issuer LIKE ?",
        (principal, f"{_PROXY}%"),
    ).fetchone()
    return found is not None


def _keep(base: sqlite3.Connection, account: ExternalAccount, principal: str) -> None:
    base.execute(
        "INSERT INTO external_accounts VALUES (?, ?, ?, ?)"
        " ON CONFLICT (issuer, subject) DO UPDATE SET grants = excluded.grants",
        (account.issuer, account.subject, principal, grants_to_json(account.grants)),
    )


def _free_name(store: AccessStore, account: ExternalAccount) -> str:
    """Return the account's name; add the provider and a number if the name is already in use."""
    directory = store.directory()
    if principal_named(directory, "person", account.name) is None:
        return account.name
    place = urlsplit(account.issuer).hostname or "provider"
    for number in range(1, _MOST_NAMESAKES):
        suffix = f" ({place})" if number == 1 else f" ({place} {number})"
        name = account.name[: LONGEST_NAME - len(suffix)] + suffix
        if principal_named(directory, "person", name) is None:
            return name
    raise AccessError(f"{_MOST_NAMESAKES} people have the name {account.name!r}")
