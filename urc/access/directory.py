"""The directory: a snapshot of all identities, sign-ins and tokens, with their current rights.

Layer 4. Pure. The store creates a new directory after each change. A socket stores an `Identity`,
but never its rights. The socket checks the rights in the current directory at each command, so a
revocation takes effect immediately.
"""

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

from urc.access.grants import Grant, highest, role_at
from urc.model.role import Role

__all__ = ["NOBODY", "Directory", "Identity", "Kind", "Principal", "SignIn", "Way", "digest_of"]

Kind = Literal["person", "device", "program", "guest"]
Way = Literal[
    "key", "pairing", "passkey", "passphrase", "oidc", "proxy", "link", "token", "site"
]  # fmt: skip
"""Sign-in method; the audit log records the method for each command."""


class Principal(NamedTuple):
    """A person, a device, a program or a guest."""

    id: str
    """Unique identifier, never reused."""
    kind: Kind
    name: str
    """Display name, also used in the audit log, such as “Tablet in the lab”."""
    grants: tuple[Grant, ...] = ()
    owner: str = ""
    """Id of the device's owner. A device with an owner has the owner's rights."""
    commands: tuple[str, ...] = ()
    """Commands that a program may send; empty for all commands of its role."""
    created_at: float = 0.0
    """UTC creation time, in seconds since 1970."""
    ends_at: float | None = None
    """UTC time at which all rights end; None if they never end."""


class SignIn(NamedTuple):
    """The sign-in of one browser, or the token of one program."""

    id: str
    """Unique identifier of the sign-in; not secret."""
    principal: str
    """Id of the principal who signed in."""
    way: Way
    digest: bytes
    """SHA-256 of the secret; the store never contains the secret itself."""
    created_at: float
    used_at: float
    """UTC time of the last use, accurate to one minute."""
    ends_at: float | None
    """Latest UTC time at which the sign-in ends; None for no limit."""
    idle_s: float | None
    """Maximum time without use, in seconds; None for no limit."""
    place: str = ""
    """Network address from which the sign-in was opened."""
    agent: str = ""
    """Names of the browser and system, such as “Chromium on Android”."""

    def is_over(self, now: float) -> bool:
        """Return whether the sign-in has expired."""
        if self.ends_at is not None and now >= self.ends_at:
            return True
        return self.idle_s is not None and now - self.used_at >= self.idle_s


class Identity(NamedTuple):
    """The proven identity of a request's sender, without the sender's rights."""

    principal: str = ""
    """The principal's id; "" for an unknown visitor."""
    sign_in: str = ""
    """Id of the sign-in; "" for an unknown visitor."""
    name: str = ""
    kind: Kind | Literal[""] = ""
    way: Way | Literal[""] = ""
    person: str = ""
    """Id of the device's owner, or of the principal itself if there is no owner."""
    visit: str = ""
    """Identifier of a visit from another site, in the audit logs of both sites; "" otherwise."""


NOBODY: Final = Identity()


def digest_of(secret: str) -> bytes:
    """Return the hash under which a random secret is stored.

    A fast hash is sufficient for 256 random bits. Only user-chosen passphrases need a slow hash.
    """
    return hashlib.sha256(secret.encode()).digest()


@dataclass(frozen=True, slots=True)
class Directory:
    """A snapshot of all principals and sign-ins."""

    principals: Mapping[str, Principal] = field(default_factory=dict)
    """Principals by id."""
    sign_ins: Mapping[str, SignIn] = field(default_factory=dict)
    """Sign-ins by id."""
    by_digest: Mapping[bytes, str] = field(default_factory=dict)
    """Id of each sign-in, by digest of the sign-in's secret."""

    def identify(self, secret: str, now: float) -> Identity:
        """Return the identity with this `secret`; `NOBODY` if it is unknown, expired or revoked."""
        sign_in = self.sign_ins.get(self.by_digest.get(digest_of(secret), ""))
        if sign_in is None or sign_in.is_over(now):
            return NOBODY
        principal = self.principals.get(sign_in.principal)
        if principal is None or self._ended(principal, now):
            return NOBODY
        person = principal.owner or principal.id
        return Identity(
            principal.id, sign_in.id, principal.name, principal.kind, sign_in.way, person
        )

    def role(
        self, who: Identity, now: float, robot: str = "", tags: Collection[str] = ()
    ) -> Role | None:
        """Return the current role of `who` for a robot; None if `who` has no role.

        Args:
            who: the identity, possibly from an earlier directory.
            now: UTC time in seconds since 1970.
            robot: the robot's name; "" for the whole server.
            tags: the robot's tags.
        """
        return role_at(self._grants(who, now), robot, tags)

    def best_role(self, who: Identity, now: float) -> Role | None:
        """Return the highest current role of `who` for any robot; None if `who` has no role."""
        return highest(grant.role for grant in self._grants(who, now))

    def _grants(self, who: Identity, now: float) -> tuple[Grant, ...]:
        sign_in = self.sign_ins.get(who.sign_in)
        principal = self.principals.get(who.principal)
        if sign_in is None or principal is None or sign_in.principal != principal.id:
            return ()
        if sign_in.is_over(now) or self._ended(principal, now):
            return ()
        return self.principals.get(principal.owner, principal).grants

    def end_of(self, sign_in: SignIn) -> float:
        """Return the UTC time at which a sign-in ends if it is not used again; infinity if never.

        A device's sign-in also ends when its owner's rights end.
        """
        principal = self.principals.get(sign_in.principal)
        owner = self.principals.get(principal.owner) if principal and principal.owner else None
        idle_end = None if sign_in.idle_s is None else sign_in.used_at + sign_in.idle_s
        ends = [sign_in.ends_at, idle_end, *(one.ends_at for one in (principal, owner) if one)]
        return min((end for end in ends if end is not None), default=float("inf"))

    def may_give(self, who: Identity, command: str) -> bool:
        """Return whether a program's token allows a command."""
        principal = self.principals.get(who.principal)
        return principal is not None and (not principal.commands or command in principal.commands)

    def _ended(self, principal: Principal, now: float) -> bool:
        """Return whether the principal's or owner's rights have ended, or the owner was removed."""
        if principal.ends_at is not None and now >= principal.ends_at:
            return True
        if not principal.owner:
            return False
        owner = self.principals.get(principal.owner)
        return owner is None or self._ended(owner, now)
