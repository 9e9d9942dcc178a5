"""The store of people, devices, programs, sign-ins and pairing codes: one private SQLite file.

Layer 4. Only hashes of secrets are stored. Several processes can use the file at once: the server,
and management commands on the same machine. `changed` reports changes by other processes, so a
removal on the command line takes effect on a running server.

Theory of operation. Each change is one transaction. `directory` reads all tables, with at most a
few thousand rows, into an immutable `Directory`. Readers never see a partial change.
"""

import json
import secrets
import sqlite3
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

from urc.access.directory import Directory, Kind, Principal, SignIn, Way, digest_of
from urc.access.grants import AccessError, Grant, grants_from_json, grants_to_json
from urc.private_files import make_private

__all__ = [
    "FILE",
    "MOST_CODES_OF_ONE",
    "MOST_DEVICES_OF_ONE",
    "MOST_INVITATIONS",
    "MOST_SIGN_INS",
    "MOST_SIGN_INS_OF_ONE",
    "AccessStore",
    "Invitation",
    "parse_name",
]

FILE: Final = "access.sqlite"
MOST_SIGN_INS: Final = 5000
"""Maximum number of sign-ins, not counting tokens; a new sign-in closes the least recently used
sign-in."""
MOST_PRINCIPALS: Final = 5000
MOST_INVITATIONS: Final = 1000
MOST_SIGN_INS_OF_ONE: Final = 100
"""Maximum number of sign-ins per person; a new sign-in closes the least recently used sign-in. One
person therefore cannot end the sign-ins of others."""
MOST_CODES_OF_ONE: Final = 8
"""Maximum number of valid pairing codes per person; above the limit, the oldest code ends."""
MOST_DEVICES_OF_ONE: Final = 50
"""Maximum number of paired devices per person."""
LONGEST_NAME: Final = 64
_VERSION: Final = 1
_BUSY_S: Final = 5.0
CHECKS: Final = 10
"""Number of checks for which a change of the file's time counts. Two changes within a few
milliseconds may have the same time, and the second one would be missed."""
_CREATE: Final = (
    "CREATE TABLE principals ( "
    "id TEXT PRIMARY KEY, kind TEXT NOT NULL, name TEXT NOT NULL, grants TEXT NOT NULL, "
    "owner TEXT NOT NULL, commands TEXT NOT NULL, created_at REAL NOT NULL, ends_at REAL "
    ") STRICT",
    "CREATE UNIQUE INDEX names ON principals (kind, name COLLATE NOCASE)",
    "CREATE TABLE passphrases ( "
    "principal TEXT PRIMARY KEY REFERENCES principals ON DELETE CASCADE, hash TEXT NOT NULL "
    ") STRICT",
    "CREATE TABLE sign_ins ( "
    "id TEXT PRIMARY KEY, principal TEXT NOT NULL REFERENCES principals ON DELETE CASCADE, "
    "way TEXT NOT NULL, digest BLOB NOT NULL UNIQUE, created_at REAL NOT NULL, "
    "used_at REAL NOT NULL, ends_at REAL, idle_s REAL, place TEXT NOT NULL, agent TEXT NOT NULL "
    ") STRICT",
    "CREATE TABLE passkeys ( "
    "id TEXT PRIMARY KEY, principal TEXT NOT NULL REFERENCES principals ON DELETE CASCADE, "
    "name TEXT NOT NULL, host TEXT NOT NULL, public_key BLOB NOT NULL, counter INTEGER NOT NULL, "
    "created_at REAL NOT NULL, used_at REAL NOT NULL "
    ") STRICT",
    "CREATE TABLE external_accounts ( "
    "issuer TEXT NOT NULL, subject TEXT NOT NULL, "
    "principal TEXT NOT NULL REFERENCES principals ON DELETE CASCADE, grants TEXT NOT NULL, "
    "PRIMARY KEY (issuer, subject) "
    ") STRICT",
    "CREATE TABLE invitations ( "
    "digest BLOB PRIMARY KEY, kind TEXT NOT NULL, name TEXT NOT NULL, grants TEXT NOT NULL, "
    "owner TEXT NOT NULL, ends_at REAL NOT NULL "
    ") STRICT",
    "CREATE TABLE server (instance TEXT NOT NULL) STRICT",
    "INSERT INTO server VALUES (lower(hex(randomblob(4))))",
)


class Invitation(NamedTuple):
    """The right to pair a device or sign in as a person with a one-time code."""

    kind: Kind
    name: str
    """Suggested name; "" lets the user choose a name on the new device."""
    grants: tuple[Grant, ...]
    owner: str = ""
    """Id of the device's owner, or of the person invited to set a passphrase."""
    ends_at: float = 0.0


