"""The directory: all identities, sign-ins and tokens at one moment, and the rights they have now.

Layer 4. Pure. The store makes a new directory after each change. A socket keeps an `Identity`,
never a right: it asks the current directory at each command, so a revocation acts at once.
"""

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

from urc.access.grants import Grant, highest, role_at
from urc.model.role import Role

__all__ = ["NOBODY", "Directory", "Identity", "Kind", "Principal", "SignIn", "Way", "digest_of"]

Kind = Literal["person", "device", "program", "guest"]
Way = Literal["key", "pairing", "passkey", "passphrase", "oidc", "proxy", "link", "token"]
"""How a sign-in began: the right by which a command was given, as the audit log names it."""


class Principal(NamedTuple):
    """A person, a device, a program or a guest."""

    id: str
    """Unique and never used again."""
    kind: Kind
    name: str
    """Name for people and for the audit log, such as “Tablet in the lab”."""
    grants: tuple[Grant, ...] = ()
    owner: str = ""
    """Id of the person whose device this is. Such a device has the rights of the owner."""
    commands: tuple[str, ...] = ()
    """Commands that a program may give; empty: all of its role."""
    created_at: float = 0.0
    """UTC time in seconds since 1970."""
    ends_at: float | None = None
    """UTC time after which all rights end; None: never."""


class SignIn(NamedTuple):
    """The sign-in of one browser, or the token of one program."""

    id: str
    """Unique; no secret."""
    principal: str
    """Id of the principal."""
    way: Way
    digest: bytes
    """SHA-256 of the secret; the store never has the secret itself."""
    created_at: float
    used_at: float
    """UTC time of the last use, exact to a minute."""
    ends_at: float | None
    """UTC time of the latest end; None: never."""
    idle_s: float | None
    """Longest time without use, in seconds; None: unlimited."""
    place: str = ""
    """Network address at the sign-in."""
    agent: str = ""
    """Browser and system in words, such as “Chromium on Android”."""

    def is_over(self, now: float) -> bool:
        """Return whether the sign-in has ended by itself."""
        if self.ends_at is not None and now >= self.ends_at:
            return True
        return self.idle_s is not None and now - self.used_at >= self.idle_s


class Identity(NamedTuple):
    """The proven identity of a request: it names, and grants nothing."""

    principal: str = ""
    """Id of the principal; "" for an unknown visitor."""
    sign_in: str = ""
    """Id of the sign-in."""
    name: str = ""
    kind: Kind | Literal[""] = ""
    way: Way | Literal[""] = ""
    person: str = ""
    """Id of the person: the owner of a device, or else the principal itself."""


NOBODY: Final = Identity()


def digest_of(secret: str) -> bytes:
    """Return the form in which a random secret is stored.

    A plain hash is enough for 256 random bits; only chosen passphrases need a slow one.
    """
    return hashlib.sha256(secret.encode()).digest()


@dataclass(frozen=True, slots=True)
class Directory:
    """All principals and sign-ins at one moment."""

    principals: Mapping[str, Principal] = field(default_factory=dict)
    """Id → principal."""
    sign_ins: Mapping[str, SignIn] = field(default_factory=dict)
    """Id → sign-in."""
    by_digest: Mapping[bytes, str] = field(default_factory=dict)
    """Digest of a secret → id of its sign-in."""

    def identify(self, secret: str, now: float) -> Identity:
        """Return the identity that holds `secret`; `NOBODY` if it is unknown, over or revoked."""
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
        """Return the present role of `who` at a robot, or None.

        Args:
            who: the identity, however old.
            now: UTC time in seconds since 1970.
            robot: name of the robot; "" asks for the whole server.
            tags: tags of the robot.
        """
        return role_at(self._grants(who, now), robot, tags)

    def best_role(self, who: Identity, now: float) -> Role | None:
        """Return the highest present role of `who` at any robot, or None."""
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
        """Return the UTC time at which a sign-in ends without further use; infinity: never.

        The sign-in of a device also ends with its owner.
        """
        principal = self.principals.get(sign_in.principal)
        owner = self.principals.get(principal.owner) if principal and principal.owner else None
        idle_end = None if sign_in.idle_s is None else sign_in.used_at + sign_in.idle_s
        ends = [sign_in.ends_at, idle_end, *(one.ends_at for one in (principal, owner) if one)]
        return min((end for end in ends if end is not None), default=float("inf"))

    def may_give(self, who: Identity, command: str) -> bool:
        """Return whether the scope of a program's token contains a command."""
        principal = self.principals.get(who.principal)
        return principal is not None and (not principal.commands or command in principal.commands)

    def _ended(self, principal: Principal, now: float) -> bool:
        """Return whether a principal's rights ended, or those of its owner, or its owner left."""
        if principal.ends_at is not None and now >= principal.ends_at:
            return True
        if not principal.owner:
            return False
        owner = self.principals.get(principal.owner)
        return owner is None or self._ended(owner, now)
