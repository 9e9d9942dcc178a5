"""Passkey actions of `urc people`, which list and remove a person's passkeys."""

import argparse
from typing import TYPE_CHECKING

from urc.cli.identities import iso, local_time, named, record, show, words_of
from urc.problems import UrcError, printable

if TYPE_CHECKING:
    from urc.access.passkey_table import Passkey
    from urc.access.store import AccessStore

__all__ = ["list_passkeys", "remove_passkey"]

_SHOWN: int = 8
"""Number of first characters of a passkey's id that the list shows."""


def list_passkeys(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """List a person's passkeys."""
    from urc.access.passkey_table import PasskeyTable

    (name,) = words_of(arguments, "people", "NAME")
    person = named(store, "person", name)
    found = PasskeyTable(store).of(person.id)
    rows = [
        {
            "id": one.id,
            "name": one.name,
            "host": one.host,
            "created": iso(one.created_at),
            "last_use": iso(_used_at(one)),
        }
        for one in found
    ]
    table = [
        (one.id[:_SHOWN], one.name, one.host, local_time(one.created_at), local_time(_used_at(one)))
        for one in found
    ]
    head = ("ID", "NAME", "HOST", "ADDED", "LAST USE")
    return show(rows, [head, *table], arguments, f"{printable(person.name)} has no passkeys")


def remove_passkey(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Remove a passkey, such as a lost phone's, and end the person's passkey sign-ins.

    Raises:
        UrcError: the name or id prefix matches none of the person's passkeys, or several of them.
    """
    from urc.access.administration import end_sign_ins
    from urc.access.passkey_table import PasskeyTable

    name, wanted = words_of(arguments, "people", "NAME", "PASSKEY")
    person = named(store, "person", name)
    table = PasskeyTable(store)
    found = [
        one
        for one in table.of(person.id)
        if one.name.casefold() == wanted.casefold() or one.id.startswith(wanted)
    ]
    if len(found) != 1:
        count = f"{len(found)} passkeys" if found else "no passkey"
        raise UrcError(
            f"{person.name} has {count} {wanted!r}: 'urc people passkeys' lists names and ids"
        )
    (passkey,) = found
    with store.transaction():
        table.remove(person.id, passkey.id)
        ended = end_sign_ins(store, lambda one, who: who.id == person.id and one.way == "passkey")
    record(store, "passkeys remove", name=person.name, passkey=passkey.name, ended=ended)
    print(printable(f"removed the passkey {passkey.name} of {person.name}; {ended} sign-ins ended"))
    return 0


def _used_at(one: "Passkey") -> float | None:
    return one.used_at if one.used_at > one.created_at else None