class AccessStore:
    """A SQLite file with people, devices, programs, sign-ins and pairing codes.

    The methods block for a few milliseconds, so servers call them in a thread.
    """

    def __init__(self, folder: Path) -> None:
        """Open the file, and create it if it is missing.

        Raises:
            AccessError: the file cannot be opened, or was written by a newer version of URC.
        """
        self.file = folder / FILE
        self._lock = threading.RLock()
        self._stamp = (0, 0, 0)
        """Time of the last change, size and number of the file."""
        self._checks_left = 0
        try:
            make_private(folder)
            if not self.file.exists():
                self.file.touch(mode=0o600)
            self._base = sqlite3.connect(
                self.file, timeout=_BUSY_S, isolation_level=None, check_same_thread=False
            )
            try:
                self._prepare()
                self._seen = self._version()
            except BaseException:
                self._base.close()
                raise
        except (OSError, sqlite3.Error) as error:
            raise AccessError(f"{self.file}: cannot be used: {error}") from None

    def _prepare(self) -> None:
        self._base.execute("PRAGMA foreign_keys = ON")
        # Overwrite the hashes of removed people in the file, instead of only unlinking them.
        self._base.execute("PRAGMA secure_delete = ON")
        with self._change():
            (version,) = self._base.execute("PRAGMA user_version").fetchone()
            if version > _VERSION:
                raise AccessError(f"{self.file}: a newer version of URC wrote this file")
            if version == 0:
                for statement in _CREATE:
                    self._base.execute(statement)
                self._base.execute(f"PRAGMA user_version = {_VERSION}")

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._base.close()

    def may_have_changed(self) -> bool:
        """Return whether `changed` should be called, according to the file's time and size.

        The method does not read the file, and never blocks. File times are coarse, so a change
        counts for several calls.
        """
        try:
            found = self.file.stat()
        except OSError:
            return True  # `changed` reports the reason
        stamp = (found.st_mtime_ns, found.st_size, found.st_ino)
        if stamp != self._stamp:
            self._stamp, self._checks_left = stamp, CHECKS
        self._checks_left -= 1
        return self._checks_left >= 0

    def changed(self) -> bool:
        """Return whether another process has changed the file since the last call."""
        was, self._seen = self._seen, self._version()
        return was != self._seen

    def instance(self) -> str:
        """Return this store's identifier, which is part of its cookies' names."""
        with self._lock, self._readable():
            (instance,) = self._base.execute("SELECT instance FROM server").fetchone()
        return str(instance)

    def directory(self) -> Directory:
        """Return a snapshot of all principals and sign-ins in the store."""
        with self._lock, self._readable():
            principals = {row[0]: _principal(row) for row in self._rows("principals")}
            sign_ins = {row[0]: SignIn(*row) for row in self._rows("sign_ins")}
        by_digest = {sign_in.digest: sign_in.id for sign_in in sign_ins.values()}
        return Directory(principals, sign_ins, by_digest)

    # People, devices and programs

    def add(
        self,
        kind: Kind,
        name: str,
        grants: Iterable[Grant] = (),
        *,
        now: float,
        owner: str = "",
        commands: Iterable[str] = (),
        ends_at: float | None = None,
    ) -> Principal:
        """Add a principal with a new id, and return the principal.

        Args:
            kind: the principal's kind.
            name: the principal's name, unique within its kind, ignoring case.
            grants: the principal's grants.
            now: UTC time in seconds since 1970.
            owner: id of the person who owns the device.
            commands: commands that a program may send; empty for all commands of its role.
            ends_at: UTC time at which all rights end; None if they never end.

        Raises:
            AccessError: the name is invalid or in use, there are too many principals, or the owner
                has too many devices.
        """
        principal = Principal(
            secrets.token_hex(8), kind, parse_name(name), tuple(grants), owner, tuple(commands),
            now, ends_at,
        )  # fmt: skip
        row = principal._replace(
            grants=grants_to_json(principal.grants),  # type: ignore[arg-type]
            commands=json.dumps(principal.commands),  # type: ignore[arg-type]
        )
        with self._change():
            (count,) = self._base.execute("SELECT count(*) FROM principals").fetchone()
            if count >= MOST_PRINCIPALS:
                raise AccessError(f"there are {count} people, devices and programs; remove some")
            (count,) = self._base.execute(
                "SELECT count(*) FROM principals WHERE owner = ? AND owner <> ''", (owner,)
            ).fetchone()
            if count >= MOST_DEVICES_OF_ONE:
                raise AccessError(f"this person has {count} devices; remove some")
            try:
                self._insert("principals", row)
            except sqlite3.IntegrityError:
                raise AccessError(f"a {kind} already has the name {principal.name!r}") from None
        return principal

    def rename(self, principal: str, name: str) -> None:
        """Rename a principal; raise `AccessError` for an unknown principal or unusable name."""
        try:
            self._update("UPDATE principals SET name = ? WHERE id = ?", parse_name(name), principal)
        except sqlite3.IntegrityError:
            raise AccessError(f"the name {name!r} is in use") from None

    def set_grants(self, principal: str, grants: Iterable[Grant]) -> None:
        """Replace a principal's grants; raise `AccessError` if the principal is unknown."""
        self._update(
            "UPDATE principals SET grants = ? WHERE id = ?", grants_to_json(grants), principal
        )

    def set_end(self, principal: str, ends_at: float) -> None:
        """Set the UTC end of a principal's rights; raise `AccessError` if it is unknown."""
        self._update("UPDATE principals SET ends_at = ? WHERE id = ?", ends_at, principal)

    def remove(self, principal: str) -> None:
        """Remove a principal with its sign-ins, credentials and devices.

        Raises:
            AccessError: the principal is unknown.
        """
        with self._change():
            # Devices and codes have no foreign key for their owner, because most have no owner.
            # Sign-ins, passphrases and passkeys are deleted with their principal (ON DELETE
            # CASCADE).
            self._base.execute("DELETE FROM principals WHERE owner = ?", (principal,))
            self._base.execute("DELETE FROM invitations WHERE owner = ?", (principal,))
            self._update("DELETE FROM principals WHERE id = ?", principal)

    # Passphrases

    def set_passphrase(self, principal: str, kept: str) -> None:
        """Store a passphrase's hash; raise `AccessError` if the principal is unknown."""
        with self._change():
            try:
                self._base.execute(
                    "INSERT OR REPLACE INTO passphrases VALUES (?, ?)", (principal, kept)
                )
            except sqlite3.IntegrityError:
                raise AccessError("that person was removed") from None

    def passphrase_of(self, name: str) -> tuple[str, str | None]:
        """Return a person's id and passphrase hash, by name; "" and None for an unknown name."""
        with self._lock, self._readable():
            row = self._base.execute(
                "SELECT id, hash FROM principals LEFT JOIN passphrases ON principal = id"
                " WHERE kind = 'person' AND name = ? COLLATE NOCASE",
                (name,),
            ).fetchone()
        return row or ("", None)

    # Sessions and tokens

    def open_sign_in(
        self,
        principal: str,
        way: Way,
        *,
        now: float,
        ends_at: float | None = None,
        idle_s: float | None = None,
        place: str = "",
        agent: str = "",
    ) -> tuple[SignIn, str]:
        """Open a sign-in; return the sign-in and its secret, which is never stored.

        Raises:
            AccessError: the principal was removed.
        """
        secret = secrets.token_urlsafe(32)
        sign_in = SignIn(
            secrets.token_hex(8), principal, way, digest_of(secret), now, now, ends_at, idle_s,
            place[:LONGEST_NAME], agent[:LONGEST_NAME],
        )  # fmt: skip
        with self._change():
            # Make room for the new sign-in, first within its person's limit, then within the total
            # limit. Tokens remain, because a program cannot sign in again by itself.
            self._base.execute(
                "DELETE FROM sign_ins WHERE ends_at <= ? OR used_at + idle_s <= ?", (now, now)
            )
            self._base.execute(
                "DELETE FROM sign_ins WHERE id IN (SELECT id FROM sign_ins WHERE principal = ?"
                " AND way <> 'token' ORDER BY used_at DESC LIMIT -1 OFFSET ?)",
                (principal, MOST_SIGN_INS_OF_ONE - 1),
            )
            self._base.execute(
                "DELETE FROM sign_ins WHERE id IN (SELECT id FROM sign_ins WHERE way <> 'token'"
                " ORDER BY used_at DESC LIMIT -1 OFFSET ?)",
                (MOST_SIGN_INS - 1,),
            )
            try:
                self._insert("sign_ins", sign_in)
            except sqlite3.IntegrityError:
                raise AccessError("that person, device or program was removed") from None
        return sign_in, secret

    def touch_all(self, used: Mapping[str, float]) -> None:
        """Record the last use of each sign-in in `used`, by id; ignore removed sign-ins."""
        with self._change():
            self._base.executemany(
                "UPDATE sign_ins SET used_at = max(used_at, ?) WHERE id = ?",
                [(at, sign_in) for sign_in, at in used.items()],
            )

    def close_sign_in(self, sign_in: str) -> None:
        """Close a sign-in; raise `AccessError` for an unknown sign-in."""
        self._update("DELETE FROM sign_ins WHERE id = ?", sign_in)

    # Codes that work once

    def invite(self, invitation: Invitation, *, now: float = 0.0) -> str:
        """Store an invitation, and return its new one-time code.

        Args:
            invitation: the right that the code grants.
            now: UTC time in seconds since 1970; codes that have expired by then are deleted.

        Raises:
            AccessError: too many codes are valid.
        """
        code = secrets.token_urlsafe(16)
        with self._change():
            self._base.execute("DELETE FROM invitations WHERE ends_at <= ?", (now,))
            self._base.execute(
                "DELETE FROM invitations WHERE digest IN (SELECT digest FROM invitations"
                " WHERE kind = 'device' AND owner = ? AND owner <> ''"
                " ORDER BY ends_at DESC, rowid DESC LIMIT -1 OFFSET ?)",
                (invitation.owner, MOST_CODES_OF_ONE - 1),
            )
            (count,) = self._base.execute("SELECT count(*) FROM invitations").fetchone()
            if count >= MOST_INVITATIONS:
                raise AccessError(f"{count} codes are valid; wait until some have expired")
            self._base.execute(
                "INSERT INTO invitations VALUES (?, ?, ?, ?, ?, ?)",
                (
                    digest_of(code),
                    invitation.kind,
                    invitation.name,
                    grants_to_json(invitation.grants),
                    invitation.owner,
                    invitation.ends_at,
                ),
            )
        return code

    def invitation(self, code: str, now: float) -> Invitation | None:
        """Return a code's invitation, or None if the code is unknown or expired.

        Reading an invitation does not invalidate its code.
        """
        with self._change():
            row = self._base.execute(
                "SELECT kind, name, grants, owner, ends_at FROM invitations"
                " WHERE digest = ? AND ends_at > ?",
                (digest_of(code), now),
            ).fetchone()
        return _invitation(row) if row else None

    def redeem(self, code: str, now: float) -> Invitation | None:
        """Return a code's invitation and invalidate the code; None if it is unknown or expired."""
        with self._change():
            self._base.execute("DELETE FROM invitations WHERE ends_at <= ?", (now,))
            row = self._base.execute(
                "DELETE FROM invitations WHERE digest = ?"
                " RETURNING kind, name, grants, owner, ends_at",
                (digest_of(code),),
            ).fetchone()
        return _invitation(row) if row else None

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Run all changes in the context as one transaction, and roll back after an error.

        Raises:
            AccessError: another process has locked the file for several seconds.
        """
        with self._change():
            yield self._base

    # Inside

    def _version(self) -> int:
        """Return a number that changes whenever another process changes the file."""
        with self._lock, self._readable():
            (version,) = self._base.execute("PRAGMA data_version").fetchone()
        return int(version)

    @contextmanager
    def _change(self) -> Iterator[None]:
        """Run one transaction; a nested transaction is part of the outer transaction."""
        with self._lock:
            if self._base.in_transaction:
                yield
                return
            with self._readable():
                # With a deferred transaction, two processes could read first, and one would then
                # fail to write.
                self._base.execute("BEGIN IMMEDIATE")
                try:
                    yield
                except BaseException:
                    self._base.execute("ROLLBACK")
                    raise
                self._base.execute("COMMIT")

    @contextmanager
    def _readable(self) -> Iterator[None]:
        """Raise `AccessError` instead of SQLite's error for a disk failure or a locked file."""
        try:
            yield
        except sqlite3.OperationalError as error:
            raise AccessError(f"{self.file}: cannot be used: {error}") from None

    def _rows(self, table: str) -> list[Any]:
        return self._base.execute(f"SELECT * FROM {table}").fetchall()  # noqa: S608 - our names

    def _insert(self, table: str, row: tuple[object, ...]) -> None:
        marks = ", ".join("?" * len(row))
        self._base.execute(f"INSERT INTO {table} VALUES ({marks})", row)  # noqa: S608 - our names

    def _update(self, statement: str, *values: object) -> None:
        with self._change():
            if self._base.execute(statement, values).rowcount == 0:
                raise AccessError("this entry was already removed")


def parse_name(name: str) -> str:
    """Return a name with single spaces between its words, and no other spaces.

    Raises:
        AccessError: the name is empty or too long, or contains invisible characters.
    """
    name = " ".join(name.split())
    if not name:
        raise AccessError("the name is empty")
    if len(name) > LONGEST_NAME:
        raise AccessError(f"the name has {len(name)} characters; expected at most {LONGEST_NAME}")
    if not name.isprintable():
        raise AccessError("the name contains unprintable characters")
    return name


def _principal(row: Any) -> Principal:
    found = Principal(*row)
    return found._replace(
        grants=grants_from_json(str(row[3])), commands=tuple(json.loads(str(row[5])))
    )


def _invitation(row: Any) -> Invitation:
    kind, name, grants, owner, ends_at = row
    return Invitation(kind, name, grants_from_json(grants), owner, ends_at)
