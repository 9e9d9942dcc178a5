"""The table of all passkeys, part of the store of people, devices and programs.

Layer 4. A passkey is a public key, so the table contains no secrets. The methods block for a few
milliseconds, so servers call them in a thread.
"""

from typing import Final, NamedTuple

from urc.access.grants import AccessError
from urc.access.store import AccessStore, parse_name

__all__ = ["MOST_PASSKEYS", "Passkey", "PasskeyTable", "check_number"]

MOST_PASSKEYS: Final = 20
"""Maximum number of passkeys per person."""


class Passkey(NamedTuple):
    """A public key; its private key is stored in a phone, a computer or a security key."""

    id: str
    """Credential id in base64url; unique, but not secret."""
    principal: str
    """Id of the person who owns the passkey."""
    name: str
    """Display name, such as “Ann's phone”."""
    host: str
    """Host name for which browsers offer the passkey (the RP ID of WebAuthn)."""
    public_key: bytes
    """The public key in COSE format (RFC 9052)."""
    counter: int
    """Last value of the signature counter; 0 for passkeys without a counter."""
    created_at: float
    """UTC creation time, in seconds since 1970."""
    used_at: float
    """UTC time of the last sign-in; equal to `created_at` before the first sign-in."""


def check_number(count: int) -> None:
    """Raise `AccessError` if a person with `count` passkeys may not add another passkey."""
    if count >= MOST_PASSKEYS:
        raise AccessError(f"you have {count} passkeys; remove one first")


class PasskeyTable:
    """Reads and changes the passkeys in the store."""

    def __init__(self, store: AccessStore) -> None:
        """Use the table in `store`."""
        self._store = store

    def add(self, passkey: Passkey) -> Passkey:
        """Add a passkey; return the passkey as stored, with normalized spaces in its name.

        Raises:
            AccessError: the name is invalid, the passkey is already registered, or the owner is not
                a person on this server or has too many passkeys.
        """
        passkey = passkey._replace(name=parse_name(passkey.name))
        with self._store.transaction() as base:
            owner = base.execute(
                "SELECT kind FROM principals WHERE id = ?", (passkey.principal,)
            ).fetchone()
            if owner != ("person",):
                raise AccessError("only people have passkeys: sign in as a person first")
            (count,) = base.execute(
                "SELECT count(*) FROM passkeys WHERE principal = ?", (passkey.principal,)
            ).fetchone()
            check_number(count)
            added = base.execute(
                "INSERT INTO passkeys VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING",
                passkey,
            )
            if added.rowcount == 0:
                raise AccessError("this passkey is already registered")
        return passkey

    def find(self, passkey: str) -> Passkey | None:
        """Return the passkey with this id, or None."""
        with self._store.transaction() as base:
            row = base.execute("SELECT * FROM passkeys WHERE id = ?", (passkey,)).fetchone()
        return Passkey(*row) if row else None

    def of(self, principal: str) -> list[Passkey]:
        """Return a person's passkeys, oldest first."""
        with self._store.transaction() as base:
            rows = base.execute(
                "SELECT * FROM passkeys WHERE principal = ? ORDER BY created_at, id", (principal,)
            ).fetchall()
        return [Passkey(*row) for row in rows]

    def rename(self, principal: str, passkey: str, name: str) -> None:
        """Rename a person's passkey.

        Raises:
            AccessError: the name is invalid, or the person has no such passkey.
        """
        self._changed(
            "UPDATE passkeys SET name = ? WHERE id = ? AND principal = ?",
            parse_name(name), passkey, principal,
        )  # fmt: skip

    def remove(self, principal: str, passkey: str) -> None:
        """Remove a person's passkey; raise `AccessError` if the person has no such passkey."""
        self._changed("DELETE FROM passkeys WHERE id = ? AND principal = ?", passkey, principal)

    def used(self, passkey: str, counter: int, now: float) -> None:
        """Record a sign-in with a passkey.

        Raises:
            AccessError: the passkey was removed, or `counter` is neither 0 nor higher than before.
        """
        self._changed(
            "UPDATE passkeys SET counter = ?, used_at = ? WHERE id = ? AND (counter < ? OR ? = 0)",
            counter, now, passkey, counter, counter,
        )  # fmt: skip

    def _changed(self, statement: str, *values: object) -> None:
        with self._store.transaction() as base:
            if base.execute(statement, values).rowcount == 0:
                raise AccessError("this passkey was removed")
